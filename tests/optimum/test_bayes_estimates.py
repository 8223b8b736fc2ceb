"""The Bayesian in whole games: its posterior is true, and nobody else errs less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.bayesian_bound import NAMES, BoundGames, BoundSettings, play_block, play_fixes
from spoofgym.evaluation.duels import play_cell
from spoofgym.optimum.bayes import POPULATION_SHAPES, Bayesian, Resolution
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

DUEL = DuelConfig(scenario="foi-drive:horizon=60", detectors="signed-mean:n=5", clean=0.2)
SETTINGS = BoundSettings(DUEL, "training", 40, 7, Resolution(growth=1.0))


@pytest.fixture(scope="module", params=POPULATION_SHAPES)
def played(request: pytest.FixtureRequest) -> tuple[BoundSettings, BoundGames]:
    settings = replace(SETTINGS, population=request.param)
    blocks = [play_block(settings, first) for first in range(0, settings.games, 20)]
    return settings, BoundGames(**{name: np.concatenate([getattr(block, name) for block in blocks]) for name in NAMES})


def test_the_posterior_expects_what_comes(played: tuple[BoundSettings, BoundGames]) -> None:
    """Six standard errors of 40 games, of the estimate and of the choice: either fails by chance with 1e-6 or so."""
    _, games = played
    for surprise in (games.harm - games.expected, games.choosing - games.choosing_expected):
        assert abs(surprise.mean()) < 6.0 * surprise.std(ddof=1) / np.sqrt(len(surprise))
    assert games.expected.mean() < 0.15 * games.trusting.mean()
    assert games.lost.max() < 3e-2


def test_nobody_errs_less_in_the_same_games(played: tuple[BoundSettings, BoundGames]) -> None:
    """Six standard errors below what is equal at worst: it fails by chance with a probability of 1e-6 or so."""
    settings, games = played
    assert (games.choosing_expected > games.expected - 1e-9).all()
    for defender in ("always-use", "always-exclude", "signed-mean:n=5 > onset-depth:reuse=12"):
        cell = play_cell(DUEL, settings.population, defender, settings.games, settings.seed)
        for harm in (games.harm, games.choosing, games.taking_back):
            difference = cell.harm - harm
            assert difference.mean() > -6.0 * difference.std(ddof=1) / np.sqrt(len(difference)), defender
        if defender.startswith("always"):
            assert cell.harm.mean() > 2.0 * games.harm.mean(), defender


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


def test_room_for_hypotheses_grows_without_a_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    played = play_fixes(DUEL, "training", RunStreams.from_seed(7, 1))
    bayesian = Bayesian(make_scenario(DUEL.scenario), "training", 0.2, Resolution(growth=4.0))
    whole = bayesian.estimates(played.of(0))
    monkeypatch.setattr("spoofgym.optimum.bayes.estimates.PLACES", 4)
    monkeypatch.setattr("spoofgym.optimum.bayes.estimates.PARTS", 4)
    grown = bayesian.estimates(played.of(0))
    assert whole.hypotheses.max() > 4
    for name in ("median", "expected", "hypotheses", "lost"):
        np.testing.assert_array_equal(getattr(grown, name), getattr(whole, name))


def test_what_is_told_is_that_of_the_attack() -> None:
    """The numbers of the attack that comes; of others any, which therefore differ from game to game."""
    settings = replace(DUEL, clean=0.0)
    streams = RunStreams.from_seed(3, 8)
    played = play_fixes(settings, "held-out", streams)
    assert played.told.shape == (8, 4, 6)
    assert len(np.unique(played.told)) == played.told.size
    again = play_fixes(settings, "held-out", RunStreams.from_seed(3, 8))
    np.testing.assert_array_equal(again.told, played.told)
    for game in range(8):
        draws = RunStreams.from_seed(3, 8)(game, "opponent").random(14)
        member = int(4 * draws[1])
        np.testing.assert_array_equal(played.told[game, member], draws[8:])


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
