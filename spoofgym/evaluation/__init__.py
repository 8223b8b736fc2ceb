"""How good a player is: Monte Carlo, metrics, reports."""

from spoofgym.program import quiet_start

quiet_start()
