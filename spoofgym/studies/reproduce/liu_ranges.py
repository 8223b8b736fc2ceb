"""Rows of Liu 2018 with fixes that are made from the ranges of table 1: what the paper simulates.

Beside them stand the rows on white noise with the filter's own R, which is what the filter believes.
"""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.studies.reproduce.rows import (
    Listing,
    Row,
    number_row,
    on,
    statement_row,
    wilson_interval,
)
from spoofgym.studies.reproduce.tracks import Tracks
from spoofgym.studies.reproduce.verdict import rounded

EAST = 0
RATES = (0.0, 0.3, 0.5, 1.0, 12.4)
NORMAL_OUTSIDE_3_SIGMA = 100.0 * math.erfc(3.0 / math.sqrt(2.0))  # %


def listing(
    tracks: dict[float, Tracks], onset: float, threshold: float, without: Floats, taken_back: Floats
) -> Listing:
    """All rows.

    Args:
        tracks: of each ramp by its rate in m/s, every fix used.
        onset: of the ramps, s.
        threshold: of the snapshot test.
        without: horizontal error at the end, from the detection of a ramp of 1 m/s on without GNSS, (N,), m.
        taken_back: the same with 50 s of backtracking, (N,), m.
    """
    first = tracks[0.0].at(onset)
    rows = (
        *_bounds(tracks, first),
        _statistic(tracks[0.0], first, threshold),
        *_detection(tracks, first, threshold),
        _gain(without, taken_back),
    )
    title = "Section 5, figures 4 to 6: fixes made from ranges with the errors of table 1"
    return Listing(title, rows, "What the paper simulates: these rows count, and not their like on white noise above.")


def _outside(track: Tracks, first: int) -> Flags:
    """Whether the error in longitude is beyond the filter's own 3 σ, from the onset on, (N, epochs)."""
    return np.abs(track.error[:, first:, EAST]) > 3.0 * track.position_sigma[:, first:, EAST]


def _bounds(tracks: dict[float, Tracks], first: int) -> tuple[Row, ...]:
    clean, fast = tracks[0.0], tracks[12.4]
    share = 100.0 * _outside(clean, first).mean(axis=1)
    low, high = mean_interval(share)
    change = 100.0 * np.abs(fast.position_sigma[:, -1] / clean.position_sigma[:, -1] - 1.0).max(axis=1)
    spread = np.sqrt(np.mean(clean.error[:, first:, EAST] ** 2))
    own = np.median(clean.position_sigma[:, first:, EAST])
    return (
        Row(
            "ranges, not spoofed: epochs outside the 3 σ bound, % (mean of the runs, 95 % interval)",
            "inside",
            float(np.mean(share)),
            (max(low, 0.0), min(high, 100.0)),
            "reproduced" if low <= NORMAL_OUTSIDE_3_SIGMA else "not reproduced",
            f"The filter takes errors that stay for the whole flight for white ones and averages them: its σ is "
            f"{own:.1f} m, its error {spread:.1f} m.",
            "words",
        ),
        statement_row(
            "ranges, 12.4 m/s: the 3 σ bound changes at 1100 s by, %",
            "unchanged",
            change < 0.5,
            change,
            "Gains and P depend on the trajectory alone, whatever the noise of the fixes.",
        ),
        on(
            "by construction",
            number_row(
                "ranges, 12.4 m/s: error in longitude at 1100 s, m (2 nautical miles)",
                rounded(2 * 1852.0, 1852.0),
                fast.error[:, -1, EAST],
                reasons={"reproduced": "The filter follows the ramp, whatever the noise."},
            ),
        ),
    )


def _statistic(clean: Tracks, first: int, threshold: float) -> Row:
    mean = clean.nis[:, first:].mean(axis=1)
    largest = float(clean.nis[:, first:].max())
    row = statement_row(
        "ranges, not spoofed: mean of the normalised innovation squared; 3 where R is right",
        "3",
        np.abs(mean - 3.0) < 1.0,
        mean,
        "Most of R stands for errors that do not change, so that innovations are far smaller than the filter expects: "
        f"the largest of all statistics is {largest:.1f}, the threshold {threshold:.1f}. The paper has no "
        "such figure.",
    )
    return on("own formula", row)


def _detection(tracks: dict[float, Tracks], first: int, threshold: float) -> tuple[Row, ...]:
    alarms = {rate: np.asarray((track.nis[:, first + 1 :] > threshold).any(axis=1)) for rate, track in tracks.items()}
    rows = []
    for rate, smaller in ((0.3, 0.0), (0.5, 0.3), (1.0, 0.5)):
        share, before = float(alarms[rate].mean()), float(alarms[smaller].mean())
        peak = tracks[rate].nis[:, first + 1 :].max(axis=1)
        rows.append(
            Row(
                f"ranges, {rate:g} m/s: share of runs that the snapshot test detects",
                "more at larger rates",
                share,
                wilson_interval(int(alarms[rate].sum()), len(alarms[rate])),
                "reproduced" if share > before or share == 1.0 else "not reproduced",
                f"At {smaller:g} m/s it is {before:.2f}. The largest statistic of a run is {np.median(peak):.1f} in "
                f"the median: a threshold set for R asks for {threshold:.1f}.",
                "words",
            )
        )
    return tuple(rows)


def _gain(without: Floats, taken_back: Floats) -> Row:
    return statement_row(
        "ranges, 1 m/s: gain by backtracking at 1100 s, m",
        "better with",
        without > taken_back,
        without - taken_back,
        f"{np.median(without):.0f} m without and {np.median(taken_back):.0f} m with it, as with white noise: the drift "
        "of the INS and the attack decide, not the fixes.",
    )
