"""This command is now ``spoofgym study self-tuning``."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym study self-tuning"))
