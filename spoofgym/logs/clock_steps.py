"""Steps of a receiver's clock, found in its own ranges and taken away.

Many receivers let their clock drift and set it back by a millisecond now and then, or correct it by less: all ranges of
an epoch, and the time tags, step together. A filter that believes in a steady oscillator would take such a step for
motion. It is found when a log is read, before any spoofer adds to the ranges, so that what a spoofer does to the clock
stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.constants import speed_of_light

from spoofgym.arrays import Flags, Floats
from spoofgym.logs.range_fixes import RangeSolution, between_fixes, solve_ranges
from spoofgym.logs.ranges_log import Ranges
from spoofgym.sensors.ranging import DrawnErrors, pseudoranges

STEP = 8.0
"""Least step of the clock from one fix to the next, in the 1 sigma that the ranges give it; multipath in a city reached
6. A smaller step stays in the ranges."""
RATE_STEP = 12.0
"""Least step in the rate of the clock, in the 1 sigma that the range rates give it. Some receivers show a step of the
clock as a single large range rate."""
SIGMA_WITHOUT_FIX = (300.0, 30.0)
"""1 sigma of the clock, m, and of its rate, m/s, where too few satellites give a fix: a single one may be wrong."""
DRIFT_CHANGE = 1.0
"""Largest change of the rate of a clock in a second, m/s."""
MILLISECOND = 1e-3 * speed_of_light
EXACT = 100.0
"""A step within this distance of whole milliseconds, m, is taken for exactly these. The distance is at most half of the
least step."""
UNKNOWN = 1000.0
"""1 sigma of the clock after any other step, m."""
NEIGHBOURS = 10
"""Epochs to either side whose median, with the epoch's own, tells the rate of the clock."""
FEWEST = 3
"""Least number of epochs that tells which of them lies beyond the others."""


@dataclass(frozen=True, eq=False)
class ClockSteps:
    """What the steps of a receiver's clock have done to its measurements at E epochs.

    Attributes:
        offset: sum of the steps up to each epoch, (E,), m; part of every range.
        rate: what a step has added to the range rates of its epoch, (E,), m/s.
        variance: of the size of each epoch's step, (E,), m²; 0 where there is none or its size is known.
    """

    offset: Floats
    rate: Floats
    variance: Floats


def without_steps(ranges: Ranges, start: Floats) -> Ranges:
    """The ranges of a receiver as if its clock had not stepped, and where it is not known by how much it has.

    Args:
        ranges: of a receiver.
        start: latitude rad, longitude rad, height m, (3,), within 100 km.
    """
    solution = solve_ranges(ranges, start)
    if not solution.solved.any():
        return ranges
    steps, there = find_steps(solution), ranges.satellite >= 0
    return replace(
        ranges,
        time=ranges.time - steps.offset / speed_of_light,
        pseudorange=np.where(there, ranges.pseudorange - steps.offset[:, None], 0.0),
        range_rate=np.where(there, ranges.range_rate - steps.rate[:, None], 0.0),
        clock_jump=steps.variance,
    )


def find_steps(solution: RangeSolution) -> ClockSteps:
    """The steps in the clock of a receiver.

    Where there is no fix, the clock is what the ranges say on average at the place between the fixes.

    Args:
        solution: least squares of every epoch, at least one of which is solved.
    """
    corrected, solved = solution.corrected, solution.solved
    nothing = np.zeros(corrected.pseudorange.shape)
    position, velocity = between_fixes(solution)
    without_clock = DrawnErrors(nothing, nothing, nothing, np.zeros((len(position), 2)))
    expected = pseudoranges(corrected.geometry, position, velocity, without_clock)
    clock = _common(corrected.pseudorange - expected.code, corrected.geometry.present)
    drift = _common(corrected.range_rate - expected.rate, corrected.has_rate)
    sigma, drift_sigma = (np.full(len(clock), value) for value in SIGMA_WITHOUT_FIX)
    clock[solved], sigma[solved] = solution.clock[solved], solution.clock_sigma[solved]
    drift[solved], drift_sigma[solved] = solution.clock_drift[solved], solution.clock_drift_sigma[solved]
    known, rate = np.flatnonzero(np.isfinite(drift)), np.zeros(len(drift))
    rate[known] = _spikes(corrected.geometry.time[known], drift[known], drift_sigma[known])
    steady = np.interp(np.arange(len(clock)), known, (drift - rate)[known])
    known, size, variance = np.flatnonzero(np.isfinite(clock)), np.zeros(len(clock)), np.zeros(len(clock))
    time = corrected.geometry.time[known]
    size[known], variance[known] = _sizes(time, clock[known], sigma[known], steady[known])
    return ClockSteps(np.cumsum(size), rate, variance)


def _common(values: Floats, present: Flags) -> Floats:
    """Median of what there is at each epoch, (E,); NaN where there is nothing."""
    result = np.full(len(values), np.nan)
    for epoch in np.flatnonzero(present.any(axis=1)).tolist():
        result[epoch] = np.median(values[epoch, present[epoch]])
    return result


def _spikes(time: Floats, drift: Floats, sigma: Floats) -> Floats:
    """What lies beyond the rate of the neighbouring epochs, (n,), m/s; 0 where it is not much.

    At an end of the log the neighbours are those of one side: the rate may have changed between their time and this.
    """
    if len(drift) < FEWEST:
        return np.zeros(len(drift))
    beyond, lag = drift - _median_around(drift), time - _median_around(time)
    return np.where(np.abs(beyond) > RATE_STEP * sigma + DRIFT_CHANGE * np.abs(lag), beyond, 0.0)


def _median_around(values: Floats) -> Floats:
    """Median of each value and its neighbours, (n,), of those alone that there are."""
    padded = np.pad(values, NEIGHBOURS, constant_values=np.nan)
    result: Floats = np.nanmedian(sliding_window_view(padded, 2 * NEIGHBOURS + 1), axis=1)
    return result


def _sizes(time: Floats, clock: Floats, sigma: Floats, drift: Floats) -> tuple[Floats, Floats]:
    """Sizes of the steps before each of n epochs, m, and their variances, m²; zero at the first epoch."""
    elapsed = np.diff(time)
    change = np.diff(clock) - 0.5 * (drift[1:] + drift[:-1]) * elapsed
    least = STEP * np.hypot(sigma[1:], sigma[:-1]) + DRIFT_CHANGE * elapsed
    whole = MILLISECOND * np.round(change / MILLISECOND)
    stepped, exact = np.abs(change) > least, np.abs(change - whole) < np.minimum(EXACT, 0.5 * least)
    size = np.where(stepped, np.where(exact, whole, change), 0.0)
    return np.append(0.0, size), np.append(0.0, np.where(stepped & ~exact, UNKNOWN**2, 0.0))
