"""Measurements of speed, each a ratio within one run."""

from spoofgym.program import quiet_start

quiet_start()
