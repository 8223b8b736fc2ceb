"""Published figures beside our own, a row for each: ``python -m spoofgym.evaluation.reproduce PAPER``."""
