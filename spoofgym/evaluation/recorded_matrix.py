"""Detectors on a recorded log at an equal false-alarm probability: thresholds, and a matrix of games along the log.

A log is one realisation. Clean games on it tell how often a statistic exceeds a threshold, and an attack is played from
several places of the log on, each a game of its own. All of it is measured on the log that the thresholds come from.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.geodesy import horizontal
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.simulation import Simulation

OWNER, CLEAN = "recorded", "none"
FIDELITY = "strapdown"
UNREACHED = 1e9
"""A threshold that nothing reaches, while statistics are looked at."""
GAMES, HORIZON = 12, 60
"""Games of each attack along the log, and epochs of each."""


@dataclass(frozen=True)
class Course:
    """One game on a log, every fix used.

    Attributes:
        time: of the epochs 1..K, (K,), s.
        statistic: of each detector, (D, K).
        error: horizontal, after the fix was used, (K,), m.
    """

    time: Floats
    statistic: Floats
    error: Floats


def at_false_alarm_probability(
    games: Sequence[Scenario], detectors: Sequence[Detector], probability: float
) -> list[Detector]:
    """Detectors whose statistics exceed their thresholds in a share of the epochs of clean games.

    The unaided inertial solution of a game begins where the game does, so that thresholds hold for games like these.

    Args:
        games: on a log.
        detectors: with or without thresholds; they are not changed.
        probability: the share, per epoch.

    Raises:
        ValueError: the games have too few epochs to show such a share, or a statistic that does not vary.
    """
    ready, refused = those_with_thresholds(games, detectors, probability)
    for reason in refused.values():
        raise ValueError(reason)
    return ready


def those_with_thresholds(
    games: Sequence[Scenario], detectors: Sequence[Detector], probability: float
) -> tuple[list[Detector], dict[str, str]]:
    """As `at_false_alarm_probability`, but the detectors that have no such threshold are named with the reason.

    Raises:
        ValueError: the games have too few epochs to show such a share.
    """
    probability = validation.probability(OWNER, "p_fa", probability)
    ready, refused = [], {}
    for detector, statistic in _clean_statistics(games, detectors):
        try:
            detector.set_threshold(_exceeded(detector.name, statistic, probability))
        except _Unvaried as error:
            refused[detector.name] = str(error)
        else:
            ready.append(detector)
    return ready, refused


def _clean_statistics(games: Sequence[Scenario], detectors: Sequence[Detector]) -> list[tuple[Detector, Floats]]:
    """Copies of detectors with the slope that clean games give them, and their statistics in all of these, (n,)."""
    ready = [copy.copy(detector) for detector in detectors]
    for detector in ready:
        games[0].facts.require(f"detector {detector.name!r}", detector.needs)
        if detector.lacks_slope:
            detector.set_slope(0.0)
        detector.set_threshold(UNREACHED)
    courses = [play(game, None, ready) for game in games]
    after = np.concatenate([course.time - game.timeline.start for game, course in zip(games, courses, strict=True)])
    statistics = np.concatenate([course.statistic for course in courses], axis=1)
    found = []
    for given, detector, statistic in zip(detectors, ready, statistics, strict=True):
        slope = max(float(np.polyfit(after, statistic, 1)[0]), 0.0) if given.lacks_slope else 0.0
        if given.lacks_slope:
            detector.set_slope(slope)
        found.append((detector, statistic - slope * after))
    return found


class _Unvaried(ValueError):
    """A statistic has one value in so many epochs that no threshold gives the share."""


def _exceeded(name: str, statistic: Floats, probability: float) -> float:
    """The threshold that a share of the values exceeds."""
    alarms = int(probability * len(statistic))
    if alarms < 1:
        raise ValueError(
            f"{OWNER}: p_fa must be 1/{len(statistic)} or more, since there are {len(statistic)} clean epochs; got "
            f"{probability:g}"
        )
    highest = np.sort(statistic)[::-1]
    if highest[alarms - 1] == highest[alarms] or highest[alarms - 1] <= 0.0:
        raise _Unvaried(
            f"detector {name!r}: no threshold gives a share of {probability:g}, since its statistic is "
            f"{highest[alarms]:.3g} in too many clean epochs"
        )
    return float(0.5 * (highest[alarms - 1] + max(highest[alarms], 0.0)))


def play(scenario: Scenario, attack: Attack | None, detectors: Sequence[Detector], seed: int = 0) -> Course:
    """Play a game on a log to its end; the seed is that of what an attack draws."""
    simulation = Simulation(scenario, attack, list(detectors), seed=seed, fidelity=FIDELITY)
    simulation.reset()
    simulation.resolve()
    time, statistics, errors = [], [], []
    for _ in range(scenario.timeline.num_epochs):
        epoch = simulation.observe()
        time.append(float(epoch.time[0]))
        statistics.append([float(values[0]) for values in epoch.statistics.values()])
        simulation.resolve()
        errors.append(float(horizontal(simulation.error)[0]))
    return Course(np.array(time), np.array(statistics).T.reshape(len(detectors), -1), np.array(errors))


def recorded_matrices(
    scenario: Scenario,
    detectors: Sequence[Detector],
    attacks: Sequence[Attack],
    probability: float,
    games: int = GAMES,
    seed: int = 0,
    progress: Progress = silent,
) -> Iterator[dict[str, Any]]:
    """The ``"matrix"`` report of a log after the clean games and after every attack; the last one is whole.

    Every detector plays by itself.

    An alarm is owed to an attack if the detector does not alarm at this epoch of the clean log.

    Args:
        scenario: the log; with a ``horizon`` games have so many epochs, else `HORIZON`.
        detectors: with or without thresholds.
        attacks: that begin with each game.
        probability: of a false alarm per epoch, to which thresholds are set on the clean games.
        games: of each attack, which begin at equal distances along the log.
        seed: of what an attack draws in each of them; nothing else on a log is drawn.
        progress: shows what is played.

    Raises:
        ValueError: what does not fit the log, or a log that is too short.
    """
    places = starts(scenario, detectors, games)
    with progress("thresholds"):
        ready, refused = those_with_thresholds(places, detectors, probability)
    if not ready:
        raise ValueError("; ".join(refused.values()))
    thresholds = np.array([detector.threshold for detector in ready])
    with progress("clean"):
        clean = [play(place, None, ready) for place in places]
    false = [course.statistic > thresholds[:, None] for course in clean]
    head = {
        "schema_version": SCHEMA_VERSION,
        "kind": "matrix",
        "scenario": scenario.name,
        "fidelity": FIDELITY,
        "arl0": None,
        "false_alarm_probability": probability,
        "episodes": len(places),
        "detectors": [
            {"name": detector.name, "threshold": detector.threshold, "arl0": None, "arl0_ci95": None}
            for detector in ready
        ],
    }
    tail: dict[str, Any] = {"curves": [], "learned": [], "left_out": list(refused.values())}
    rows = _rows(CLEAN, ready, clean, false)
    yield {**head, "rows": list(rows), **tail}
    for attack in attacks:
        with progress(attack.name):
            played = [play(place, copy.deepcopy(attack), ready, seed) for place in places]
        owed = [
            (course.statistic > thresholds[:, None]) & ~alarms for course, alarms in zip(played, false, strict=True)
        ]
        rows += _rows(attack.name, ready, played, owed)
        yield {**head, "rows": list(rows), **tail}


def starts(scenario: Scenario, detectors: Sequence[Detector], games: int) -> list[Scenario]:
    """Games that begin at equal distances along the log.

    Raises:
        ValueError: the log is too short for one, or is spoofed itself.
    """
    games = validation.whole(OWNER, "episodes", games, 1)
    log = recorded_family(scenario)
    if log.attacked and log.spoofed_within:
        raise ValueError(
            f"scenario {scenario.name!r} is one game, that of the attack in its ranges: 'spoofgym evaluate recorded' "
            "plays it; without attack=recorded games end before the attack"
        )
    time = log.epoch_time
    for detector in detectors:
        detector.bind(1, scenario.dimension)
    memory = max((detector.memory for detector in detectors), default=0)
    begin = max(int(np.searchsorted(time, log.align_time + SETTLING)), memory)
    given = scenario.timeline.num_epochs
    horizon = given if given < len(time) // 4 else HORIZON
    last = len(time) - 1 - horizon
    if last < begin:
        raise ValueError(
            f"scenario {scenario.name!r}: the log is too short for games of {horizon} epochs; give it a shorter horizon"
        )
    chosen = np.unique(np.linspace(begin, last, games).astype(int)).tolist()
    return [scenario.changed(onset=float(time[first]), horizon=horizon) for first in chosen]


def _rows(
    attack: str, detectors: Sequence[Detector], courses: Sequence[Course], alarms: Sequence[Flags]
) -> list[dict[str, Any]]:
    rows = []
    for place, detector in enumerate(detectors):
        first = [int(flags[place].argmax()) if flags[place].any() else None for flags in alarms]
        found = [(course, k) for course, k in zip(courses, first, strict=True) if k is not None]
        errors = [0.0 if k is not None else float(course.error[-1]) for course, k in zip(courses, first, strict=True)]
        late = sorted(float(course.time[k] - course.time[0]) for course, k in found)
        needed = (len(courses) + 1) // 2
        rows.append(
            {
                "detector": detector.name,
                "attack": attack,
                "detection_probability": len(found) / len(courses),
                "ci95": exact_interval(len(found), len(courses)),
                "median_time_to_detect_s": late[needed - 1] if len(late) >= needed else None,
                "error_at_detection_m": _mean([float(course.error[k]) for course, k in found]),
                "mean_undetected_error_m": _mean(errors),
            }
        )
    return rows


def _mean(values: Sequence[float]) -> float | None:
    known = [value for value in values if np.isfinite(value)]  # a hole in the reference has no errors
    return float(np.mean(known)) if known else None
