import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(0.0, 1.0, 300)


def bound(num_runs=1, seed=0, timeline=TIMELINE):
    attack = make_attack("song-mix")
    attack.bind(timeline, num_runs)
    attack.reset(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))
    return attack


def clocks(num_runs):
    return [Clock(np.full(num_runs, k), np.full(num_runs, float(k))) for k in range(301)]


def offsets_of(attack, num_runs=1):
    """Of the whole game, (301, N, 3)."""
    return np.array([attack.offset(clock) for clock in clocks(num_runs)])


def test_spoofed_are_51_to_100_and_151_to_200():
    attack = bound(2)
    spoofed = [*range(51, 101), *range(151, 201)]
    offsets = offsets_of(attack, 2)
    assert np.flatnonzero(offsets[:, 0, 0]).tolist() == spoofed
    assert np.flatnonzero([attack.active(clock).all() for clock in clocks(2)]).tolist() == spoofed
    np.testing.assert_array_equal(offsets[..., 2], 0.0)


def test_it_is_a_jump_then_a_walk():
    """Normal tails 1e-8 per figure: eq 28 with a variance of 0.1, eq 29 with steps of 0.5 and 0.05."""
    offsets = offsets_of(bound(200), 200)[..., :2]
    jump, walk = offsets[51:101], np.diff(offsets[150:201], axis=0)
    assert abs(jump.mean() - 20.0) < 5.7 * np.sqrt(0.1 / jump.size)
    assert abs(walk.mean() - 0.5) < 5.7 * np.sqrt(0.05 / walk.size)
    assert jump.var() == pytest.approx(0.1, rel=5.7 * np.sqrt(2.0 / jump.size))
    assert walk.var() == pytest.approx(0.05, rel=5.7 * np.sqrt(2.0 / walk.size))


def test_run_i_is_the_same_for_any_number_of_runs():
    whole = offsets_of(bound(8), 8)
    np.testing.assert_array_equal(offsets_of(bound(3), 3), whole[:, :3])
    np.testing.assert_array_equal(offsets_of(bound(1, seed=5)), whole[:, 5:6])


def test_the_name_builds_it():
    assert make_attack("song-mix").name == "song-mix"


def test_a_game_that_is_too_short_is_refused():
    with pytest.raises(ValueError, match="onset 150 s lies outside the game, which runs from 0 s to 120 s"):
        bound(timeline=Timeline.steady(0.0, 1.0, 120))
