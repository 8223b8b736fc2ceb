"""Cells get more games where an interval decides who is mixed in, and nowhere else; games stay paired."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from spoofgym.arrays import Floats
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.allotment import Allotment, paired
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.contests import Contest, nash_contests
from spoofgym.evaluation.duels import Cell, harms, play_cell
from spoofgym.evaluation.engine import Engine, Here, Notify
from spoofgym.evaluation.payoff import nash, value_interval

MOST = 1600


class Drawn:
    """Cells whose games are drawn: a mean each, noise that all share, and noise of each."""

    games = 100

    def __init__(self, means: Floats, own: float) -> None:
        rng = np.random.default_rng(6)
        self.harm = means[:, :, None] + 50.0 * rng.normal(size=MOST) + own * rng.normal(size=(*means.shape, MOST))
        self.played: list[dict[tuple[str, str], int]] = []

    def fill(self, wanted: Mapping[tuple[str, str], int], engine: Engine, notify: Notify) -> None:
        self.played.append(dict(wanted))

    def cell(self, spoofer: str, defender: str, games: int) -> Cell:
        harm = self.harm[int(spoofer), int(defender), :games]
        return Cell(spoofer, defender, harm, np.zeros(games, dtype=bool))


def settled(means: Floats, own: float = 1.0, most: int = MOST) -> tuple[Floats, list[list[Cell]], Drawn]:
    """The games of every cell when all is settled."""
    store = Drawn(means, own)
    rows, columns = ([str(place) for place in range(count)] for count in means.shape)
    allotment = Allotment(store, most, Here())  # type: ignore[arg-type]
    cells = allotment.settle(rows, columns, lambda mean: nash_contests(mean, nash(mean)), lambda _: None)
    return np.array([[len(cell.harm) for cell in row] for row in cells]), cells, store


def test_cells_that_decide_nothing_get_no_more_games() -> None:
    """A saddle 10 away from all others, with noise of 1 in each cell and of 50 in common: paired, 100 games decide it.

    A contest's mean has a deviation of sqrt(2) / 10, so an interval that reaches zero is 68 sigma off.
    """
    means = np.array([[10.0, 20.0, 30.0], [0.0, 40.0, 20.0], [0.0, 30.0, 30.0]])
    games, _, store = settled(means)
    assert (games == 100).all()
    assert len(store.played) == 1


def test_a_close_contest_gets_games_until_it_is_decided() -> None:
    """The second spoofer is 0.25 below the first; a third one and a third defender are far off.

    Of 100 games the difference has a deviation of 0.14, and of 1600 of 0.035: 0.25 is 7 of it, and 5 more than the
    interval needs (P = 3e-7).
    """
    means = np.array([[10.0, 30.0, 60.0], [9.75, 30.0, 60.0], [0.0, 30.0, 60.0]])
    games, cells, store = settled(means)
    weights = np.zeros((3, 3))
    weights[0, 0], weights[1, 0] = -1.0, 1.0
    assert Contest(weights, False).decided(paired(cells, weights), 60.0)
    assert games[0, 0] == games[1, 0] > 100
    assert (np.delete(games.ravel(), [0, 3]) == 100).all()
    # each time twice the games
    assert {wanted["0", "0"] for wanted in store.played} == {100 * 2**n for n in range(len(store.played))}


def test_a_tie_of_means_ends_at_the_most_games() -> None:
    """Noise alone tells them apart. Undecided at 100, 200 and 400 games: the seed is one where it is."""
    games, cells, _ = settled(np.array([[10.0], [10.0]]), most=400)
    assert (games == 400).all()
    assert not all(
        contest.decided(paired(cells, contest.weights), 10.0)
        for contest in nash_contests(harms(cells).mean(axis=2), nash(harms(cells).mean(axis=2)))
    )


def test_games_that_are_the_same_are_a_tie_from_the_beginning() -> None:
    games, _, _ = settled(np.array([[10.0, 11.0], [10.0, 11.0]]), own=0.0)
    assert (games == 100).all()


def test_games_that_are_the_same_are_played_equally_often() -> None:
    """Two spoofers who harm alike: only one of them is needed in the close contest of the first two defenders."""
    store = Drawn(np.array([[10.0, 10.0, 90.0], [10.0, 10.0, 90.0]]), 0.0)
    store.harm[:, 1] += np.random.default_rng(3).normal(size=MOST)
    allotment = Allotment(store, MOST, Here())  # type: ignore[arg-type]
    cells = allotment.settle("01", "012", lambda mean: nash_contests(mean, nash(mean)), lambda _: None)
    games = np.array([[len(cell.harm) for cell in row] for row in cells])
    assert (games[:, :2] == games[0, 0]).all()
    assert games[0, 0] > 100 == games[0, 2] == games[1, 2]


def test_a_sum_of_cells_is_over_the_games_that_all_of_them_have() -> None:
    cells = [[Cell("a", "b", np.arange(5.0), np.zeros(5, bool)), Cell("a", "c", np.ones(3), np.zeros(3, bool))]]
    np.testing.assert_array_equal(paired(cells, np.array([[2.0, -1.0]])), [-1.0, 1.0, 3.0])
    np.testing.assert_array_equal(paired(cells, np.array([[1.0, 0.0]])), np.arange(5.0))
    np.testing.assert_array_equal(paired(cells, np.zeros((1, 2))), np.zeros(3))
    padded = harms(cells)
    np.testing.assert_array_equal(padded[0, 1], [1.0, 1.0, 1.0, np.nan, np.nan])


def test_the_interval_of_the_value_takes_the_games_that_each_cell_has() -> None:
    """One cell alone: the bootstrap of a mean. With a second defender far off, the games of that one do not matter."""
    harm = np.random.default_rng(1).normal(size=400)
    alone = value_interval(harm[None, None], resamples=60)
    far = np.where(np.arange(400) < 40, 100.0, np.nan)
    assert value_interval(np.stack([harm, far])[None], resamples=60) == pytest.approx(alone, rel=1e-12)
    with pytest.raises(ValueError, match="of two games or more"):
        value_interval(np.stack([harm, np.where(np.arange(400) < 1, 1.0, np.nan)])[None])


def test_a_cell_that_grows_has_the_games_of_one_played_at_once(tmp_path: Path) -> None:
    config = DuelConfig(scenario="foi-drive:horizon=20", detectors=("snapshot",))
    whole = play_cell(config, "ramp:1", "snapshot > latch", 14, 3)
    store = CellStore(tmp_path, config, 5, 3)
    for games in (5, 9, 14, 7):
        found = store.cell("ramp:1", "snapshot > latch", games)
        np.testing.assert_array_equal(found.harm, whole.harm[:games])
        np.testing.assert_array_equal(found.clean, whole.clean[:games])
    told: list[str] = []
    wanted = {("ramp:1", "snapshot > latch"): 14, ("ramp:1", "always-use"): 5, ("none", "snapshot > latch"): 5}
    store.fill(wanted, Here(), told.append)
    assert told == ["ramp:1 against always-use", "none against snapshot > latch"]
    store.fill({("ramp:1", "always-use"): 6, ("ramp:1", "snapshot > latch"): 16}, Here(), told.append)
    assert told[2:] == ["ramp:1 against always-use, games 5 to 5", "ramp:1 against snapshot > latch, games 14 to 15"]
    grown = store.cell("ramp:1", "snapshot > latch", 16)
    np.testing.assert_array_equal(grown.harm, play_cell(config, "ramp:1", "snapshot > latch", 16, 3).harm)
