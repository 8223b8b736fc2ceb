"""The noise of a weighted least-squares fix that the errors of the ranges cause, for a filter that takes fixes.

The fix is linear in the errors of the ranges, p = (G' W G)⁻¹ G' W e (Liu 2018, section 5), so the slow errors
become states of a coloured noise and the other errors become white noise. The receiver's clock is estimated together
with the position and does not affect it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.sensors.constellation import Constellation
from spoofgym.sensors.geometry import SatelliteGeometry, view
from spoofgym.sensors.least_squares import projection
from spoofgym.sensors.ranging import RangeErrors, code_variance, gauss_markov, obliquity, troposphere_mapping
from spoofgym.trajectory import Trajectory
from spoofgym.validation import written

POSITION = 3
MASK = math.radians(5.0)
"""Elevation below which a satellite is not used, rad: that of DO-229."""


@dataclass(frozen=True)
class RangeFix:
    """The noise of fixes made from ranges: first-order Gauss-Markov states c and white noise, at E consecutive epochs.

    Attributes:
        sigma: stationary sigma of the states, (C,), m.
        decay: of the states from one epoch to the next, (C,).
        started: whether a state begins anew, with a satellite that rises, (E, C).
        mapping: what the states make of the fix, (E, 3, C), east, north, up.
        white: what the white noises of the ranges, of one sigma, make of it, (E, 3, S), m.
    """

    sigma: Floats
    decay: Floats
    started: Flags
    mapping: Floats
    white: Floats

    @property
    def num_states(self) -> int:
        """C."""
        return len(self.sigma)

    @property
    def num_epochs(self) -> int:
        """E."""
        return len(self.mapping)

    def white_covariance(self, epoch: int) -> Floats:
        """Of the white part, (3, 3), m²."""
        return np.asarray(self.white[epoch] @ self.white[epoch].T)

    def covariance(self, epoch: int) -> Floats:
        """Of the whole noise at an epoch, the states stationary, (3, 3), m²."""
        slow = self.mapping[epoch] * self.sigma
        return np.asarray(slow @ slow.T + self.white_covariance(epoch))


def range_fix(errors: RangeErrors, geometry: SatelliteGeometry) -> RangeFix:
    """The noise of fixes from all satellites in view, each range weighted by the variance of all its errors.

    States without variance are left out.

    Args:
        errors: budget of the ranges.
        geometry: satellites in view at equidistant epochs, two or more.

    Raises:
        ValueError: an epoch has no fix, for want of satellites.
    """
    present = geometry.present
    weight = present / code_variance(errors, geometry.elevation)
    to_fix = projection(geometry.line_of_sight, present, weight)[:, :POSITION]
    without = np.flatnonzero(~np.isfinite(to_fix).all(axis=(1, 2)))
    if len(without):
        raise ValueError(
            f"range_fix: {len(without)} epochs have no fix, the first at {written(geometry.time[without[0]])} s with "
            f"{int(present[without[0]].sum())} satellites in view; 4 or more are needed"
        )
    interval = float(geometry.time[1] - geometry.time[0])
    slots = np.ones(geometry.num_slots)
    zenith = np.arange(len(present))[:, None] == 0
    parts = [
        (errors.ephemeris_sigma * slots, errors.ephemeris_time, geometry.started, to_fix),
        (
            errors.ionosphere_sigma * slots,
            errors.ionosphere_time,
            geometry.started,
            to_fix * obliquity(geometry.elevation)[:, None],
        ),
        (errors.code_multipath_sigma * slots, errors.code_multipath_time, geometry.started, to_fix),
        (
            np.array([errors.troposphere_sigma]),
            errors.troposphere_time,
            zenith,
            np.add.reduce(to_fix * troposphere_mapping(geometry.elevation)[:, None], axis=2, keepdims=True),
        ),
    ]
    parts = [part for part in parts if part[0].any()]
    empty: list[Floats] = [np.zeros((len(present), POSITION, 0))]
    return RangeFix(
        sigma=np.concatenate([np.zeros(0), *(sigma for sigma, *_ in parts)]),
        decay=np.concatenate([np.zeros(0), *(np.full(len(s), math.exp(-interval / t)) for s, t, *_ in parts)]),
        started=np.concatenate([np.zeros((len(present), 0), dtype=bool), *(part[2] for part in parts)], axis=1),
        mapping=np.concatenate(empty + [part[3] for part in parts], axis=2),
        white=errors.code_noise * to_fix,
    )


def range_fix_along(
    errors: RangeErrors,
    constellation: Constellation,
    trajectory: Trajectory,
    rate: float,
    start_time: float = 0.0,
    mask: float = MASK,
) -> RangeFix:
    """The noise of fixes from ranges along a trajectory, to its end.

    Args:
        errors: budget of the ranges.
        constellation: the satellites.
        trajectory: of the receiver.
        rate: of the fixes, Hz; the first is one interval after the start.
        start_time: the constellation's time at the start, s.
        mask: elevation below which a satellite is not used, rad.

    Raises:
        ValueError: an epoch has no fix, for want of satellites.
    """
    time = np.arange(1, math.floor(trajectory.time[-1] * rate * (1.0 + 1e-12)) + 1) / rate
    position = trajectory.position[np.round(time * trajectory.rate).astype(int)]
    return range_fix(errors, view(constellation, position, start_time + time, mask))


def draw_fix_noise(fix: RangeFix, first: int, last: int, rng: np.random.Generator, before: Floats) -> Floats:
    """Noise of the fixes at epochs first..last-1, (last - first, 3), m ENU.

    Args:
        fix: whose noise.
        first: epoch.
        last: epoch after the last one.
        rng: source of randomness.
        before: the states one epoch before the first, (C,), m.
    """
    epochs = slice(first, last)
    normals = rng.standard_normal((last - first, fix.num_states))
    states = gauss_markov(normals, fix.sigma, fix.decay, fix.started[epochs], before)
    noise = np.add.reduce(fix.mapping[epochs] * states[:, None], axis=2)
    white = fix.white[epochs]
    noise += np.add.reduce(white * rng.standard_normal((last - first, 1, white.shape[2])), axis=2)
    return np.asarray(noise)
