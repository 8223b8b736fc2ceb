"""Attitudes of tests in angles."""

import numpy as np
from numpy.typing import NDArray


def euler_angles(attitude: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Pitch, roll and yaw of an attitude; the inverse of `attitude_matrix` (pitch not at +-90 degrees).

    Args:
        attitude: (..., 3, 3) body to ENU.

    Returns:
        Pitch, roll (-pi, pi], yaw (-pi, pi] clockwise from north, rad, each of the leading shape.
    """
    pitch = np.arcsin(np.clip(attitude[..., 2, 1], -1.0, 1.0))
    roll = np.arctan2(-attitude[..., 2, 0], attitude[..., 2, 2])
    yaw = np.arctan2(attitude[..., 0, 1], attitude[..., 1, 1])
    return pitch, roll, yaw
