"""Defenders who choose among the solutions of the filter: what they say is what the simulation does."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import DuelGame
from spoofgym.evaluation.bayesian_bound import UNAIDED, PlayedFixes, play_fixes
from spoofgym.navigation.interface import Decision
from spoofgym.optimum.bayes import LONGEST, Bayesian, Chooser, Hindsight, Resolution
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

DRIVE = DuelConfig(scenario="foi-drive:horizon=60", detectors="snapshot", clean=0.2)
SHORT = DuelConfig(scenario="liu-flight:horizon=10,rate=0.4,imu=industrial", detectors="snapshot", clean=0.2)
SEED, GAMES = 5, 4


@cache
def fixes(duel: DuelConfig) -> PlayedFixes:
    return play_fixes(duel, "training", RunStreams.from_seed(SEED, GAMES))


def errors(duel: DuelConfig, used: Flags, backtracked: Runs) -> Floats:
    """Horizontal errors (G, K, 2) of the same games in which these decisions are taken, (G, K) each."""
    game = DuelGame(duel, GAMES, spoofer="training", defender=UNAIDED, streams=RunStreams.from_seed(SEED, GAMES))
    game.reset(np.arange(GAMES))
    found = np.empty((*used.shape, 2))
    for epoch in range(used.shape[1]):
        game.simulation.resolve(Decision(used[:, epoch], backtracked[:, epoch]))
        found[:, epoch] = game.simulation.error[:, :2]
        game.simulation.observe()
    return found


@pytest.mark.parametrize("depth", [0, 60])
def test_decisions_have_the_errors_that_they_are_said_to_have(depth: int) -> None:
    scenario, played = make_scenario(DRIVE.scenario), fixes(DRIVE)
    bayesian, choosers = Bayesian(scenario, "training", 0.2, Resolution(growth=4.0)), []
    for game in range(GAMES):
        choosers.append(Chooser(scenario.linear_model(), played.of(game), depth))
        bayesian.estimates(played.of(game), choosers[-1:])
    used = np.stack([each.used for each in choosers])
    backtracked = np.stack([each.backtracked for each in choosers])
    assert (~used & played.available).any()
    assert (backtracked > 0).any() == (depth > 0)
    moved = np.stack([each.moved for each in choosers])
    np.testing.assert_allclose(errors(DRIVE, used, backtracked), played.error + moved, atol=1e-6)


@cache
def short_games() -> list[tuple[Chooser, Hindsight, Floats]]:
    """Of each the one who chooses, all sequences, and what is expected of the estimate that errs least."""
    scenario, played, found = make_scenario(SHORT.scenario), fixes(SHORT), []
    bayesian, model = Bayesian(scenario, "training", 0.2, Resolution(growth=2.0)), scenario.linear_model()
    for game in range(GAMES):
        chooser, hindsight = Chooser(model, played.of(game)), Hindsight(model, played.of(game))
        expected = bayesian.estimates(played.of(game), [chooser, hindsight]).expected
        found.append((chooser, hindsight, expected))
    return found


def test_hindsight_lies_between_the_estimate_and_the_choice() -> None:
    for game, (chooser, hindsight, expected) in enumerate(short_games()):
        assert len(hindsight.costs) == 1 << int(fixes(SHORT).available[game].sum())
        assert expected.sum() <= hindsight.costs.min() <= chooser.expected.sum() + 1e-9
        # the one who chooses takes one of the sequences
        assert np.abs(hindsight.costs - chooser.expected.sum()).min() < 1e-9


def test_a_sequence_costs_what_its_errors_are_expected_to_be() -> None:
    """The first uses no fix and the last every one; both are solutions that a Bayesian can be asked about."""
    scenario, played = make_scenario(SHORT.scenario), fixes(SHORT)
    epochs = played.residual.shape[1]
    every = np.ones((GAMES, epochs), dtype=bool)
    trusting = errors(SHORT, every, np.zeros((GAMES, epochs), dtype=np.int64)) - played.error

    class Given:
        """Adds up what is expected of a solution, by draws from the posterior."""

        def __init__(self, moved: Floats) -> None:
            self.moved, self.total, self.variance = moved, 0.0, 0.0

        def see(self, epoch: int, view) -> None:
            rng, (weight, x, y, deviation) = np.random.default_rng(epoch), view.parts[0].T
            part = rng.choice(len(weight), 20_000, p=weight)
            at = np.stack([x[part], y[part]], axis=1) + deviation[part, None] * rng.standard_normal((len(part), 2))
            distance = np.hypot(*(view.estimate[0] + at + self.moved[epoch]).T)
            self.total += distance.mean()
            self.variance += distance.var() / len(part)

    bayesian = Bayesian(scenario, "training", 0.2, Resolution(growth=2.0))
    for game in range(GAMES):
        none, all_ = Given(np.zeros((epochs, 2))), Given(trusting[game])
        bayesian.estimates(played.of(game), [none, all_])
        costs = short_games()[game][1].costs
        for given, cost in ((none, costs[0]), (all_, costs[-1])):
            assert given.total == pytest.approx(cost, abs=6.0 * np.sqrt(given.variance) + 1e-6)


def test_a_long_game_has_too_many_sequences() -> None:
    with pytest.raises(ValueError, match=f"games of at most {LONGEST} epochs, got 60"):
        Hindsight(make_scenario(DRIVE.scenario).linear_model(), fixes(DRIVE).of(0))
