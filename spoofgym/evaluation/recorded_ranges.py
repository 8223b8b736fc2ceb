"""Loosely and tightly coupled filters side by side on a drive whose log has raw ranges, clean and pulled north.

There are two kinds of rows: the filters on the clean drive, and games in which all ranges (or the fixes made from them)
are pulled as one position. A game begins every minute; run i of a simulation is the game with onset i, so that one pass
over the drive plays them all.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.geodesy import horizontal, position_difference
from spoofgym.logs.log import Fixes, interpolate, read_log
from spoofgym.logs.range_epochs import RangeEpochs
from spoofgym.program import moved
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.simulation import Simulation
from spoofgym.validation import written

FILTERS: dict[str, Callable[[str], Scenario]] = {
    "loose, receiver's fixes": partial(recorded, fixes="phone"),
    "loose, fixes from ranges": partial(recorded, fixes="ranges"),
    "tight": partial(recorded, coupling="tight"),
}
PULLS = (0.5, 2.0)
"""Rates of the ramps, m/s north."""
DETECTORS = {"snapshot": "snapshot:p_fa=1e-5", "ci": "ci:n=20", "raim": "raim"}
"""At their nominal thresholds, a false alarm in 100,000 epochs of a matched filter."""
DURATION = 120.0
"""Of a game, s."""
SPACING = 60.0
"""Between the onsets of games, s."""
LONGEST_GAP = 20.0
"""A game has no longer gap in the receiver's own fixes, s."""
BETWEEN = 1.5
"""Longest time between two of the receiver's fixes over whose middle a straight comparison is made, s."""
SAME_EPOCH = 0.5
"""Epochs of two filters no further apart than this are common to both, s."""


@dataclass(frozen=True)
class Course:
    """N games of one filter over the same K epochs.

    Attributes:
        time: of the epochs, (K,), s.
        position: the filter's, after each epoch, (K, N, 3), latitude rad, longitude rad, height m.
        nis: (K, N).
        degrees: of freedom of each nis, (K,).
        statistics: of each detector by its label, (K, N).
        thresholds: nominal one of each detector, by its label.
    """

    time: Floats
    position: Floats
    nis: Floats
    degrees: Floats
    statistics: dict[str, Floats]
    thresholds: dict[str, float]


def detectors_of(scenario: Scenario) -> dict[str, Detector]:
    """Those of `DETECTORS` that this filter can have."""
    made = {label: make_detector(text) for label, text in DETECTORS.items()}
    return {label: detector for label, detector in made.items() if set(detector.needs) <= set(scenario.offers)}


def play(scenario: Scenario, rate: float, onsets: Floats) -> Course:
    """Pull north from each onset on, a run each.

    Args:
        scenario: the drive, from before the first onset to its end.
        rate: m/s.
        onsets: (N,), s.
    """
    detectors = detectors_of(scenario)
    simulation = Simulation(scenario, None, [*detectors.values()], num_runs=len(onsets), seed=0, fidelity="strapdown")
    # position is the navigator's own, which the truth of the scenario does not touch
    navigator: Any = simulation.navigator
    simulation.reset()
    simulation.resolve()
    position, nis, degrees = [], [], []
    statistics: dict[str, list[Floats]] = {label: [] for label in detectors}
    time = scenario.times(0)[1:]
    for moment in time:
        offset = np.zeros((len(onsets), 3))
        offset[:, 1] = rate * np.maximum(moment - onsets, 0.0)
        epoch = simulation.observe(offset)
        nis.append(epoch.innovation.nis.copy())
        degrees.append(epoch.innovation.degrees[0])
        for label, detector in detectors.items():
            statistics[label].append(epoch.statistics[detector.name].copy())
        simulation.resolve()
        position.append(navigator.position.copy())
    counted = np.array(degrees, dtype=np.float64)
    log = recorded_family(scenario)
    counted -= log.unmeasured[log.first + 1 :]
    return Course(
        time,
        np.array(position),
        np.array(nis),
        counted,
        {label: np.array(values) for label, values in statistics.items()},
        {label: float(detector.threshold or np.inf) for label, detector in detectors.items()},
    )


