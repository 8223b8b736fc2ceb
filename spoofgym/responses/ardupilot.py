"""The two ways in which ArduPilot's EKF3 treats a GNSS fix that fails its gates.

The module follows ``libraries/AP_NavEKF3`` on the master branch of ArduPilot at commit 0005fc0:
``AP_NavEKF3_PosVelFusion.cpp``, ``AP_NavEKF3_Control.cpp`` and ``AP_NavEKF3.h``.
"""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.detectors.gates import DEFAULT_GATE, at_least_one_sigma, joint_ratio
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses.autopilot import (
    HORIZONTAL,
    LEAST_VARIANCE,
    ROUNDING,
    UP,
    VELOCITY,
    Autopilot,
    fix_variance,
    position_variance,
)
from spoofgym.responses.base import given

GLITCH_RADIUS = 25.0
"""m: EK3_GLITCH_RAD."""
RETRY_POSITION_ONLY, RETRY_WITH_VELOCITY = 7.0, 10.0
"""s: posRetryTimeNoVel_ms and posRetryTimeUseVel_ms (AP_NavEKF3.h)."""


class ArduPilot(Autopilot):
    """ArduPilot's gates: Σν²/(gate² ΣS) below 1, for east and north together, for the height, and for the velocity.

    In ArduPilot the gate of the velocity counts with a noise of its own that grows with the acceleration; here it is
    the filter's S.

    Args:
        position_gate: sigma, of the horizontal position (EK3_POS_I_GATE).
        velocity_gate: sigma, of the velocity (EK3_VEL_I_GATE); there is none where the receiver gives position only.
        height_gate: sigma, of the height (EK3_HGT_I_GATE).

    Raises:
        ValueError: a gate less than 1.
    """

    def __init__(
        self,
        position_gate: float = DEFAULT_GATE,
        velocity_gate: float = DEFAULT_GATE,
        height_gate: float = DEFAULT_GATE,
    ) -> None:
        super().__init__(position_gate, velocity_gate)
        self.height_gate = at_least_one_sigma(self.kind, "height_gate", height_gate)

    def _spell(self, **options: object) -> str:
        """The specification with the gates before a subclass's own options."""
        return super()._spell(height_gate=None if self.height_gate == DEFAULT_GATE else self.height_gate, **options)

    def ratios(self, epoch: Epoch) -> list[tuple[slice, Floats]]:
        """The test ratio, (N,), of each group of axes that the fix has."""
        groups = [(self.position_gate, HORIZONTAL), (self.height_gate, UP)]
        if epoch.innovation.residual.shape[1] == 6:
            groups.append((self.velocity_gate, VELOCITY))
        return [(axes, joint_ratio(epoch.innovation, gate, axes)) for gate, axes in groups]

    def timed_out(self, epoch: Epoch) -> Flags:
        """Whether no fix has been used for longer than the retry time, (N,)."""
        with_velocity = epoch.innovation.residual.shape[1] == 6
        retry = RETRY_WITH_VELOCITY if with_velocity else RETRY_POSITION_ONLY
        return self.silence(epoch) > retry + ROUNDING


