"""Programs: ``python -m train.spoofer``, ``python -m train.evaluate``."""
