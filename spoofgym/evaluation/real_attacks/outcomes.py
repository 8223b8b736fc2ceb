"""What a detector made of the games of one attack: alarms, delays, and errors that nobody noticed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.recorded import RECOVERED
from spoofgym.geodesy import horizontal

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Game:
    """One attack in one run of a record.

    Attributes:
        time: of the epochs, (K,), s.
        first: the first attacked epoch.
        last: the last one.
        begin: the onset, the last epoch before the attack, s.
        ends: whether the attack ends before the record.
        error: horizontal, (K,), m; NaN where the truth is not known.
        apart: horizontal distance from where the filter would be without the attack, (K,), m.
        largest_offset: of the spoofed position, m.
        pull: when the pull begins, s; None = it is not stated.
    """

    time: Floats
    first: int
    last: int
    begin: float
    ends: bool
    error: Floats
    apart: Floats
    largest_offset: float
    pull: float | None = None

    @property
    def largest(self) -> float | None:
        """Error while the attack lasts, m; None = it is not known."""
        return _largest(self.error[self.first : self.last + 1])

    @property
    def recovery(self) -> float | None:
        """Time from the end of the attack until the filter is back within `RECOVERED`, for good, s.

        None = the attack does not end, or the filter does not come back within the record.
        """
        if not self.ends:
            return None
        after = self.apart[self.last + 1 :]
        away = np.flatnonzero(after > RECOVERED)
        if not len(away):
            return 0.0
        if away[-1] == len(after) - 1:
            return None
        return float(self.time[self.last + 1 + away[-1]] - self.time[self.last])


def game(
    time: Floats, active: Flags, error: Floats, solution: Floats, unspoofed: Floats, offset: Floats,
    pull: float | None = None,
) -> Game:  # fmt: skip
    """The game of one run.

    Args:
        time: of the epochs, (K,), s.
        active: whether the run is attacked, (K,).
        error: horizontal, (K,), m.
        solution: estimate less truth, (K, 3), m ENU.
        unspoofed: that without the attack, (K, 3) or (3,).
        offset: horizontal size of what is added, (K,), m.
        pull: when the pull begins, s.
    """
    during = np.flatnonzero(active)
    first, last = int(during[0]), int(during[-1])
    begin = float(time[first - 1] if first else time[0] - np.median(np.diff(time)))
    apart = horizontal(solution - unspoofed)
    return Game(time, first, last, begin, last < len(time) - 1, error, apart, float(offset.max()), pull)


def outcome(games: Sequence[Game], alarms: Sequence[Flags], clean: Sequence[Flags]) -> dict[str, Any]:
    """What one detector made of the games of one attack.

    An alarm while the attack lasts is owed to it if the clean run has none in the same epoch. Where there is no clean
    run, one that stands at the onset is not owed to it until it has gone off (`standing`).

    Args:
        games: G of them.
        alarms: of the detector in each game, (K,) each.
        clean: those that are not owed to it: of the clean run, or what stands at the onset, (K,) each.

    Returns:
        games, found and its exact interval; delay_s, its interval and each of them (None = not found); error_at_alarm_m
        and undetected_m: the largest error before the alarm, or until the end of the attack, medians and each;
        alarms_before of epochs_before; alarms_after_end; after_pull_s. None where a thing does not exist.
    """
    played = [_one(each, alarm, false) for each, alarm, false in zip(games, alarms, clean, strict=True)]
    delays = [each["delay_s"] for each in played]
    found = sum(delay is not None for delay in delays)
    return {
        "games": len(played),
        "found": found,
        "found_ci95": exact_interval(found, len(played)),
        **_median_of("delay_s", [math.inf if delay is None else delay for delay in delays]),
        **_median_of("error_at_alarm_m", [each["error_m"] for each in played if each["error_m"] is not None]),
        **_median_of("undetected_m", [each["undetected_m"] for each in played if each["undetected_m"] is not None]),
        "most_undetected_m": max((each["undetected_m"] or 0.0 for each in played), default=None),
        "alarms_before": played[0]["before"],
        "epochs_before": games[0].first,
        **_median_of("alarms_after_end", [float(each["later"]) for each in played if each["later"] is not None]),
        "after_pull_s": played[0]["pulled"],
        "delays_s": delays,
        "errors_at_alarm_m": [each["error_m"] for each in played],
        "undetected_by_game_m": [each["undetected_m"] for each in played],
    }


def standing(alarm: Flags, first: int) -> Flags:
    """The alarm that stands at the onset, until it goes off, (K,); ``first`` is the first attacked epoch."""
    stands = np.zeros_like(alarm)
    if first > 0 and alarm[first - 1]:
        off = np.flatnonzero(~alarm[first:])
        stands[first - 1 : first + int(off[0]) if len(off) else None] = True
    return stands


def _one(played: Game, alarm: Flags, clean: Flags) -> dict[str, Any]:
    owed = alarm & ~clean
    during = np.flatnonzero(owed[played.first : played.last + 1])
    found = int(played.first + during[0]) if len(during) else None
    stop = played.last + 1 if found is None else found + 1
    error = None if found is None or np.isnan(played.error[found]) else float(played.error[found])
    pulled = None
    if played.pull is not None:
        late = np.flatnonzero(alarm & (played.time >= played.pull))
        pulled = float(played.time[late[0]] - played.pull) if len(late) else None
    return {
        "delay_s": None if found is None else float(played.time[found] - played.begin),
        "error_m": error,
        "undetected_m": _largest(played.error[played.first : stop]),
        "before": int(alarm[: played.first].sum()),
        "later": int(owed[played.last + 1 :].sum()) if played.ends else None,
        "pulled": pulled,
    }


def _largest(errors: Floats) -> float | None:
    known = errors[~np.isnan(errors)]
    return float(known.max()) if len(known) else None


def _median_of(name: str, values: Sequence[float]) -> dict[str, Any]:
    """The median and its interval; None where it is infinite, or there are too few values for one."""
    middle = float(np.median(values)) if len(values) else math.inf
    return {name: middle if math.isfinite(middle) else None, f"{name}_ci95": median_interval(values)}


def median_interval(values: Sequence[float]) -> list[float | None] | None:
    """The order statistics between which the median lies with 95 % confidence or more, whatever the distribution.

    Args:
        values: independent; infinite where an event did not come.

    Returns:
        Its ends, of which one that is infinite is None. None = there are fewer than six values.
    """
    number = len(values)
    place = int(stats.binom.ppf((1.0 - CONFIDENCE) / 2.0, number, 0.5)) - 1 if number else -1
    if place < 0:
        return None
    ordered = sorted(values)
    return [end if math.isfinite(end) else None for end in (ordered[place], ordered[number - 1 - place])]
