"""Windows of solution separation, all of them at once: N runs of a filter and of the coastings that depart from it.

The equations are those of `coasting`: a window is the E and, where every run has a covariance of its own, the M of the
epoch after which it was opened.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.separation.coasting import PACKED, CoastingTables
from spoofgym.navigation.separation.covariances import (
    bring_back,
    fill_early,
    move_covariances,
    quadratic_forms,
    take_back,
    with_gained,
)
from spoofgym.navigation.tight.kalman import FIRST_POSITION


class Windows(NamedTuple):
    """The n windows of N runs, each in its slot.

    Attributes:
        total: E of the present epoch, (N, 15).
        departure: E of each window, (N, 15, n).
        excess: M of each window, packed, (N, 120, n); (0, 120, n) while every run uses every range.
        alarmed: whether each window has alarmed, (N, n).
        known: the last row whose ranges each window knows, (N, n).
        place: slot of the oldest window, (N,).
        num_open: windows that are open, (N,).
        age: see `CoastingWindows`, (N,).
        clean_age: the same after the present epoch, (N,).
    """

    total: Floats
    departure: Floats
    excess: Floats
    alarmed: Flags
    known: Runs
    place: Runs
    num_open: Runs
    age: Runs
    clean_age: Runs


class OwnFilters(NamedTuple):
    """What N filters with covariances of their own know before the ranges of an epoch.

    Attributes:
        auxiliary: the unaided solution minus the filter's, (N, 15).
        covariance: P of the inertial states, (N, 15, 15).
        gain: U' of the position, (N, m, 3), m.
        given: whether there are ranges, (N,).
        backtracked: epochs whose ranges were taken back at the epoch before, (N,).
    """

    auxiliary: Floats
    covariance: Floats
    gain: Floats
    given: Flags
    backtracked: Runs


class Separated(NamedTuple):
    """What an epoch of the windows shows.

    Attributes:
        ratio: the largest |d| / σ_ss of all windows, (N,).
        separation: σ_ss of the most uncertain window, (N, A), m.
        coasting: σ_coast of the same window, (N, A), m.
    """

    ratio: Floats
    separation: Floats
    coasting: Floats


class CoastingWindows:
    """The n windows of N runs: one is opened after every epoch and closed n epochs later."""

    def __init__(self, num_runs: int, num_windows: int) -> None:
        """Allocate ``num_runs`` runs without a window."""
        self._windows = Windows(
            total=np.zeros((num_runs, NUM_INERTIAL)),
            departure=np.zeros((num_runs, NUM_INERTIAL, num_windows)),
            excess=np.zeros((0, PACKED, num_windows)),
            alarmed=np.zeros((num_runs, num_windows), dtype=bool),
            known=np.full((num_runs, num_windows), -1),
            place=np.zeros(num_runs, dtype=np.int64),
            num_open=np.zeros(num_runs, dtype=np.int64),
            age=np.zeros(num_runs, dtype=np.int64),
            clean_age=np.zeros(num_runs, dtype=np.int64),
        )

    @property
    def age(self) -> Runs:
        """Epochs since the newest window was opened that has closed without an alarm, (N,).

        Where none has, epochs since the reset. As of the epoch before, the present one counted.
        """
        return self._windows.age

    def reset(self, runs: Runs) -> None:
        """Close all windows of these runs."""
        windows = self._windows
        for part in (windows.age, windows.clean_age, windows.total, windows.place, windows.num_open):
            part[runs] = 0
        windows.known[runs] = -1

    def take(self, runs: Runs, other: CoastingWindows) -> None:
        """Copy the windows of fewer runs; run j becomes ``runs[j]`` here."""
        # no M: no run is at epoch 0 yet, where they are made
        if len(other._windows.excess):
            self._allocate_covariances()
        for mine, theirs in zip(self._windows, other._windows, strict=True):
            if len(theirs):
                mine[runs] = theirs

    def _allocate_covariances(self) -> None:
        """Make room for M; it is large and needed only where covariances are each run's own."""
        windows = self._windows
        if not len(windows.excess):
            self._windows = windows._replace(excess=np.zeros((len(windows.age), *windows.excess.shape[1:])))

    def separate(self, tables: CoastingTables, row: Runs, whitened: Floats, limit: float) -> Separated:
        """See an epoch of filters that use every range.

        Args:
            tables: of the filter.
            row: of each run in them, (N,); negative where a run has nothing to see yet.
            whitened: w, (N, m).
            limit: of |d| / σ_ss, above which a window alarms.
        """
        separated = self._nothing_separated(tables)
        _separate(tables, row, whitened, limit, self._windows, separated)
        return separated

    def separate_own(
        self, tables: CoastingTables, row: Runs, whitened: Floats, limit: float, filters: OwnFilters
    ) -> Separated:
        """See an epoch of filters that each have a covariance of their own, from epoch 0 on.

        Args:
            tables: of the filter.
            row: of each run in them, (N,).
            whitened: w, (N, m).
            limit: of |d| / σ_ss, above which a window alarms.
            filters: before the ranges.
        """
        self._allocate_covariances()
        separated = self._nothing_separated(tables)
        _separate_own(tables, row, whitened, limit, filters, self._windows, separated)
        return separated

    def _nothing_separated(self, tables: CoastingTables) -> Separated:
        runs, axes = len(self.age), len(tables.directions)
        return Separated(np.zeros(runs), np.zeros((runs, axes)), np.zeros((runs, axes)))


