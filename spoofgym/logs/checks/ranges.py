"""Ranges of a log by themselves: units, range rates against differences of the ranges, steps of the clock."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.constants import speed_of_light as C

from spoofgym.arrays import Floats
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.ranges_log import LIMITS, RANGE_COLUMNS
from spoofgym.logs.table import has_table, read_table, table_path

L1 = C / 1_575.42e6
"""Wavelength of GPS L1, m."""
LONGEST_STEP = 10.0
"""Longest time between two ranges of a satellite that are compared, s."""
FEWEST = 20
"""Least number of comparisons that tell something."""
SPREAD = (2e4, 2e7)
"""Differences between the ranges of one time that are metres: satellites are 20 000 to 26 000 km away."""
MILLISECOND = 1e-3 * C
RATE_CHANGE = 30.0
"""Difference of a step of all ranges from whole milliseconds that is one, m."""


def check_ranges(folder: Path) -> Iterator[Finding]:
    """Findings about ``ranges.csv``; none where there is none.

    Raises:
        ValueError: it cannot be read.
    """
    if not has_table(folder, "ranges"):
        return
    path = table_path(folder, "ranges")
    table = read_table(path, [RANGE_COLUMNS], [], LIMITS)
    if not (folder / "ephemeris.csv").is_file():
        text = "ephemeris.csv is missing, which ranges need"
        yield Finding("note", path.name, text, "spoofgym.sensors.rinex.read_rinex reads a navigation file")
    unit = _unit(table)
    if unit is not None:
        yield Finding("error", path.name, f"pseudorange_m is in {unit[0]}", f"multiply it by {unit[1]:.10g}", 1)
        return
    yield from _check_rates(path.name, *_differences(table))
    yield from _check_clock(path.name, table)


def _unit(table: dict[str, Floats]) -> tuple[str, float] | None:
    """Another unit than metres, by the spread of the ranges of one time, and its factor; None = metres, or unknown."""
    first = np.unique(table["t_s"], return_index=True)[1]
    spread = []
    for begin, end in zip(first, [*first[1:], len(table["t_s"])], strict=True):
        if end - begin >= 4:
            spread.append(np.ptp(table["pseudorange_m"][begin:end]))
    if len(spread) < 5:
        return None
    median = float(np.median(spread))
    if SPREAD[0] <= median <= SPREAD[1]:
        return None
    for name, factor in (("kilometres", 1e3), ("seconds", C), ("milliseconds", 1e-3 * C), ("nanoseconds", 1e-9 * C)):
        if SPREAD[0] < median * factor < SPREAD[1]:
            return name, factor
    return None


def _differences(table: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Rates by differences of ranges, less their median over the satellites at each time, and the rates in the log.

    Returns:
        Both, (n,), m/s.
    """
    order = np.lexsort([table["t_s"], table["svid"]])
    time, ranges, rates, svid = (table[name][order] for name in ("t_s", "pseudorange_m", "range_rate_mps", "svid"))
    step = np.diff(time)
    used = (svid[1:] == svid[:-1]) & (step > 0.0) & (step <= LONGEST_STEP)
    by_ranges = (np.diff(ranges)[used]) / step[used]
    by_rates = 0.5 * (rates[1:] + rates[:-1])[used]
    when = time[1:][used]
    groups = np.unique(when, return_inverse=True)[1]
    shared_ranges, shared_rates = (_medians(values, groups) for values in (by_ranges, by_rates))
    several = np.bincount(groups)[groups] >= 3
    return (by_ranges - shared_ranges)[several], (by_rates - shared_rates)[several]


def _medians(values: Floats, groups: np.ndarray) -> Floats:
    """The median of each value's group, (n,)."""
    order = np.argsort(groups, kind="stable")
    ends = np.cumsum(np.bincount(groups))
    medians = np.array([np.median(part) for part in np.split(values[order], ends[:-1])]) if len(values) else values
    return np.asarray(medians[groups])


def _check_rates(name: str, by_ranges: Floats, by_rates: Floats) -> Iterator[Finding]:
    usual = np.abs(by_ranges) < 2000.0
    one, other = by_ranges[usual], by_rates[usual]
    if len(one) < FEWEST or not other.any():
        return
    ratio = float(np.median(np.abs(one)) / max(float(np.median(np.abs(other))), 1e-9))
    sign = float(np.sum(np.sign(one) * np.sign(other)) / len(one))
    if sign < -0.5:
        extra = ", and are in Hz: multiply them by -0.1903" if abs(ratio / L1 - 1.0) < 0.2 else ": multiply them by -1"
        text = "range_rate_mps has the opposite sign of the differences of the ranges"
        yield Finding("error", name, text, f"it is positive where a satellite recedes; these are Dopplers{extra}", 1)
    elif sign > 0.5 and not 0.67 < ratio < 1.5:
        unit = next((unit for unit, size in (("Hz", L1), ("km/s", 1e3)) if abs(ratio / size - 1.0) < 0.2), None)
        told = f"they are in {unit}: multiply them by {ratio:.4g}" if unit else "look at their unit"
        text = f"the differences of the ranges are {ratio:.3g} times the range rates"
        yield Finding("error", name, text, told, 1)
    elif abs(sign) <= 0.5 and len(one) > 10 * FEWEST:
        text = f"range rates and differences of the ranges disagree (signs agree in {50 * (1 + sign):.0f} %)"
        yield Finding("warning", name, text, "coupling=tight needs both; rows may belong to other satellites", 1)


def _check_clock(name: str, table: dict[str, Floats]) -> Iterator[Finding]:
    """Steps of whole milliseconds that all ranges take at once; a reader takes them away."""
    order = np.lexsort([table["t_s"], table["svid"]])
    time, svid = table["t_s"][order], table["svid"][order]
    step = np.diff(time)
    used = (svid[1:] == svid[:-1]) & (step > 0.0) & (step <= LONGEST_STEP)
    change = np.diff(table["pseudorange_m"][order])[used] - (table["range_rate_mps"][order][1:] * step)[used]
    when = time[1:][used]
    times, groups = np.unique(when, return_inverse=True)
    if not len(times):
        return
    shared = np.zeros(len(times))
    shared[groups] = _medians(change, groups)
    whole = np.round(shared / MILLISECOND)
    stepped = (np.abs(whole) >= 1.0) & (np.abs(shared - whole * MILLISECOND) < RATE_CHANGE * LONGEST_STEP)
    if stepped.any():
        text = f"the receiver's clock steps by whole milliseconds {int(stepped.sum())} times"
        yield Finding("note", name, text, "they are taken away when the log is read")