def errors(course: Course, fixes: Fixes) -> Floats:
    """Horizontal distance from the receiver's own fixes, (K, N), m; NaN where there are none around."""
    after = np.clip(np.searchsorted(fixes.time, course.time), 1, len(fixes.time) - 1)
    inside = (course.time >= fixes.time[after - 1]) & (course.time <= fixes.time[after])
    inside &= fixes.time[after] - fixes.time[after - 1] <= BETWEEN
    distance = np.full(course.nis.shape, np.nan)
    place, _ = interpolate(fixes, course.time[inside])
    for run in range(course.nis.shape[1]):
        distance[inside, run] = horizontal(position_difference(course.position[inside, run], place))
    return distance


def common(times: Floats, others: Sequence[Floats]) -> Flags:
    """Which times have one of every other filter beside them, (K,)."""
    result = np.ones(len(times), dtype=bool)
    for other in others:
        after = np.clip(np.searchsorted(other, times), 1, len(other) - 1)
        result &= np.minimum(np.abs(other[after] - times), np.abs(times - other[after - 1])) <= SAME_EPOCH
    return result


def game_onsets(fixes: Fixes, begin: float, end: float) -> Floats:
    """Onsets of the games that fit between two times without a long gap in the receiver's fixes, (N,), s.

    Raises:
        ValueError: there are none.
    """
    gaps = np.flatnonzero(np.diff(fixes.time) > LONGEST_GAP)
    onsets = [
        onset
        for onset in np.arange(begin, end - DURATION, SPACING)
        if not np.any((fixes.time[gaps] < onset + DURATION) & (fixes.time[gaps + 1] > onset))
    ]
    if not onsets:
        raise ValueError(
            f"the drive leaves no game of {DURATION:g} s without a gap of {LONGEST_GAP:g} s between "
            f"{written(begin)} and {written(end)} s"
        )
    return np.array(onsets)


def clock_drift(epochs: RangeEpochs) -> dict[str, float]:
    """Median drift of the receiver's clock by pseudoranges and by range rates, and the largest step between them, m/s.

    Over neighbouring epochs with a fix, less the steps of the clock that are found when the log is read. A receiver
    whose pseudoranges and range rates hang on different clocks shows it here.
    """
    near = np.flatnonzero(np.diff(epochs.fix) == 1)
    first = epochs.fix[near]
    by_code = np.diff(epochs.clock)[first] / np.diff(epochs.time)[first]
    by_rate = 0.5 * (epochs.clock_drift[first] + epochs.clock_drift[first + 1])
    return {
        "by_pseudoranges_mps": float(np.median(by_code)),
        "by_range_rates_mps": float(np.median(by_rate)),
        "largest_difference_mps": float(np.abs(by_code - by_rate).max()),
    }


def _percentiles(distance: Floats) -> dict[str, float | None]:
    known = distance[np.isfinite(distance)]
    if not len(known):
        return {"median_m": None, "p95_m": None}
    return {"median_m": float(np.median(known)), "p95_m": float(np.percentile(known, 95.0))}


def _per_degree(course: Course, window: Flags) -> float:
    """Sum of the nis over that of their degrees of freedom in the epochs of a window (K, N)."""
    return float(np.sum(course.nis * window) / np.sum(course.degrees[:, None] * window))


def clean_row(name: str, course: Course, distance: Floats, shared: Flags) -> dict[str, Any]:
    """What a filter does on the clean drive."""
    hours = float(course.time[-1] - course.time[0]) / 3600.0
    alarms = {}
    for detector, statistic in course.statistics.items():
        alarm = statistic[:, 0] > course.thresholds[detector]
        begun = int(alarm[0]) + int(np.sum(alarm[1:] & ~alarm[:-1]))
        alarms[detector] = {"threshold": course.thresholds[detector], "begun": begun, "per_hour": begun / hours}
        alarms[detector] |= {"epochs": int(alarm.sum()), "largest": float(statistic.max())}
    return {
        "filter": name,
        "epochs": len(course.time),
        "compared": int(np.isfinite(distance).sum()),
        **_percentiles(distance),
        "common": int(np.isfinite(distance[shared]).sum()),
        **{f"common_{key}": value for key, value in _percentiles(distance[shared]).items()},
        "nis_per_degree": _per_degree(course, np.ones(course.nis.shape, dtype=bool)),
        "hours": hours,
        "false_alarms": alarms,
    }


