"""Learners: PPO spoofer and defender, with torch and Stable-Baselines3 (``pip install "spoofgym[train]"``)."""

from spoofgym.program import quiet_start

quiet_start()
