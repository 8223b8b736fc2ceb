"""One game, three views: what the seats show and pay for the same play is identical, whoever sits outside."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.defender_seat import DefenderSeat, demands_on
from spoofgym.envs.game import Game
from spoofgym.envs.policy_players import PolicySpoofer
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.envs.spoofer_seat import SpooferSeat
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

FLIGHT, LANES = "liu-flight:horizon=22,onset=300", 3
SPOOFER = SpooferConfig(scenario=FLIGHT, on_alarm="respond")
DEFENDER: dict[str, Any] = {
    "scenario": FLIGHT, "detectors": "snapshot", "clean": 0.0, "outage": 0.0, "multipath": 0.0
}


def streams() -> RunStreams:
    return RunStreams.from_seed(5, LANES)


def both_outside() -> Game:
    scenario = make_scenario(FLIGHT)
    simulation = Simulation(
        scenario,
        None,
        [make_detector("snapshot")],
        None,
        LANES,
        demands=demands_on(scenario),
        on_divergence="hold",
        streams=streams(),
    )
    spoofer = SpooferSeat(simulation, SPOOFER, ("snapshot",))
    return Game(
        simulation, spoofer=spoofer, defender=DefenderSeat(simulation, DefenderConfig(**DEFENDER), ("snapshot",))
    )


def arbitrary_policy(layout: tuple[str, ...]) -> LearnedSpoofer:
    rng, sizes = np.random.default_rng(1), [len(layout), 8, 3]
    weights = tuple(0.3 * rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])
    return LearnedSpoofer(Path("x"), {"knowledge": "shadow"}, layout, weights, biases)


def test_three_views_of_the_same_play_are_identical() -> None:
    """A policy against `exclude`: from the spoofer's seat, from the defender's, and with both from outside."""
    own = SpooferGame(SPOOFER, LANES, streams=streams())
    policy = arbitrary_policy(tuple(field.name for field in own.fields))
    other = DefenderGame(DefenderConfig(**DEFENDER, attacks=PolicySpoofer(policy, "x")), LANES, streams=streams())
    duel = both_outside()
    assert duel.spoofer is not None
    assert duel.defender is not None
    last = duel.scenario.timeline.num_epochs
    for game in (own, other, duel):
        game.reset(np.arange(LANES))
    excluded = 0
    for k in range(last):
        decisions = np.zeros((LANES, 2), dtype=np.int64)
        decisions[:, 0] = ~own.simulation.decision.use
        excluded += int(decisions[:, 0].sum())
        duel.advance(policy.act(duel.spoofer.observation()), decisions)
        other.step(decisions)
        own.step(policy.act(own.observation()))
        np.testing.assert_array_equal(duel.spoofer.observation(), own.observation())
        np.testing.assert_array_equal(duel.defender.observation(), other.observation())
        np.testing.assert_array_equal(duel.defender.reward, other.seat.reward)
        np.testing.assert_array_equal(duel.defender.outcome.terminated, own.seat.outcome.terminated)
        if k < last - 1:  # a response decides on the last fix, too; a defender outside does not
            np.testing.assert_array_equal(duel.spoofer.reward, own.seat.reward)
            np.testing.assert_array_equal(duel.spoofer.error, other.seat.error)
    assert 0 < excluded < last * LANES
    assert duel.defender.outcome.terminated.all()


def test_a_seat_that_is_filled_from_outside_needs_actions_and_nothing_is_played_without_them() -> None:
    duel = both_outside()
    assert duel.spoofer is not None
    duel.reset(np.arange(LANES))
    rates, decisions = np.zeros((LANES, 3), dtype=np.float32), np.zeros((LANES, 2), dtype=np.int64)
    for given in ((None, decisions), (rates, None), (rates, decisions + 9), (rates + np.nan, decisions)):
        with pytest.raises(ValueError, match=r"seat is filled from outside|must be whole numbers|is not finite"):
            duel.advance(*given)
        assert not duel.index.any()
    duel.advance(rates, decisions)
    assert (duel.index == 1).all()
