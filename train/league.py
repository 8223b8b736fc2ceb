"""Play a league: ``python -m train.league`` is `spoofgym.learning.league` in a checkout."""

import sys

from spoofgym.learning.league import main

if __name__ == "__main__":
    sys.exit(main())
