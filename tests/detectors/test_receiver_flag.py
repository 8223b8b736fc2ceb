"""The model of a receiver's own flag: a chain of two states whose probabilities are known."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
from scipy.stats import binom

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import Clock, Epoch
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

CHANCE = 1e-8
SCENARIO = "foi-drive:horizon=60"
RUNS = 800


def flags(detector: str, attack: str = "none", runs: int = RUNS, seed: int = 1, **options) -> np.ndarray:
    """Whether the flag is on at epochs 0..60, (61, N)."""
    made = None if attack == "none" else make_attack(attack)
    scenario, watching = make_scenario(SCENARIO), [make_detector(detector)]
    simulation = Simulation(scenario, made, watching, num_runs=runs, seed=seed, **options)
    simulation.reset()
    seen = [simulation.alarm.copy()]
    for _ in range(60):
        simulation.resolve()
        simulation.observe()
        seen.append(simulation.alarm.copy())
    return np.array(seen)


def share(count: int, number: int, probability: float) -> bool:
    return bool(binom.ppf(CHANCE, number, probability) <= count <= binom.isf(CHANCE, number, probability))


def test_it_fires_at_the_transition_and_flickers() -> None:
    """Onset at epoch 0: the first counterfeit fix is epoch 1. Then on and off as the chain says."""
    on = flags("receiver-flag:detects=0.7,lasts=2,flickers=10", "ramp:0.5")
    assert share(int(on[1].sum()), RUNS, 0.7)
    stays, comes = math.exp(-1.0 / 2.0), -math.expm1(-1.0 / 10.0)
    before, after = on[1:-1], on[2:]
    assert share(int((before & after).sum()), int(before.sum()), max(stays, comes))
    assert share(int((~before & after).sum()), int((~before).sum()), comes)


def test_it_fires_when_the_attack_ends_too() -> None:
    on = flags("receiver-flag:detects=1,lasts=1e-3,flickers=1e9,arl0=1e9", "jump:end=45,onset=30")
    start = make_scenario(SCENARIO).timeline.start
    first, last = round(30 - start) + 1, round(45 - start) + 1
    assert on.any(axis=1).nonzero()[0].tolist() == [first, last]
    assert on[[first, last]].all()


def test_clean_epochs_to_the_first_false_alarm() -> None:
    """Geometric with the probability 1/arl0: at least one in 61 epochs."""
    on = flags("receiver-flag:arl0=50")
    assert share(int(on.any(axis=0).sum()), RUNS, 1.0 - (1.0 - 1.0 / 50.0) ** 61)
    assert not flags("receiver-flag:arl0=1e9", runs=20).any()


def test_a_run_has_its_own_draws() -> None:
    """The same for any number of runs, and nothing else in the game moves."""
    whole = flags("receiver-flag:arl0=20", "ramp:0.5", runs=12)
    one = flags("receiver-flag:arl0=20", "ramp:0.5", runs=1, seed=1 + 7)
    np.testing.assert_array_equal(whole[:, 7], one[:, 0])
    scenario = make_scenario(SCENARIO)
    played = []
    for detectors in ([make_detector("snapshot")], [make_detector("snapshot"), make_detector("receiver-flag")]):
        simulation = Simulation(scenario, make_attack("ramp:0.5"), detectors, num_runs=3, seed=2)
        simulation.reset()
        simulation.resolve()
        played.append(simulation.observe().innovation.residual.copy())
    np.testing.assert_array_equal(*played)


def test_later_episodes_and_copies_draw_anew() -> None:
    simulation = Simulation(make_scenario(SCENARIO), None, [make_detector("receiver-flag:arl0=2")], num_runs=4, seed=5)

    def play(game: Simulation, restart: bool) -> np.ndarray:
        if restart:
            game.restart(np.arange(4))
        else:
            game.reset()
        seen = []
        for _ in range(30):
            if not restart or seen:
                game.resolve()
            game.observe()
            seen.append(game.alarm.copy())
        return np.array(seen)

    first = play(simulation, False)
    other = copy.deepcopy(simulation)
    again, copied = play(simulation, True), play(other, True)
    assert (first != again).any()
    np.testing.assert_array_equal(again, copied)


def test_it_needs_no_calibration_and_says_what_it_has() -> None:
    (ready,) = calibrated_for_play([make_detector("receiver-flag:arl0=300")], make_scenario("foi-drive"), "linear")
    assert (ready.threshold, ready.arl0, ready.name) == (0.5, 300.0, "receiver-flag:arl0=300")
    assert make_detector("receiver-flag").arl0 == 1e5


def test_without_a_game_it_stays_off() -> None:
    detector = make_detector("receiver-flag")
    detector.bind(3, 3)
    clock = Clock(np.arange(3), np.zeros(3))
    innovation = make_scenario(SCENARIO).family.blank_innovation(3)
    np.testing.assert_array_equal(detector.update(Epoch(clock.index, clock.time, innovation)), 0.0)


def test_in_an_ensemble() -> None:
    on = flags("ensemble:receiver-flag:detects=1+snapshot:threshold=1e8,threshold=1", "ramp:0.5", runs=5)
    assert on[1].all()
    assert not on[0].any()


@pytest.mark.parametrize("text", ["detects=1.5", "lasts=0", "flickers=-1", "arl0=0.5"])
def test_bad_numbers(text: str) -> None:
    with pytest.raises(ValueError, match=f"receiver-flag: {text.partition('=')[0]} must be"):
        make_detector(f"receiver-flag:{text}")
