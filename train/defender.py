"""Train a PPO defender: ``python -m train.defender`` is `spoofgym.learning.defender` in a checkout."""

import sys

from spoofgym.learning.defender import main

if __name__ == "__main__":
    sys.exit(main())
