"""GNSS spoofing as a Gymnasium game on a real INS/GNSS filter."""

from gymnasium.envs.registration import register, registry

__version__ = "0.1.0"

if "spoofgym/Spoofer-v0" not in registry:
    register(
        id="spoofgym/Spoofer-v0",
        entry_point="spoofgym.envs.spoofer:SpooferEnv",
        vector_entry_point="spoofgym.envs.vector:SpooferVectorEnv",
    )

if "spoofgym/Defender-v0" not in registry:
    register(
        id="spoofgym/Defender-v0",
        entry_point="spoofgym.envs.defender:DefenderEnv",
        vector_entry_point="spoofgym.envs.vector:DefenderVectorEnv",
    )
