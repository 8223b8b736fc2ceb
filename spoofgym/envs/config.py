"""Arguments of the environments: frozen, typed, and unknown keys are refused."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, TypeVar

from spoofgym import validation
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import COUPLINGS

KNOWLEDGE = ("blind", "shadow", "full")
ACTIONS = ("rate", "innovation")
ON_ALARM = ("end", "respond")

DEFENDER_DETECTORS = ("snapshot", "windowed:n=5", "windowed:n=20", "relative-motion:k=20")

Config = TypeVar("Config")


def configure(kind: type[Config], arguments: dict[str, Any]) -> Config:
    """Build a configuration from keyword arguments.

    Raises:
        TypeError: an unknown key; the message lists the valid ones.
    """
    valid = [item.name for item in fields(kind)]  # type: ignore[arg-type]
    for key in arguments:
        if key not in valid:
            raise TypeError(f"unknown argument {key!r}; valid arguments: {', '.join(valid)}")
    return kind(**arguments)


def require(name: str, value: str, valid: tuple[str, ...]) -> None:
    """Refuse a value that is not one of ``valid``.

    Raises:
        ValueError: naming the value and the valid ones.
    """
    if value not in valid:
        raise ValueError(f"unknown {name} {value!r}; valid values: {', '.join(valid)}")


def _require_coupling(coupling: str | None) -> None:
    if coupling is not None:
        require("coupling", coupling, COUPLINGS)


@dataclass(frozen=True, kw_only=True)
class SpooferConfig:
    """Arguments of Spoofer-v0; the environment's page says what each means.

    Raises:
        ValueError: a name that is not valid, or a number out of range.
    """

    scenario: str | Scenario = "liu-flight"
    detector: str | Detector | tuple[str | Detector, ...] = "snapshot"
    knowledge: str = "shadow"
    action: str = "rate"
    fidelity: str = "linear"
    on_alarm: str = "end"
    response: str | Response = "exclude"
    forfeit: float = 1.0
    tracking_sigma: float = 0.0
    tracking_time: float = 0.0
    frames: int = 1
    shadow: str | Scenario | None = None
    coupling: str | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        _require_coupling(self.coupling)
        require("knowledge", self.knowledge, KNOWLEDGE)
        require("action", self.action, ACTIONS)
        require("on_alarm", self.on_alarm, ON_ALARM)
        if self.action == "innovation" and self.knowledge == "blind":
            raise ValueError(
                "action 'innovation' runs a shadow filter: knowledge must be 'shadow' or 'full', not 'blind'"
            )
        if self.shadow is not None and self.knowledge == "blind":
            raise ValueError(
                f"shadow {self.shadow!r} needs knowledge 'shadow' or 'full': a 'blind' spoofer has no shadow filter"
            )
        validation.whole("Spoofer-v0", "frames", self.frames, 1)
        if not 0 <= self.forfeit < float("inf"):
            raise ValueError(f"forfeit must be 0 or more and finite, got {self.forfeit}")
        if not 0 <= self.tracking_sigma < float("inf"):
            raise ValueError(f"tracking_sigma must be 0 or more metres, got {self.tracking_sigma}")
        validation.non_negative("Spoofer-v0", "tracking_time", self.tracking_time)
        if self.threads < 1:
            raise ValueError(f"threads must be 1 or more, got {self.threads}")


@dataclass(frozen=True, kw_only=True)
class DefenderConfig:
    """Arguments of Defender-v0; the environment's page says what each means.

    Raises:
        ValueError: a number out of range.
    """

    scenario: str | Scenario = "foi-drive"
    attacks: str | Attack | tuple[str | Attack, ...] = "training"
    detectors: str | Detector | tuple[str | Detector, ...] = DEFENDER_DETECTORS
    fidelity: str = "linear"
    clean: float = 0.5
    outage: float = 0.15
    multipath: float = 0.15
    error_scale: float | None = None
    error_clip: float = 5.0
    exclusion_cost: float = 0.05
    coupling: str | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        _require_coupling(self.coupling)
        for name in ("clean", "outage", "multipath"):
            validation.share("Defender-v0", name, getattr(self, name))
        if self.error_scale is not None and not 0.0 < self.error_scale < float("inf"):
            raise ValueError(f"error_scale must be positive metres, or None for the scenario's, got {self.error_scale}")
        if not 0.0 < self.error_clip < float("inf"):
            raise ValueError(f"error_clip must be positive and finite, got {self.error_clip}")
        if not 0.0 <= self.exclusion_cost < float("inf"):
            raise ValueError(f"exclusion_cost must be 0 or more and finite, got {self.exclusion_cost}")
        if self.threads < 1:
            raise ValueError(f"threads must be 1 or more, got {self.threads}")
