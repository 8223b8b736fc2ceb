"""Training programs of a checkout: ``python -m train.spoofer``, ``python -m train.defender``."""

from spoofgym.program import quiet_start

quiet_start()
