"""Figures of merit of an attacker, with their intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.monte_carlo import Episodes

NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class AttackerScore:
    """What an attacker achieved against detectors that end the game.

    Attributes:
        episodes: games played.
        mean_undetected_error: mean of the final error where there was no alarm, and zero where there was, m.
        interval: its 95 % interval, m.
        detection_probability: share of games with an alarm.
        median_time_to_detect: time after the onset by which half of all games had an alarm, s; None if fewer had one
            (censored by the end).
        error_at_detection: mean error of the estimate at the first alarm, m; None if there was none.
    """

    episodes: int
    mean_undetected_error: float
    interval: tuple[float, float]
    detection_probability: float
    median_time_to_detect: float | None
    error_at_detection: float | None


def undetected_error(episodes: Episodes) -> Floats:
    """Final error where there was no alarm, else zero, (n,), m."""
    return np.where(episodes.detected, 0.0, episodes.final_error)


def mean_interval(values: Floats) -> tuple[float, float]:
    """95 % interval of a mean by the central limit theorem; a single value gives an interval of no length."""
    mean = float(np.mean(values))
    half = NORMAL_95 * float(np.std(values, ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0
    return mean - half, mean + half


def median_time_to_detect(episodes: Episodes) -> float | None:
    """Kaplan-Meier median, s: undetected games are censored at the end, so it is when half of all have alarmed."""
    n = len(episodes.alarm_epoch)
    needed = (n + 1) // 2
    found = episodes.detected
    times = np.sort(episodes.timeline.between(episodes.onset_epoch[found], episodes.alarm_epoch[found]))
    return float(times[needed - 1]) if len(times) >= needed else None


def attacker_score(episodes: Episodes) -> AttackerScore:
    """All figures of one attacker."""
    undetected = undetected_error(episodes)
    detected = episodes.detected
    return AttackerScore(
        episodes=len(undetected),
        mean_undetected_error=float(np.mean(undetected)),
        interval=mean_interval(undetected),
        detection_probability=float(np.mean(detected)),
        median_time_to_detect=median_time_to_detect(episodes),
        error_at_detection=float(np.mean(episodes.alarm_error[detected])) if detected.any() else None,
    )
