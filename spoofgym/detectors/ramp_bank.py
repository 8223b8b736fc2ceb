"""A likelihood ratio test of a ramp with unknown onset, rate and direction (Willsky and Jones 1976)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.facts import LINEAR_MODEL, FilterFacts
from spoofgym.navigation.interface import Epoch
from spoofgym.navigation.linear_model import LinearModel

DEFAULT_LENGTH = 60
HORIZONTAL = 2
"""Unknowns of a ramp whose onset is given: its rates east and north."""


class RampBank(ThresholdDetector):
    """Alarm where a ramp that began within the last epochs explains the innovations far better than none does.

    A ramp of the rates r (east, north) whose first spoofed epoch is τ gives the whitened innovation w_j the mean g_τj r
    (`ramp_signatures`). Its log-likelihood ratio, r at its maximum, is half of

        b' A⁻¹ b,      b = Σ_{j=τ..k} g_τj' w_j,      A = Σ_{j=τ..k} g_τj' g_τj,

    and the statistic is the largest over the onsets τ = k-length+1..k. For one onset it is chi-square with 2 degrees of
    freedom under a matched filter; the largest of many that share their innovations has no simple distribution.

    The signatures are those of a filter that uses every fix, computed once along the scenario's linear model. Where
    fixes are left out, or the receiver gives none, they are only approximate; the statistic then takes w = 0 for what
    is missing, and is smaller. Onsets before epoch 0 go on with the gains of epoch 0.

    The test is by Willsky and Jones (1976), for jumps of the state; ramps of the fix and two unknown rates are ours.

    Args:
        length: onsets that are tried, the last ones, epochs.
        threshold: compared with the statistic, no unit.
        arl0: average run length between false alarms, epochs; calibrated, and 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "ramp-bank"
    needs = (LINEAR_MODEL,)

    def __init__(self, length: int = DEFAULT_LENGTH, threshold: float | None = None, arl0: float | None = None) -> None:
        self.length = validation.epochs(self.kind, "length", length, 1, validation.LONGEST_TABLE)
        self.memory = self.length - 1
        self.set_up(threshold, arl0, length=self.length)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate b of every onset, by its age."""
        self._match = np.zeros((num_runs, HORIZONTAL, self.length))

    def know(self, facts: FilterFacts) -> None:
        """Compute the signatures along the scenario."""
        self._signature, information = ramp_signatures(facts.model(0), facts.interval, self.length)
        self._root = np.linalg.inv(np.linalg.cholesky(information)).transpose(0, 2, 3, 1).copy()

    def reset(self, runs: Runs) -> None:
        """Forget the innovations of these runs."""
        self._match[runs] = 0.0

    def update(self, epoch: Epoch) -> Floats:
        """The largest b' A⁻¹ b of all onsets, (N,)."""
        largest = np.empty(len(epoch.index))
        row = np.maximum(epoch.index, 0)
        _advance(row, epoch.innovation.whitened, self._signature, self._root, self._match, largest)
        return largest


def ramp_signatures(model: LinearModel, interval: float, length: int) -> tuple[Floats, Floats]:
    """The mean whitened innovation of a ramp of 1 m/s, east and north, in a filter that uses every fix.

    With e the mean error of the estimate, a the age of the ramp (1 in its first epoch) and T the interval,

        e⁻ = Φ e,      g = L⁻¹ (H e⁻ - [a T; 1]),      e = e⁻ - U g,

    the 1 in the fixes that hold a velocity. Epochs before epoch 0 are as epoch 0.

    Args:
        model: of epochs 0..K.
        interval: T, s.
        length: the greatest age, epochs.

    Returns:
        g of epoch k and age a, (K+1, m, 2, length), and A = Σ g'g since the onset, (K+1, length, 2, 2).
    """
    epochs, m = len(model.time), model.dimension
    whitener = np.linalg.inv(model.innovation_factor)
    onset = np.arange(1 - length, epochs)
    error = np.zeros((len(onset), model.num_states, HORIZONTAL))
    offset = np.zeros((m, HORIZONTAL))
    offset[3:5] = np.eye(HORIZONTAL)[: m - 3]
    total = np.zeros((len(onset), HORIZONTAL, HORIZONTAL))
    signature = np.empty((epochs, m, HORIZONTAL, length))
    information = np.empty((epochs, length, HORIZONTAL, HORIZONTAL))
    for age in range(length):
        row = np.clip(onset + age, 0, epochs - 1)
        offset[:2] += interval * np.eye(HORIZONTAL)
        error = model.transition[row] @ error
        mean = whitener[row] @ (model.observation[row] @ error[:, :NUM_NAVIGATION] - offset)
        error -= model.whitened_gain[row].transpose(0, 2, 1) @ mean
        total += mean.transpose(0, 2, 1) @ mean
        reached = slice(length - 1 - age, length - 1 - age + epochs)
        signature[..., age], information[:, age] = mean[reached], total[reached]
    return signature, information


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(row: Runs, whitened: Floats, signature: Floats, root: Floats, match: Floats, largest: Floats) -> None:
    """Let every onset become an epoch older, and see the new innovation.

    Args:
        row: epoch of each run in the tables, (N,).
        whitened: w, (N, m).
        signature: g, (K+1, m, 2, length).
        root: C⁻¹ with A = C C', lower, (K+1, 2, 2, length).
        match: b, (N, 2, length), in place.
        largest: of |C⁻¹ b|², (N,), result.
    """
    length = match.shape[2]
    for i in range(len(row)):
        g, c = signature[row[i]], root[row[i]]
        for axis in range(2):
            b = match[i, axis]
            for age in range(length - 1, 0, -1):
                b[age] = b[age - 1]
            b[0] = 0.0
            for j in range(whitened.shape[1]):
                for age in range(length):
                    b[age] += g[j, axis, age] * whitened[i, j]
        largest[i] = 0.0
        for age in range(length):
            first = c[0, 0, age] * match[i, 0, age]
            second = c[1, 0, age] * match[i, 0, age] + c[1, 1, age] * match[i, 1, age]
            largest[i] = max(largest[i], first * first + second * second)
