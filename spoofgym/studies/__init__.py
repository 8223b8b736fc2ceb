"""Programs that evaluate players, or print the tables of one paper or of one page."""

from spoofgym.program import quiet_start

quiet_start()
