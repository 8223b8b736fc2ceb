"""What the defender sees: the fields of its observation, and the memory that they need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.chi_square import quantile
from spoofgym.envs.bank_features import BankFeatures
from spoofgym.envs.observation import Field, Squash
from spoofgym.envs.range_features import RangeFeatures
from spoofgym.geodesy import AXES
from spoofgym.kernels import njit
from spoofgym.navigation.facts import RANGES
from spoofgym.responses.onset import OnsetEstimator
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

SHORT, LONG = 5, 10
"""Epochs of the signed means."""
QUIET_P = 1e-3
"""A fix is quiet if a matched filter exceeds its NIS with a greater probability. The signed mean has the same limit."""
QUIET_EPOCHS = 5
"""Quiet fixes in a row after which a suspicion is dropped."""


def defender_fields(dimension: int, detectors: tuple[str, ...], error_scale: float) -> tuple[Field, ...]:
    """The entries of the defender's observation, in order.

    Args:
        dimension: m, of the fix; 3 where ranges are turned into a position.
        detectors: their names.
        error_scale: metres of error that make a reward of -1.
    """
    axes = [f"{kind}{axis}" for kind in ("", "velocity ")[: dimension // 3] for axis in AXES]
    result = [Field(f"whitened innovation {axis}", "sigma", 2.0) for axis in axes]
    result += [Field(f"statistic of {name} over its threshold", "1", 1.0) for name in detectors]
    for epochs in (SHORT, LONG):
        result += [Field(f"signed mean of {epochs} epochs {axis}", "sigma", 2.0) for axis in AXES[:2]]
    result += [Field(f"innovation {axis}", "m", error_scale) for axis in AXES[:2]]
    result += [Field(f"change of the innovation {axis}", "m", error_scale) for axis in AXES[:2]]
    result += [
        Field("onset estimate, epochs back", "epochs", 20.0),
        Field("score of the onset estimate", "1", 20.0),
        Field("suspicion", "1", 0.0),
        Field("quiet fixes since the suspicion", "epochs", 5.0),
        Field("fixes in a row that agree, in exclusion", "epochs", 10.0),
        Field("GNSS available", "1", 0.0),
        Field("last decision was to exclude", "1", 0.0),
        Field("coasting time", "s", 20.0),
        Field("predicted position sigma", "m", error_scale),
        Field("speed", "m/s", 50.0),
        Field("acceleration", "m/s²", 1.0),
    ]
    for sensor in ("gyro", "accelerometer"):
        result += [Field(f"{sensor} bias {axis} over its data sheet", "1", 1.0) for axis in ("right", "forward", "up")]
    result.append(Field("elapsed fraction of the game", "1", 0.0))
    return tuple(result)


class Seen(NamedTuple):
    """What the monitors show of the present epoch; shapes as in `Innovation`.

    Attributes:
        epoch: its index, (N,).
        whitened: innovation, (N, m).
        residual: innovation, (N, m), m and m/s.
        nis: (N,).
        available: whether the receiver gives a fix, (N,).
        ratios: each statistic over its threshold, (N, D).
        depth: epochs since the estimated onset, (N,).
        score: of this estimate, (N,).
    """

    epoch: Runs
    whitened: Floats
    residual: Floats
    nis: Floats
    available: Flags
    ratios: Floats
    depth: Runs
    score: Floats


class Told(NamedTuple):
    """What the defender knows of itself and of its filter.

    Attributes:
        excluding: whether its last decision was to exclude, (N,).
        coast: time without a fix that was used, (N,), s.
        covariance: of the position, (N, 3, 3), m².
        velocity: estimated, (N, 3), ENU, m/s.
        bias: estimated, over the data sheet's, (N, 6).
        interval: since the epoch before, (N,), s.
        elapsed: share of the game that is over, (N,).
    """

    excluding: Flags
    coast: Floats
    covariance: Floats
    velocity: Floats
    bias: Floats
    interval: Floats
    elapsed: Floats


class QuietBounds(NamedTuple):
    """What a quiet fix stays below.

    Attributes:
        nis: bound of its NIS.
        mean: bound of the squared signed mean.
    """

    nis: float
    mean: float


class Memory(NamedTuple):
    """What is kept from epoch to epoch.

    Attributes:
        means: the last horizontal innovations, a ring, (N, 10, 2), sigma.
        residual: horizontal innovation of the last fix, (N, 2), m.
        velocity: estimated one epoch ago, (N, 3), m/s.
        suspicion: whether a classical defender would exclude, (N,).
        old_alarm: whether the alarm lasts on from before the suspicion was dropped, (N,).
        quiet: fixes in a row that agree, under suspicion, (N,).
        agreeing: fixes in a row that agree, in exclusion, (N,).
    """

    means: Floats
    residual: Floats
    velocity: Floats
    suspicion: Flags
    old_alarm: Flags
    quiet: Runs
    agreeing: Runs


class DefenderFeatures:
    """The observations of N lanes.

    Attributes:
        fields: the entries, in order.
        bank: what is seen of a bank of hypotheses; None = nothing.
        onset_depth: epochs since the estimated onset, (N,).
    """

    def __init__(
        self,
        scenario: Scenario,
        simulation: Simulation,
        detectors: Sequence[str],
        num_lanes: int,
        bank: str | None = None,
    ) -> None:
        """Allocate the memory of ``num_lanes`` lanes.

        Args:
            scenario: of the game.
            simulation: of the game.
            detectors: names of those that are seen.
            num_lanes: N.
            bank: specification of the bank of hypotheses that is seen; None = none.

        Raises:
            ValueError: the bank is none, or needs what the scenario does not give.
        """
        self._simulation = simulation
        ranges = RANGES in scenario.offers
        dimension = 3 if ranges else scenario.dimension
        self.fields = defender_fields(dimension, tuple(detectors), scenario.defender_scale)
        self._common = len(self.fields)
        self._ranges = RangeFeatures(scenario, simulation, detectors) if ranges else None
        if self._ranges is not None:
            self.fields += self._ranges.fields
        self._behind_ranges = len(self.fields)
        self.bank = None if bank is None else BankFeatures(scenario, simulation, bank)
        if self.bank is not None:
            self.fields += self.bank.fields
        self._detectors = tuple(detectors)
        self._thresholds = np.array([simulation.detectors[name].threshold for name in detectors])
        self._onset = OnsetEstimator(num_lanes)
        self._memory = Memory(
            np.zeros((num_lanes, LONG, 2)),
            np.zeros((num_lanes, 2)),
            np.zeros((num_lanes, 3)),
            np.zeros(num_lanes, dtype=bool),
            np.zeros(num_lanes, dtype=bool),
            np.zeros(num_lanes, dtype=np.int64),
            np.zeros(num_lanes, dtype=np.int64),
        )
        self.onset_depth = np.zeros(num_lanes, dtype=np.int64)
        self._raw = np.zeros((num_lanes, len(self.fields)))
        self._quiet_bounds = QuietBounds(quantile(QUIET_P, dimension), quantile(QUIET_P, 2))
        self._timeline, self._horizon = scenario.timeline, scenario.timeline.num_epochs
        self._bias_sigma = scenario.bias_sigma
        self._squash = Squash(self.fields)

    def reset(self, lanes: Runs) -> None:
        """Forget the games of these lanes."""
        self._onset.reset(lanes)
        memory = self._memory
        memory.means[lanes], memory.residual[lanes], memory.velocity[lanes] = 0.0, 0.0, np.nan
        memory.suspicion[lanes], memory.old_alarm[lanes] = False, False
        memory.quiet[lanes], memory.agreeing[lanes] = 0, 0
        if self.bank is not None:
            self.bank.reset(lanes)

    @property
    def suspicion(self) -> Flags:
        """Whether a classical defender would exclude, (N,)."""
        return self._memory.suspicion

    @property
    def agreeing(self) -> Runs:
        """Fixes in a row that agree with the coasting filter while the defender excludes, (N,)."""
        return self._memory.agreeing

    def update(self, excluding: Flags, coast: Runs, lanes: Runs) -> None:
        """See the present epoch of these lanes.

        Args:
            excluding: whether the last decision was to exclude, (N,).
            coast: epochs since a fix was last used, (N,).
            lanes: which.
        """
        epoch = self._simulation.epoch.in_position
        assert epoch.available is not None
        assert epoch.view is not None
        self._onset.push(epoch.innovation.whitened[:, :2], lanes)
        self.onset_depth, score = self._onset.estimate()
        statistics = np.empty((len(coast), len(self._thresholds)))
        for place, name in enumerate(self._detectors):
            statistics[:, place] = epoch.statistics[name]
        seen = Seen(
            epoch.index,
            epoch.innovation.whitened,
            epoch.innovation.residual,
            epoch.innovation.nis,
            epoch.available,
            statistics / self._thresholds,
            self.onset_depth,
            score,
        )
        told = Told(
            excluding,
            self._coasting_time(epoch.index, coast),
            epoch.view.position_covariance,
            epoch.view.velocity,
            epoch.view.estimated_bias / self._bias_sigma,
            self._timeline.intervals[np.maximum(epoch.index - 1, 0)],
            epoch.index / self._horizon,
        )
        _fill(lanes, seen, told, self._quiet_bounds, self._memory, self._raw)
        if self._ranges is not None:
            self._raw[lanes, self._common : self._behind_ranges] = self._ranges()[lanes]
        if self.bank is not None:
            self._raw[lanes, self._behind_ranges :] = self.bank.update(lanes, excluding)

    def _coasting_time(self, index: Runs, coast: Runs) -> Floats:
        """Time without a fix that was used, (N,), s, beyond the usual interval; epochs that are missing count."""
        timeline = self._timeline
        before = np.maximum(index - 1, 0)
        late = np.where(index > 0, timeline.intervals[before] - timeline.interval, 0.0)
        return timeline.between(before - coast, before) + late

    def observation(self) -> NDArray[np.float32]:
        """What each lane's defender sees, (N, D)."""
        return self._squash(self._raw)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(lanes: Runs, seen: Seen, told: Told, bounds: QuietBounds, memory: Memory, raw: Floats) -> None:
    """Write the raw entries of lanes, in the order of `defender_fields`, and keep what the next epoch compares with."""
    m, detectors = seen.whitened.shape[1], seen.ratios.shape[1]
    for lane in lanes:
        row, first = raw[lane], seen.epoch[lane] == 0
        place = 0
        for a in range(m):
            row[place + a] = seen.whitened[lane, a]
        place += m
        for d in range(detectors):
            row[place + d] = seen.ratios[lane, d]
        place += detectors
        square = _signed_means(memory.means[lane], seen.epoch[lane], seen.whitened[lane], row[place : place + 4])
        place += 4
        _changes(seen.residual[lane], memory.residual[lane], seen.available[lane], first, row[place : place + 4])
        place += 4
        if not told.excluding[lane]:
            memory.agreeing[lane] = 0
        elif seen.available[lane]:
            memory.agreeing[lane] = memory.agreeing[lane] + 1 if seen.nis[lane] < bounds.nis else 0
        if seen.available[lane]:
            _suspect(lane, square > bounds.mean, seen.nis[lane] < bounds.nis, memory)
        row[place] = seen.depth[lane]
        row[place + 1] = seen.score[lane]
        row[place + 2] = 1.0 if memory.suspicion[lane] else 0.0
        row[place + 3] = memory.quiet[lane]
        row[place + 4] = memory.agreeing[lane]
        row[place + 5] = 1.0 if seen.available[lane] else 0.0
        row[place + 6] = 1.0 if told.excluding[lane] else 0.0
        row[place + 7] = told.coast[lane]
        row[place + 8] = np.sqrt(told.covariance[lane, 0, 0] + told.covariance[lane, 1, 1])
        _motion(told.velocity[lane], memory.velocity[lane], first, told.interval[lane], row[place + 9 : place + 11])
        place += 11
        for a in range(6):
            row[place + a] = told.bias[lane, a]
        row[place + 6] = told.elapsed[lane]


