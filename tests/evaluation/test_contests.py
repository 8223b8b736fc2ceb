"""What decides a support: each player against the equilibrium without it, on games of common random numbers."""

import numpy as np
import pytest

from spoofgym.evaluation.contests import CONTESTS, Contest, nash_contests, stackelberg_contests
from spoofgym.evaluation.payoff import META_STRATEGIES, nash, stackelberg


def test_without_whoever_is_mixed_in_the_game_is_worth_less_to_its_side() -> None:
    """The sum of a contest bounds what the value loses without the player, and is positive for those who are missed."""
    rng = np.random.default_rng(2)
    for shape in ((2, 2), (3, 4), (5, 3)):
        for _ in range(10):
            matrix = rng.normal(size=shape)
            exact = nash(matrix)
            contests = nash_contests(matrix, exact)
            assert len(contests) == sum(shape)
            for place, contest in enumerate(contests):
                axis, index = (0, place) if place < shape[0] else (1, place - shape[0])
                loss = (exact.value - nash(np.delete(matrix, index, axis=axis)).value) * (1 - 2 * axis)
                gain = float((contest.weights * matrix).sum())
                assert contest.mixed == (gain > 0.0) == (loss > 1e-9)
                assert gain >= loss - 1e-9 or not contest.mixed
                assert contest.weights.sum() == pytest.approx(0.0, abs=1e-12)  # a constant payoff decides nothing


def test_a_player_alone_is_in_no_contest() -> None:
    assert nash_contests(np.array([[1.0]]), nash([[1.0]])) == []
    assert len(nash_contests(np.array([[1.0, 2.0]]), nash([[1.0, 2.0]]))) == 2  # of the two defenders


def test_the_defender_that_commits_is_compared_with_every_other_by_their_worst_cases() -> None:
    matrix = np.array([[4.0, 1.0, 9.0], [0.0, 5.0, 9.0]])
    found = stackelberg_contests(matrix, stackelberg(matrix))
    # the second spoofer against the first one; the second and the third defender against the first one
    assert [float((contest.weights * matrix).sum()) for contest in found] == [-4.0, -1.0, -5.0]
    assert not any(contest.mixed for contest in found)
    assert set(CONTESTS) == set(META_STRATEGIES)
    assert CONTESTS["uniform"](matrix, META_STRATEGIES["uniform"](matrix)) == []


def test_intervals_decide() -> None:
    """Means of 1 and of 0.01 with a deviation of 1 over 100 games; equal games decide nothing more."""
    noise = np.random.default_rng(4).normal(size=100)
    noise = (noise - noise.mean()) / noise.std()
    for mixed, there, elsewhere in ((True, True, False), (False, False, True), (None, True, True)):
        contest = Contest(np.zeros((1, 1)), mixed)
        assert contest.decided(noise + 1.0, 10.0) is there
        assert contest.decided(noise - 1.0, 10.0) is elsewhere
        assert not contest.decided(noise + 0.01, 10.0)
        assert contest.tied(np.full(100, 1e-12), 10.0)
        assert not contest.tied(noise, 10.0)
