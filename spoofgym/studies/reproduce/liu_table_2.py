"""Table 2 of Liu et al. (2018): what a spoofing attack changes in the filter's P."""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.sensors.imu import DEGREE_PER_HOUR, MICRO_G
from spoofgym.studies.reproduce.rows import (
    Grid,
    Group,
    Listing,
    Reasons,
    Row,
    again,
    each,
    number_row,
    on,
    statement_row,
)
from spoofgym.studies.reproduce.verdict import Published, rounded

HEADS = ("state", "E or R", "N or F", "U")

# relative change of sqrt(P) in %, absolute change, and the last place of each: table 2, 12.4 m/s at 1100 s
TABLE_2 = {
    "attitude, °": (((0.20, 3.43e-6), (0.26, 4.40e-6), (0.19, 1.06e-5)), (1e-8, 1e-8, 1e-7)),
    "velocity, m/s": (((0.01, 1.52e-6), (0.14, 1.96e-5), (0.02, 8.63e-7)), (1e-8, 1e-7, 1e-9)),
    "position, m": (((0.002, 1.02e-5), (0.05, 3.69e-4), (0.004, 2.87e-5)), (1e-7, 1e-6, 1e-7)),
    "gyro bias, °/h": (((0.11, 1.59e-5), (0.18, 2.52e-5), (0.03, 7.72e-6)), (1e-7, 1e-7, 1e-8)),
    "acc. bias, µg": (((0.29, 6.33e-2), (0.35, 7.17e-2), (0.07, 1.14e-3)), (1e-4, 1e-4, 1e-5)),
}
SMALL = 0.5
"""What counts as negligible, %: the largest printed change is 0.35 %."""
TRAJECTORY: Reasons = {
    "partly": "Another trajectory gives another number; within a factor of two.",
    "not reproduced": "The flight before the attack is not printed, and the changes depend on it.",
}
UNITS = np.repeat([math.radians(1.0), 1.0, 1.0, DEGREE_PER_HOUR, MICRO_G], 3)


def grids(spoofed: Floats, clean: Floats) -> tuple[Grid, Listing, Grid, Group]:
    """All figures of the table, and the square roots of P that they imply.

    Args:
        spoofed: square root of the diagonal of P at 1100 s after 300 s of a 12.4 m/s ramp, (N, 15), SI.
        clean: the same runs without the ramp.
    """
    return (
        relative_change(spoofed, clean),
        small_change(spoofed, clean),
        absolute_change(spoofed, clean),
        each(lambda row: on("calibrated", row), deviation(clean)),
    )


def relative_change(spoofed: Floats, clean: Floats) -> Grid:
    """Table 2, relative: change of sqrt(P) at 1100 s under 12.4 m/s (eq 46), %."""
    change = 100.0 * np.abs(spoofed / clean - 1.0)
    rows = [
        number_row(f"relative change of sqrt(P), {state}, %", p, column, reasons=TRAJECTORY)
        for state, p, column in zip(_states(), _published_relative(), change.T, strict=True)
    ]
    largest = number_row(
        "largest of the 15 relative changes, %", rounded(0.35, 0.01), change.max(axis=1), reasons=TRAJECTORY
    )
    lines = (*_lines(rows), ("largest", (again(largest), None, None)))
    return Grid("Table 2: relative change of √P after 300 s at 12.4 m/s, %", HEADS, lines)


def small_change(spoofed: Floats, clean: Floats) -> Listing:
    """What table 2 is printed for: an attack hardly changes the filter's P."""
    largest = 100.0 * np.abs(spoofed / clean - 1.0).max(axis=1)
    row = statement_row(
        "largest of the 15 relative changes of √P, %",
        "negligible",
        largest < SMALL,
        largest,
        f"We ask for less than {SMALL:g} %: gains and P depend on the trajectory, which the spoofer hardly changes.",
    )
    return Listing("Table 2 in words", (row,))


def absolute_change(spoofed: Floats, clean: Floats) -> Grid:
    """Table 2, absolute: change of sqrt(P) at 1100 s under 12.4 m/s (eq 45), in the units of the paper."""
    change = np.abs(spoofed - clean) / UNITS
    rows = [
        number_row(f"absolute change of sqrt(P), {state}", p, column, reasons=TRAJECTORY)
        for state, p, column in zip(_states(), _published_absolute(), change.T, strict=True)
    ]
    return Grid("Table 2: absolute change of √P", HEADS, _lines(rows))


def deviation(clean: Floats) -> Grid:
    """The square roots of P that the two changes imply: their quotient, as uncertain as both are rounded.

    The rate of the fixes was chosen by these figures.
    """
    reasons: Reasons = {
        "partly": "Within a factor of two; the flight before the attack decides how well the state is observed.",
        "not reproduced": "The flight before the attack is not printed, and it decides how well the state is observed.",
    }
    published = []
    for relative, absolute in zip(_published_relative(), _published_absolute(), strict=True):
        low, high = 100.0 * absolute.low / relative.high, 100.0 * absolute.high / relative.low
        published.append(Published(100.0 * float(absolute.value) / float(relative.value), low, high))
    rows = [
        number_row(f"sqrt(P) at 1100 s, {state}", p, column, reasons=reasons)
        for state, p, column in zip(_states(), published, (clean / UNITS).T, strict=True)
    ]
    return Grid("√P at 1100 s, as table 2 implies", HEADS, _lines(rows))


def _published_relative() -> list[Published]:
    """The relative changes of the 15 states, %."""
    relative = [pair[0] for pairs, _ in TABLE_2.values() for pair in pairs]
    return [rounded(value, 0.001 if value < 0.01 else 0.01) for value in relative]


def _published_absolute() -> list[Published]:
    """The absolute changes of the 15 states, in the units of the paper."""
    return [
        rounded(absolute, place)
        for pairs, places in TABLE_2.values()
        for (_, absolute), place in zip(pairs, places, strict=True)
    ]


def _states() -> list[str]:
    """Names of the 15 states."""
    return [f"{kind} {axis}" for kind in TABLE_2 for axis in ("RFU" if "bias" in kind else "ENU")]


def _lines(rows: list[Row]) -> tuple[tuple[str, tuple[Row | None, ...]], ...]:
    return tuple((kind, tuple(rows[3 * i : 3 * i + 3])) for i, kind in enumerate(TABLE_2))
