"""This command has moved to `spoofgym.studies.integrity`."""

import sys

from spoofgym.program import moved

if __name__ == "__main__":
    sys.exit(moved("spoofgym.studies.integrity"))
