"""What a sequence of offsets is worth to the spoofer: the one place that computes survival and score.

The filter in expectation (`navigation/loose/mean.py`) gives the mean whitened innovations u_k of epochs 1..K and the
error e_K after the last fix. Then

    score = |horizontal e_K| · Π_k P(χ²_m(|u_k|²) <= threshold).

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
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean import expected_sequence
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
    whitened = np.empty((len(plays), num_epochs, model.dimension))
    final_error = np.empty((len(plays), 2))
    log_survival, survival, score = (np.empty(len(plays)) for _ in range(3))
    for b, play in enumerate(plays):
        whitened[b], error = expected_sequence(model, play)
        final_error[b] = error[HORIZONTAL]
        log_survival[b], survival[b], score[b] = _worth(whitened[b], final_error[b], threshold)
    return Outcome(
        offsets=offsets,
        whitened=whitened.reshape(*batch, num_epochs, model.dimension),
        final_error=final_error.reshape(*batch, 2),
        log_survival=log_survival.reshape(batch),
        survival=survival.reshape(batch),
        score=score.reshape(batch),
    )


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
