"""Published figures beside our own, a row for each: ``spoofgym reproduce PAPER``."""
