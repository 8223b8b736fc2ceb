"""The ranges of a recorded log as epochs of a filter: at a steady rate, on the clock of the IMU, with what is known."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.logs.clock_steps import without_steps
from spoofgym.logs.log import Fixes, Log
from spoofgym.logs.range_fixes import (
    along_fixes,
    between_fixes,
    check_solved,
    fixes_of,
    range_delay,
    solve_ranges,
)
from spoofgym.logs.ranges_log import Ranges, correct, read_ranges
from spoofgym.logs.spoofed_ranges import spoofed_ranges
from spoofgym.logs.table import has_table, seconds
from spoofgym.sensors.geometry import SatelliteGeometry

UNSTEADY = 0.1
"""Share of the interval between epochs by which one may come early or late."""
MOST_EMPTY = 20_000
"""Epochs without ranges in a log at most: 5 hours at 1 Hz, half an hour at 10 Hz."""


@dataclass(frozen=True, eq=False)
class RangeEpochs:
    """Ranges at E epochs, equally spaced on the receiver's clock, in a slot for each of S satellites.

    Steps of that clock have been taken away (`clock_steps`).

    An epoch in which the receiver gave nothing has empty slots. A satellite counts where both its code and its range
    rate are usable, and neither is one that a fix of the epoch leaves out as faulty (`without_faults`). An antenna that
    rests has a position that is known, so that nothing is left out there: what a spoofer did to a range stays in sight.

    Attributes:
        time: on the clock of the IMU, (E,), s.
        interval: between epochs, s.
        geometry: of the satellites that count.
        started: where a satellite counts for the first time, (E, S).
        code: pseudorange, corrected for all but the receiver's clock and errors, (E, S), m.
        code_sigma: (E, S), m.
        rate: range rate, corrected for all but the receiver's clock and errors, (E, S), m/s.
        rate_sigma: (E, S), m/s.
        position: of the receiver, latitude rad, longitude rad, height m, (E, 3). It and the next three are fixes by
            least squares, with straight lines between them.
        velocity: of the receiver, ENU, (E, 3), m/s.
        clock: offset of the receiver's clock as a range, (E,), m.
        clock_drift: its rate, (E,), m/s.
        clock_jump: variance of what a step of the clock leaves in its offset, (E,), m².
        fix: epochs that have a fix, (n,).
        fixes: of these epochs, on the clock of the IMU.
        spoofed: epochs in which a recorded attack acts, (E,).
        added: what it adds to these ranges: code, m, and range rate, m/s, (E, 2 S); zero where the ranges themselves
            are those that the victim got.
    """

    time: Floats
    interval: float
    geometry: SatelliteGeometry
    started: Flags
    code: Floats
    code_sigma: Floats
    rate: Floats
    rate_sigma: Floats
    position: Floats
    velocity: Floats
    clock: Floats
    clock_drift: Floats
    clock_jump: Floats
    fix: Runs
    fixes: Fixes
    spoofed: Flags
    added: Floats

    def part(self, first: int, last: int) -> RangeEpochs:
        """Epochs first..last-1 of these, with all the fixes."""

        def cut(owner: Any, whole: tuple[str, ...] = ()) -> dict[str, Any]:
            return {
                item.name: getattr(owner, item.name)[first:last] for item in fields(owner) if item.name not in whole
            }

        geometry = SatelliteGeometry(**cut(self.geometry))
        return replace(self, geometry=geometry, **cut(self, ("interval", "geometry", "fix", "fixes")))


def range_epochs(log: Log) -> RangeEpochs:
    """The ranges of a log as epochs of a filter.

    Raises:
        ValueError: the log has no ranges, they cannot be used or come unsteadily, hardly any gives a fix, or the drive
            does not tell their delay.
    """
    if not has_table(log.folder, "ranges"):
        raise ValueError(f"log {str(log.folder)!r} has no ranges (ranges.csv, ephemeris.csv) for a filter to take")
    start, owner = log.fixes.position[0], str(log.folder)
    read = read_ranges(log.folder, ionosphere=log.ionosphere)
    stepless = without_steps(read, start)
    ranges, marked = steady(stepless, owner), steady(spoofed_ranges(log, read).marked(read, stepless), owner)
    solution = solve_ranges(ranges, start)
    check_solved(log, ranges, solution)
    delay = range_delay(log, solution)
    position, velocity = between_fixes(solution)
    clock, drift = (along_fixes(values, solution) for values in (solution.clock, solution.clock_drift))
    corrected = correct(ranges, position, clock)
    counts = corrected.geometry.present & corrected.has_rate
    if log.antenna is None:
        counts = counts & solution.used & solution.used_rate
    slots = counts.any(axis=0)
    counts = counts[:, slots]

    def kept(values: Any, empty: Any = 0.0) -> Any:
        there = counts.reshape(counts.shape + (1,) * (values.ndim - 2))
        return np.where(there, values[:, slots], empty)

    geometry = corrected.geometry
    return RangeEpochs(
        time=geometry.time - delay,
        interval=float(np.median(np.diff(geometry.time))),
        geometry=SatelliteGeometry(
            time=geometry.time,
            satellite=kept(geometry.satellite, -1),
            position=kept(geometry.position),
            velocity=kept(geometry.velocity),
            line_of_sight=kept(geometry.line_of_sight),
            elevation=kept(geometry.elevation),
            azimuth=kept(geometry.azimuth),
        ),
        started=counts & (np.cumsum(counts, axis=0) == 1),
        code=kept(corrected.pseudorange),
        code_sigma=kept(corrected.sigma),
        rate=kept(corrected.range_rate),
        rate_sigma=kept(corrected.rate_sigma),
        position=position,
        velocity=velocity,
        clock=clock,
        clock_drift=drift,
        clock_jump=ranges.clock_jump,
        fix=np.flatnonzero(solution.solved),
        fixes=fixes_of(solution, delay),
        spoofed=np.asarray(marked.has_rate.any(axis=1)),
        added=np.concatenate([kept(marked.pseudorange), kept(marked.range_rate)], axis=1),
    )


def steady(ranges: Ranges, owner: str) -> Ranges:
    """The ranges with an empty epoch wherever the receiver's steady rate asks for one and there is none.

    Args:
        ranges: of a receiver.
        owner: where they come from, for the message.

    Raises:
        ValueError: an epoch lies between those of the steady rate, there are fewer than two, or more than `MOST_EMPTY`
            are empty.
    """
    if len(ranges.time) < 2:
        raise ValueError(f"{owner}: ranges of 2 epochs or more are needed, got {len(ranges.time)}")
    interval = float(np.median(np.diff(ranges.time)))
    steps = np.diff(ranges.time) / interval
    number = np.maximum(np.round(steps), 1.0)
    off = np.flatnonzero(np.abs(steps - number) > UNSTEADY)
    if len(off):
        raise ValueError(
            f"{owner}: ranges must come at a steady rate: after {seconds(ranges.time[off[0]])} s the next come "
            f"{steps[off[0]] * interval:.4g} s later, with a median of {interval:.4g} s"
        )
    empty = number.sum() - len(number)
    if empty > MOST_EMPTY:
        widest = int(np.argmax(steps))
        raise ValueError(
            f"{owner}: ranges.csv leaves out {empty:.4g} epochs of {interval:.4g} s, valid are {MOST_EMPTY} at most: "
            f"after {seconds(ranges.time[widest])} s the next come at {seconds(ranges.time[widest + 1])} s"
        )
    place = np.concatenate([[0], np.cumsum(number).astype(np.int64)])
    epochs = place[-1] + 1

    def spread(values: Any, nothing: float) -> Any:
        result = np.full((epochs, values.shape[1]), nothing, dtype=values.dtype)
        result[place] = values
        return result

    return replace(
        ranges,
        time=np.interp(np.arange(epochs), place, ranges.time),
        satellite=spread(ranges.satellite, -1),
        pseudorange=spread(ranges.pseudorange, 0.0),
        range_rate=spread(ranges.range_rate, 0.0),
        has_rate=spread(ranges.has_rate, False),
        cn0=spread(ranges.cn0, 0.0),
        clock_jump=spread(ranges.clock_jump[:, None], 0.0)[:, 0],
    )
