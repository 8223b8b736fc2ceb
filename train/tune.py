"""This command has moved to `spoofgym.studies.tune`."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym.studies.tune"))
