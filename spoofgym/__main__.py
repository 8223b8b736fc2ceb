"""``python -m spoofgym`` is the command ``spoofgym``."""

import sys

from spoofgym.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
