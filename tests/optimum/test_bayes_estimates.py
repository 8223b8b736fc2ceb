"""The Bayesian in whole games: its posterior is true, and nobody else errs less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.bayesian_bound import NAMES, BoundGames, BoundSettings, play_block, play_fixes
from spoofgym.evaluation.duels import play_cell
from spoofgym.optimum.bayes import Bayesian, Resolution
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

DUEL = DuelConfig(scenario="foi-drive:horizon=60", detectors="signed-mean:n=5", clean=0.2)
SETTINGS = BoundSettings(DUEL, "training", 60, 7, Resolution(growth=2.0))


@pytest.fixture(scope="module")
def games() -> BoundGames:
    blocks = [play_block(SETTINGS, first) for first in range(0, SETTINGS.games, 20)]
    return BoundGames(**{name: np.concatenate([getattr(block, name) for block in blocks]) for name in NAMES})


def test_the_posterior_expects_what_comes(games: BoundGames) -> None:
    """Six standard errors of 60 games: it fails by chance with a probability of 1e-7 or so."""
    surprise = games.harm - games.expected
    assert abs(surprise.mean()) < 6.0 * surprise.std(ddof=1) / np.sqrt(len(surprise))
    assert games.expected.mean() < 0.15 * games.trusting.mean()
    assert games.lost.max() < 1e-3


def test_nobody_errs_less_in_the_same_games(games: BoundGames) -> None:
    for defender in ("always-use", "always-exclude", "signed-mean:n=5 > onset-depth:reuse=12"):
        cell = play_cell(DUEL, "training", defender, SETTINGS.games, SETTINGS.seed)
        difference = cell.harm - games.harm
        assert difference.mean() > 3.0 * difference.std() / np.sqrt(len(difference)), defender


def test_without_attacks_it_is_the_filter() -> None:
    settings = replace(SETTINGS, duel=replace(DUEL, clean=1.0), games=4)
    found = play_block(settings, 0)
    np.testing.assert_allclose(found.harm, found.trusting, rtol=1e-9)
    np.testing.assert_allclose(found.lost, 0.0)


def test_a_fix_that_is_not_there_says_nothing() -> None:
    played = play_fixes(DUEL, "training", RunStreams.from_seed(7, 2))
    bayesian = Bayesian(make_scenario(DUEL.scenario), "training", 0.2, Resolution(growth=4.0))
    fixes = played.of(0)
    available = fixes.available.copy()
    available[20:30] = False
    noisy = fixes.residual.copy()
    noisy[20:30] += 1000.0
    fixes = replace(fixes, available=available)
    one, two = bayesian.estimates(fixes), bayesian.estimates(replace(fixes, residual=noisy))
    np.testing.assert_array_equal(one.median, two.median)
    assert (np.diff(one.expected[20:30]) > 0.0).all()


def test_what_it_does_not_exist_for_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Bayesian bound: scenario 'song-robot' has .*position alone"):
        Bayesian(make_scenario("song-robot"))
    with pytest.raises(ValueError, match="an attack needs a game of more than 20 s"):
        Bayesian(make_scenario("foi-drive:horizon=20"))
    with pytest.raises(ValueError, match="population must be"):
        Bayesian(make_scenario("foi-drive"), "drills")
    with pytest.raises(ValueError, match="fixes from ranges have no such model"):
        Bayesian(make_scenario("liu-flight:noise=ranges"))
    with pytest.raises(ValueError, match="resolution: growth must be"):
        Resolution(growth=0.0)
