"""Where the filter starts on a recorded log: at rest, by an attitude, by the course, or by what the IMU felt."""

from spoofgym.logs.alignment.base import Alignment
from spoofgym.logs.alignment.choose import METHODS, align

__all__ = ["METHODS", "Alignment", "align"]
