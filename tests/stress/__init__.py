"""A program that tries to break the promises of docs/inside/reliability.md: ``python -m tests.stress``."""

from spoofgym.program import quiet_start

quiet_start()
