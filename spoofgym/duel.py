"""The duel of a spoofer and a defender, as PettingZoo names such things (extra ``spoofgym[multiagent]``).

- `parallel_env`: both agents act at once.
- `env`, `raw_env`: the agent-environment cycle, one after the other; `env` wants actions in the right order.
- `vector_env`: N duels in one batch.

All take the arguments of `spoofgym.envs.duel.DuelParallelEnv`, whose page tells the rules. PettingZoo 1.27 makes it by
its id: ``pettingzoo.make("parallel", "spoofgym/duel-v0")`` after ``import spoofgym.duel``.
"""

from __future__ import annotations

from typing import Any

from spoofgym.envs.duel import DuelParallelEnv
from spoofgym.envs.vector import DuelVectorEnv

ID = "spoofgym/duel-v0"
"""In PettingZoo's registry."""

__all__ = ["ID", "DuelParallelEnv", "DuelVectorEnv", "env", "parallel_env", "raw_env", "vector_env"]


def parallel_env(render_mode: str | None = None, **arguments: Any) -> DuelParallelEnv:
    """The duel, both agents acting at once."""
    return DuelParallelEnv(render_mode, **arguments)


def raw_env(render_mode: str | None = None, **arguments: Any) -> Any:
    """The duel as an `AECEnv`, without a check of the order of calls."""
    from pettingzoo.utils.conversions import parallel_to_aec_wrapper

    return parallel_to_aec_wrapper(parallel_env(render_mode, **arguments))


def env(render_mode: str | None = None, **arguments: Any) -> Any:
    """The duel as an `AECEnv` that refuses calls in the wrong order."""
    from pettingzoo.utils.wrappers import OrderEnforcingWrapper

    return OrderEnforcingWrapper(raw_env(render_mode, **arguments))


def vector_env(num_envs: int = 1, **arguments: Any) -> DuelVectorEnv:
    """N duels in one batch, as a Gymnasium vector environment whose spaces are dictionaries by agent."""
    return DuelVectorEnv(num_envs, **arguments)


def _register() -> None:
    import pettingzoo

    if not hasattr(pettingzoo, "register"):  # older than 1.27
        return
    for kind, entry, registry in (
        ("aec", env, pettingzoo.aec_registry),
        ("parallel", parallel_env, pettingzoo.parallel_registry),
    ):
        if ID not in registry:
            pettingzoo.register(kind, ID, entry)


_register()