@njit(cache=True, nogil=True, error_model="numpy")
def _open(run: int, origin: Floats, windows: Windows) -> int:
    """Open the window of the epoch before, at E = ``origin``, in place of the oldest; its slot."""
    slot, n = windows.place[run], windows.departure.shape[2]
    for i in range(NUM_INERTIAL):
        windows.departure[run, i, slot] = origin[i]
    windows.alarmed[run, slot] = False
    windows.place[run] = (slot + 1) % n
    windows.num_open[run] = min(windows.num_open[run] + 1, n)
    windows.clean_age[run] += 1
    windows.age[run] = windows.clean_age[run]
    return int(slot)


@njit(cache=True, nogil=True, error_model="numpy")
def _close(run: int, windows: Windows) -> None:
    """The oldest window has seen its last epoch."""
    n = windows.alarmed.shape[1]
    if windows.num_open[run] == n and not windows.alarmed[run, windows.place[run]]:
        windows.clean_age[run] = n


@njit(cache=True, nogil=True, error_model="numpy")
def _separations(present: Floats, direction: Floats, departure: Floats, separation: Floats) -> None:
    """b' (E_k - E_j) of all slots, (n,); present E_k (15,), direction b (15,), departure (15, n)."""
    base = 0.0
    for i in range(NUM_INERTIAL):
        base += direction[i] * present[i]
    for s in range(separation.shape[0]):
        separation[s] = base
    # several terms at once: the sum is then loaded and stored less often
    for i in range(0, NUM_INERTIAL, 5):
        b0, b1, b2, b3, b4 = direction[i], direction[i + 1], direction[i + 2], direction[i + 3], direction[i + 4]
        e0, e1, e2, e3, e4 = departure[i], departure[i + 1], departure[i + 2], departure[i + 3], departure[i + 4]
        for s in range(separation.shape[0]):
            separation[s] -= b0 * e0[s] + b1 * e1[s] + b2 * e2[s] + b3 * e3[s] + b4 * e4[s]


@njit(cache=True, nogil=True, error_model="numpy")
def _by_slot(variance: Floats, slot: int, count: int, spread: Floats) -> None:
    """Variances by age, (n,), for the slots of ``count`` windows, the newest in ``slot``; zero in the others."""
    n = spread.shape[0]
    spread[:] = 0.0
    for age in range(min(count, slot + 1)):
        spread[slot - age] = variance[age]
    for age in range(slot + 1, count):
        spread[slot - age + n] = variance[age]


