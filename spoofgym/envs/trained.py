"""The environment that a learned policy was trained on, from the plain values that its run folder holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from spoofgym import files
from spoofgym.envs.config import DefenderConfig, SpooferConfig, configuration
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.policies.learned import (
    DEFENDER,
    SPOOFER,
    LearnedDefender,
    LearnedPolicy,
    LearnedSpoofer,
    described_by,
    environment_of,
    kind_of,
)

AnyConfig = SpooferConfig | DefenderConfig | DuelSpooferConfig | DuelDefenderConfig
Config = TypeVar("Config", bound=AnyConfig)

ENVIRONMENTS: dict[str, type[AnyConfig]] = {
    "spoofgym/Spoofer-v0": SpooferConfig,
    "spoofgym/Defender-v0": DefenderConfig,
    "spoofgym/DuelSpoofer-v0": DuelSpooferConfig,
    "spoofgym/DuelDefender-v0": DuelDefenderConfig,
}
PLAYERS: dict[type, str] = {
    SpooferConfig: SPOOFER,
    DefenderConfig: DEFENDER,
    DuelSpooferConfig: SPOOFER,
    DuelDefenderConfig: DEFENDER,
}
"""Who is trained on an environment of a configuration."""
ONE = ("scenario", "fidelity")
"""Arguments that a run folder holds as the specification of one part."""
SEVERAL = ("detector", "detectors", "attacks", "response", "spoofer", "defender")
"""Arguments that a run folder holds as one specification or as a list of them."""


def trained_on(policy: LearnedPolicy) -> AnyConfig:
    """The environment that a policy was trained on.

    Raises:
        ValueError: naming the file that tells it, an argument of which is unknown or of another type.
    """
    path = described_by(policy.folder)
    with files.reading(path):
        kind = ENVIRONMENTS[environment_of(policy.configuration)]
    return config_from(kind, policy.configuration, path)


def spoofer_config(policy: LearnedSpoofer) -> SpooferConfig:
    """What a spoofer knows and does, as its seat takes it.

    Raises:
        ValueError: as `trained_on`.
    """
    config = trained_on(policy)
    if isinstance(config, DuelConfig):
        return config.spoofer_side
    assert isinstance(config, SpooferConfig)
    return config


def sees_decisions(policy: LearnedSpoofer) -> bool:
    """Whether a spoofer sees what the defender decided last.

    Raises:
        ValueError: as `trained_on`.
    """
    config = trained_on(policy)
    return isinstance(config, DuelConfig) and config.sees_decisions


def defender_config(policy: LearnedDefender) -> DefenderConfig:
    """What a defender sees, as its seat takes it.

    Raises:
        ValueError: as `trained_on`.
    """
    config = trained_on(policy)
    if isinstance(config, DuelConfig):
        return config.defender_side
    assert isinstance(config, DefenderConfig)
    return config


def config_from(kind: type[Config], arguments: Mapping[str, Any], path: Path) -> Config:
    """The configuration of an environment from the plain values of a file.

    Args:
        kind: of the configuration.
        arguments: of the environment, by name.
        path: of the file, for messages.

    Raises:
        ValueError: naming the file, an argument of which is unknown or of another type; or the folder, if the other
            side was trained there.
    """
    with files.reading(path):
        player = kind_of(arguments)
    if player != PLAYERS[kind]:
        raise ValueError(f"{path.parent} is the run folder of a {player}, not of a {PLAYERS[kind]}")
    with files.reading(path):
        return configuration(kind, {name: _checked(name, value) for name, value in arguments.items()})


def _checked(name: str, value: Any) -> Any:
    """A value of a file; parts are named by specifications, and a list of these becomes a tuple.

    Raises:
        ValueError: a part is not named by a specification.
    """
    if name in SEVERAL and isinstance(value, list | tuple):
        value = tuple(tuple(item) if isinstance(item, list) else item for item in value)
        right = bool(value) and all(isinstance(item, str) or _is_weighted(item) for item in value)
    elif name in ONE or name in SEVERAL:
        right = isinstance(value, str)
    elif name in ("shadow", "bank"):
        right = value is None or isinstance(value, str)
    else:
        right = True
    if not right:
        raise ValueError(f"{name} must be named by a specification, got {value!r}")
    return value


def _is_weighted(item: Any) -> bool:
    """Whether a member of a pool is a specification and its weight."""
    if not isinstance(item, tuple) or len(item) != 2:
        return False
    part, weight = item
    return isinstance(part, str) and isinstance(weight, int | float) and not isinstance(weight, bool)
