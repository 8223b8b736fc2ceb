"""GNSS fixes: their rate, noise, lever arm and latency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from spoofgym import validation
from spoofgym.arrays import Floats

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)
RATES = (1e-3, 1e4)
"""Least and largest rate, Hz."""


@dataclass(frozen=True, kw_only=True)
class Receiver:
    """A receiver of position fixes, and of velocity where ``velocity_sigma`` is given.

    Attributes:
        rate: of the fixes, Hz.
        white_sigma: white noise of the position (E, N, U), 1 sigma, m.
        markov_sigma: first-order Gauss-Markov noise of the position (E, N, U), stationary sigma, m.
        markov_time: its correlation time, s.
        velocity_sigma: white noise of the velocity (E, N, U), m/s; None = the receiver gives position only.
        latency: age of a fix at its epoch, s; less than the interval between fixes.
        lever_arm: of the antenna from the IMU, body R, F, U, m. The velocity is referred to the IMU.
    """

    rate: float = 1.0
    white_sigma: Triple = (3.7, 3.7, 6.0)
    markov_sigma: Triple = ZERO
    markov_time: float = 0.0
    velocity_sigma: Triple | None = None
    latency: float = 0.0
    lever_arm: Triple = ZERO

    def __post_init__(self) -> None:
        validation.between("receiver", "rate", self.rate, *RATES)
        for name in ("white_sigma", "markov_sigma", "velocity_sigma"):
            values = getattr(self, name)
            if name == "velocity_sigma" and values is None:
                continue
            for value in validation.triple("receiver", name, values):
                validation.non_negative("receiver", name, value)
        time = validation.zero_or_above("receiver", "markov_time", self.markov_time)
        if any(self.markov_sigma) and not time:
            raise ValueError(
                "receiver: markov_time must be a finite number greater than 0, got "
                f"{self.markov_time!r} beside a markov_sigma"
            )
        if time and not any(self.markov_sigma):
            raise ValueError(f"receiver: markov_time {self.markov_time!r} needs a markov_sigma beside it")
        validation.non_negative("receiver", "latency", self.latency)
        if self.latency >= self.interval:
            raise ValueError(
                f"receiver: latency must be less than the interval of {validation.written(self.interval)} s, got "
                f"{self.latency!r}"
            )
        validation.triple("receiver", "lever_arm", self.lever_arm, "R, F, U")

    @property
    def interval(self) -> float:
        """Time between fixes, s."""
        return 1.0 / self.rate

    @property
    def dimension(self) -> int:
        """m: 3 for position, 6 with velocity."""
        return 3 if self.velocity_sigma is None else 6

    @cached_property
    def white_deviation(self) -> Floats:
        """White noise of the fix, (m,), m and m/s."""
        return np.array([*self.white_sigma, *(self.velocity_sigma or ())], dtype=np.float64)

    def samples_per_fix(self, imu_rate: float) -> int:
        """IMU samples between fixes.

        Raises:
            ValueError: the rate of the IMU is no multiple of the fixes', or the latency no multiple of a sample.
        """
        ratio = imu_rate / self.rate
        if ratio < 1 or abs(ratio - round(ratio)) > 1e-9:
            raise ValueError(
                f"receiver: rate {validation.written(self.rate)} Hz must divide the IMU's "
                f"{validation.written(imu_rate)} Hz into whole samples"
            )
        late = self.latency * imu_rate
        if abs(late - round(late)) > 1e-6:
            raise ValueError(
                f"receiver: latency {validation.written(self.latency)} s must be a multiple of "
                f"{validation.written(1.0 / imu_rate)} s"
            )
        return round(ratio)


def draw_noise(receiver: Receiver, num_epochs: int, rng: np.random.Generator, before: Floats) -> Floats:
    """Noise of consecutive fixes: a Gauss-Markov part, then a white part, drawn only where they exist.

    Args:
        receiver: whose noise.
        num_epochs: E.
        rng: source of randomness.
        before: value of the Gauss-Markov part one interval before the first fix, (3,), m.

    Returns:
        (E, m), m and m/s.
    """
    colour: Floats | None = None
    if any(receiver.markov_sigma):
        decay = np.exp(-receiver.interval / receiver.markov_time)
        driving = np.sqrt(1.0 - decay**2) * np.array(receiver.markov_sigma) * rng.standard_normal((num_epochs, 3))
        colour, _ = lfilter([1.0], [1.0, -decay], driving, axis=0, zi=(decay * before)[None, :])
    if not receiver.white_deviation.any():
        noise = np.zeros((num_epochs, receiver.dimension))
    else:
        noise = rng.standard_normal((num_epochs, receiver.dimension))
        noise *= receiver.white_deviation
    if colour is not None:
        noise[:, :3] += colour
    return noise
