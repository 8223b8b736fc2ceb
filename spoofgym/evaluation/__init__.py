"""How good a player is: Monte Carlo, metrics, rows of reports."""

from spoofgym.program import quiet_start

quiet_start()
