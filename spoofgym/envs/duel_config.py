"""Arguments of the duel and of its two sides: frozen, typed, and unknown keys are refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from spoofgym import validation
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import (
    DEFENDER_DETECTORS,
    TIME_ALONE,
    DefenderConfig,
    Idle,
    SpooferConfig,
    Weighted,
    clean_of_pool,
)
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario


class _Spoofer(SpooferConfig):
    owner: ClassVar[str] = "duel"


class _Defender(DefenderConfig):
    owner: ClassVar[str] = "duel"


@dataclass(frozen=True, kw_only=True)
class DuelConfig:
    """Arguments of the duel; the page of `spoofgym.envs.duel.DuelParallelEnv` says what each means.

    Attributes:
        owner: the environment, for messages.
        idle: arguments that have no effect beside others.

    Raises:
        ValueError: a name that is not valid, or a number out of range.
    """

    owner: ClassVar[str] = "duel"
    idle: ClassVar[tuple[Idle, ...]] = (TIME_ALONE,)

    scenario: str | Scenario = "foi-drive"
    detectors: str | Detector | tuple[str | Detector, ...] = DEFENDER_DETECTORS
    knowledge: str = "shadow"
    action: str = "rate"
    payoff: str = "error"
    fidelity: str = "linear"
    clean: float = 0.5
    outage: float = 0.15
    multipath: float = 0.15
    tracking_sigma: float = 0.0
    tracking_time: float = 0.0
    frames: int = 1
    shadow: str | Scenario | None = None
    coupling: str | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        validation.text("duel", "payoff", self.payoff)
        _ = self.spoofer_side, self.defender_side  # building them checks their arguments

    @property
    def spoofer_side(self) -> SpooferConfig:
        """What the spoofer knows and does, as its seat takes it."""
        return _Spoofer(
            scenario=self.scenario,
            detector=self.detectors,
            knowledge=self.knowledge,
            action=self.action,
            fidelity=self.fidelity,
            on_alarm="respond",
            tracking_sigma=self.tracking_sigma,
            tracking_time=self.tracking_time,
            frames=self.frames,
            shadow=self.shadow,
            coupling=self.coupling,
            threads=self.threads,
        )

    @property
    def defender_side(self) -> DefenderConfig:
        """What the defender sees, as its seat takes it."""
        return _Defender(
            scenario=self.scenario,
            detectors=self.detectors,
            fidelity=self.fidelity,
            clean=self.clean,
            outage=self.outage,
            multipath=self.multipath,
            coupling=self.coupling,
            threads=self.threads,
        )

    @property
    def sees_decisions(self) -> bool:
        """Whether the spoofer sees what the defender decided last."""
        return self.knowledge == "full"


@dataclass(frozen=True, kw_only=True)
class DuelSpooferConfig(DuelConfig):
    """Arguments of DuelSpoofer-v0: those of the duel, and who defends."""

    defender: str | Response | tuple[Weighted[Response], ...] = "exclude"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.defender is None:
            raise ValueError("duel: defender must be a specification, a Response or a pool of them, got None")


@dataclass(frozen=True, kw_only=True)
class DuelDefenderConfig(DuelConfig):
    """Arguments of DuelDefender-v0: those of the duel, and who spoofs.

    Those of a spoofer outside stay, so that a league has one duel for both of its sides.
    """

    idle: ClassVar[tuple[Idle, ...]] = (
        Idle(
            ("knowledge", "action", "tracking_sigma", "tracking_time", "frames", "shadow"),
            lambda *_: True,
            "is of a spoofer outside: that of DuelDefender-v0 sits inside, and 'spoofer' says who it is",
        ),
        clean_of_pool("spoofer"),
    )

    spoofer: str | Attack | tuple[Weighted[Attack], ...] = "training"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.spoofer is None:
            raise ValueError("duel: spoofer must be a specification, an Attack or a pool of them, got None")
