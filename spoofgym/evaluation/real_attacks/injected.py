"""Attacks that are injected into a clean record: what, from where on, and for how long."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Runs
from spoofgym.attacks import make_attack
from spoofgym.attacks.base import Attack
from spoofgym.attacks.staggered import Staggered, Stretch
from spoofgym.evaluation.real_attacks.clean_record import OWNER
from spoofgym.fitting import fit_attack
from spoofgym.navigation.facts import RANGES
from spoofgym.scenario import Scenario
from spoofgym.streams import RunStreams

INJECTED = {
    "step": "jump-ramp:0,jump=20",
    "ramp": "ramp:0.5",
    "drift": "exponential:0.05,time=15",
    "frozen": "frozen",
    "time": "time-only",
}
"""The usual ones, by the word that tables use: 20 m at once; 0.5 m/s; slow at first and ever faster, as an inertial
solution drifts, 40 m in a minute; the last position, at rest; the receiver's clock."""
LONGEST = 60.0
"""Of an attack, s."""
LEAD = 0.125
"""Share of a record before the first onset, and after the last attack."""
LEAST_OFFSET = 0.5
"""An attack that never moves a fix by this, m, is left out: a frozen fix of a vehicle that rests."""


@dataclass(frozen=True)
class Injected:
    """The games of one attack along a record.

    Attributes:
        word: by which tables name it.
        attack: of which every game gets a copy.
        stretches: epochs of each game.
    """

    word: str
    attack: Attack
    stretches: tuple[tuple[int, int], ...]

    def staggered(self) -> list[Stretch]:
        """A stretch for each game, with an attack of its own."""
        return [Stretch(copy.deepcopy(self.attack), first, last) for first, last in self.stretches]


def words_of(attacks: Sequence[str] | None) -> dict[str, str]:
    """Specifications by the words of tables; None = the usual attacks. Others are named by their specification."""
    if attacks is None:
        return dict(INJECTED)
    usual = {text: word for word, text in INJECTED.items()}
    return {usual.get(text, text): INJECTED.get(text, text) for text in attacks}


def onsets(scenario: Scenario, games: int) -> tuple[Runs, float]:
    """Epochs at equal distances along the record at which attacks begin, (G,), and how long each lasts, s.

    An attack lasts `LONGEST`, and half of the record at most; an eighth of the record lies before the first onset,
    and an eighth after the last attack.
    """
    time = scenario.timeline.times
    whole = float(time[-1] - time[0])
    lasts = min(LONGEST, 0.5 * whole)
    begin, end = time[0] + LEAD * whole, time[-1] - LEAD * whole - lasts
    chosen = np.searchsorted(time, np.linspace(begin, end, games) - 1e-6)
    return np.unique(np.clip(chosen, 1, len(time) - 2)), lasts


def injected(scenario: Scenario, words: dict[str, str], games: int) -> tuple[list[Injected], dict[str, str]]:
    """The games of every attack that the record allows, from common onsets, and why the others are left out.

    Args:
        scenario: the record.
        words: specifications by the words of tables.
        games: of each attack.
    """
    first, lasts = onsets(scenario, games)
    time = scenario.timeline.times
    last = np.searchsorted(time, time[first] + lasts + 1e-6) - 1
    stretches = tuple((int(a), int(b)) for a, b in zip(first, last, strict=True) if b > a)
    found, left_out = [], {}
    for word, text in words.items():
        one = Injected(word, make_attack(text), stretches)
        if one.attack.needs_ranges and RANGES not in scenario.offers:
            left_out[word] = f"needs {RANGES}"
            continue
        try:
            if does_something(scenario, one):
                found.append(one)
            else:
                left_out[word] = f"moves the fix by less than {LEAST_OFFSET:g} m here"
        except ValueError as error:
            left_out[word] = str(error)
    return found, left_out


def does_something(scenario: Scenario, one: Injected) -> bool:
    """Whether an attack ever moves a fix by `LEAST_OFFSET`, or acts on velocity or clock alone.

    Raises:
        ValueError: the record does not give what it needs.
    """
    if one.attack.closed_loop:
        raise ValueError(f"attack {one.attack.name!r} plays against a filter of its own: 'spoofgym evaluate recorded'")
    games = one.staggered()
    fit_attack(OWNER, Staggered(games), scenario, len(games))
    first, streams = np.array([0]), RunStreams.from_seed(0, 1)
    return not one.attack.moves_position or any(
        np.abs(game.attack.episode(first, streams)).max() >= LEAST_OFFSET for game in games
    )
