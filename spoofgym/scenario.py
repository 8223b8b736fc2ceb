"""What a game is played on: the true motion and a filter on it, which a family holds, and the rules."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.guidance import Guidance, Steering, make_guidance
from spoofgym.immutable import Immutable
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.family import FilterFamily
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.tight.model import TightModel
from spoofgym.specification import Specification
from spoofgym.timeline import Timeline, manoeuvre_times
from spoofgym.truth import Truth
from spoofgym.validation import shown

ALERT_LIMITS = (556.0, 50.0)
"""Horizontal and vertical, m: RNP 0.3, and the limit of an approach with vertical guidance (DO-229, LNAV/VNAV)."""
LANE = 3.5
"""Width of a lane of a road, m: the usual corridor of a vehicle that is steered across its direction of travel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario(Immutable):
    """A true motion, a kind of filter, and the rules of the game.

    Attributes:
        family: the kind of filter, on the true motion.
        drag_off_rate: the largest rate at which a spoofer moves the position, per axis (E, N, U), m/s.
        error_scale: metres of navigation error that make a spoofer's reward of 1.
        defender_scale: metres of navigation error that cost a defender 1.
        harm_cap: error at which the harm of a duel is clipped, m.
        depth_table: depths among which a defender chooses, epochs.
        history: epochs that the navigator keeps at least, where somebody can backtrack.
        clock_rate: the largest rate at which a spoofer pulls the clock of a receiver of ranges, m/s.
        alert_limits: horizontal and vertical position error from which the navigation is hazardous, m.
        guidance: how the vehicle is steered by its own estimate; None = it keeps its path whatever it estimates.
    """

    family: FilterFamily
    drag_off_rate: tuple[float, float, float]
    error_scale: float
    defender_scale: float = 10.0
    harm_cap: float = 200.0
    depth_table: tuple[int, ...] = (0, 5, 10, 20, 50)
    history: int = 60
    clock_rate: float = 0.0
    alert_limits: tuple[float, float] = ALERT_LIMITS
    guidance: Guidance | None = None

    def __post_init__(self) -> None:
        owner = f"scenario {self.name!r}"
        for rate in validation.triple(owner, "drag_off_rate", self.drag_off_rate):
            validation.above(owner, "drag_off_rate", rate)
        validation.above(owner, "error_scale", self.error_scale)
        validation.above(owner, "defender_scale", self.defender_scale)
        validation.above(owner, "harm_cap", self.harm_cap)

    @property
    def truth(self) -> Truth:
        """The true motion."""
        return self.family.truth

    @property
    def name(self) -> str:
        """The specification that builds it."""
        if self.guidance is None:
            return self.truth.name
        given = Specification.parse(self.truth.name)
        return str(replace(given, options={**given.options, "guidance": self.guidance.nested}))

    @cached_property
    def unguided(self) -> Scenario:
        """The same game of a vehicle that keeps its path: innovations, errors and thresholds are those of this one."""
        return self if self.guidance is None else replace(self, guidance=None)

    def guided(self, text: str | None, axes: str) -> Scenario:
        """The game of a vehicle that is steered by its own estimate.

        Args:
            text: how, as `spoofgym.guidance.make_guidance` takes it; None = it is not.
            axes: in which it is steered where the text does not say. The corridor is then `LANE` wide across the
                direction of travel, and twice the horizontal alert limit in both horizontal axes.

        Raises:
            ValueError: a guidance that is unknown or not valid.
        """
        if text is None:
            return self
        owner, corridors = f"scenario {self.name!r}", {"lateral": LANE, "horizontal": 2.0 * self.alert_limits[0]}
        with validation.argument(owner, "guidance"):
            made = make_guidance(validation.text(owner, "guidance", text), axes, corridors)
        return replace(self, guidance=made)

    def steering(self, num_runs: int) -> Steering | None:
        """That of so many vehicles; None where they keep their path.

        Raises:
            ValueError: the vehicle has no direction of travel, across which it could be steered.
        """
        if self.guidance is None:
            return None
        return Steering(self.guidance, self.timeline, self.velocity_in_steps(), num_runs)

    @property
    def timeline(self) -> Timeline:
        """The epochs of the game."""
        return self.truth.timeline

    @property
    def dimension(self) -> int:
        """m, of a measurement."""
        return self.family.dimension

    @property
    def slots(self) -> int:
        """S, satellites that are tracked at most; 0 where the filter takes fixes."""
        return self.family.slots

    @property
    def fidelities(self) -> tuple[str, ...]:
        """The valid ones."""
        return self.family.fidelities

    @property
    def offers(self) -> tuple[str, ...]:
        """What its filter gives to monitors beside innovations."""
        return self.family.offers

    @property
    def matched(self) -> bool:
        """Whether the filter's model is the truth, so that clean innovations are white."""
        return self.family.matched

    @property
    def random(self) -> bool:
        """Whether every episode is drawn anew; a recorded log has one realisation."""
        return self.family.random

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU's gyros and accelerometers, (6,), rad/s and m/s²."""
        return self.family.bias_sigma

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return self.family.facts

    def manoeuvres(self) -> tuple[float, ...]:
        """Times within the game at which the vehicle begins to change its velocity, s."""
        return manoeuvre_times(self.velocity_in_steps(), self.timeline)

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        return self.truth.times(burn_in)

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, which a spoofer tracks, (burn_in + K + 1, 3), ENU, m/s."""
        return self.truth.velocity(burn_in)

    def velocity_in_steps(self) -> Floats:
        """The true velocity at the moments of the timeline's steps, (M+1, 3), ENU, m/s."""
        return self.truth.velocity_in_steps()

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        return self.truth.track()

    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity from epoch -burn_in on, every fix used: what a shadow filter knows.

        Raises:
            ValueError: the scenario has no such model.
        """
        return self.family.linear_model(burn_in)

    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The game of a filter on ranges from epoch -burn_in on, every range used.

        Raises:
            ValueError: the filter takes fixes.
        """
        model = self.facts.range_model
        if model is None:
            raise ValueError(f"scenario {self.name!r} is loosely coupled: it has a linear_model, not a tight_model")
        made = model(burn_in)
        assert isinstance(made, TightModel)
        return made

    def check_fidelity(self, fidelity: object) -> None:
        """Refuse a fidelity that the scenario does not have.

        Raises:
            ValueError: naming the valid ones.
        """
        if not isinstance(fidelity, str) or fidelity not in self.fidelities:
            valid = ", ".join(self.fidelities)
            raise ValueError(f"scenario {self.name!r} has no fidelity {shown(fidelity)}; valid fidelities: {valid}")

    def changed(self, **fields: Any) -> Scenario:
        """A scenario with other values of some fields: its own, those of its family, and those of the family's truth.

        Args:
            fields: by name. A field that several of the three have is changed in the first of them.

        Raises:
            TypeError: none of the three has a field of this name.
        """
        parts: dict[str, Any] = {"own": self, "family": self.family}
        if "truth" in _fields(self.family):
            parts["truth"] = self.family.truth
        changes: dict[str, dict[str, Any]] = {part: {} for part in parts}
        for name, value in fields.items():
            holders = [part for part, held in parts.items() if name in _fields(held)]
            if not holders:
                raise TypeError(f"scenario {self.name!r} has no field {name!r}")
            changes[holders[0]][name] = value
        if changes.get("truth"):
            changes["family"]["truth"] = replace(parts["truth"], **changes["truth"])
        if changes["family"]:
            changes["own"]["family"] = replace(parts["family"], **changes["family"])
        return replace(self, **changes["own"])


def _fields(part: Any) -> set[str]:
    """Names of the fields of a data class."""
    return {item.name for item in dataclasses.fields(part)}