@njit(cache=True, nogil=True, error_model="numpy")
def _largest(separation: Floats, variance: Floats, limit: float, square: Floats, alarmed: Flags) -> float:
    """The largest d² / σ_ss² of all slots, (n,); those without a variance have no window. Alarms above the limit."""
    for s in range(square.shape[0]):
        square[s] = separation[s] * separation[s] / variance[s] if variance[s] > 0.0 else 0.0
    for s in range(square.shape[0]):
        alarmed[s] |= square[s] > limit * limit
    largest = 0.0
    for s in range(square.shape[0]):
        if square[s] > largest:
            largest = square[s]
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
def _separate(
    tables: CoastingTables, row: Runs, whitened: Floats, limit: float, windows: Windows, separated: Separated
) -> None:
    """An epoch of windows whose variances are tabulated; ``separated`` is overwritten."""
    n = windows.departure.shape[2]
    separation, spread, square = np.empty(n), np.empty(n), np.empty(n)
    for run in range(len(row)):
        k = row[run]
        if k < 0:
            continue
        total, departure = windows.total[run], windows.departure[run]
        if k % tables.origin_rows == 0:
            _move_origin(tables.moved[k // tables.origin_rows], total, departure)
        slot = _open(run, total, windows)
        for i in range(NUM_INERTIAL):
            for c in range(whitened.shape[1]):
                total[i] -= tables.response[k, i, c] * whitened[run, c]
        largest, count = 0.0, windows.num_open[run]
        for a in range(tables.projected.shape[1]):
            _separations(total, tables.projected[k, a], departure, separation)
            _by_slot(tables.variance[k, a], slot, count, spread)
            largest = max(largest, _largest(separation, spread, limit, square, windows.alarmed[run]))
            most = tables.variance[k, a, count - 1]
            separated.separation[run, a] = np.sqrt(most)
            separated.coasting[run, a] = np.sqrt(tables.filtered[k, a] + most)
        separated.ratio[run] = np.sqrt(largest)
        _close(run, windows)


@njit(cache=True, nogil=True, error_model="numpy")
def _separate_own(
    tables: CoastingTables,
    row: Runs,
    whitened: Floats,
    limit: float,
    filters: OwnFilters,
    windows: Windows,
    separated: Separated,
) -> None:
    """An epoch of windows with covariances of their own; ``separated`` is overwritten."""
    n = windows.departure.shape[2]
    separation, variance, square = np.empty(n), np.empty(n), np.empty(n)
    present, weight = np.empty(NUM_INERTIAL), np.empty(PACKED)
    for run in range(len(row)):
        k, departure = row[run], windows.departure[run]
        slot = _open_own(run, k, tables, filters, windows, present)
        largest, count = 0.0, windows.num_open[run]
        for a in range(len(tables.directions)):
            axis = tables.directions[a]
            pulled, gained = 0.0, 0.0
            if filters.given[run]:
                for c in range(whitened.shape[1]):
                    part = filters.gain[run, c, axis]
                    pulled += part * whitened[run, c]
                    gained += part * part
            _separations(present, tables.projected[k, a], departure, separation)
            quadratic_forms(tables.projected[k, a], windows.excess[run], slot, weight, variance)
            most = with_gained(gained, slot, count, variance)
            for s in range(n):
                separation[s] -= pulled
            largest = max(largest, _largest(separation, variance, limit, square, windows.alarmed[run]))
            prior = filters.covariance[run, FIRST_POSITION + axis, FIRST_POSITION + axis]
            separated.separation[run, a] = np.sqrt(most + gained)
            separated.coasting[run, a] = np.sqrt(prior + most)
        separated.ratio[run] = np.sqrt(largest)
        _close(run, windows)


@njit(cache=True, nogil=True, error_model="numpy")
def _open_own(
    run: int, k: int, tables: CoastingTables, filters: OwnFilters, windows: Windows, present: Floats
) -> int:
    """Bring the windows of a run to row k and open that of the epoch before; its slot.

    Args:
        run: whose windows.
        k: the present row of the tables.
        tables: of the filter.
        filters: before the ranges.
        windows: of all runs.
        present: E of the present epoch before the ranges, (15,), overwritten.
    """
    total, departure, excess = windows.total[run], windows.departure[run], windows.excess[run]
    if k % tables.origin_rows == 0:
        origin = k // tables.origin_rows
        _move_origin(tables.moved[origin], total, departure)
        move_covariances(tables.moved[origin], tables.spread[origin], excess)
    for i in range(NUM_INERTIAL):
        present[i] = total[i]
        for j in range(NUM_INERTIAL):
            present[i] -= tables.inverse[k, i, j] * filters.auxiliary[run, j]
    slot = _open(run, present, windows)
    windows.known[run, slot] = k - 1
    bring_back(filters.covariance[run], tables.noise[k], tables.inverse[k], excess[:, slot])
    if k == windows.departure.shape[2] - 1:
        fill_early(slot, windows.num_open[run], tables.early, excess)
    if filters.backtracked[run] > 0:
        first = k - 1 - filters.backtracked[run]
        take_back(slot, windows.num_open[run], first, windows.known[run], departure, excess, windows.alarmed[run])
    return int(slot)


@njit(cache=True, nogil=True, error_model="numpy")
def _move_origin(moved: Floats, total: Floats, departure: Floats) -> None:
    """E <- C E: of the present epoch, (15,), and of all slots, (15, n), in place; moved C (15, 15)."""
    before, windows = total.copy(), departure.copy()
    total[:] = 0.0
    departure[:] = 0.0
    for i in range(NUM_INERTIAL):
        for j in range(NUM_INERTIAL):
            total[i] += moved[i, j] * before[j]
            for s in range(departure.shape[1]):
                departure[i, s] += moved[i, j] * windows[j, s]
