"""The strapdown fidelity of an aided filter: between two fixes the aids correct the inertial solution at their times.

An epoch is cut into parts that end wherever an aid measures. Runs go through them together, each in its own epoch, and
each aid sees all runs that it measures at once.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.aids.aid import Place
from spoofgym.navigation.aids.aid_set import AidSet, Readings, in_turn
from spoofgym.navigation.interface import NO_DEMANDS, Demands
from spoofgym.navigation.loose.aided import strapdown_kernels as kernels
from spoofgym.navigation.loose.aided.batch import AidedBatch
from spoofgym.navigation.loose.kernels import StrapdownSteps
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


class AidedStrapdownNavigator(AidedBatch, StrapdownNavigator):
    """N closed-loop error-state filters on one game, corrected by fixes and by aids.

    Attributes:
        aid_error: of the aids' states, estimate minus truth, (N, a); in a log, whose truth is unknown, the estimates.
    """

    def __init__(
        self,
        model: StrapdownModel,
        aids: AidSet,
        readings: list[Readings],
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
        *,
        simulated: bool,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: the game; its prior covariance is of all states, (n, n), and its fixes are not late.
            aids: of the filter.
            readings: of each aid, by the samples of the model at whose end they come.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
            simulated: whether noise is added to the readings, and the truth of the aids' states walks.
        """
        super().__init__(model, num_runs, slices, demands)
        n = len(model.prior_covariance)
        self._listen(aids, n, demands)
        self._steps = cut(model.steps, model.boundaries, readings)
        ends = self._steps.bounds[1:]
        order, places = in_turn(readings)
        self._number = [_places(ends, each.moment) for each in readings]
        self._turn, self._value = places, [each.value for each in readings]
        own = aids.num_states
        self.aid_error = np.zeros((num_runs, own))
        self.walk_normals = np.zeros((num_runs, len(ends) if simulated else 0, own))
        self.aid_normals = np.zeros((num_runs, len(order), aids.most_rows if simulated else 0))
        self._aid_states = kernels.AidStates(self.aid_error, aids.walk, self.walk_normals)
        self._density = np.concatenate([model.filter_density, aids.walk**2])
        self.past.add(aid_error=self.aid_error)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; the last columns of ``initial`` are of the aids' states."""
        super().reset(runs, initial, streams)
        self.aid_error[runs] = initial[:, initial.shape[1] - self.aid_error.shape[1] :]
        self._draw_aids(runs, streams)

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        self._draw(runs)
        for done in range(int(epochs[runs].max(initial=0))):
            self._carry_epoch(runs[epochs[runs] > done], auxiliary)

    def _carry_epoch(self, runs: Runs, auxiliary: Floats) -> None:
        """Carry runs to their next epoch, part by part."""
        kernels.begin_epoch(runs, self.index, self.past.ring, self._told)
        first = self._steps.places[self.index[runs]]
        count = self._steps.places[self.index[runs] + 1] - first
        for j in range(int(count.max())):
            chosen = count > j
            some, parts = runs[chosen], first[chosen] + j
            kernels.carry_part(
                some,
                parts,
                self._steps,
                self._density,
                self._vehicles,
                self._aid_states,
                self.covariance,
                auxiliary,
            )
            for aid in range(len(self.aids.aids)):
                number = self._number[aid][parts]
                there = number >= 0
                if there.any():
                    self._read(aid, some[there], number[there], auxiliary)
        kernels.take_fix(runs, self._inertial, self._fix)

    def _read(self, place: int, runs: Runs, number: Runs, auxiliary: Floats) -> None:
        """Let an aid correct runs (k,) by its readings of these numbers, (k,)."""
        aid, aids = self.aids.aids[place], self.aids
        here = Place(self.attitude[runs], self.velocity[runs], self.position[runs])
        value = self._value[place][number]
        with np.errstate(all="ignore"):  # a filter that has diverged, but is not held yet, may be anywhere
            residual, observation = aid.residual(here, value), aid.observe(here, value)
        normals = np.zeros((len(runs), aid.dimension))
        if self.aid_normals.shape[2]:
            normals[:] = self.aid_normals[runs, self._turn[place][number], : aid.dimension]
        reading = kernels.Reading(
            place,
            aids.first_row[place],
            np.array(aid.noise),
            aid.limit(aids.usual_gate),
            residual,
            aids.whole_rows(place, observation),
            normals,
        )
        kernels.use_reading(
            runs, reading, self._inertial, self.aid_error, self.covariance, self._told, auxiliary
        )

    def _correct(self, runs: Runs) -> None:
        super()._correct(runs)
        kernels.correct_states(runs, self.aid_error, self._filters)

    def _settle(self, runs: Runs) -> None:
        super()._settle(runs)
        if self.diverged.any():
            self.aid_error[self.diverged] = 0.0

    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        return (*super()._solution(runs), self.aid_error[runs])

    def _moved(self, before: tuple[Floats, ...], after: tuple[Floats, ...]) -> Floats:
        return np.concatenate([super()._moved(before, after), before[4] - after[4]], axis=1)


def cut(steps: StrapdownSteps, boundaries: Runs, readings: list[Readings]) -> StrapdownSteps:
    """Steps whose parts end wherever an aid measures, too.

    Args:
        steps: of a model.
        boundaries: samples boundaries[k]..boundaries[k+1] lead to epoch k, (K+2,).
        readings: of the aids, by samples.
    """
    inside = [each.moment[(each.moment > boundaries[0]) & (each.moment <= boundaries[-1])] for each in readings]
    bounds = np.unique(np.concatenate([steps.bounds, *inside])).astype(np.int64)
    places = np.searchsorted(bounds, boundaries).astype(np.int64)
    return steps._replace(bounds=bounds, places=places)


def _places(ends: Runs, moments: Runs) -> Runs:
    """The number of the reading that comes at each of the ends, (P,); -1 = none does."""
    number = np.full(len(ends), -1)
    place = np.searchsorted(ends, moments)
    there = (place < len(ends)) & (ends[np.minimum(place, len(ends) - 1)] == moments)
    number[place[there]] = np.flatnonzero(there)
    return number

