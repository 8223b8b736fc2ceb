"""Published figures beside our own, a row for each: ``python -m spoofgym.studies.reproduce PAPER``."""
