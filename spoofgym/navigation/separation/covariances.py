"""The covariances of the windows of separation, where every run has its own: M of each slot, packed.

M is that of `coasting`: the filter's covariance without the coasting's process noise, about the common origin.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.packed import unpack
from spoofgym.navigation.separation.coasting import PACKED


@njit(cache=True, nogil=True, error_model="numpy")
def bring_back(covariance: Floats, noise: Floats, inverse: Floats, packed: Floats) -> None:
    """C⁻¹ (P - Γ) C⁻ᵀ, packed, (120,), overwritten; covariance P, noise Γ and inverse C⁻¹ (15, 15)."""
    work = np.empty((NUM_INERTIAL, NUM_INERTIAL))
    for i in range(NUM_INERTIAL):
        for j in range(NUM_INERTIAL):
            work[i, j] = 0.0
        for c in range(NUM_INERTIAL):
            factor = inverse[i, c]
            if factor != 0.0:
                for j in range(NUM_INERTIAL):
                    work[i, j] += factor * (covariance[c, j] - noise[c, j])
    place = 0
    for i in range(NUM_INERTIAL):
        for j in range(i + 1):
            total = 0.0
            for c in range(NUM_INERTIAL):
                total += work[i, c] * inverse[j, c]
            packed[place] = total
            place += 1


@njit(cache=True, nogil=True, error_model="numpy")
def move_covariances(moved: Floats, spread: Floats, excess: Floats) -> None:
    """M <- C M C' + Γ of all slots, packed (120, n), in place; moved C and spread Γ (15, 15)."""
    covariance, work = np.empty((NUM_INERTIAL, NUM_INERTIAL)), np.empty((NUM_INERTIAL, NUM_INERTIAL))
    for s in range(excess.shape[1]):
        unpack(excess[:, s], covariance)
        work[:] = 0.0
        for i in range(NUM_INERTIAL):
            for c in range(NUM_INERTIAL):
                for j in range(NUM_INERTIAL):
                    work[i, j] += moved[i, c] * covariance[c, j]
        place = 0
        for i in range(NUM_INERTIAL):
            for j in range(i + 1):
                total = spread[i, j]
                for c in range(NUM_INERTIAL):
                    total += work[i, c] * moved[j, c]
                excess[place, s] = total
                place += 1


@njit(cache=True, nogil=True, error_model="numpy")
def fill_early(slot: int, count: int, early: Floats, excess: Floats) -> None:
    """M of the windows opened before epoch 0, at which the newest stands in ``slot``; excess (120, n)."""
    for p in range(PACKED):
        for age in range(1, count):
            excess[p, slot - age] = excess[p, slot] + early[p, age]


@njit(cache=True, nogil=True, error_model="numpy")
def take_back(
    slot: int, count: int, first: int, known: Runs, departure: Floats, excess: Floats, alarmed: Flags
) -> None:
    """The filter has given back the ranges from row ``first`` up to the last but one: so do the windows that know some.

    They are then as the youngest that knows none of them; where that one has closed they are as the newest, in
    ``slot``. The last row that each knows is in ``known``, (n,).
    """
    source = slot
    for age in range(count - 1, 0, -1):
        if known[slot - age] < first:
            source = slot - age
    for age in range(1, count):
        if first <= known[slot - age] < known[slot]:
            known[slot - age] = known[source]
            alarmed[slot - age] = alarmed[source]
            for i in range(NUM_INERTIAL):
                departure[i, slot - age] = departure[i, source]
            for p in range(PACKED):
                excess[p, slot - age] = excess[p, source]


@njit(cache=True, nogil=True, error_model="numpy")
def quadratic_forms(direction: Floats, excess: Floats, slot: int, weight: Floats, variance: Floats) -> None:
    """b' (M_j - M_k) b of all slots j, (n,), of which k is one; direction b (15,), excess (120, n), weight (120,)."""
    place = 0
    for i in range(NUM_INERTIAL):
        for j in range(i + 1):
            weight[place] = direction[i] * direction[j] * (1.0 if i == j else 2.0)
            place += 1
    base = 0.0
    for p in range(PACKED):
        base += weight[p] * excess[p, slot]
    for s in range(variance.shape[0]):
        variance[s] = -base
    for p in range(0, PACKED, 4):
        w0, w1, w2, w3 = weight[p], weight[p + 1], weight[p + 2], weight[p + 3]
        m0, m1, m2, m3 = excess[p], excess[p + 1], excess[p + 2], excess[p + 3]
        for s in range(variance.shape[0]):
            variance[s] += w0 * m0[s] + w1 * m1[s] + w2 * m2[s] + w3 * m3[s]


@njit(cache=True, nogil=True, error_model="numpy")
def with_gained(gained: float, slot: int, count: int, variance: Floats) -> float:
    """Add what the present ranges tell to the variance of every open window, (n,); the largest without it.

    Slots without a window have none. Rounding must not make a variance negative.
    """
    n, most = variance.shape[0], 0.0
    for s in range(n):
        age = slot - s if s <= slot else slot - s + n
        coasted = max(variance[s], 0.0)
        variance[s] = coasted + gained if age < count else 0.0
        if age < count and coasted > most:
            most = coasted
    return most
