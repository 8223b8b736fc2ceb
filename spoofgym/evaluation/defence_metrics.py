"""Figures of merit of a defender, with their intervals, and paired differences between defenders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.evaluation.defence import DefenceEpisodes
from spoofgym.evaluation.metrics import mean_interval

STEADY = 20
"""GNSS counts as used again from the epoch on after which no fix is excluded for so many epochs, or to the end."""
NEVER = -1


@dataclass(frozen=True)
class DefenderScore:
    """What a defender achieved.

    Attributes:
        episodes: games played.
        mean_error: of the real-time output over all decisions of all games, m.
        interval: its 95 % interval, m.
        rmse: root mean square of the error from the onset to the end, during and after the attack, m; of whole games
            where there is no attack.
        max_error: mean over games of the largest error in that stretch, m.
        detection_probability: share of the attacked games in which a fix was excluded during the attack; None without
            any attack.
        median_time_to_detect: from the first spoofed fix to the first exclusion during the attack, s; None if fewer
            than half of the attacks were detected (censored by their end).
        error_at_detection: mean error of the estimate after that decision, m; None if there was none.
        median_time_to_reuse: from the attack's end until GNSS is used without interruption, s, among attacks that end
            in the game; None if more than half never see it, or if no attack ends.
        never_reused: share of the attacks that end in the game after which it is never used so; None if none ends.
        clean_exclusion: share of clean fixes that were excluded.
        false_alarms: exclusions begun on clean fixes before an attack per epoch at risk of one; None if there is no
            such epoch.
    """

    episodes: int
    mean_error: float
    interval: tuple[float, float]
    rmse: float
    max_error: float
    detection_probability: float | None
    median_time_to_detect: float | None
    error_at_detection: float | None
    median_time_to_reuse: float | None
    never_reused: float | None
    clean_exclusion: float
    false_alarms: float | None


def defender_score(episodes: DefenceEpisodes) -> DefenderScore:
    """All figures of one defender on some games."""
    per_game = episodes.error.mean(axis=1)
    stretch = _from_onset(episodes)
    excluded = episodes.excluded & episodes.available
    detected = first_exclusion(episodes)
    spoofed = episodes.attacked.any(axis=1)
    found = np.flatnonzero(spoofed & (detected != NEVER))
    begun = onset(episodes)[found]
    reuse, ends = time_to_reuse(episodes)
    again = np.flatnonzero(ends & (reuse != NEVER))
    over = last_spoofed(episodes)[again] + 1
    between = episodes.timeline.between
    return DefenderScore(
        episodes=len(per_game),
        mean_error=float(per_game.mean()),
        interval=mean_interval(per_game),
        rmse=math.sqrt(float((episodes.error**2)[stretch].mean())),
        max_error=float(np.where(stretch, episodes.error, 0.0).max(axis=1).mean()),
        detection_probability=float((detected[spoofed] != NEVER).mean()) if spoofed.any() else None,
        median_time_to_detect=_censored_median(between(begun, begun + detected[found]), int(spoofed.sum())),
        error_at_detection=_error_at_detection(episodes, detected),
        median_time_to_reuse=_censored_median(between(over, over + reuse[again]), int(ends.sum())),
        never_reused=float((reuse[ends] == NEVER).mean()) if ends.any() else None,
        clean_exclusion=float(excluded[episodes.clean].mean()) if episodes.clean.any() else 0.0,
        false_alarms=false_alarm_rate(episodes),
    )


def onset(episodes: DefenceEpisodes) -> Runs:
    """First spoofed epoch of each game, (n,); K where there is none."""
    spoofed = episodes.attacked
    return np.where(spoofed.any(axis=1), spoofed.argmax(axis=1), spoofed.shape[1])


def last_spoofed(episodes: DefenceEpisodes) -> Runs:
    """Last spoofed epoch of each game, (n,); K - 1 where there is none."""
    return np.asarray(episodes.attacked.shape[1] - 1 - episodes.attacked[:, ::-1].argmax(axis=1))


def _from_onset(episodes: DefenceEpisodes) -> Flags:
    """Epochs during and after the attack, (n, K); whole games where there is none."""
    first, epochs = onset(episodes), np.arange(episodes.error.shape[1])
    first = np.where(first == len(epochs), 0, first)
    return epochs >= first[:, None]


def first_exclusion(episodes: DefenceEpisodes) -> Runs:
    """Epochs from the onset to the first exclusion of a fix during the attack, (n,); -1 = never."""
    hit = episodes.attacked & episodes.excluded & episodes.available
    return np.where(hit.any(axis=1), hit.argmax(axis=1) - onset(episodes), NEVER)


def _error_at_detection(episodes: DefenceEpisodes, detected: Runs) -> float | None:
    games = np.flatnonzero(detected != NEVER)
    if len(games) == 0:
        return None
    return float(episodes.error[games, (onset(episodes) + detected)[games]].mean())


def time_to_reuse(episodes: DefenceEpisodes) -> tuple[Runs, Flags]:
    """Epochs from the attack's end until GNSS is used without interruption.

    An epoch without a fix neither counts as use nor interrupts it.

    Returns:
        Epochs (n,), -1 = never; whether the attack ends in the game, (n,).
    """
    count, epochs = episodes.attacked.shape
    last = last_spoofed(episodes)
    ends = episodes.attacked.any(axis=1) & (last < epochs - 1)
    excluded = episodes.excluded & episodes.available
    # fixes excluded from each epoch on, over the next STEADY epochs
    summed = np.zeros((count, epochs + STEADY + 1), dtype=np.int64)
    summed[:, 1 : epochs + 1] = excluded.cumsum(axis=1)
    summed[:, epochs + 1 :] = summed[:, epochs : epochs + 1]
    steady = summed[:, STEADY : STEADY + epochs] == summed[:, :epochs]
    after = steady & episodes.available & (np.arange(epochs) > last[:, None])
    reuse = np.where(after.any(axis=1), after.argmax(axis=1) - last - 1, NEVER)
    return reuse, ends


def false_alarm_rate(episodes: DefenceEpisodes) -> float | None:
    """Exclusions begun on clean fixes before any attack, per epoch at which one could begin."""
    before = np.arange(episodes.error.shape[1]) < onset(episodes)[:, None]
    at_risk = before & episodes.clean & ~_excluded_before(episodes)
    return float((episodes.excluded & at_risk).sum() / at_risk.sum()) if at_risk.any() else None


def _excluded_before(episodes: DefenceEpisodes) -> Flags:
    """Whether the latest fix before each epoch was excluded, (n, K): an exclusion lasts through an outage."""
    epochs = episodes.available.shape[1]
    latest = np.maximum.accumulate(np.where(episodes.available, np.arange(epochs), -1), axis=1)[:, :-1]
    before = np.zeros_like(episodes.excluded)
    before[:, 1:] = np.take_along_axis(episodes.excluded, np.maximum(latest, 0), axis=1) & (latest >= 0)
    return before


def _censored_median(times: Floats, cases: int) -> float | None:
    """The time, s, by which half of all cases have come; those that are missing never did."""
    needed = (cases + 1) // 2
    if cases == 0 or len(times) < needed:
        return None
    return float(np.sort(times)[needed - 1])


@dataclass(frozen=True)
class Difference:
    """Mean error of one defender minus that of another on the same games.

    Attributes:
        mean: m; negative where the first is better.
        interval: its 95 % interval, m.
    """

    mean: float
    interval: tuple[float, float]


def paired_difference(one: DefenceEpisodes, other: DefenceEpisodes) -> Difference:
    """Of the mean errors of two defenders on common episodes.

    Raises:
        ValueError: the episodes are not the same: another opponent, or other epochs under attack.
    """
    same = one.error.shape == other.error.shape and np.array_equal(one.member, other.member)
    if not same or not np.array_equal(one.attacked, other.attacked):
        raise ValueError("the defenders were not played on the same episodes")
    return difference(one.error.mean(axis=1), other.error.mean(axis=1))


def difference(one: Floats, other: Floats) -> Difference:
    """Of paired values, (n,)."""
    return Difference(float((one - other).mean()), mean_interval(one - other))
