"""Windows of solution separation, all of them at once: N runs of a filter and of the coastings that depart from it.

The equations are those of `coasting`: a window is the E and, where every run has a covariance of its own, the M of the
epoch after which it was opened.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.separation.coasting import PACKED, CoastingTables
from spoofgym.navigation.separation.covariances import (
    bring_back,
    fill_early,
    move_covariances,
    quadratic_forms,
    take_back,
    with_gained,
)
from spoofgym.navigation.tight.kalman import POSITION


class CoastingWindows:
    """The n windows of N runs, one opened after every epoch, closed n epochs later.

    Attributes:
        age: epochs since the newest window was opened that has closed without an alarm; since the reset where none has,
            (N,). As of the epoch before, the present one counted.
    """

    def __init__(self, num_runs: int, num_windows: int) -> None:
        """Allocate ``num_runs`` runs without a window."""
        self._num_windows = num_windows
        self.age = np.zeros(num_runs, dtype=np.int64)
        self._clean_age = np.zeros(num_runs, dtype=np.int64)
        self._total = np.zeros((num_runs, NUM_STATES))
        self._departure = np.zeros((num_runs, NUM_STATES, num_windows))
        self._excess: Floats | None = None
        self._alarmed = np.zeros((num_runs, num_windows), dtype=bool)
        self._known = np.full((num_runs, num_windows), -1)
        self._place = np.zeros(num_runs, dtype=np.int64)
        self._count = np.zeros(num_runs, dtype=np.int64)

    def reset(self, runs: Runs) -> None:
        """Close all windows of these runs."""
        for part in (self.age, self._clean_age, self._total, self._place, self._count):
            part[runs] = 0
        self._known[runs] = -1

    def take(self, runs: Runs, other: CoastingWindows) -> None:
        """Copy the windows of fewer runs; run j becomes ``runs[j]`` here."""
        for name in ("age", "_clean_age", "_total", "_departure", "_alarmed", "_known", "_place", "_count"):
            getattr(self, name)[runs] = getattr(other, name)
        # None: no run is at epoch 0 yet, where they are made
        if other._excess is not None:
            self._covariances()[runs] = other._excess

    def _covariances(self) -> Floats:
        """M of the windows, packed, (N, 120, n); allocated where covariances are each run's own."""
        if self._excess is None:
            self._excess = np.zeros((len(self.age), PACKED, self._num_windows))
        return self._excess

    def separate(
        self, tables: CoastingTables, row: Runs, whitened: Floats, limit: float
    ) -> tuple[Floats, Floats, Floats]:
        """See an epoch of filters that use every range.

        Args:
            tables: of the filter.
            row: of each run in them, (N,); negative where a run has nothing to see yet.
            whitened: w, (N, m).
            limit: of |d| / σ_ss, above which a window alarms.

        Returns:
            The largest |d| / σ_ss of all windows, (N,); σ_ss and σ_coast of the most uncertain one, (N, A), m.
        """
        ratio, separation, coasting = self._results(tables)
        _separate(
            row,
            whitened,
            tables.origin_rows,
            tables.moved,
            tables.response,
            tables.projected,
            tables.variance,
            tables.filtered,
            limit,
            self._total,
            self._departure,
            self._alarmed,
            self._place,
            self._count,
            self.age,
            self._clean_age,
            ratio,
            separation,
            coasting,
        )
        return ratio, separation, coasting

    def separate_own(
        self,
        tables: CoastingTables,
        row: Runs,
        whitened: Floats,
        limit: float,
        auxiliary: Floats,
        covariance: Floats,
        gain: Floats,
        given: Flags,
        backtracked: Runs,
    ) -> tuple[Floats, Floats, Floats]:
        """See an epoch of filters that each have a covariance of their own, from epoch 0 on.

        Args:
            tables: of the filter.
            row: of each run in them, (N,).
            whitened: w, (N, m).
            limit: of |d| / σ_ss, above which a window alarms.
            auxiliary: the unaided solution minus the filter's, (N, 15), before the ranges.
            covariance: P of the inertial states before the ranges, (N, 15, 15).
            gain: U' of the position, (N, m, 3), m.
            given: whether there are ranges, (N,).
            backtracked: epochs whose ranges were taken back at the epoch before, (N,).

        Returns:
            As `separate`.
        """
        ratio, separation, coasting = self._results(tables)
        _separate_own(
            row,
            whitened,
            auxiliary,
            covariance,
            gain,
            given,
            backtracked,
            tables.origin_rows,
            tables.moved,
            tables.spread,
            tables.directions,
            tables.inverse,
            tables.projected,
            tables.noise,
            tables.early,
            limit,
            self._total,
            self._departure,
            self._covariances(),
            self._alarmed,
            self._known,
            self._place,
            self._count,
            self.age,
            self._clean_age,
            ratio,
            separation,
            coasting,
        )
        return ratio, separation, coasting

    def _results(self, tables: CoastingTables) -> tuple[Floats, Floats, Floats]:
        runs, axes = len(self.age), len(tables.directions)
        return np.zeros(runs), np.zeros((runs, axes)), np.zeros((runs, axes))


