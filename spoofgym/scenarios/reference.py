"""Whether the reference of a recorded log fits its fixes."""

from __future__ import annotations

import numpy as np

from spoofgym.geodesy import position_difference
from spoofgym.scenarios.log import Log, covered, interpolate
from spoofgym.scenarios.log_warning import warn

APART = 3.0
"""Median distance between fixes and reference that is too large, over the median sigma of the fixes."""
UNSTATED_SIGMA = 3.5
"""Horizontal 1 sigma of fixes that state none, m."""
LEAST_SIGMA = 1.0
"""The same at least, m: a reference may hold for another point of the vehicle."""


def check_reference(log: Log) -> None:
    """Warn where the fixes lie far from the reference.

    Warns:
        LogWarning: the distances, and the shift in time that makes them smaller, if there is one.
    """
    if log.reference is None:
        return
    used = (log.fixes.time >= log.start) & covered(log.reference, log.fixes.time)
    if np.count_nonzero(used) < 3:
        return
    place, velocity = interpolate(log.reference, log.fixes.time[used])
    apart = position_difference(log.fixes.position[used], place)[:, :2]
    sigma = UNSTATED_SIGMA
    if log.fixes.position_sigma is not None:
        sigma = float(np.median(np.hypot(*log.fixes.position_sigma[used, :2].T)))
    distance = float(np.median(np.hypot(*apart.T)))
    if distance <= APART * max(sigma, LEAST_SIGMA) + float(np.linalg.norm(log.lever_arm)):
        return
    speed = np.square(velocity[:, :2]).sum()
    delay = float((apart * velocity[:, :2]).sum() / speed) if speed > 0.0 else 0.0
    left = float(np.median(np.hypot(*(apart - delay * velocity[:, :2]).T)))
    shift = f"; with the times of the reference {-delay:+.2f} s it is {left:.1f} m" if left < distance / 2.0 else ""
    warn(
        log.folder,
        f"reference: the fixes lie {distance:.1f} m from it (median), their sigma is {sigma:.1f} m{shift}; likely "
        "reasons: another clock (UTC against GPS time: 18 s), another datum, a point of the vehicle far from the "
        "antenna, fixes that were spoofed",
    )
