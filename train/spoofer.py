"""Train a PPO spoofer: ``python -m train.spoofer`` is `spoofgym.learning.spoofer` in a checkout."""

import sys

from spoofgym.learning.spoofer import main

if __name__ == "__main__":
    sys.exit(main())
