"""GNSS spoofing as a Gymnasium game on a real INS/GNSS filter."""

from gymnasium.envs.registration import register, registry

__version__ = "0.1.0"

for _name, _module in (
    ("Spoofer", "spoofer"),
    ("Defender", "defender"),
    ("DuelSpoofer", "duel_sides"),
    ("DuelDefender", "duel_sides"),
):
    if f"spoofgym/{_name}-v0" not in registry:
        register(
            id=f"spoofgym/{_name}-v0",
            entry_point=f"spoofgym.envs.{_module}:{_name}Env",
            vector_entry_point=f"spoofgym.envs.vector:{_name}VectorEnv",
        )
