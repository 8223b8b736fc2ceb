"""Arguments of the environments: frozen, typed, and unknown keys are refused."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, TypeAlias, TypeVar

from spoofgym import validation
from spoofgym.attacks.base import KNOWLEDGE, Attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.detectors.base import Detector
from spoofgym.navigation.facts import LINEAR_MODEL
from spoofgym.navigation.family import COUPLINGS
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario

ACTIONS = ("rate", "innovation")
ON_ALARM = ("end", "respond")
RECORDED = "recorded"
"""Begins the specification of a log."""

DEFENDER_DETECTORS = ("snapshot", "windowed:n=5", "windowed:n=20", "relative-motion:k=20")

MOST_FRAMES = 1000
"""Epochs that an observation may hold."""
MOST_WEIGHT = 1e6
"""Of a reward term, and of the spoofer's tracking error, m."""
SCALES = (1e-6, 1e6)
"""Least and largest scale of an error, m, and largest cost of one."""

Config = TypeVar("Config")
Part = TypeVar("Part")
Weighted: TypeAlias = str | Part | tuple[str | Part, float]
"""A member of a pool: a specification or an object, or a pair of one of these and its weight."""


@dataclass(frozen=True)
class Idle:
    """Arguments that have no effect beside certain others.

    Attributes:
        names: of the arguments.
        where: whether they have none, of a configuration and the names of the arguments that were given.
        needs: what they need, for the message.
    """

    names: tuple[str, ...]
    where: Callable[[Any, Collection[str]], bool]
    needs: str


TIME_ALONE = Idle(
    ("tracking_time",),
    lambda config, given: config.tracking_sigma == 0.0 and "tracking_sigma" not in given,
    "needs a tracking_sigma, the size of the error whose correlation time it is",
)


def clean_of_pool(name: str) -> Idle:
    """The share of clean games, where the argument ``name`` is a pool of attacks, which has its own."""
    return Idle(
        ("clean",),
        lambda config, _: isinstance(getattr(config, name), AttackPool),
        f"is given twice: the AttackPool that {name} is has a share of its own",
    )


def configure(kind: type[Config], arguments: Mapping[str, Any]) -> Config:
    """The configuration that a person asks for by keyword arguments.

    Fidelity and knowledge that are not given choose themselves where the scenario leaves one value: a recorded log has
    one fidelity, and no linear model, so that its spoofers are blind.

    Raises:
        TypeError: an unknown key; the message lists the valid ones.
        ValueError: an argument that has no effect beside the others.
    """
    config = configuration(kind, {**_only_possible(kind, arguments), **arguments})
    for idle in kind.idle:  # type: ignore[attr-defined]
        for name in idle.names:
            if name in arguments and idle.where(config, arguments):
                raise ValueError(f"{kind.owner}: {name} {validation.shown(arguments[name])} {idle.needs}")  # type: ignore[attr-defined]
    return config


def configuration(kind: type[Config], arguments: Mapping[str, Any]) -> Config:
    """The configuration of all arguments that one had before, those without effect included.

    Raises:
        TypeError: an unknown key; the message lists the valid ones.
    """
    valid = [item.name for item in fields(kind)]  # type: ignore[arg-type]
    for key in arguments:
        if key not in valid:
            raise TypeError(f"unknown argument {key!r}; valid arguments: {', '.join(valid)}")
    return kind(**arguments)


def _only_possible(kind: type, arguments: Mapping[str, Any]) -> dict[str, str]:
    """The values of arguments that are not given, and of which the scenario leaves one."""
    scenario = arguments.get("scenario")
    if isinstance(scenario, str) and scenario.strip().startswith(RECORDED):
        try:
            scenario = make_scenario(scenario, arguments.get("coupling"))
        except (ValueError, TypeError):
            return {}  # the environment says what is wrong
    if not isinstance(scenario, Scenario):
        return {}
    chosen = {}
    names = [item.name for item in fields(kind)]
    if "fidelity" in names and len(scenario.fidelities) == 1:
        chosen["fidelity"] = scenario.fidelities[0]
    if "knowledge" in names and LINEAR_MODEL not in scenario.offers:
        chosen["knowledge"] = "blind"
    return chosen


def arguments_of(config: Any) -> dict[str, Any]:
    """The arguments that build an environment of this configuration: those that have an effect."""
    without = {name for idle in config.idle if idle.where(config, ()) for name in idle.names}
    return {name: value for name, value in vars(config).items() if name not in without}


def check_options(owner: str, options: object, valid: tuple[str, ...] = ()) -> None:
    """Refuse options of a reset that the environment does not have.

    Raises:
        TypeError: they are no dictionary.
        ValueError: an unknown one; the message lists the valid ones.
    """
    if options is None:
        return
    validation.instance(owner, "options", options, dict, "a dictionary or None")
    for key in options:  # type: ignore[attr-defined]
        if key not in valid:
            known = f"valid options: {', '.join(valid)}" if valid else "there are none"
            raise ValueError(f"{owner}: options: reset has no option {validation.shown(key)}; {known}")


