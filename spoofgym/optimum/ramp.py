"""The best constant horizontal ramp: the baseline `best-ramp`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.play import Outcome, expected_play
from spoofgym.optimum.response import horizontal_unit
from spoofgym.optimum.survival import check_threshold, log_survival

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True)
class BestRamp:
    """A constant ramp: offset = rate · (time_k - time_0) along an azimuth.

    Attributes:
        rate: m/s.
        azimuth: degrees clockwise from north, in [0, 180); the opposite direction is worth the same.
        outcome: its expected play.
    """

    rate: float
    azimuth: float
    outcome: Outcome


def best_ramp(
    model: LinearModel,
    threshold: float,
    drag_off_rate: Floats | float | None = None,
    azimuth: float | None = None,
) -> BestRamp:
    """The constant horizontal ramp with the highest score, over rate and direction.

    Everything is linear in the rate, and for a fixed direction the log-score is concave in it (see `survival`): a
    golden section finds the best rate of every direction at once. Directions are a grid of 5 degrees, then twice a
    finer one around the best.

    Args:
        model: the filter along the scenario.
        threshold: of the snapshot test.
        drag_off_rate: largest rate per axis, (3,) ENU or one for all, m/s; None = no limit.
        azimuth: search the rate for this direction only, degrees clockwise from north.

    Raises:
        ValueError: a threshold or a drag-off rate that is not positive.
    """
    threshold = check_threshold(threshold)
    limit = axis_limits(drag_off_rate)[:2]
    elapsed = (model.time[1:] - model.time[0])[:, None]
    unit = np.stack([np.hstack((elapsed * axis, np.zeros_like(elapsed))) for axis in np.eye(2)])
    played = expected_play(model, unit, threshold)
    response, error = played.whitened, played.final_error  # of 1 m/s east and north: (2, K, m) and (2, 2)
    if azimuth is not None:
        candidates = np.array([validation.finite("best_ramp", "azimuth", azimuth) % 360.0])
        rate = _best_rates(response, error, candidates, threshold, limit)[0]
        best = 0
    else:
        candidates = np.arange(0.0, 180.0, 5.0)
        rate, score = _best_rates(response, error, candidates, threshold, limit)
        best = int(np.argmax(score))
        for step in (0.25, 0.0125):
            candidates = candidates[best] + step * np.arange(-20, 21)
            rate, score = _best_rates(response, error, candidates, threshold, limit)
            best = int(np.argmax(score))
    direction = candidates[best] if azimuth is not None else candidates[best] % 180.0
    east_north = rate[best] * elapsed * horizontal_unit(direction)
    outcome = expected_play(model, np.hstack((east_north, np.zeros_like(elapsed))), threshold)
    return BestRamp(float(rate[best]), float(direction), outcome)


RATES = (1e-6, 1e6)
"""Least and largest limit of a rate, m/s."""


def axis_limits(drag_off_rate: Floats | float | None) -> Floats:
    """The largest rate of the offset per axis, (3,), m/s ENU; infinite where there is no limit.

    Raises:
        ValueError: a rate that is not positive, or not one number or three.
    """
    limits = validation.real_array(np.inf if drag_off_rate is None else drag_off_rate)
    if limits is None or limits.shape not in ((), (3,)) or not (limits > 0.0).all():
        given = validation.shown(drag_off_rate)
        raise ValueError(f"drag_off_rate must be one positive number or three (east, north, up), got {given}")
    for limit in limits[np.isfinite(limits)].tolist():
        validation.between("optimum", "drag_off_rate", limit, *RATES)
    return np.broadcast_to(np.asarray(limits, dtype=np.float64), (3,))


def _best_rates(
    response: Floats, error: Floats, azimuth: Floats, threshold: float, limit: Floats
) -> tuple[Floats, Floats]:
    """The best rate of each azimuth and its log-score, by golden section.

    From max_k |u_k| = √threshold + 1 on the log-score falls with the rate, so that bounds the search where the drag-off
    rate does not.

    Args:
        response: whitened innovations of ramps of 1 m/s east and north, (2, K, m).
        error: final horizontal errors of these ramps, (2, 2), m.
        azimuth: (A,), degrees.
        threshold: of the snapshot test.
        limit: largest rate east and north, (2,), m/s.

    Returns:
        rate (A,), m/s, and log-score (A,).
    """
    direction = horizontal_unit(azimuth)
    magnitude = np.linalg.norm(np.einsum("aj,jkm->akm", direction, response), axis=-1)
    reach = np.linalg.norm(direction @ error, axis=-1)

    def log_score(rate: Floats) -> Floats:
        survival = log_survival(rate[:, None] * magnitude, response.shape[-1], threshold).sum(axis=-1)
        return np.log(rate * reach) + survival

    fastest = np.min(limit / np.maximum(np.abs(direction), 1e-300), axis=-1)
    high = np.minimum(fastest, (math.sqrt(threshold) + 1.0) / magnitude.max(axis=-1))
    low = np.zeros_like(high)
    for _ in range(50):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        up = log_score(left) < log_score(right)
        low, high = np.where(up, left, low), np.where(up, high, right)
    return high, log_score(high)
