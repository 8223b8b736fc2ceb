"""Programs: ``python -m train.spoofer``, ``python -m train.evaluate``."""

from spoofgym.program import quiet_start

quiet_start()