def pulled_rows(
    name: str, rate: float, onsets: Floats, course: Course, distance: Floats, clean: Course
) -> list[dict[str, Any]]:
    """What a filter does in the games: a row per detector.

    An alarm is owed to the pull where the clean drive has none in the same epoch. Other alarms in a game are false
    ones that happen to fall into it.
    """
    after = course.time[:, None] - onsets
    window = (after > 0.0) & (after <= DURATION)
    every = {
        "filter": name,
        "rate_mps": rate,
        "games": len(onsets),
        **_percentiles(distance[window]),
        "nis_per_degree": _per_degree(course, window),
    }
    rows = []
    for detector, statistic in course.statistics.items():
        alarm = statistic > course.thresholds[detector]
        false = clean.statistics[detector] > clean.thresholds[detector]
        row: dict[str, Any] = {"detector": detector}
        for key, which in (("any", alarm), ("owed", alarm & ~false)):
            first = _first_alarms(which, after, window)
            seen = first[np.isfinite(first)]
            middle = float(np.median(seen)) if len(seen) else None
            row[key] = {
                "games": len(seen),
                "first_s": [None if np.isnan(value) else float(value) for value in first],
                "median_s": middle,
                "median_pull_m": None if middle is None else rate * middle,
            }
        rows.append(every | row)
    return rows


def _first_alarms(alarm: Flags, after: Floats, window: Flags) -> Floats:
    """Time from the onset to the first alarm in the window of each game, (N,), s; NaN = none."""
    alarm = alarm & window
    first = alarm.argmax(axis=0)
    return np.where(alarm.any(axis=0), after[first, np.arange(alarm.shape[1])], np.nan)


def side_by_side(path: str, progress: Progress = silent) -> Iterator[dict[str, Any]]:
    """Play all filters on a log: the report after each filter's games, the last one with all.

    Args:
        path: folder of the log.
        progress: shows which filter plays.

    Raises:
        ValueError: no such log, no ranges in it, or a drive too short.
    """
    fixes = read_log(path).fixes
    scenarios = {name: build(path) for name, build in FILTERS.items()}
    logs = {name: recorded_family(scenario) for name, scenario in scenarios.items()}
    begin = max(log.align_time for log in logs.values()) + SETTLING
    end = min(log.epoch_time[-1] for log in logs.values())
    onsets = game_onsets(fixes, begin, end)
    memory = max(make_detector(text).memory for text in DETECTORS.values())
    whole, clean = {}, {}
    for name, scenario in scenarios.items():
        time = logs[name].epoch_time
        first = max(int(np.searchsorted(time, begin)), memory)
        whole[name] = scenario.changed(onset=float(time[first]), horizon=None)
        with progress(f"{name}, clean"):
            clean[name] = play(whole[name], 0.0, np.array([np.inf]))
    tight = logs["tight"]
    assert isinstance(tight, RecordedRanges)
    filters, games = [], []
    for name, scenario in whole.items():
        shared = common(clean[name].time, [other.time for key, other in clean.items() if key != name])
        filters.append(clean_row(name, clean[name], errors(clean[name], fixes)[:, 0], shared))
        for rate in PULLS:
            with progress(f"{name}, pulled at {rate:g} m/s"):
                course = play(scenario, rate, onsets)
            games += pulled_rows(name, rate, onsets, course, errors(course, fixes), clean[name])
        yield {
            "schema_version": SCHEMA_VERSION,
            "kind": "recorded-ranges",
            "log": path,
            "onsets_s": onsets.tolist(),
            "clock": clock_drift(tight.epochs),
            "clean": list(filters),
            "pulled": list(games),
        }


if __name__ == "__main__":
    sys.exit(moved("spoofgym study recorded-ranges"))
