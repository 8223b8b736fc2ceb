"""The aided filter on a simulated trajectory: the loosely coupled one, and what its aids add."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.navigation.aids.aid import Aid
from spoofgym.navigation.aids.aid_set import AidSet, Readings
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.facts import AIDS, INERTIAL_SOLUTION, LINEAR_MODEL, FilterFacts
from spoofgym.navigation.interface import Demands, Navigator
from spoofgym.navigation.loose.aided.dynamics import AidedDynamics, aided_dynamics, readings_along, steps_per_epoch
from spoofgym.navigation.loose.aided.model import AidedModel, aided_model
from spoofgym.navigation.loose.aided.own_gains import AidedOwnNavigator
from spoofgym.navigation.loose.aided.shared_gains import AidedNavigator
from spoofgym.navigation.loose.aided.strapdown import AidedStrapdownNavigator
from spoofgym.navigation.loose.aided.warm_start import aided_cold_start, aided_warm_up
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.loose.warm_start import WarmStart, cold_start
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


@dataclass(frozen=True, kw_only=True, eq=False)
class AidedFamily(LooseFamily):
    """Loosely coupled filters with aids on a simulated trajectory.

    The aids' errors are those that the filter believes in, so that it is matched where it is without them. If no run
    can leave a fix out and no aid has a gate, all runs share the gains of fixes and aids; else each has its own.

    Attributes:
        aids: of the filter, at least one.
    """

    aids: tuple[Aid, ...]

    offers = (INERTIAL_SOLUTION, LINEAR_MODEL, AIDS)

    def __post_init__(self) -> None:
        super().__post_init__()
        owner = f"scenario {self.truth.name!r}"
        for what, there in (
            ("a filter that tunes itself", self.adaptation is not None),
            ("fixes that are made from ranges", self.ranges is not None),
            ("a receiver with latency", self.receiver.latency != 0.0),
        ):
            if there:
                raise ValueError(f"{owner}: aids do not go together with {what}")
        steps_per_epoch(owner, self.aids, self.receiver, self.truth.trajectory.rate)

    @property
    def num_states(self) -> int:  # type: ignore[override]
        """n, with the states of the aids."""
        return NUM_INERTIAL + self.aid_set.num_states

    @cached_property
    def aid_set(self) -> AidSet:
        """The aids, none of which has a gate unless it is asked for."""
        return AidSet(self.aids)

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return replace(super().facts, aids=tuple((aid.kind, aid.dimension) for aid in self.aids))

    @cached_property
    def aided_dynamics(self) -> AidedDynamics:
        """What acts on an error from the start of the trajectory to the end of the game, in the steps of the aids."""
        return aided_dynamics(
            f"scenario {self.truth.name!r}",
            self.aid_set,
            self.truth.trajectory,
            self.grade,
            self.receiver,
            self.tuning,
            self.true_position_random_walk,
            round(self.truth.timeline.end * self.receiver.rate),
        )

    @kept_by_burn_in
    def warm_start(self, burn_in: int = 0) -> WarmStart:
        """Truth and filter just before epoch -burn_in, the states of the aids last.

        Raises:
            ValueError: the trajectory does not reach back that far.
        """
        before = self._before(burn_in)
        start = aided_cold_start(cold_start(self.grade, self.receiver, self.tuning), self.aid_set)
        dynamics = self.aided_dynamics.epochs(0, before)
        return aided_warm_up(start, dynamics, self.aid_set, self.grade, self.receiver, self.tuning)

    @kept_by_burn_in
    def linear_model(self, burn_in: int = 0) -> AidedModel:
        """The game in the linear fidelity, from epoch -burn_in on, every fix and every reading used."""
        first, timeline = self.truth.first(burn_in), self.truth.timeline_from(burn_in)
        dynamics = self.aided_dynamics.epochs(first, first + timeline.num_epochs + 1)
        prior = self.warm_start(burn_in).filter_covariance
        return aided_model(dynamics, self.aid_set, prior, self.tuning.measurement_covariance, timeline)

    def _readings(self, burn_in: int) -> list[Readings]:
        """What each aid reads from epoch -burn_in on, by the samples of the strapdown model."""
        truth, receiver = self.truth, self.receiver
        per_epoch = self.aided_dynamics.per_epoch
        first, epochs = truth.first(burn_in), round(truth.timeline.end * receiver.rate)
        rate = per_epoch * receiver.rate
        samples = round(truth.trajectory.rate / rate)
        found = []
        for each in readings_along(self.aids, truth.trajectory, rate, per_epoch * epochs):
            used = each.moment >= first * per_epoch
            found.append(Readings(samples * (each.moment[used] + 1 - first * per_epoch), each.value[used]))
        return found

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `FilterFamily`."""
        if fidelity == "strapdown":
            model, readings = self._strapdown_model(burn_in), self._readings(burn_in)
            return AidedStrapdownNavigator(
                model, self.aid_set, readings, num_runs, slices, demands, simulated=True
            )
        kind = AidedOwnNavigator if demands.excludes or self.aid_set.gated else AidedNavigator
        return kind(self.linear_model(burn_in), self.grade, self.receiver.interval, num_runs, slices, demands)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Joint states of truth and filter just before epoch -burn_in, (n, 30 + a), those of the aids last."""
        factor = self.warm_start(burn_in).joint_factor
        normals = np.empty((len(runs), len(factor)))
        for place, run in enumerate(runs):
            streams(run, "initial").standard_normal(out=normals[place])
        initial = np.zeros_like(normals)
        for j in np.flatnonzero(factor.any(axis=0)):
            initial += normals[:, j, None] * factor[:, j]
        return initial


def with_aids(family: LooseFamily, aids: tuple[Aid, ...]) -> LooseFamily:
    """The family with aids; the family itself where there are none.

    Raises:
        ValueError: rates that do not fit, or a filter that takes no aids.
    """
    if not aids:
        return family
    fields = {item.name: getattr(family, item.name) for item in dataclasses.fields(family)}
    return AidedFamily(**fields, aids=aids)
