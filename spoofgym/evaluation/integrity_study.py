"""This command is now ``spoofgym integrity``."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym integrity"))
