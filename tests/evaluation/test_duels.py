"""Cells of a payoff matrix: what a duel is worth, whoever sits where, and whatever the batches."""

import re
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import DuelGame
from spoofgym.evaluation import duels
from spoofgym.evaluation.duels import check_players, harms, play_cell, play_matrix, with_detectors_of
from spoofgym.streams import RunStreams

CONFIG = DuelConfig(scenario="foi-drive:horizon=30", detectors=("snapshot",))
WATCHED = "windowed:n=5,threshold=60 > exclude:reuse=5"


def test_a_cell_does_not_depend_on_its_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = play_cell(CONFIG, "ramp:1", "snapshot > exclude:reuse=5", 20, 3)
    monkeypatch.setattr(duels, "LANES", 7)
    parts = play_cell(CONFIG, "ramp:1", "snapshot > exclude:reuse=5", 20, 3)
    np.testing.assert_array_equal(whole.harm, parts.harm)
    np.testing.assert_array_equal(whole.clean, parts.clean)
    assert 0 < whole.clean.sum() < 20
    low, high = whole.interval
    assert low < whole.mean < high


def test_it_is_worth_what_the_same_play_is_from_outside() -> None:
    """Nobody attacks, and no fix is used: an agent outside that sends nothing and excludes all."""
    cell = play_cell(CONFIG, "none", "always-exclude", 6, 3)
    game = DuelGame(CONFIG, 6, streams=RunStreams.from_seed(3, 6))
    game.reset(np.arange(6))
    for _ in range(30):
        game.step({"spoofer": np.zeros((6, 3)), "defender": np.tile([1, 0], (6, 1))})
    np.testing.assert_array_equal(cell.harm, game.harm.total)


def test_all_cells_of_a_matrix_meet_the_same_noise() -> None:
    cells = play_matrix(CONFIG, ("none", "ramp:1"), ("snapshot > latch", WATCHED, "always-use"), 10, 3)
    assert [[cell.defender for cell in row] for row in cells] == [["snapshot > latch", WATCHED, "always-use"]] * 2
    found = harms(cells)
    assert found.shape == (2, 3, 10)
    clean = cells[0][0].clean
    assert all((cell.clean == clean).all() for row in cells for cell in row)
    # a clean game is one game, whoever would have attacked
    np.testing.assert_array_equal(found[0][:, clean], found[1][:, clean])
    alone = play_cell(with_detectors_of(CONFIG, (WATCHED,)), "ramp:1", WATCHED, 10, 3)
    np.testing.assert_array_equal(alone.harm, found[1, 1])


def test_detectors_that_defenders_follow_are_added_once() -> None:
    config = with_detectors_of(CONFIG, ("snapshot > latch", WATCHED, "px4-auto", WATCHED))
    assert config.detectors == ("snapshot", "windowed:n=5,threshold=60")


def test_the_detectors_of_a_pool_are_watched_too() -> None:
    pool = "pool:snapshot > latch+windowed:n=5/threshold=60 > exclude+px4-auto,weights=1+1+2"
    config = with_detectors_of(replace(CONFIG, detectors=("ewma:threshold=50",)), (pool,))
    assert config.detectors == ("ewma:threshold=50", "snapshot", "windowed:n=5,threshold=60")


def test_a_filter_that_diverges_is_counted_once() -> None:
    """A jump of 60 km that is used ends the solution of the strapdown fidelity; the rest is worth the cap."""
    config = DuelConfig(scenario="foi-drive:horizon=12", detectors="snapshot", fidelity="strapdown", clean=0.0)
    cell = play_cell(config, "jump:6000000", "always-use", 2, 3)
    assert (cell.harm <= 200.0).all()
    assert (cell.harm > 150.0).all()


@pytest.mark.parametrize(
    ("side", "player", "message"),
    [
        ("spoofer", "unsen:4", "duel: spoofer: unknown attack 'unsen': did you mean 'unseen'?"),
        ("spoofer", "policy:nobody", "duel: spoofer: 'nobody' is no run folder"),
        ("defender", "snapshot > nothing", "duel: defender: unknown response 'nothing'"),
        ("defender", "policy:nobody", "duel: defender: 'nobody' is no run folder"),
        ("defender", "pool:always-use+policy:nobody", "duel: defender: 'nobody' is no run folder"),
    ],
)
def test_unknown_players_are_refused_before_thresholds_are_calibrated(
    side: str, player: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spoofgym.envs.duel_game.calibrated_for_play", pytest.fail)
    config = DuelConfig(scenario="foi-drive:horizon=22", detectors=("snapshot", "windowed:n=7"))
    players = ((player,), ()) if side == "spoofer" else ((), (player,))
    with pytest.raises(ValueError, match=re.escape(message)):
        check_players(config, *players)


def test_bad_input() -> None:
    with pytest.raises(ValueError, match="at least one spoofer and one defender"):
        play_matrix(CONFIG, (), ("always-use",), 10, 3)
    with pytest.raises(ValueError, match="duel: spoofer: unknown attack 'nobody'"):
        play_cell(CONFIG, "nobody", "always-use", 10, 3)
    with pytest.raises(ValueError, match="duel: defender: unknown response 'nobody'"):
        play_cell(CONFIG, "none", "nobody", 10, 3)
    with pytest.raises(ValueError, match="episodes must be"):
        play_cell(CONFIG, "none", "always-use", 0, 3)
