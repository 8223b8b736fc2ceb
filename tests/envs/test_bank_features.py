"""What a defender sees of a bank of hypotheses: the solutions that it can choose, and what they are expected to err."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from spoofgym.envs.checker import check_vector_env
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.vector import DefenderVectorEnv
from spoofgym.navigation.error_model import POSITION
from spoofgym.streams import RunStreams

BANK = "multiple-hypothesis:hypotheses=4"
SHORT: dict[str, Any] = {"scenario": "foi-drive:horizon=40", "detectors": "snapshot", "bank": BANK}
SHORTER = SHORT | {"scenario": "foi-drive:horizon=25"}


def games(lanes: int, **arguments: Any) -> DefenderGame:
    game = DefenderGame(DefenderConfig(**(SHORT | arguments)), lanes, streams=RunStreams.from_seed(3, lanes))
    game.reset(np.arange(lanes))
    return game


def test_the_entries_follow_those_of_a_game_without_a_bank() -> None:
    with_bank, without = games(1), games(1, bank=None)
    plain = len(without.fields)
    assert with_bank.fields[:plain] == without.fields
    assert [field.name for field in with_bank.fields[plain:]][:5] == [
        "expected error now, fix used",
        "expected error ahead, fix used",
        "expected error now, fix left out",
        "expected error ahead, fix left out",
        "expected gain of exclusion",
    ]
    assert len(with_bank.fields) == plain + 12 + len(with_bank.seat.depths)
    np.testing.assert_array_equal(with_bank.observation()[:, :plain], without.observation())


def test_every_choice_becomes_what_was_appraised() -> None:
    """Where the filter stands after a decision is what the appraisal says of it, told by the navigator's own error."""
    game, rng = games(6, attacks="ramp:1", clean=0.0), np.random.default_rng(5)
    lanes = np.arange(6)
    for _ in range(40):
        bank, navigator = game.seat.features.bank, game.simulation.navigator
        assert bank is not None
        unaided = navigator.error + navigator.auxiliary[:, POSITION]
        actions = np.stack([rng.random(6) < 0.4, rng.integers(0, 6, 6)], axis=1).astype(np.int64)
        reads_depth = (actions[:, 0] == 1) & ~game.seat.excluding
        choice = np.where(actions[:, 0] == 0, 0, 1 + np.where(reads_depth, actions[:, 1], 0))
        expected = unaided[:, :2] - bank.appraisal.place[lanes, choice, :2]
        game.step(actions)
        np.testing.assert_allclose(game.seat.error, np.hypot(*expected.T), atol=1e-9)


def test_expected_errors_are_those_that_come() -> None:
    """In the linear game on which the bank's filters run, its expectation of a clean game's error is right on average.

    400 games of 30 epochs without outage or multipath: the mean error has a standard deviation of about 0.01 m between
    such samples, so that 0.1 m is ten of it.
    """
    game = games(400, clean=1.0, outage=0.0, multipath=0.0, bank="multiple-hypothesis:hypotheses=4,hidden=0")
    expected, found = [], []
    for _ in range(30):
        bank = game.seat.features.bank
        assert bank is not None
        expected.append(bank.appraisal.error[:, 0, 0].mean())
        game.step(np.zeros((400, 2), dtype=np.int64))
        found.append(game.seat.error.mean())
    # √(|μ|² + tr Σ) stands for the mean distance, which is up to √(4/π) less
    assert np.mean(found) - 0.1 < np.mean(expected) < 1.13 * np.mean(found) + 0.1


def test_the_gain_asks_for_no_more_than_the_action_can() -> None:
    """Whoever is excluding already cannot go back: the gain is then that of leaving the fix out, at no depth."""
    game = games(4, attacks="jump:40,onset=30", clean=0.0)
    exclude = np.array([[1, 0]] * 4)
    for _ in range(20):
        game.step(exclude)
        bank = game.seat.features.bank
        assert bank is not None
        error = bank.appraisal.error.mean(axis=2)
        np.testing.assert_allclose(bank.gain, error[:, 0] - error[:, 1])
        assert not bank.place.any()


def test_equal_to_single_environments() -> None:
    check_vector_env(
        lambda num_envs, mode: DefenderVectorEnv(num_envs, autoreset_mode=mode, **SHORTER),
        lambda: gym.make("spoofgym/Defender-v0", **SHORTER),
        num_steps=60,
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"bank": "exclude"}, "Defender-v0: bank: a bank is spelled multiple-hypothesis"),
        ({"bank": "multiple-hypothesis:limit=50"}, "Defender-v0: bank: the entries of a bank are errors in metres"),
        ({"bank": 3}, "Defender-v0: bank"),
        ({"scenario": "song-robot"}, "Defender-v0: bank: .*song-robot"),
    ],
    ids=str,
)
def test_what_is_no_bank_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        DefenderEnv(**(SHORT | arguments))


def test_same_step_mode_forgets_the_game_before() -> None:
    """A lane that begins anew sees what the first game of a fresh vector environment would."""
    given = SHORTER | {"clean": 1.0}
    vector = DefenderVectorEnv(3, autoreset_mode=AutoresetMode.SAME_STEP, **given)
    vector.reset(seed=1)
    for _ in range(25):
        observation, *_ = vector.step(np.zeros((3, 2), dtype=np.int64))
    names = [field.name for field in vector.game.fields]
    assert (observation[:, names.index("probability of a pull")] < 0.2).all()
    assert (observation[:, names.index("elapsed fraction of the game")] == 0.0).all()
