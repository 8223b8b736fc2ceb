"""This command is now ``spoofgym evaluate ...`` and ``spoofgym matrix``."""

import sys

from spoofgym.program import moved


def new_name(arguments: list[str]) -> str:
    """The command that does what the old one did with these arguments."""
    names = [text.partition("=")[0] for text in arguments]
    if "--matrix" in names:
        return "spoofgym matrix"
    if "--defender" in names:
        return "spoofgym evaluate defenders"
    if any(text.rpartition("=")[2].startswith("recorded:") for text in arguments):
        return "spoofgym evaluate recorded FOLDER"
    return "spoofgym evaluate spoofers"


if __name__ == "__main__":
    sys.exit(moved(new_name(sys.argv[1:])))
