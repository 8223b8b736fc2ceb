"""N runs of the credible filter (Song 2021): fixes at 1 Hz, odometer and the yaw of an INS at 10 Hz."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.immutable import Immutable
from spoofgym.kernels import njit
from spoofgym.navigation.batch import FilterBatch, Weights
from spoofgym.navigation.credible.kalman import (
    HEIGHT,
    POSITIONS,
    VELOCITIES,
    CredibleTuning,
    carry,
    settled_covariance,
    update_covariance,
)
from spoofgym.navigation.history import History, Ring, keep
from spoofgym.navigation.interface import NO_DEMANDS, Decision, Demands, Innovation
from spoofgym.parallel import RunSlices
from spoofgym.sensors.odometer import Odometer, OdometerGrade, PlanarMotion, draw_displacement
from spoofgym.streams import RunStreams

GRAIN = 256
"""Runs below which a slice is not worth a thread."""
ANCHORING = ("anchored", "credited", "free")
NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, kw_only=True)
class AuxiliaryRule:
    """What becomes of the auxiliary position where a fix is used. While fixes are left out it runs free in any case.

    The paper does not say. Nor does it say where the auxiliary position is after an exclusion: here it is where it has
    run to, until the rule anchors it.

    Attributes:
        anchoring: ``anchored``: it is set to the filter's position at every fix that is used. This is the reading that
            gives the paper's accuracies: the auxiliary error stays that of a second. ``credited``: so too, but once
            a fix has been left out or was missing, only from the ``credit``-th fix used in a row on, so that GNSS must
            earn its trust back. ``free``: never; the filter then follows it rather than GNSS.
        credit: fixes in a row, with ``credited``.
    """

    anchoring: str = "anchored"
    credit: int = 5

    def __post_init__(self) -> None:
        validation.one_of("auxiliary rule", "anchoring", self.anchoring, ANCHORING)
        validation.epochs("auxiliary rule", "credit", self.credit)

    @property
    def needed(self) -> int:
        """Fixes used in a row from which on the auxiliary position is anchored."""
        return {"anchored": 1, "credited": self.credit, "free": NEVER}[self.anchoring]


@dataclass(frozen=True, kw_only=True, eq=False)
class CredibleModel(Immutable):
    """What the N runs go through, epochs 0..K.

    Attributes:
        motion: the truth, from one interval before epoch 0 to epoch K.
        odometer: the encoders.
        grade: of their errors and the yaw's.
        tuning: what the filter believes.
        rule: for the auxiliary position.
    """

    motion: PlanarMotion
    odometer: Odometer
    grade: OdometerGrade
    tuning: CredibleTuning
    rule: AuxiliaryRule


class CredibleSteps(NamedTuple):
    """What kernels carry runs with: numbers of the tuning and the rule, and the true motion of each odometer step."""

    step: float
    density: float
    auxiliary_variance: float
    fix_variance: float
    samples: int
    needed: int
    displacement: Floats
    velocity: Floats


class CredibleRuns(NamedTuple):
    """The arrays of `CredibleNavigator` that its kernels change, and the odometer, fix and weight they use."""

    epoch: Runs
    state: Floats
    covariance: Floats
    credit: Runs
    displacement: Floats
    deviation: Floats
    noise_scale: Floats


class CredibleNavigator(FilterBatch):
    """N credible filters, each with a covariance of its own; the height is known.

    The innovation is formed after the auxiliary update of the epoch. Its third component is the receiver's noise (and
    offset) in height alone, with a gain of zero. The unaided solution is the auxiliary position, which is a part of the
    filter.

    Attributes:
        model: the game.
        state: errors of the filter's position and velocity and of the auxiliary position, east and north each, (N, 6).
        covariance: [pp, pv, vv] of either axis, (N, 3), m², m²/s, m²/s².
        credit: fixes used in a row, (N,), as far as the rule counts them.
        displacement: what the odometer gives for each step of the episode, (N, J, 2), m.
    """

    grain = carry_grain = GRAIN

    def __init__(self, model: CredibleModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            num_runs: N.
            slices: the threads to use.
            demands: of the players; whether fixes are left out makes no difference here.
        """
        super().__init__(num_runs, 3, slices, replace(demands, auxiliary=False))
        tuning, motion = model.tuning, model.motion
        self.model = model
        self.state = np.zeros((num_runs, 6))
        self.covariance = np.zeros((num_runs, 3))
        self.credit = np.zeros(num_runs, dtype=np.int64)
        self.displacement = np.zeros((num_runs, motion.num_steps, 2))
        self._settled = settled_covariance(tuning)
        self._noise_scale = np.ones(num_runs)
        self._steps = CredibleSteps(
            tuning.step,
            tuning.acceleration**2,
            tuning.auxiliary_sigma**2,
            tuning.fix_sigma**2,
            tuning.samples,
            model.rule.needed,
            motion.displacement,
            motion.velocity,
        )
        self._runs = CredibleRuns(
            self.index,
            self.state,
            self.covariance,
            self.credit,
            self.displacement,
            self._deviation,
            self._noise_scale,
        )
        self.past = History(
            demands.history,
            np.zeros((num_runs, 0, 0)),
            state=self.state,
            covariance=self.covariance,
            credit=self.credit,
        )

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, the auxiliary position anchored to the filter's.

        Args:
            runs: which, (n,).
            initial: joint state drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        super().reset(runs, initial, streams)
        model = self.model
        self.state[runs] = initial[:, [*POSITIONS, *VELOCITIES, *POSITIONS]]
        self.covariance[runs] = self._settled
        self.credit[runs] = 0 if model.rule.needed == NEVER else model.rule.needed
        for run in runs.tolist():
            self.displacement[run] = draw_displacement(model.motion, model.odometer, model.grade, streams(run, "imu"))

    def restart_auxiliary(self, runs: Runs) -> None:
        """Set the auxiliary position of runs to the filter's, whatever the rule."""
        self.state[runs, 4:] = self.state[runs, :2]

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        _carry(runs, epochs, self._steps, self._runs, self.past.ring)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        """The innovation of the fix as it is; only `_correct` weights it."""
        self._noise_scale[runs] = weights.noise_scale
        residual = -self._deviation[runs]
        residual[:, :HEIGHT] += self.state[runs, :2]
        tuning = self.model.tuning
        sigma = np.full((len(runs), 3), tuning.height_sigma)
        sigma[:, :HEIGHT] = np.sqrt(self.covariance[runs, 0] + tuning.fix_sigma**2)[:, None]
        covariance = np.zeros((len(runs), 3, 3))
        covariance[:, range(3), range(3)] = np.square(sigma)
        whitened = residual / sigma
        nis = whitened[:, 0] ** 2 + whitened[:, 1] ** 2 + whitened[:, 2] ** 2
        return Innovation(residual, covariance, whitened, nis)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take fixes back, then apply the present one, or reset to it, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history.
        """
        super().resolve(decision, runs)
        self.credit[self._select(runs)[~np.asarray(decision.use)]] = 0

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: _correct(part, self._steps, self._runs), runs)

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        _reset(runs, variance, self._steps, self._runs)

    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        raise NotImplementedError("the unaided solution is a part of the filter")

    def _moved(self, before: tuple[Floats, ...], after: tuple[Floats, ...]) -> Floats:
        raise NotImplementedError("the unaided solution is a part of the filter")

    def _past_error(self, epochs: Runs) -> Floats:
        state = self.past.recall("state", epochs)
        return np.concatenate([state[:, :, :2], np.zeros((*epochs.shape, 1))], axis=2)

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU; the height's is zero."""
        return np.column_stack([self.state[:, :2], np.zeros(len(self.state))])

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return np.column_stack([self.state[:, 2:4], np.zeros(len(self.state))])

    @property
    def auxiliary_offset(self) -> Floats:
        """Position by odometer and INS minus that of the filter, (N, 3), m ENU."""
        return np.column_stack([self.state[:, 4:] - self.state[:, :2], np.zeros(len(self.state))])

    @property
    def position_covariance(self) -> Floats:
        """The filter's own covariance of the position, (N, 3, 3), m²; it does not know that dead reckoning drifts."""
        covariance = np.zeros((len(self.state), 3, 3))
        covariance[:, 0, 0] = covariance[:, 1, 1] = self.covariance[:, 0]
        return covariance

    @property
    def estimated_bias(self) -> Floats:
        """None is estimated, (N, 6)."""
        return np.zeros((len(self.state), 6))


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(runs: Runs, epochs: Runs, steps: CredibleSteps, filters: CredibleRuns, ring: Ring) -> None:
    """Carry runs over so many epochs each; what was known before each is kept."""
    samples = steps.samples
    for run in runs:
        for left in range(epochs[run] - 1, -1, -1):
            filters.epoch[run] += 1
            k = filters.epoch[run]
            keep(run, k, ring)
            first, last = k * samples, (k + 1) * samples
            carry(
                steps.step,
                steps.density,
                steps.auxiliary_variance,
                filters.displacement[run, first:last],
                steps.displacement[first:last],
                steps.velocity[first : last + 1],
                filters.state[run],
                filters.covariance[run],
            )
            if left > 0:  # its fix has been taken back
                filters.credit[run] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, steps: CredibleSteps, filters: CredibleRuns) -> None:
    """The credible update (eq 9), and the anchoring of the auxiliary position."""
    for run in runs:
        state, deviation = filters.state[run], filters.deviation[run]
        variance = filters.noise_scale[run] * steps.fix_variance
        position_gain, velocity_gain = update_covariance(variance, filters.covariance[run])
        for a in range(2):
            innovation = deviation[a] - state[a]
            state[a] += position_gain * innovation
            state[2 + a] += velocity_gain * innovation
        _anchor(run, steps.needed, filters)


@njit(cache=True, nogil=True, error_model="numpy")
def _reset(runs: Runs, variance: Floats, steps: CredibleSteps, filters: CredibleRuns) -> None:
    """The position jumps to the fix; the auxiliary position is anchored."""
    for place in range(len(runs)):
        run = runs[place]
        for a in range(2):
            filters.state[run, a] = filters.deviation[run, a]
        filters.covariance[run, 0] = variance[place]
        filters.covariance[run, 1] = 0.0
        _anchor(run, steps.needed, filters)


@njit(cache=True, nogil=True, error_model="numpy")
def _anchor(run: int, needed: int, filters: CredibleRuns) -> None:
    """Count a fix that a run has used, and set the auxiliary position to the filter's where there are enough."""
    filters.credit[run] = min(filters.credit[run] + 1, needed)
    if filters.credit[run] >= needed:
        for a in range(2):
            filters.state[run, 4 + a] = filters.state[run, a]
