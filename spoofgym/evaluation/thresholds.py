"""This command is now ``spoofgym thresholds``."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym thresholds"))