class ArduPilotGlitch(ArduPilot):
    """ArduPilot as it is delivered: fixes beyond the gates are glitches, until 7 s of them force a reset.

    A fix beyond a gate is left out. The next fix after more than 7 s without one that was used (10 s with a receiver of
    velocity), or one that passes while the filter's horizontal variance P_E + P_N exceeds the square of the glitch
    radius, is not fused: the position, and the velocity where there is one, are reset to it, with the variance of
    half the glitch radius. Its last line of defence is therefore opened by waiting: see the page on responses.

    ArduPilot resets position and velocity each by its own timer. What else is simplified stands in `ArduPilot` and
    `Autopilot`.

    Args:
        position_gate: as `ArduPilot`.
        velocity_gate: as `ArduPilot`.
        height_gate: as `ArduPilot`.
        glitch_radius: EK3_GLITCH_RAD, m; `ArduPilotClip` is the autopilot with a radius of 0.

    Raises:
        ValueError: a gate less than 1, or a radius that is not positive.
    """

    kind = "ardupilot-glitch"

    def __init__(
        self,
        position_gate: float = DEFAULT_GATE,
        velocity_gate: float = DEFAULT_GATE,
        height_gate: float = DEFAULT_GATE,
        glitch_radius: float = GLITCH_RADIUS,
    ) -> None:
        super().__init__(position_gate, velocity_gate, height_gate)
        self.glitch_radius = validation.above(self.kind, "glitch_radius", glitch_radius)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell(glitch_radius=None if self.glitch_radius == GLITCH_RADIUS else self.glitch_radius)

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Use a fix within the gates, reset to one after 7 s or when the filter is lost; the alarm is not heard."""
        fix = given(epoch)
        passes = fix.copy()
        for _, ratio in self.ratios(epoch):
            passes &= ratio < 1.0
        variance = position_variance(epoch)
        lost = variance[:, 0] + variance[:, 1] > self.glitch_radius**2
        resets = fix & (self.timed_out(epoch) | (passes & lost))
        used = passes | resets
        self.mark(epoch, used)
        return Decision(used, reset=np.where(resets, (0.5 * self.glitch_radius) ** 2, 0.0) if resets.any() else None)


class ArduPilotClip(ArduPilot):
    """ArduPilot with EK3_GLITCH_RAD = 0: no fix is rejected; one beyond a gate counts with a larger variance.

    The innovation variance S is multiplied by the test ratio: a fix at x times its gate moves the filter by 1/x of what
    one at the gate does. One factor on R serves the whole fix, 1 + (ratio - 1) ΣS/ΣR of the group of axes that needs
    the largest; where the axes of the group have equal variances, its S is exactly ratio times larger. The filter's
    variance of the velocity is not in view: there the factor is the ratio, a little less than ArduPilot's.

    In commit 0005fc0 the larger variance does not reach the gain, which is computed from a variance formed anew after
    the tests; here it does, as the comments of the code intend.

    A fix after more than 7 s (10 s) without one, as after an outage, resets the position with the least variance that
    ArduPilot allows, because half a radius of 0 is 0. What else is simplified stands in `ArduPilot` and `Autopilot`.
    Args and errors as `ArduPilot`.
    """

    kind = "ardupilot-clip"

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Use every fix, with a larger variance where it lies beyond a gate; the alarm is not heard."""
        fix = given(epoch)
        resets = fix & self.timed_out(epoch)
        self.mark(epoch, fix)
        return Decision(
            fix,
            reset=np.where(resets, LEAST_VARIANCE, 0.0) if resets.any() else None,
            noise_scale=self._noise_scale(epoch),
        )

    def _noise_scale(self, epoch: Epoch) -> Floats | None:
        """Factor on R, (N,); None where every fix lies within its gates."""
        scale = np.ones(len(epoch.index))
        for axes, ratio in self.ratios(epoch):
            beyond = ratio > 1.0
            if beyond.any():
                scale = np.maximum(scale, np.where(beyond, 1.0 + (ratio - 1.0) * self._share(epoch, axes), 1.0))
        return scale if (scale > 1.0).any() else None

    def _share(self, epoch: Epoch, axes: slice) -> Floats:
        """ΣS/ΣR over the axes of a group, (N,); 1 for the velocity."""
        if axes == VELOCITY:
            return np.ones(len(epoch.index))
        innovation = np.diagonal(epoch.innovation.covariance, axis1=1, axis2=2)[:, axes]
        noise = fix_variance(epoch)[:, axes]
        total, own = np.zeros(len(noise)), np.zeros(len(noise))
        for axis in range(noise.shape[1]):
            total += innovation[:, axis]
            own += noise[:, axis]
        return total / own
