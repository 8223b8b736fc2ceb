"""The environment that a learned policy was trained on, from the plain values that its run folder holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from spoofgym import files
from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.policies.learned import CONFIG_FILE, DEFENDER, SPOOFER, LearnedDefender, LearnedSpoofer, kind_of

Config = TypeVar("Config", SpooferConfig, DefenderConfig)

PLAYERS: dict[type, str] = {SpooferConfig: SPOOFER, DefenderConfig: DEFENDER}
"""Who is trained on an environment of a configuration."""
ONE = ("scenario", "fidelity")
"""Arguments that a run folder holds as the specification of one part."""
SEVERAL = ("detector", "detectors", "attacks", "response")
"""Arguments that a run folder holds as one specification or as a list of them."""


def spoofer_config(policy: LearnedSpoofer) -> SpooferConfig:
    """The environment that a spoofer was trained on.

    Raises:
        ValueError: naming its ``config.json``, an argument of which is unknown or of another type.
    """
    return config_from(SpooferConfig, policy.configuration, policy.folder / CONFIG_FILE)


def defender_config(policy: LearnedDefender) -> DefenderConfig:
    """The environment that a defender was trained on.

    Raises:
        ValueError: naming its ``config.json``, an argument of which is unknown or of another type.
    """
    return config_from(DefenderConfig, policy.configuration, policy.folder / CONFIG_FILE)


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
        return configure(kind, {name: _checked(name, value) for name, value in arguments.items()})


def _checked(name: str, value: Any) -> Any:
    """A value of a file; parts are named by specifications, and a list of these becomes a tuple.

    Raises:
        ValueError: a part is not named by a specification.
    """
    if name in SEVERAL and isinstance(value, list | tuple):
        right = bool(value) and all(isinstance(item, str) for item in value)
        value = tuple(value)
    elif name in ONE or name in SEVERAL:
        right = isinstance(value, str)
    elif name == "shadow":
        right = value is None or isinstance(value, str)
    else:
        right = True
    if not right:
        raise ValueError(f"{name} must be named by a specification, got {value!r}")
    return value
