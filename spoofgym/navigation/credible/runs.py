"""N runs of the credible filter (Song 2021): fixes at 1 Hz, odometer and the yaw of an INS at 10 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.immutable import Immutable
from spoofgym.kernels import njit
from spoofgym.navigation.credible.kalman import (
    HEIGHT,
    POSITIONS,
    VELOCITIES,
    CredibleTuning,
    carry,
    settled_covariance,
    update_covariance,
)
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.loose.shared_gains import NO_DEMANDS
from spoofgym.parallel import RunSlices
from spoofgym.sensors.odometer import Odometer, OdometerGrade, PlanarMotion, draw_displacement
from spoofgym.streams import RunStreams

GRAIN = 256
"""Runs below which a slice is not worth a thread."""
ANCHORING = ("anchored", "credited", "free")
NEVER = np.iinfo(np.int64).max
NUM_KEPT = 10
"""Numbers of the history per epoch: 6 errors, 3 of the covariance, the credit."""


@dataclass(frozen=True, kw_only=True)
class AuxiliaryRule:
    """What becomes of the auxiliary position where a fix is used. While fixes are left out it runs free in any case.

    The paper does not say. Nor does it say where the auxiliary position is after an exclusion: here it is where it has
    run to, until the rule anchors it.

    Attributes:
        anchoring: ``anchored``: it is set to the filter's position at every fix that is used. This is the reading that
            gives the paper's accuracies: the auxiliary error stays that of a second. ``credited``: the same, but after
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


