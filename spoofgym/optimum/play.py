"""What a sequence of offsets is worth to the spoofer: the one place that computes survival and score.

In expectation (Liu 2018, eqs 32-34; gains and transitions do not feel the spoofing):

    e⁻_k = Φ_k e_{k-1}                      the error carried to epoch k
    u_k  = L_k⁻¹ (H_k e⁻_k - s_k)           the mean whitened innovation
    e_k  = e⁻_k - U_k u_k                   the error after the fix is used
    score = |horizontal e_K| · Π_k P(χ²_m(|u_k|²) <= threshold)

Against the snapshot test with a matched filter the innovations are white, so the product is exact; and the filter's own
random error after the last update is independent of all innovations, so the mean of the error vector given survival is
e_K. Neglected is only that random error inside the norm: E|e_K + random| exceeds |e_K| by about (variance across e_K) /
(2 |e_K|), 5 mm at 50 m on the Liu flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.survival import check_threshold, evaluate

HORIZONTAL = slice(6, 8)  # east and north of the position error


@dataclass(frozen=True)
class Outcome:
    """What comes of a sequence of offsets. Arrays have a leading axis B where a batch was played; one play has none.

    Attributes:
        offsets: s_k of epochs 1..K, (..., K, 3), m ENU.
        whitened: mean whitened innovations u_k, (..., K, m).
        final_error: mean horizontal error after the last epoch, estimate minus truth, (..., 2), m east and north.
        log_survival: log-probability of no alarm in epochs 1..K, (...,).
        survival: its exponential, (...,).
        score: norm of the final error times survival, (...,), m.
    """

    offsets: Floats
    whitened: Floats
    final_error: Floats
    log_survival: Floats
    survival: Floats
    score: Floats


def expected_play(model: LinearModel, offsets: Floats, threshold: float) -> Outcome:
    """Play offsets against the snapshot test, in expectation.

    Args:
        model: the filter along the scenario, epochs 0..K.
        offsets: (K, 3), or a batch (B, K, 3), m ENU.
        threshold: of the snapshot test.

    Raises:
        ValueError: offsets of another shape or not finite, or a threshold that is not positive.
    """
    threshold = check_threshold(threshold)
    offsets = np.asarray(offsets, dtype=np.float64)
    num_epochs = model.num_epochs
    if offsets.ndim not in (2, 3) or offsets.shape[-2:] != (num_epochs, 3):
        raise ValueError(f"offsets must have shape ({num_epochs}, 3) or (B, {num_epochs}, 3), got {offsets.shape}")
    if not np.isfinite(offsets).all():
        raise ValueError("offsets must be finite")
    batch = offsets.shape[:-2]
    plays = np.ascontiguousarray(offsets).reshape(-1, num_epochs, 3)
    dimension, columns = model.dimension, model.transition_columns
    whitened = np.empty((len(plays), num_epochs, dimension))
    final_error = np.empty((len(plays), 2))
    log_survival, survival, score = (np.empty(len(plays)) for _ in range(3))
    for b, play in enumerate(plays):
        deviations = fix_deviations(model.time, play, dimension)
        _recursion(
            columns,
            model.observation,
            model.innovation_factor,
            model.whitened_gain,
            deviations,
            whitened[b],
            final_error[b],
        )
        log_survival[b], survival[b], score[b] = _worth(whitened[b], final_error[b], threshold)
    return Outcome(
        offsets=offsets,
        whitened=whitened.reshape(*batch, num_epochs, dimension),
        final_error=final_error.reshape(*batch, 2),
        log_survival=log_survival.reshape(batch),
        survival=survival.reshape(batch),
        score=score.reshape(batch),
    )


def fix_deviations(time: Floats, offsets: Floats, dimension: int) -> Floats:
    """What the spoofer adds to a whole fix: the position offset and, where the fix has a velocity, the offset's rate.

    Args:
        time: of epochs 0..K, (K+1,), s.
        offsets: of epochs 1..K, (K, 3), m ENU; zero at epoch 0.
        dimension: 3 (position) or 6 (position and velocity).

    Returns:
        (K, m), m and m/s.
    """
    if dimension == 3:
        return offsets
    increments = np.diff(offsets, axis=0, prepend=np.zeros((1, 3)))
    return np.hstack((offsets, increments / np.diff(time)[:, None]))


@njit(cache=True, nogil=True)
def _recursion(
    columns: Floats,
    observation: Floats,
    innovation_factor: Floats,
    whitened_gain: Floats,
    deviations: Floats,
    whitened: Floats,
    final_error: Floats,
) -> None:
    """The mean error through epochs 1..K (Liu 2018, eqs 32-34).

    Args:
        columns: the first nine rows of Φ by columns, epochs 0..K, (K+1, 15, 9).
        observation: H, (K+1, m, 9).
        innovation_factor: L, (K+1, m, m).
        whitened_gain: U', (K+1, m, 15).
        deviations: what the spoofer adds to the fixes, (K, m).
        whitened: filled with u_k, (K, m).
        final_error: filled with the horizontal e_K, (2,), m.
    """
    num_epochs, dimension = deviations.shape
    error, no_noise, work, residual = np.zeros(NUM_STATES), np.zeros(NUM_STATES), np.empty(9), np.empty(dimension)
    for k in range(1, num_epochs + 1):
        kalman.predict_error(columns[k], no_noise, error, work)
        for i in range(dimension):
            residual[i] = -deviations[k - 1, i]
            for j in range(9):
                residual[i] += observation[k, i, j] * error[j]
        kalman.whiten(innovation_factor[k], residual, whitened[k - 1])
        kalman.correct_error(whitened_gain[k], whitened[k - 1], error)
    final_error[:] = error[HORIZONTAL]


@njit(cache=True, nogil=True)
def _worth(whitened: Floats, final_error: Floats, threshold: float) -> tuple[float, float, float]:
    """Log-survival, survival and score of one play: whitened (K, m), final_error (2,)."""
    num_epochs, dimension = whitened.shape
    magnitude, value, slope = np.empty(num_epochs), np.empty(num_epochs), np.empty(num_epochs)
    for k in range(num_epochs):
        square = 0.0
        for i in range(dimension):
            square += whitened[k, i] ** 2
        magnitude[k] = math.sqrt(square)
    evaluate(magnitude, dimension, threshold, value, slope)
    log_survival = 0.0
    for k in range(num_epochs):
        log_survival += value[k]
    survival = math.exp(log_survival)
    return log_survival, survival, math.hypot(final_error[0], final_error[1]) * survival