@njit(cache=True, nogil=True, error_model="numpy")
def _changes(residual: Floats, last: Floats, available: bool, first: bool, row: Floats) -> None:
    """Write the horizontal innovation and its change since the last fix, (4,), m, and keep it, (2,)."""
    for a in range(2):
        row[a] = residual[a]
        change = residual[a] - last[a]
        row[2 + a] = change if available and not first else 0.0
        if available:
            last[a] = residual[a]


@njit(cache=True, nogil=True, error_model="numpy")
def _motion(velocity: Floats, last: Floats, first: bool, interval: float, row: Floats) -> None:
    """Write speed and acceleration, (2,), m/s and m/s², and keep the velocity (3,); no acceleration at epoch 0."""
    speed = 0.0
    change = 0.0
    for a in range(3):
        speed += velocity[a] ** 2
        if not first:
            change += (velocity[a] - last[a]) ** 2
        last[a] = velocity[a]
    row[0] = np.sqrt(speed)
    row[1] = np.sqrt(change) / interval


@njit(cache=True, nogil=True, error_model="numpy")
def _signed_means(ring: Floats, index: int, whitened: Floats, row: Floats) -> float:
    """Put the newest horizontal innovation into its ring (10, 2) and write √n times the means of 5 and 10 epochs, (4,).

    Returns:
        The square of the shorter one, chi-square with 2 degrees of freedom under a matched filter.
    """
    for a in range(2):
        ring[index % LONG, a] = whitened[a]
        short = 0.0
        long = 0.0
        for back in range(LONG):
            value = ring[(index - back) % LONG, a]
            long += value
            if back < SHORT:
                short += value
        row[a] = short / np.sqrt(SHORT)
        row[2 + a] = long / np.sqrt(LONG)
    return row[0] ** 2 + row[1] ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def _suspect(lane: int, alarm: bool, agrees: bool, memory: Memory) -> None:
    """What a classical defender would believe: `spoofgym.responses.reuse.Consistent` after the alarm of a signed mean.

    An alarm raises the suspicion, five fixes in a row that agree drop it; an alarm that lasts on from before then does
    not raise it again.
    """
    suspicion, old_alarm, quiet = memory.suspicion, memory.old_alarm, memory.quiet
    old_alarm[lane] = old_alarm[lane] and alarm and agrees
    if suspicion[lane]:
        quiet[lane] = quiet[lane] + 1 if agrees else 0
        if quiet[lane] >= QUIET_EPOCHS:
            suspicion[lane], quiet[lane], old_alarm[lane] = False, 0, alarm
    elif alarm and not old_alarm[lane]:
        suspicion[lane] = True
