"""The tightly coupled filter with aids on a simulated trajectory."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.navigation.aids.aid import Aid, Place
from spoofgym.navigation.aids.aid_set import AidSet
from spoofgym.navigation.facts import AIDS, INERTIAL_SOLUTION, RANGES, FilterFacts
from spoofgym.navigation.interface import Demands, Navigator
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.tight.aided.dynamics import EpochReadings, epoch_readings, epochs_per_reading, with_aid_states
from spoofgym.navigation.tight.aided.mean import AidedTightMeanFilter
from spoofgym.navigation.tight.aided.model import AidedTightModel, aided_tight_model, settle_aided
from spoofgym.navigation.tight.aided.runs import AidedTightOwnNavigator, AidedTightStrapdownNavigator
from spoofgym.navigation.tight.family import TightFamily
from spoofgym.navigation.tight.model import TightDynamics
from spoofgym.navigation.tight.states import num_states
from spoofgym.parallel import RunSlices


@dataclass(frozen=True, kw_only=True, eq=False)
class AidedTightFamily(TightFamily):
    """Tightly coupled filters with aids, which read at the epochs of the ranges; every run has a covariance of its own.

    Attributes:
        aids: of the filter, at least one.
    """

    aids: tuple[Aid, ...]

    offers = (INERTIAL_SOLUTION, RANGES, AIDS)

    def __post_init__(self) -> None:
        super().__post_init__()
        for aid in self.aids:
            epochs_per_reading(f"scenario {self.truth.name!r}", aid, self.truth.rate)

    @property
    def num_states(self) -> int:
        """n, with the states of the aids."""
        return num_states(self.slots) + self.aid_set.num_states

    @cached_property
    def aid_set(self) -> AidSet:
        """The aids, none of which has a gate unless it is asked for."""
        return AidSet(self.aids)

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return replace(super().facts, aids=tuple((aid.kind, aid.dimension) for aid in self.aids))

    def _make_dynamics(self) -> TightDynamics:
        return with_aid_states(super()._make_dynamics(), self.aid_set)

    @cached_property
    def readings(self) -> EpochReadings:
        """Of the aids at every epoch from the start of the trajectory to the end of the game."""
        truth = self.truth
        times = np.asarray(truth.interval * np.arange(1, len(self.geometry.time) + 1), dtype=np.float64)
        samples = truth.samples(times)
        motion = truth.trajectory
        place = Place(motion.attitude[samples], motion.velocity[samples], motion.position[samples])
        first_state = num_states(self.slots)
        return epoch_readings(f"scenario {truth.name!r}", self.aid_set, first_state, place, truth.rate)

    def _cold(self) -> Floats:
        inner, sigma = super()._cold(), self.aid_set.sigma
        whole = np.zeros((len(inner) + len(sigma),) * 2)
        whole[: len(inner), : len(inner)] = inner
        whole[range(len(inner), len(whole)), range(len(inner), len(whole))] = sigma**2
        return whole

    @kept_by_burn_in
    def tight_model(self, burn_in: int = 0) -> AidedTightModel:
        """The game in the linear fidelity, from epoch -burn_in on, every range and every reading used."""
        first, dynamics, readings = self._first(burn_in), self._dynamics, self.readings
        last = first + self.truth.horizon + burn_in + 1
        prior = settle_aided(dynamics.part(0, first), readings.part(0, first), self._cold())
        return aided_tight_model(dynamics.part(first, last), readings.part(first, last), prior)

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation, everything used."""
        return AidedTightMeanFilter(self.tight_model(), num_runs, slices)

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `FilterFamily`."""
        model = self.tight_model(burn_in)
        if fidelity == "linear":
            return AidedTightOwnNavigator(model, num_runs, slices, demands)
        inertial, satellites = self._strapdown(burn_in)
        return AidedTightStrapdownNavigator(inertial, model, satellites, num_runs, slices, demands)


def with_aids(family: TightFamily, aids: tuple[Aid, ...]) -> TightFamily:
    """The family with aids; the family itself where there are none.

    Raises:
        ValueError: rates that do not fit.
    """
    if not aids:
        return family
    fields = {item.name: getattr(family, item.name) for item in dataclasses.fields(family)}
    return AidedTightFamily(**fields, aids=aids)