@njit(cache=True, nogil=True, error_model="numpy")
def _open(
    run: int, origin: Floats, departure: Floats, alarmed: Flags, place: Runs, count: Runs, age: Runs, clean_age: Runs
) -> int:
    """Open the window of the epoch before, at E = ``origin``, in place of the oldest; its slot."""
    slot, n = place[run], departure.shape[2]
    for i in range(NUM_STATES):
        departure[run, i, slot] = origin[i]
    alarmed[run, slot] = False
    place[run] = (slot + 1) % n
    count[run] = min(count[run] + 1, n)
    clean_age[run] += 1
    age[run] = clean_age[run]
    return int(slot)


@njit(cache=True, nogil=True, error_model="numpy")
def _close(run: int, alarmed: Flags, place: Runs, count: Runs, clean_age: Runs) -> None:
    """The oldest window has seen its last epoch."""
    n = alarmed.shape[1]
    if count[run] == n and not alarmed[run, place[run]]:
        clean_age[run] = n


@njit(cache=True, nogil=True, error_model="numpy")
def _separations(present: Floats, direction: Floats, departure: Floats, separation: Floats) -> None:
    """b' (E_k - E_j) of all slots, (n,); present E_k (15,), direction b (15,), departure (15, n)."""
    base = 0.0
    for i in range(NUM_STATES):
        base += direction[i] * present[i]
    for s in range(separation.shape[0]):
        separation[s] = base
    # several terms at once: the sum is then loaded and stored less often
    for i in range(0, NUM_STATES, 5):
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
    row: Runs,
    whitened: Floats,
    origin_rows: int,
    moved: Floats,
    response: Floats,
    projected: Floats,
    variance: Floats,
    filtered: Floats,
    limit: float,
    total: Floats,
    departure: Floats,
    alarmed: Flags,
    place: Runs,
    count: Runs,
    age: Runs,
    clean_age: Runs,
    ratio: Floats,
    separation_sigma: Floats,
    coasting_sigma: Floats,
) -> None:
    n = departure.shape[2]
    separation, spread, square = np.empty(n), np.empty(n), np.empty(n)
    for run in range(len(row)):
        k = row[run]
        if k < 0:
            continue
        if k % origin_rows == 0:
            _move_origin(moved[k // origin_rows], total[run], departure[run])
        slot = _open(run, total[run], departure, alarmed, place, count, age, clean_age)
        for i in range(NUM_STATES):
            for c in range(whitened.shape[1]):
                total[run, i] -= response[k, i, c] * whitened[run, c]
        largest = 0.0
        for a in range(projected.shape[1]):
            _separations(total[run], projected[k, a], departure[run], separation)
            _by_slot(variance[k, a], slot, count[run], spread)
            largest = max(largest, _largest(separation, spread, limit, square, alarmed[run]))
            most = variance[k, a, count[run] - 1]
            separation_sigma[run, a] = np.sqrt(most)
            coasting_sigma[run, a] = np.sqrt(filtered[k, a] + most)
        ratio[run] = np.sqrt(largest)
        _close(run, alarmed, place, count, clean_age)


@njit(cache=True, nogil=True, error_model="numpy")
def _separate_own(
    row: Runs,
    whitened: Floats,
    auxiliary: Floats,
    covariance: Floats,
    gain: Floats,
    given: Flags,
    backtracked: Runs,
    origin_rows: int,
    moved: Floats,
    spread: Floats,
    directions: Runs,
    inverse: Floats,
    projected: Floats,
    noise: Floats,
    early: Floats,
    limit: float,
    total: Floats,
    departure: Floats,
    excess: Floats,
    alarmed: Flags,
    known: Runs,
    place: Runs,
    count: Runs,
    age: Runs,
    clean_age: Runs,
    ratio: Floats,
    separation_sigma: Floats,
    coasting_sigma: Floats,
) -> None:
    n = departure.shape[2]
    separation, variance, square = np.empty(n), np.empty(n), np.empty(n)
    present, beyond, weight = np.empty(NUM_STATES), np.empty(PACKED), np.empty(PACKED)
    work = np.empty((NUM_STATES, NUM_STATES))
    for run in range(len(row)):
        k = row[run]
        if k % origin_rows == 0:
            _move_origin(moved[k // origin_rows], total[run], departure[run])
            move_covariances(moved[k // origin_rows], spread[k // origin_rows], excess[run])
        for i in range(NUM_STATES):
            present[i] = total[run, i]
            for j in range(NUM_STATES):
                present[i] -= inverse[k, i, j] * auxiliary[run, j]
        slot = _open(run, present, departure, alarmed, place, count, age, clean_age)
        known[run, slot] = k - 1
        bring_back(covariance[run], noise[k], inverse[k], work, beyond)
        for p in range(PACKED):
            excess[run, p, slot] = beyond[p]
        if k == n - 1:
            fill_early(slot, count[run], early, excess[run])
        if backtracked[run] > 0:
            first = k - 1 - backtracked[run]
            take_back(slot, count[run], first, known[run], departure[run], excess[run], alarmed[run])
        largest = 0.0
        for a in range(len(directions)):
            pulled, gained = 0.0, 0.0
            if given[run]:
                for c in range(whitened.shape[1]):
                    part = gain[run, c, directions[a]]
                    pulled += part * whitened[run, c]
                    gained += part * part
            _separations(present, projected[k, a], departure[run], separation)
            quadratic_forms(projected[k, a], excess[run], slot, weight, variance)
            most = with_gained(gained, slot, count[run], variance)
            for s in range(n):
                separation[s] -= pulled
            largest = max(largest, _largest(separation, variance, limit, square, alarmed[run]))
            prior = covariance[run, POSITION + directions[a], POSITION + directions[a]]
            separation_sigma[run, a] = np.sqrt(most + gained)
            coasting_sigma[run, a] = np.sqrt(prior + most)
        ratio[run] = np.sqrt(largest)
        _close(run, alarmed, place, count, clean_age)


@njit(cache=True, nogil=True, error_model="numpy")
def _move_origin(moved: Floats, total: Floats, departure: Floats) -> None:
    """E <- C E: of the present epoch, (15,), and of all slots, (15, n), in place; moved C (15, 15)."""
    before, windows = total.copy(), departure.copy()
    total[:] = 0.0
    departure[:] = 0.0
    for i in range(NUM_STATES):
        for j in range(NUM_STATES):
            total[i] += moved[i, j] * before[j]
            for s in range(departure.shape[1]):
                departure[i, s] += moved[i, j] * windows[j, s]
