"""A test of the distance between one fix and its prediction; Song 2021 compares ACNA with it."""

from __future__ import annotations

from spoofgym.arrays import Floats
from spoofgym.detectors.acna import horizontal_drift
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.navigation.interface import Epoch


class Rio(ThresholdDetector):
    """Alarm where a fix lies too far from where inertia puts it: the horizontal norm of the innovation, m.

    Song et al. (2021) compare ACNA with a distance constraint, RIO, which they cite and do not describe. This is a
    reconstruction: a test of one epoch, of the fix against the prediction from the last fix that was used. In a
    closed-loop filter the prediction is the INS itself. The paper prints no threshold; ``threshold=4.3`` is what a
    prototype of their robot, outside this package, was tuned to.

    For equal standard deviations σ of the innovation east and north the statistic over σ has a Rayleigh distribution.

    Args:
        threshold: compared with the statistic, m.
        arl0: average run length between false alarms, epochs; calibrated, and 1e5 with nothing given.

    Raises:
        ValueError: both are given, or a value is out of range.
    """

    kind = "rio"
    in_position = True

    def __init__(self, threshold: float | None = None, arl0: float | None = None) -> None:
        self.set_up(threshold, arl0)

    def update(self, epoch: Epoch) -> Floats:
        """Horizontal distance of the fix from the prediction, (N,), m."""
        return horizontal_drift(epoch.innovation.residual)