class CredibleNavigator:
    """N credible filters, each with a covariance of its own; the height is known.

    The innovation is formed after the auxiliary update of the epoch. Its third component is the receiver's noise (and
    offset) in height alone, with a gain of zero.

    Attributes:
        model: the game.
        state: errors of the filter's position and velocity and of the auxiliary position, east and north each, (N, 6).
        covariance: [pp, pv, vv] of either axis, (N, 3), m², m²/s, m²/s².
        credit: fixes used in a row, (N,), as far as the rule counts them.
        displacement: what the odometer gives for each step of the episode, (N, J, 2), m.
        index: the epoch where each run stands, (N,); -1 before the first.
        diverged: whether the filter has diverged, (N,); a linear one never does.
        backtracked: epochs that the last `resolve` took back, (N,).
        history: epochs that can be taken back.
    """

    def __init__(
        self, model: CredibleModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            num_runs: N.
            slices: the threads to use.
            demands: of the players; whether fixes are left out makes no difference here.
        """
        self.model = model
        self.state = np.zeros((num_runs, 6))
        self.covariance = np.zeros((num_runs, 3))
        self.credit = np.zeros(num_runs, dtype=np.int64)
        self.displacement = np.zeros((num_runs, model.motion.num_steps, 2))
        self.index = np.full(num_runs, -1)
        self.diverged = np.zeros(num_runs, dtype=bool)  # a linear filter never does
        self.backtracked = np.zeros(num_runs, dtype=np.int64)
        self.history = demands.history
        self._past = np.zeros((num_runs, demands.history + 1 if demands.history else 0, NUM_KEPT))
        self._deviation = np.zeros((num_runs, 3))
        self._settled = settled_covariance(model.tuning)
        self._slices = slices
        self._all = np.arange(num_runs)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, the auxiliary position anchored to the filter's.

        Args:
            runs: which, (n,).
            initial: joint state drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        model = self.model
        self.index[runs] = -1
        self.backtracked[runs] = 0
        self.state[runs] = initial[:, [*POSITIONS, *VELOCITIES, *POSITIONS]]
        self.covariance[runs] = self._settled
        self.credit[runs] = 0 if model.rule.needed == NEVER else model.rule.needed
        for run in runs.tolist():
            self.displacement[run] = draw_displacement(model.motion, model.odometer, model.grade, streams(run, "imu"))

    def restart_auxiliary(self, runs: Runs) -> None:
        """Set the auxiliary position of runs to the filter's, whatever the rule."""
        self.state[runs, 4:] = self.state[runs, :2]

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by odometer and INS."""
        runs = self._all if runs is None else runs
        self.index[runs] += 1
        self._carry(runs, np.zeros(len(runs), dtype=np.int64))

    def _carry(self, runs: Runs, depth: Runs) -> None:
        """Carry runs over their present epoch and as many before it as ``depth`` (n,) says, without any fix."""
        model, tuning = self.model, self.model.tuning
        self._slices.call(
            lambda part: _carry(
                part,
                runs,
                depth,
                self.index,
                tuning.step,
                tuning.acceleration**2,
                tuning.auxiliary_sigma**2,
                tuning.samples,
                self.displacement,
                model.motion.displacement,
                model.motion.velocity,
                self.state,
                self.covariance,
                self.credit,
                self._past,
            ),
            self._all[: len(runs)],
            GRAIN,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of the present epoch of runs (all by default).

        Args:
            deviation: receiver noise plus offset, (n, 3), m ENU.
            runs: which, (n,).
        """
        runs = self._all if runs is None else runs
        self._deviation[runs] = deviation
        residual = -np.asarray(deviation, dtype=np.float64)
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
        runs = self._all if runs is None else runs
        self._take_back(decision, runs)
        nothing = np.zeros(len(runs))
        _correct(
            runs,
            np.asarray(decision.use),
            nothing if decision.reset is None else np.asarray(decision.reset, dtype=np.float64),
            nothing + 1.0 if decision.noise_scale is None else np.asarray(decision.noise_scale, dtype=np.float64),
            self.model.tuning.fix_sigma**2,
            self.model.rule.needed,
            self._deviation,
            self.state,
            self.covariance,
            self.credit,
        )

    def _take_back(self, decision: Decision, runs: Runs) -> None:
        """Restore the states before the fixes taken back, and carry them to the present epoch without these."""
        self.backtracked[runs] = 0
        if decision.backtrack is None or not decision.backtrack.any():
            return
        if not self.history:
            raise ValueError("a backtrack is decided, but the navigator keeps no history: demand one when it is built")
        depth = np.minimum(np.minimum(decision.backtrack, self.history), self.index[runs])
        self.backtracked[runs] = depth
        back = depth > 0
        runs, depth = runs[back], depth[back]
        if len(runs):
            kept = self._past[runs, (self.index[runs] - depth) % self._past.shape[1]]
            self.state[runs], self.covariance[runs] = kept[:, :6], kept[:, 6:9]
            self.credit[runs] = kept[:, 9]
            self._carry(runs, depth)

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
def _carry(
    places: Runs,
    runs: Runs,
    depth: Runs,
    index: Runs,
    step: float,
    density: float,
    variance: float,
    samples: int,
    displacement: Floats,
    true_displacement: Floats,
    true_velocity: Floats,
    state: Floats,
    covariance: Floats,
    credit: Runs,
    past: Floats,
) -> None:
    """Epochs index - depth .. index of runs; what was known before each is kept."""
    slots = past.shape[1]
    for place in places:
        run = runs[place]
        for k in range(index[run] - depth[place], index[run] + 1):
            if slots > 0:
                kept = past[run, k % slots]
                kept[:6] = state[run]
                kept[6:9] = covariance[run]
                kept[9] = credit[run]
            first, last = k * samples, (k + 1) * samples
            carry(
                step,
                density,
                variance,
                displacement[run, first:last],
                true_displacement[first:last],
                true_velocity[first : last + 1],
                state[run],
                covariance[run],
            )
            if k < index[run]:
                credit[run] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(
    runs: Runs,
    use: Flags,
    reset: Floats,
    noise_scale: Floats,
    variance: float,
    needed: int,
    deviation: Floats,
    state: Floats,
    covariance: Floats,
    credit: Runs,
) -> None:
    """The credible update (eq 9) where the fix is used, and the anchoring of the auxiliary position."""
    for place in range(len(runs)):
        run = runs[place]
        if not use[place]:
            credit[run] = 0
            continue
        if reset[place] > 0.0:
            for a in range(2):
                state[run, a] = deviation[run, a]
            covariance[run, 0] = reset[place]
            covariance[run, 1] = 0.0
        else:
            position_gain, velocity_gain = update_covariance(noise_scale[place] * variance, covariance[run])
            for a in range(2):
                innovation = deviation[run, a] - state[run, a]
                state[run, a] += position_gain * innovation
                state[run, 2 + a] += velocity_gain * innovation
        credit[run] = min(credit[run] + 1, needed)
        if credit[run] >= needed:
            for a in range(2):
                state[run, 4 + a] = state[run, a]
