"""AIME: chi-square tests of the mean innovation over several windows, weighted by information."""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.window_bank import window_lengths
from spoofgym.kernels import njit
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOWS = "30+60+120"
NOTHING = 1e12
"""Variance of a range that is not there, m²; its own innovation is zero, and not correlated with the others."""


@njit(cache=True, nogil=True, error_model="numpy")
def sweep(packed: Floats) -> None:
    """Sweep [[V, r], [r', 0]] into [[−V⁻¹, V⁻¹ r], [., −r' V⁻¹ r]], of many matrices at once (Beaton 1964).

    Elimination without pivoting, which suits a definite V, positive or negative. The inner loops run over the matrices.

    Args:
        packed: lower triangles by rows, ((m + 1) (m + 2) / 2, R), in place; the corner is the last row.
    """
    size = int(math.sqrt(2.0 * len(packed)))
    runs = packed.shape[1]
    column, inverse = np.empty((size, runs)), np.empty(runs)
    for k in range(size - 1):
        for i in range(size):
            place = i * (i + 1) // 2 + k if i > k else k * (k + 1) // 2 + i
            column[i] = packed[place]
            packed[place] = 0.0
        for run in range(runs):
            inverse[run] = 1.0 / column[k, run]
        for i in range(size):
            for j in range(i + 1):
                place = i * (i + 1) // 2 + j
                left, right, target = column[i], column[j], packed[place]
                if i == k and j == k:
                    for run in range(runs):
                        target[run] = -inverse[run]
                elif i == k or j == k:
                    other = right if i == k else left
                    for run in range(runs):
                        target[run] = other[run] * inverse[run]
                else:
                    for run in range(runs):
                        target[run] -= left[run] * right[run] * inverse[run]


class Aime(ThresholdDetector):
    """Alarm where the mean innovation over any of several windows is too large, in all axes (Diesel and Luu 1995).

    Autonomous integrity monitoring by extrapolation averages the innovations r_i, of covariance V_i, over each window
    with their information as weight:

        r̄ = V̄ Σ V_i⁻¹ r_i,      V̄ = (Σ V_i⁻¹)⁻¹,      statistic = max over windows of r̄' V̄⁻¹ r̄.

    Under a matched filter each window's r̄' V̄⁻¹ r̄ is chi-square with m degrees of freedom at every epoch, however many
    fixes the window holds: one threshold serves all windows. A constant bias b of the whitened innovation has the
    noncentrality n |b|² in a window of n. The published windows are 150 s, 10 min and 30 min; games last minutes, and
    the default windows are shorter.

    Epochs that have not come, and those without a fix, have no information. Windows overlap: ARL0 is
    calibrated.

    Args:
        windows: epochs, increasing, with ``+`` between.
        threshold: compared with the statistic, no unit.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "aime"

    def __init__(
        self, windows: str = DEFAULT_WINDOWS, threshold: float | None = None, arl0: float | None = None
    ) -> None:
        self.windows = window_lengths(self.kind, "windows", windows)
        self.memory = self.windows[-1] - 1
        self.set_up(threshold, arl0, windows=windows)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate what the longest window's epochs and every window know: the triangle of −V⁻¹, and V⁻¹ r.

        Runs come last in memory, where the kernels loop over them, and first in the shapes, as everywhere.
        """
        self._triangle = tuple(np.tril_indices(dimension))
        width = dimension * (dimension + 1) // 2 + dimension
        self._past = np.zeros((width, self.windows[-1], num_runs)).T
        self._total = np.zeros((width, len(self.windows), num_runs)).T
        self._count = np.zeros(num_runs, dtype=np.int64)
        self._since = np.full(num_runs, self.windows[-1])

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._past[runs] = self._total[runs] = 0.0
        self._count[runs] = 0
        self._since[runs] = self.windows[-1]

    def update(self, epoch: Epoch) -> Floats:
        """The largest r̄' V̄⁻¹ r̄, (N,); 0 where no window has a fix."""
        num_runs, num_windows, width = self._total.shape
        rows, columns = self._triangle
        newest = np.zeros((width + 1, num_runs))
        newest[: len(rows)] = _covariance(epoch)[:, rows, columns].T
        newest[len(rows) : -1] = epoch.innovation.residual.T
        sweep(newest)
        self._since += 1
        fix = slice(None) if epoch.available is None else epoch.available
        self._since[fix] = 0
        newest[:, self._since > 0] = 0.0
        _slide(np.array(self.windows), newest, self._past.T, self._total.T, self._count, self._since)
        means = np.zeros((width + 1, num_windows * num_runs))
        means[:-1] = self._total.T.reshape(width, -1)
        sweep(means)
        tests = means[-1].reshape(num_windows, num_runs)
        known = self._since < np.array(self.windows)[:, None]
        return np.asarray(np.maximum.reduce(np.where(known, tests, 0.0), axis=0))


def _covariance(epoch: Epoch) -> Floats:
    """V, (N, m, m); a range that is not there knows next to nothing."""
    covariance, present = epoch.innovation.covariance, epoch.innovation.present
    if present is None or present.all():
        return covariance
    return np.asarray(covariance + NOTHING * ~present[:, :, None] * np.eye(present.shape[1]))


@njit(cache=True, nogil=True, error_model="numpy")
def _slide(windows: Runs, newest: Floats, past: Floats, total: Floats, count: Runs, since: Runs) -> None:
    """Move every window by one epoch; a window in which no fix is left is emptied, of rounding errors, too.

    Args:
        windows: lengths, (W,).
        newest: what this epoch knows, (width + 1, N), the last row left out.
        past: what the last epochs knew, (width, longest, N).
        total: sums over the windows, (width, W, N).
        count: epochs since the reset, (N,).
        since: epochs since the last fix, (N,).
    """
    width, longest, runs = past.shape
    slot = np.empty(runs, dtype=np.int64)
    for window, length in enumerate(windows):
        for run in range(runs):
            slot[run] = (count[run] - length) % longest
        for i in range(width):
            for run in range(runs):
                moved = total[i, window, run] + (newest[i, run] - past[i, slot[run], run])
                total[i, window, run] = moved if since[run] < length else 0.0
    # what leaves the longest window makes room
    for i in range(width):
        for run in range(runs):
            past[i, slot[run], run] = newest[i, run]
    for run in range(runs):
        count[run] += 1
