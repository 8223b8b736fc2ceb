"""The real attack that a recorded log holds."""

from __future__ import annotations

from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.validation import written

NAME = "recorded"


class Recorded(Attack):
    """The attack that a log holds: the victim gets the fixes, or the ranges, that were recorded in it.

    They stand in ``gnss_spoofed.csv`` or ``ranges_spoofed.csv``, or ``ranges.csv`` itself is spoofed from
    ``first_effect_s`` on; nothing is added then. Only a scenario ``recorded:FOLDER`` can be attacked with it. The
    offsets of an attack on ranges are zero: nobody knows where it wanted the victim.
    """

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return NAME

    def join(self, simulation: Any) -> None:
        """Take what was recorded at the game's epochs.

        Raises:
            ValueError: the scenario has no recorded attack, or the game does not begin before it.
        """
        scenario = simulation.scenario
        read = getattr(scenario.family, "recorded_spoof", None)
        if read is None:
            raise ValueError(
                f"attack {NAME!r} needs a recorded log that holds one, recorded:FOLDER with gnss_spoofed.csv or "
                f"ranges_spoofed.csv in it; scenario {scenario.name!r} is none"
            )
        if scenario.family.spoofed_within and not scenario.family.attacked:
            raise ValueError(
                f"attack {NAME!r}: the ranges of scenario {scenario.name!r} are spoofed themselves: its own option "
                "attack=recorded plays them"
            )
        spoof = read()
        times = self._timeline.times
        if not times[0] < spoof.begin <= times[-1]:
            raise ValueError(
                f"attack {NAME!r}: it begins at {written(spoof.begin)} s, the game lasts from {written(times[0])} to "
                f"{written(times[-1])} s: choose an onset before it, and a horizon that reaches it"
            )
        place = np.searchsorted(spoof.time, times - 1e-6)
        self._offsets, self._velocities = spoof.offset[place], spoof.velocity[place]
        self._ranges = None if spoof.ranges is None else spoof.ranges[place]
        self.on_ranges = spoof.ranges is not None
        self._last, self.end = spoof.end, spoof.end if np.isfinite(spoof.end) else None
        self._onset = self.onset = float(times[times < spoof.begin - 1e-6][-1])

    def offset(self, clock: Clock) -> Floats:
        """What the spoofed fix adds to the true position, (N, 3), m ENU."""
        return np.asarray(self._offsets[np.maximum(clock.index, 0)])

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """What it adds to the true velocity, (N, 3), m/s ENU."""
        return np.asarray(self._velocities[np.maximum(clock.index, 0)])

    def ranges(self, clock: Clock) -> Floats | None:
        """What the victim's ranges are beside the true ones, (N, m), m and m/s."""
        return None if self._ranges is None else np.asarray(self._ranges[np.maximum(clock.index, 0)])

    def active(self, clock: Clock) -> Flags:
        """Whether the victim gets what is spoofed, (N,)."""
        return np.asarray((clock.time > self._onset) & (clock.time <= self._last + 1e-6))