def _set(config: Any, **values: object) -> None:
    """Put checked values in place of those given: 3 for 3.0, a number for a NumPy scalar."""
    for name, value in values.items():
        object.__setattr__(config, name, value)


def _check_coupling(owner: str, coupling: object) -> None:
    if coupling is not None:
        validation.one_of(owner, "coupling", coupling, COUPLINGS)


@dataclass(frozen=True, kw_only=True)
class SpooferConfig:
    """Arguments of Spoofer-v0; the environment's page says what each means.

    Attributes:
        owner: the environment, for messages.
        idle: arguments that have no effect beside others.

    Raises:
        ValueError: a name that is not valid, or a number out of range.
    """

    owner: ClassVar[str] = "Spoofer-v0"
    idle: ClassVar[tuple[Idle, ...]] = (
        Idle(
            ("response",),
            lambda config, _: config.on_alarm == "end",
            "needs on_alarm='respond': with on_alarm='end' an alarm ends the game and nobody responds to it",
        ),
        Idle(
            ("forfeit",),
            lambda config, _: config.on_alarm == "respond",
            "needs on_alarm='end': with on_alarm='respond' an alarm takes nothing back",
        ),
        TIME_ALONE,
    )

    scenario: str | Scenario = "liu-flight"
    detector: str | Detector | tuple[str | Detector, ...] = "snapshot"
    knowledge: str = "shadow"
    action: str = "rate"
    fidelity: str = "linear"
    on_alarm: str = "end"
    response: str | Response | tuple[Weighted[Response], ...] = "exclude"
    forfeit: float = 1.0
    objective: str = "error"
    tracking_sigma: float = 0.0
    tracking_time: float = 0.0
    frames: int = 1
    shadow: str | Scenario | None = None
    coupling: str | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        owner = self.owner
        _check_coupling(owner, self.coupling)
        validation.one_of(owner, "knowledge", self.knowledge, KNOWLEDGE)
        validation.one_of(owner, "action", self.action, ACTIONS)
        validation.one_of(owner, "on_alarm", self.on_alarm, ON_ALARM)
        validation.text(owner, "fidelity", self.fidelity)
        validation.text(owner, "objective", self.objective)
        if self.action == "innovation" and self.knowledge == "blind":
            raise ValueError(
                "action 'innovation' runs a shadow filter: knowledge must be 'shadow' or 'full', not 'blind'"
            )
        if self.shadow is not None and self.knowledge == "blind":
            raise ValueError(
                f"shadow {self.shadow!r} needs knowledge 'shadow' or 'full': a 'blind' spoofer has no shadow filter"
            )
        _set(
            self,
            frames=validation.whole(owner, "frames", self.frames, 1, MOST_FRAMES),
            forfeit=validation.non_negative(owner, "forfeit", self.forfeit, MOST_WEIGHT),
            tracking_sigma=validation.non_negative(owner, "tracking_sigma", self.tracking_sigma, MOST_WEIGHT),
            tracking_time=validation.zero_or_above(owner, "tracking_time", self.tracking_time),
            threads=validation.threads(owner, self.threads),
        )


@dataclass(frozen=True, kw_only=True)
class DefenderConfig:
    """Arguments of Defender-v0; the environment's page says what each means.

    Attributes:
        owner: the environment, for messages.
        idle: arguments that have no effect beside others.

    Raises:
        ValueError: a number out of range.
    """

    owner: ClassVar[str] = "Defender-v0"
    idle: ClassVar[tuple[Idle, ...]] = (clean_of_pool("attacks"),)

    scenario: str | Scenario = "foi-drive"
    attacks: str | Attack | tuple[Weighted[Attack], ...] = "training"
    detectors: str | Detector | tuple[str | Detector, ...] = DEFENDER_DETECTORS
    fidelity: str = "linear"
    clean: float = 0.5
    outage: float = 0.15
    multipath: float = 0.15
    error_scale: float | None = None
    error_clip: float = 5.0
    exclusion_cost: float = 0.05
    coupling: str | None = None
    bank: str | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        owner = self.owner
        _check_coupling(owner, self.coupling)
        validation.text(owner, "fidelity", self.fidelity)
        if self.bank is not None:
            validation.text(owner, "bank", self.bank)
        scale = self.error_scale
        _set(
            self,
            clean=validation.share(owner, "clean", self.clean),
            outage=validation.share(owner, "outage", self.outage),
            multipath=validation.share(owner, "multipath", self.multipath),
            error_scale=None if scale is None else validation.between(owner, "error_scale", scale, *SCALES),
            error_clip=validation.between(owner, "error_clip", self.error_clip, *SCALES),
            exclusion_cost=validation.non_negative(owner, "exclusion_cost", self.exclusion_cost, MOST_WEIGHT),
            threads=validation.threads(owner, self.threads),
        )
