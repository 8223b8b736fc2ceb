"""The azimuth attack of FOI-R-5687: the spoofed vehicle turns away slowly, turns back, and runs in parallel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.fixed_offsets import FixedOffsets
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell
from spoofgym.timeline import Timeline
from spoofgym.validation import written

DECAY = 45.0
"""Length of the decay, s, where the attack lasts so long. The report's table leaves it out; with it the parallel run of
its scenario 3 lasts the 40 s of which the report speaks."""


def azimuth_error(since: Floats, azimuth: float, growth: float, decay: float) -> Floats:
    """Error of the azimuth at times since the onset (n,), rad.

    FOI-R-5687, chapter 4: exp(log(A + 1) i / N) - 1 while it grows, the same with (M - i) / (M - N) while it decays,
    then zero. A is in radians: in degrees, as the tables give it, the report's own position errors do not come out.

    Args:
        since: time since the onset, s.
        azimuth: A, rad.
        growth: N, s.
        decay: M - N, s.
    """
    left = np.where(since < growth, since / growth, 1.0 - (since - growth) / decay)
    return np.expm1(np.log1p(azimuth) * np.clip(left, 0.0, 1.0))


class Azimuth(FixedOffsets):
    """The receiver is led along the true speed with a false azimuth (FOI-R-5687, chapter 4).

    The spoofed position advances by the turned velocity of the coming epoch, p(i+1) = p(i) + v(i+1) Δt, from the true
    position at the onset; where epochs are missing it goes on in steps of the usual interval. This rectangle rule is
    the report's: in a turn of the vehicle it adds half an interval's change of velocity to the offset, 10 m in 60
    degrees at 20 m/s, and the report's figures have that in them. Its horizontal speed is scaled by the vertical
    velocity, which is left out. The offset is zero again after the end.

    Args:
        azimuth: largest error, degrees clockwise.
        growth: time until it is reached, s.
        onset: scenario time of the last true fix, s; None = the start of the game.
        end: scenario time of the last spoofed fix, s; None = the end of the game.
        decay: time in which the error goes back to zero after that, s; less where the attack ends sooner.

    Raises:
        ValueError: an azimuth or a time that is not positive, or an end before the onset.
    """

    def __init__(
        self,
        azimuth: float,
        growth: float = 10.0,
        onset: float | None = None,
        end: float | None = None,
        decay: float = DECAY,
    ) -> None:
        self.azimuth = validation.above("azimuth", "azimuth", azimuth)
        self.growth = validation.above("azimuth", "growth", growth)
        self.decay = validation.above("azimuth", "decay", decay)
        self.onset = None if onset is None else validation.time("azimuth", "onset", onset)
        self.end = None if end is None else validation.time("azimuth", "end", end)
        if self.end is not None and self.onset is not None and self.end <= self.onset:
            raise ValueError(f"azimuth: end must be later than the onset at {written(self.onset)} s, got {end!r}")

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            "azimuth",
            self.azimuth,
            growth=None if self.growth == 10.0 else self.growth,
            onset=self.onset,
            end=self.end,
            decay=None if self.decay == DECAY else self.decay,
        )

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game; the offsets follow from the vehicle's velocity, which `follow` tells.

        Raises:
            ValueError: the attack starts before the game or after its end, or ends before it starts.
        """
        super().bind(timeline, num_runs)
        if self.end is not None and self.end <= self._onset:
            raise ValueError(f"azimuth: end must be later than the onset at {written(self._onset)} s, got {self.end!r}")
        self._end = timeline.end if self.end is None else self.end

    def follow(self, velocity: Floats) -> None:
        """Take the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        end = self._end
        decay = max(min(self.decay, end - self._onset - self.growth), self._timeline.interval)
        moments, lengths, epochs = self._timeline.steps
        since = moments - self._onset
        error = -azimuth_error(np.maximum(since, 0.0), np.radians(self.azimuth), self.growth, decay)
        cosine, sine = np.cos(error), np.sin(error)
        east, north = velocity[:, 0], velocity[:, 1]
        turned = np.stack([cosine * east - sine * north, sine * east + cosine * north], axis=1)
        inside = (since > 1e-9) & (moments <= end + 1e-9)
        travelled = 0.5 * (velocity[1:, :2] + velocity[:-1, :2])
        moved = np.where(inside[1:, None], (turned[1:] - travelled) * lengths[:, None], 0.0)
        self._offsets[:] = 0.0
        self._offsets[1:, :2] = np.cumsum(moved, axis=0)[epochs[1:] - 1]
        self._offsets[~inside[epochs]] = 0.0

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,): to the end of the attack."""
        return self.started(clock) & (clock.time <= self._end + 1e-9)


FOI_SCENARIOS: dict[int, tuple[float, float, float, float]] = {
    1: (95.0, 190.0, 10.0, 5.0),
    2: (95.0, 190.0, 80.0, 5.0),
    3: (95.0, 190.0, 10.0, 30.0),
    4: (95.0, 190.0, 80.0, 30.0),
    5: (95.0, 190.0, 10.0, 1.0),
    6: (95.0, 190.0, 80.0, 1.0),
    7: (125.0, 160.0, 10.0, 1.0),
    8: (125.0, 160.0, 20.0, 1.0),
}
"""Start s, end s, growth s and azimuth deg of the report's scenarios (FOI-R-5687, tables 1 and 7)."""


class FoiScenario(Azimuth):
    """One of the eight attacks of FOI-R-5687, tables 1 and 7, on its drive.

    Args:
        number: 1 to 8.

    Raises:
        ValueError: there is no such scenario.
    """

    def __init__(self, number: int) -> None:
        number = validation.whole("foi", "number", number, 1, len(FOI_SCENARIOS))
        onset, end, growth, azimuth = FOI_SCENARIOS[number]
        super().__init__(azimuth, growth, onset, end)
        self.number = number

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return f"foi-{self.number}"


def _scenario(number: int) -> Callable[[], Attack]:
    onset, end, growth, azimuth = FOI_SCENARIOS[number]

    def build() -> Attack:
        return FoiScenario(number)

    turned = f"{azimuth:g}° within {growth:g} s, from {onset:g} to {end:g} s"
    build.__doc__ = f"The false azimuth of FOI-R-5687's scenario {number}: {turned} (FOI-R-5687, tables 1 and 7)."
    return build


FOI_ATTACKS: dict[str, Callable[[], Attack]] = {f"foi-{number}": _scenario(number) for number in FOI_SCENARIOS}
