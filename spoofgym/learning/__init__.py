"""Learners: PPO spoofer and defender, with torch and Stable-Baselines3 (``pip install "spoofgym[train]"``)."""

from importlib.util import find_spec

from spoofgym.program import quiet_start

if find_spec("torch") is None or find_spec("stable_baselines3") is None:
    raise ModuleNotFoundError("training needs PyTorch and Stable-Baselines3: pip install 'spoofgym[train]'")

quiet_start()
