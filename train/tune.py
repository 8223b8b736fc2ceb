"""This command is now ``spoofgym tune``."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym tune"))
