"""Detectors against attacks at an equal false-alarm rate: rows, and the trade between false alarms and detection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from spoofgym.arrays import Floats
from spoofgym.calibration.thresholds import CONFIDENCE
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.metrics import attacker_score
from spoofgym.evaluation.monte_carlo import WatchedEpisodes
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.scenario import Scenario

CURVE_POINTS = 24
MOST_FALSE_ALARMS = 0.5


def exact_interval(events: int, trials: int) -> list[float]:
    """95 % interval of a probability from ``events`` in ``trials`` (Clopper and Pearson 1934)."""
    interval = stats.binomtest(events, trials).proportion_ci(CONFIDENCE, method="exact")
    return [float(interval.low), float(interval.high)]


def matrix_rows(detectors: Sequence[Detector], attack: str, games: WatchedEpisodes) -> list[dict[str, Any]]:
    """What each detector made of the games of one attack.

    Args:
        detectors: in the order of ``games``.
        attack: its name.
        games: watched by these detectors.
    """
    rows = []
    for place, detector in enumerate(detectors):
        seen = games.of(place)
        score = attacker_score(seen)
        rows.append(
            {
                "detector": detector.name,
                "attack": attack,
                "detection_probability": score.detection_probability,
                "ci95": exact_interval(int(np.count_nonzero(seen.detected)), score.episodes),
                "median_time_to_detect_s": score.median_time_to_detect,
                "error_at_detection_m": score.error_at_detection,
                "mean_undetected_error_m": score.mean_undetected_error,
            }
        )
    return rows


def detection_curve(clean: Floats, spoofed: Floats) -> list[dict[str, Any]]:
    """Detection against false alarms in a whole game, for thresholds from high to low, each with its 95 % intervals.

    Args:
        clean: highest statistic of clean games, (n,).
        spoofed: highest statistic of spoofed games, (k,).

    Returns:
        points of the curve; the first has one false alarm.
    """
    n, k = len(clean), len(spoofed)
    highest = np.sort(clean)[::-1]
    most = max(int(MOST_FALSE_ALARMS * n), 1)
    points = []
    for alarms in np.unique(np.round(np.geomspace(1, most, CURVE_POINTS)).astype(int)).tolist():
        if alarms >= n or highest[alarms - 1] == highest[alarms]:
            continue
        threshold = 0.5 * (highest[alarms - 1] + highest[alarms])
        found = int(np.count_nonzero(spoofed > threshold))
        points.append(
            {
                "false_alarm_probability": alarms / n,
                "false_alarm_ci95": exact_interval(alarms, n),
                "detection_probability": found / k,
                "detection_ci95": exact_interval(found, k),
            }
        )
    return points


def detection_curves(
    detectors: Sequence[Detector], clean: WatchedEpisodes, attack: str, games: WatchedEpisodes
) -> list[dict[str, Any]]:
    """The curve of each detector for one attack; arguments as in `matrix_rows`, and clean games beside them."""
    return [
        {
            "detector": detector.name,
            "attack": attack,
            "points": detection_curve(clean.peak[place], games.peak[place]),
        }
        for place, detector in enumerate(detectors)
    ]


def matrix_report(
    scenario: Scenario,
    fidelity: str,
    arl0: float,
    episodes: int,
    detectors: Sequence[Detector],
    rows: list[dict[str, Any]],
    curves: list[dict[str, Any]],
) -> dict[str, Any]:
    """A whole ``"matrix"`` report.

    Args:
        scenario: of the games.
        fidelity: of the simulation.
        arl0: that was asked for, epochs.
        episodes: of each attack.
        detectors: with their thresholds.
        rows: from `matrix_rows`, of all attacks.
        curves: from `detection_curves`.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "matrix",
        "scenario": scenario.name,
        "fidelity": fidelity,
        "arl0": arl0,
        "episodes": episodes,
        "detectors": [
            {
                "name": detector.name,
                "threshold": detector.threshold,
                "arl0": detector.arl0 if detector.calibrated or scenario.matched else None,
                "arl0_ci95": None if detector.arl0_interval is None else _finite(detector.arl0_interval),
            }
            for detector in detectors
        ],
        "rows": rows,
        "curves": curves,
    }


def _finite(interval: tuple[float, float]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in interval]
