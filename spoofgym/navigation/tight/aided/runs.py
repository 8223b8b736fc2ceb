"""N aided filters on ranges, in both fidelities: each has a covariance of its own."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.aid_innovations import AidInnovations
from spoofgym.navigation.aids.aid import Place
from spoofgym.navigation.aids.kernels import Told
from spoofgym.navigation.batch import FilterBatch
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tight.aided.dynamics import EpochReadings
from spoofgym.navigation.tight.aided.kernels import Reading, Unaided, feed_back_all, use_reading
from spoofgym.navigation.tight.aided.model import AidedTightModel
from spoofgym.navigation.tight.own_gains import TightOwnNavigator
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


class AidedTightBatch(FilterBatch):
    """N filters on ranges that aids correct at the end of every epoch, before the ranges come.

    Attributes:
        auxiliary_aids: states of the aids of the solution without GNSS minus those of the filter, (N, a); (N, 0) if it
            is not demanded.
        aid_normals: standard normals of the readings of each aid in the episode, (N, M, r) each.
    """

    state: Floats
    covariance: Floats

    def _listen(self, readings: EpochReadings, demands: Demands) -> None:
        """Allocate what the aids need."""
        n, aids = len(self.index), readings.aids
        self._readings = readings
        heard = [each[each >= 0] for each in readings.number.T]
        self._first_number = [int(numbers[0]) if len(numbers) else 0 for numbers in heard]
        self.aid_normals = [
            np.zeros((n, len(numbers), aid.dimension)) for numbers, aid in zip(heard, aids.aids, strict=True)
        ]
        self.auxiliary_aids = np.zeros((n, aids.num_states if demands.auxiliary else 0))
        count = np.zeros((n, len(aids.aids)), dtype=np.int64)
        self._told = Told(np.zeros((n, aids.num_rows)), count, count.copy())

    def _reset_aids(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the noise of the aids of new episodes, from a stream of its own."""
        for run in runs.tolist():
            stream = streams(run, "aids")
            for normals in self.aid_normals:
                stream.standard_normal(out=normals[run])
        self.auxiliary_aids[runs] = 0.0
        for part in self._told:
            part[runs] = 0

    @abstractmethod
    def _carry_ranges(self, runs: Runs, auxiliary: Floats) -> None:
        """Carry runs to their next epoch without any reading."""

    @abstractmethod
    def _apart(self, place: int, runs: Runs, number: Runs) -> tuple[Floats, Floats]:
        """Residual of an aid beyond the states of the filter (k, r), and its H on all of them, (k, r, n)."""

    @abstractmethod
    def _add(self, runs: Runs, corrections: Floats) -> None:
        """Correct the states of runs."""

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        wanted = auxiliary.shape[1] > 0
        unaided = Unaided(auxiliary, self.auxiliary_aids if wanted else self.auxiliary_aids[:, :0].copy())
        for done in range(int(epochs[runs].max(initial=0))):
            some = runs[epochs[runs] > done]
            self._carry_ranges(some, auxiliary)
            for part in self._told:
                part[some] = 0
            for place in range(len(self._readings.aids.aids)):
                number = self._readings.number[self.index[some], place]
                there = number >= 0
                if there.any():
                    self._read(place, some[there], number[there], unaided)

    def _read(self, place: int, runs: Runs, number: Runs, unaided: Unaided) -> None:
        """Let an aid correct runs (k,) by its readings of these numbers, (k,)."""
        aids = self._readings.aids
        aid = aids.aids[place]
        with np.errstate(all="ignore"):  # a filter that has diverged, but is not held yet, may be anywhere
            residual, observation = self._apart(place, runs, number)
        normals = self.aid_normals[place][runs, number - self._first_number[place]]
        limit, first_row = aid.limit(aids.usual_gate), aids.first_row[place]
        reading = Reading(place, first_row, np.array(aid.noise), limit, residual, observation, normals)
        corrections = np.empty((len(runs), self.state.shape[1]))
        use_reading(runs, reading, self.state, self.covariance, self._told, unaided, corrections)
        self._add(runs, corrections)

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided solution of runs, where there is one, begin anew from the filter's."""
        super().restart_auxiliary(runs)
        self.auxiliary_aids[runs] = 0.0

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """As `FilterBatch.resolve`; the unaided solution keeps its own states of the aids."""
        chosen = self._select(runs)
        own = self.auxiliary_aids.shape[1]
        before = self.state[chosen, self.state.shape[1] - own :]
        super().resolve(decision, runs)
        self.auxiliary_aids[chosen] += before - self.state[chosen, self.state.shape[1] - own :]

    def aid_innovations(self, runs: Runs) -> AidInnovations:
        """What the aids told these runs at their present epoch."""
        aids, told = self._readings.aids, self._told
        return AidInnovations(
            aids.names, aids.first_row, told.whitened[runs], told.number[runs], told.rejected[runs]
        )


class AidedTightOwnNavigator(AidedTightBatch, TightOwnNavigator):
    """N aided filters on ranges in the linear fidelity."""

    def __init__(self, model: AidedTightModel, num_runs: int, slices: RunSlices, demands: Demands) -> None:
        """As for `TightOwnNavigator`."""
        super().__init__(model, num_runs, slices, demands)
        self._listen(model.readings, demands)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0."""
        super().reset(runs, initial, streams)
        self._reset_aids(runs, streams)

    def _carry_ranges(self, runs: Runs, auxiliary: Floats) -> None:
        TightOwnNavigator._carry(self, runs, self._one_epoch, auxiliary)

    def _apart(self, place: int, runs: Runs, number: Runs) -> tuple[Floats, Floats]:
        observation = self._readings.observations[place][number]
        return np.zeros(observation.shape[:2]), observation

    def _add(self, runs: Runs, corrections: Floats) -> None:
        self.state[runs] += corrections


class AidedTightStrapdownNavigator(AidedTightBatch, TightStrapdownNavigator):
    """N aided filters on ranges in the strapdown fidelity."""

    def __init__(
        self,
        model: StrapdownModel,
        tight: AidedTightModel,
        satellites: Floats,
        num_runs: int,
        slices: RunSlices,
        demands: Demands,
    ) -> None:
        """As for `TightStrapdownNavigator`."""
        super().__init__(model, tight, satellites, num_runs, slices, demands)
        self._listen(tight.readings, demands)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0."""
        super().reset(runs, initial, streams)
        self._reset_aids(runs, streams)

    def _settle(self, runs: Runs) -> None:
        super()._settle(runs)
        if self.diverged.any():
            self.auxiliary_aids[self.diverged] = 0.0

    def _carry_ranges(self, runs: Runs, auxiliary: Floats) -> None:
        TightStrapdownNavigator._carry(self, runs, self._one_epoch, auxiliary)

    def _apart(self, place: int, runs: Runs, number: Runs) -> tuple[Floats, Floats]:
        readings = self._readings
        aid, value = readings.aids.aids[place], readings.values[place][number]
        here = Place(self.attitude[runs], self.velocity[runs], self.position[runs])
        return aid.residual(here, value), readings.on_all(place, aid.observe(here, value))

    def _add(self, runs: Runs, corrections: Floats) -> None:
        feed_back_all(runs, corrections, self._inertial, self.state)
