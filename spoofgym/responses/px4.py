"""The two ways in which PX4's EKF2 treats a GNSS fix that fails its gates.

The module follows ``src/modules/ekf2`` on the main branch of PX4-Autopilot at commit 012e542:
``EKF/aid_sources/gnss/gps_control.cpp``, ``EKF/ekf_helper.cpp``, ``EKF/common.h`` and ``params_gnss.yaml``.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.gates import axis_ratios
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses.autopilot import HORIZONTAL, ROUNDING, VELOCITY, Autopilot, fix_variance
from spoofgym.responses.base import given

RESET_TIMEOUT = 7.0
"""s: reset_timeout_max, which no parameter changes (EKF/common.h)."""
POSITION_NOISE = 0.5
"""m: EKF2_GPS_P_NOISE, the least standard deviation of a fix."""
POSITION = slice(0, 3)


class Px4(Autopilot):
    """PX4's gates: a fix is rejected where ν²/(gate² S) exceeds 1 on any axis (EKF/ekf_helper.cpp).

    Height is an aid of its own in PX4; here its axis is gated like the others. Args and errors as `Autopilot`.
    """

    def passes(self, epoch: Epoch) -> Flags:
        """Whether every axis of a fix lies within its gate, (N,)."""
        inside = given(epoch).copy()
        gates = (self.position_gate, POSITION), (self.velocity_gate, VELOCITY)
        for gate, axes in gates:
            for ratio in axis_ratios(epoch.innovation, gate, axes).T:
                inside &= ratio <= 1.0
        return inside


class Px4Auto(Px4):
    """PX4 as it is delivered (EKF2_GPS_MODE = 0): a fix that keeps failing its gates becomes the truth after 7 s.

    A fix beyond a gate is left out. When no fix has been used for more than 7 s and the next one fails, too, position,
    and velocity where there is one, are reset to it, because there is no other source of horizontal position. The
    variance of the position is then the sum of the fix's in east and north, as the code passes it. A spoofer that
    jumps beyond the gate and waits is therefore let in: see the page on responses.

    After an outage of more than 7 s PX4 has stopped the fusion and starts it again with the first fix: by using it
    if it passes, by a reset if not. That is the same rule. Velocity gate and reset where the receiver gives velocity,
    else left out. What else is simplified stands in `Autopilot`, with its arguments and errors.
    """

    kind = "px4-auto"

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Use a fix within the gates, reset to one beyond them after 7 s; the alarm is not heard."""
        passes = self.passes(epoch)
        resets = given(epoch) & ~passes & (self.silence(epoch) > RESET_TIMEOUT + ROUNDING)
        used = passes | resets
        self.mark(epoch, used)
        return Decision(used, reset=np.where(resets, self._reset_variance(epoch), 0.0) if resets.any() else None)

    def _reset_variance(self, epoch: Epoch) -> Floats:
        """R_E + R_N, (N,), m² (resetHorizontalPositionToGnss)."""
        variance = np.maximum(fix_variance(epoch), POSITION_NOISE**2)
        return np.asarray(variance[:, 0] + variance[:, 1])


class Px4DeadReckoning(Px4):
    """PX4 that prefers dead reckoning to a doubtful GNSS (EKF2_GPS_MODE = 1): no reset, the fault is latched.

    When no fix has been used for more than 7 s while there are fixes, PX4 stops GNSS and declares a fault, provided
    that another aid is at work (airspeed, optical flow, wheels); position, velocity and height are then held out
    together. Our vehicles have an INS alone; it is read as such an aid, or there would be no
    difference from `Px4Auto`. The fault ends with the first fix that passes the gates in east and north. Since a fix
    is used as a whole here, what is used is what passes all gates.

    The filter's covariance grows while it coasts, and the gate with it: an offset that stands still passes in the end.

    Velocity gate where the receiver gives velocity, else left out. What else is simplified stands in `Autopilot`, with
    its arguments and errors.

    Attributes:
        fault: whether GNSS is declared faulty, (N,).
    """

    kind = "px4-dead-reckoning"

    def bind(self, num_runs: int) -> None:
        """Allocate the clock and the fault of ``num_runs`` runs."""
        super().bind(num_runs)
        self.fault = np.zeros(num_runs, dtype=bool)

    def reset(self, runs: Runs) -> None:
        """Begin without a fault in these runs."""
        super().reset(runs)
        self.fault[runs] = False

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Use a fix within the gates, unless a fault is latched; the alarm is not heard."""
        fix, passes = given(epoch), self.passes(epoch)
        rejected = fix & ~passes
        self.fault |= rejected & (self.silence(epoch) > RESET_TIMEOUT + ROUNDING)
        ratio = axis_ratios(epoch.innovation, self.position_gate, HORIZONTAL)
        self.fault &= ~(fix & (ratio[:, 0] < 1.0) & (ratio[:, 1] < 1.0))
        used = passes & ~self.fault
        self.mark(epoch, used)
        return Decision(used)
