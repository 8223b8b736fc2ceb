"""Thresholds at an equal false-alarm rate, found from clean runs and kept on disk."""

from spoofgym.calibration.play import calibrated_for_play
from spoofgym.calibration.thresholds import (
    Calibration,
    calibrate,
    calibrate_together,
    calibrated,
    calibrated_all,
    measure_arl0,
    poisson_interval,
)

__all__ = [
    "Calibration",
    "calibrate",
    "calibrate_together",
    "calibrated",
    "calibrated_all",
    "calibrated_for_play",
    "measure_arl0",
    "poisson_interval",
]
