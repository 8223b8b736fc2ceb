"""The gates of two autopilots as tests. PX4 tests each axis by itself, ArduPilot tests east and north together.

The tests follow ``EKF/ekf_helper.cpp`` in ``src/modules/ekf2`` of PX4-Autopilot at commit 012e542 and
``AP_NavEKF3_PosVelFusion.cpp`` in ``libraries/AP_NavEKF3`` of ArduPilot at commit 0005fc0.
"""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.specification import spell

DEFAULT_GATE = 5.0
"""Sigma: the default of every gate in PX4 (EKF2_GPS_P_GATE, EKF2_GPS_V_GATE) and ArduPilot (EK3_..._I_GATE = 500)."""

EAST_NORTH = slice(0, 2)


def axis_ratios(innovation: Innovation, gate: float, axes: slice) -> Floats:
    """Each axis by itself, ν²/(gate² S), (N, axes); 1 is the edge of the gate (PX4: updateAidSourceStatus)."""
    variance = np.diagonal(innovation.covariance, axis1=1, axis2=2)[:, axes]
    return np.asarray(innovation.residual[:, axes] ** 2 / (gate**2 * variance))


def joint_ratio(innovation: Innovation, gate: float, axes: slice) -> Floats:
    """Axes together, Σν²/(gate² ΣS), (N,); 1 is the edge of the gate (ArduPilot: posTestRatio, velTestRatio)."""
    variance = np.diagonal(innovation.covariance, axis1=1, axis2=2)[:, axes]
    squares, variances = np.zeros(len(variance)), np.zeros(len(variance))
    for axis in range(variance.shape[1]):
        squares += innovation.residual[:, axes][:, axis] ** 2
        variances += variance[:, axis]
    return np.asarray(squares / (gate**2 * variances))


def at_least_one_sigma(owner: str, name: str, value: float) -> float:
    """A gate in sigma, of which both autopilots refuse less than 1.

    Raises:
        ValueError: it is less, or not a finite number.
    """
    gate = validation.finite(owner, name, value)
    if gate < 1.0:
        raise ValueError(f"{owner}: {name} must be 1 sigma or more, got {validation.shown(value)}")
    return gate


class Gate(ThresholdDetector):
    """A gate on the innovation of one epoch: alarm where the test ratio exceeds 1, the edge of the gate.

    Args:
        gate: sigma; None = the autopilots' default of 5.
        arl0: average run length between false alarms, epochs: the threshold on the ratio to the default gate is then
            calibrated instead.

    Raises:
        ValueError: both are given, or a value is out of range.
    """

    in_position = True

    def __init__(self, gate: float | None = None, arl0: float | None = None) -> None:
        validation.at_most_one(self.kind, gate=gate, arl0=arl0)
        self.gate = at_least_one_sigma(self.kind, "gate", DEFAULT_GATE if gate is None else gate)
        if arl0 is None:
            self.threshold = 1.0
        else:
            self.target_arl0 = validation.average_run_length(self.kind, "arl0", arl0)
        self._name = spell(self.kind, gate=None if self.gate == DEFAULT_GATE else self.gate, arl0=self.target_arl0)


class Px4Gate(Gate):
    """PX4's gate: the largest ν²/(gate² S) of all axes of the fix.

    Each axis by itself is the square of a standard normal number over gate² under a matched filter; axes are correlated
    as S is. PX4 gates the height as an aid of its own, and here its axis is one of the fix's. What PX4 does with a fix
    beyond its gate is a response (`spoofgym.responses.px4`). Args and errors as `Gate`.
    """

    kind = "px4-gate"

    def update(self, epoch: Epoch) -> Floats:
        """The largest test ratio, (N,)."""
        return np.asarray(np.maximum.reduce(axis_ratios(epoch.innovation, self.gate, slice(None)), axis=1))


class ArduPilotGate(Gate):
    """ArduPilot's gate on the horizontal position: (ν_N² + ν_E²) / (gate² (S_N + S_E)).

    With equal variances it is chi-square with 2 degrees of freedom over 2 gate². ArduPilot also gates height and
    velocity; these gates are left out. What it does with a fix beyond its gate is a response
    (`spoofgym.responses.ardupilot`). Args and errors as `Gate`.
    """

    kind = "ardupilot-gate"

    def update(self, epoch: Epoch) -> Floats:
        """The test ratio of east and north together, (N,)."""
        return joint_ratio(epoch.innovation, self.gate, EAST_NORTH)
