"""Attacks side by side in one simulation: each run is what it is alone."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.profiles import NoAttack
from spoofgym.attacks.staggered import Staggered, Stretch
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

SCENARIO = "foi-drive:horizon=30"
NAMES = ("ramp:2", "frozen", "jump-ramp:0,jump=20", "circle:20")
STRETCHES = ((4, 20), (9, 25), (9, 25), (0, 30))


def errors(attack: object, runs: int) -> np.ndarray:
    """After each epoch, (K, N, 3), m, on the same noise in every run."""
    streams = RunStreams([np.random.default_rng(7)] * runs)
    simulation = Simulation(make_scenario(SCENARIO), attack, [], num_runs=runs, streams=streams)  # type: ignore[arg-type]
    simulation.reset()
    found = []
    for _ in range(30):
        simulation.resolve()
        simulation.observe()
        found.append(simulation.error.copy())
    return np.array(found)


@pytest.fixture(scope="module")
def together() -> np.ndarray:
    stretches = [Stretch(make_attack(name), *ends) for name, ends in zip(NAMES, STRETCHES, strict=True)]
    return errors(Staggered([*stretches, Stretch(NoAttack(), 0, 30)]), 5)


@pytest.mark.parametrize("run", range(len(NAMES)))
def test_until_its_end_a_run_is_that_of_the_attack_alone(run: int, together: np.ndarray) -> None:
    first, last = STRETCHES[run]
    onset = make_scenario(SCENARIO).timeline.times[first]
    alone = errors(make_attack(f"{NAMES[run]},onset={onset:.17g}"), 1)
    np.testing.assert_array_equal(together[:last, run], alone[:last, 0])
    assert np.abs(together[last - 1, run] - together[last - 1, 4]).max() > 5.0


def test_before_its_stretch_a_run_is_clean(together: np.ndarray) -> None:
    np.testing.assert_array_equal(together[:9, 1], together[:9, 4])
    np.testing.assert_array_equal(together[:, 4], errors(None, 1)[:, 0])


def test_after_its_stretch_position_and_velocity_are_true() -> None:
    timeline = Timeline.steady(100.0, 0.5, 20)
    attack = Staggered([Stretch(make_attack("ramp:2"), 3, 10), Stretch(make_attack("ramp:4"), 5, 20)])
    attack.bind(timeline, 2)
    attack.follow(np.zeros((21, 3)))
    attack.reset(np.arange(2), RunStreams.from_seed(0, 2))
    sent, active, rate = [], [], np.ones((2, 3))
    for index, time in enumerate(timeline.times):
        clock = Clock(np.full(2, index), np.full(2, time))
        sent.append(attack.offset(clock)[:, 0])
        active.append(attack.active(clock))
        np.testing.assert_array_equal(attack.velocity(clock, rate), np.where(active[-1][:, None], rate, 0.0))
    index = np.arange(21)
    np.testing.assert_allclose(np.array(sent)[:, 0], np.where(index <= 10, 1.0 * np.maximum(index - 3, 0), 0.0))
    np.testing.assert_allclose(np.array(sent)[:, 1], 2.0 * np.maximum(index - 5, 0))
    assert np.array(active).sum(axis=0).tolist() == [7, 15]


def test_as_many_runs_as_attacks() -> None:
    with pytest.raises(ValueError, match="1 attacks cannot be those of 2 runs"):
        errors(Staggered([Stretch(make_attack("ramp:2"), 0, 30)]), 2)
