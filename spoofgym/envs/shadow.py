"""The spoofer's copy of the victim's filter, or of what it takes for it, run in expectation.

Liu 2018, eqs 32-34: with the gains of the filter known, the mean error and the mean innovation follow from the offsets
alone,

    e⁻ = Φ e,      r = H e⁻ - s,      u = L⁻¹ r,      e = e⁻ - U u.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario

GRAIN = 4096
"""Lanes below which a slice is not worth a thread."""


def require_fitting(victim: Scenario, shadow: Scenario) -> None:
    """Refuse a shadow filter that cannot run beside the victim's.

    Args:
        victim: scenario of the game.
        shadow: the scenario that the spoofer believes in.

    Raises:
        ValueError: another timeline, coupling or dimension of the fix than the victim's.
    """
    mine, theirs = victim.timeline, shadow.timeline
    pairs: dict[str, tuple[object, object]] = {
        "start, s": (theirs.start, mine.start),
        "interval, s": (theirs.interval, mine.interval),
        "epochs": (theirs.num_epochs, mine.num_epochs),
        "coupling": (shadow.family.coupling, victim.family.coupling),
    }
    if not shadow.slots and not victim.slots:
        pairs["dimension of the fix"] = (shadow.dimension, victim.dimension)
    differing = [f"{name}: {has} instead of {needs}" for name, (has, needs) in pairs.items() if has != needs]
    if differing:
        raise ValueError(f"shadow {shadow.name!r} does not fit the game {victim.name!r}: {'; '.join(differing)}")


def shadow_model(victim: Scenario, shadow: Scenario) -> LinearModel:
    """The linear model that a spoofer runs in place of the victim's: that of the scenario it takes the victim for.

    Args:
        victim: scenario of the game.
        shadow: the scenario that the spoofer believes in.

    Raises:
        ValueError: as `require_fitting`, or a scenario without a linear model.
    """
    require_fitting(victim, shadow)
    return shadow.linear_model()


class ShadowFilter:
    """N shadow filters along one game; it assumes that the victim uses every fix.

    Attributes:
        prior: mean error before the coming fix, (N, 15).
        mean: mean error after the last fix, (N, 15).
        whitened: mean whitened innovation of the last epoch, (N, m).
        coming: mean whitened innovation of the coming epoch if the offset is held, (N, m).
    """

    def __init__(self, model: LinearModel, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` filters, which start without any offset."""
        self.model = model
        self.prior = np.zeros((num_runs, NUM_STATES))
        self.mean = np.zeros((num_runs, NUM_STATES))
        self.whitened = np.zeros((num_runs, model.dimension))
        self.coming = np.zeros((num_runs, model.dimension))
        self._slices = slices
        self._all = np.arange(num_runs)

    def reset(self, runs: Runs) -> None:
        """Start anew at epoch 0, where no offset has acted yet."""
        for array in (self.prior, self.mean, self.whitened, self.coming):
            array[runs] = 0.0

    def advance(self, index: Runs, offset: Floats, previous: Floats, interval: Floats) -> None:
        """Go through the fix of the present epoch.

        Args:
            index: the present epoch of each run, (N,).
            offset: added to its fix, (N, 3), m ENU.
            previous: added to the fix before, (N, 3), m ENU.
            interval: time since that epoch, (N,), s.
        """
        model = self.model
        self._slices.call(
            lambda part: _advance(
                part,
                index,
                offset,
                previous,
                interval,
                model.transition_columns,
                model.observation,
                model.innovation_factor,
                model.whitened_gain,
                self.prior,
                self.mean,
                self.whitened,
                self.coming,
            ),
            self._all,
            GRAIN,
        )

    def offset_for(self, index: Runs, whitened: Floats) -> Floats:
        """The offset that provokes a whitened mean innovation in the position at the coming epoch.

        Args:
            index: the coming epoch of each run, (N,).
            whitened: wanted, (N, 3).

        Returns:
            s = H e⁻ - L u, (N, 3), m ENU.
        """
        offset = np.empty((len(index), 3))
        _offset_for(index, whitened, self.model.observation, self.model.innovation_factor, self.prior, offset)
        return offset


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(
    runs: Runs,
    index: Runs,
    offset: Floats,
    previous: Floats,
    interval: Floats,
    transition_columns: Floats,
    observation: Floats,
    factor: Floats,
    gain: Floats,
    prior: Floats,
    mean: Floats,
    whitened: Floats,
    coming: Floats,
) -> None:
    m = observation.shape[1]
    residual, nothing, work = np.empty(m), np.zeros(NUM_STATES), np.empty(NUM_NAVIGATION)
    last = transition_columns.shape[0] - 1
    for run in runs:
        k = index[run]
        if k > 0:
            _residual(observation[k], prior[run], offset[run], previous[run], interval[run], residual)
            kalman.whiten(factor[k], residual, whitened[run])
            for i in range(NUM_STATES):
                mean[run, i] = prior[run, i]
            kalman.correct_error(gain[k], whitened[run], mean[run])
        if k < last:
            for i in range(NUM_STATES):
                prior[run, i] = mean[run, i]
            kalman.predict_error(transition_columns[k + 1], nothing, prior[run], work)
            _residual(observation[k + 1], prior[run], offset[run], offset[run], interval[run], residual)
            kalman.whiten(factor[k + 1], residual, coming[run])


@njit(cache=True, nogil=True, error_model="numpy")
def _residual(
    observation: Floats, error: Floats, offset: Floats, previous: Floats, interval: float, residual: Floats
) -> None:
    """R = H e⁻ - s; a receiver that gives velocity gives the offset's rate with it."""
    for a in range(residual.shape[0]):
        total = -offset[a] if a < 3 else -(offset[a - 3] - previous[a - 3]) / interval
        for j in range(NUM_NAVIGATION):
            total += observation[a, j] * error[j]
        residual[a] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _offset_for(
    index: Runs, whitened: Floats, observation: Floats, factor: Floats, prior: Floats, offset: Floats
) -> None:
    for run in range(len(index)):
        k = index[run]
        for a in range(3):
            total = 0.0
            for j in range(NUM_NAVIGATION):
                total += observation[k, a, j] * prior[run, j]
            for b in range(a + 1):
                total -= factor[k, a, b] * whitened[run, b]
            offset[run, a] = total
