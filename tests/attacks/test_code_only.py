"""An attack whose Doppler does not follow: what it adds to the ranges, and who refuses it."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

INSIDE = "liu-spoofer:0.5/clock_rate=2"


def first_residual(scenario, attack):
    simulation = Simulation(scenario, attack, num_runs=3, seed=5)
    simulation.reset()
    simulation.resolve()
    return simulation.observe().innovation.residual.copy()


@pytest.mark.parametrize("name", ["liu-flight:coupling=tight,horizon=10", "kujur-flight:onset=60,horizon=10"])
def test_the_codes_move_as_with_the_attack_inside_and_the_carriers_stay(name):
    scenario = make_scenario(name)
    clean = first_residual(scenario, None)
    whole = first_residual(scenario, make_attack(INSIDE.replace("/", ","))) - clean
    alone = first_residual(scenario, make_attack(f"code-only:{INSIDE}")) - clean
    slots = scenario.slots
    assert np.abs(whole[:, slots:]).max() > 0.1
    np.testing.assert_allclose(alone[:, :slots], whole[:, :slots], atol=1e-9)
    np.testing.assert_allclose(alone[:, slots:], 0.0, atol=1e-9)


def test_in_a_pool_each_run_has_the_carriers_of_its_own_opponent():
    scenario = make_scenario("liu-flight:coupling=tight,horizon=10")
    pool = AttackPool([(make_attack(f"code-only:{INSIDE}"), 1.0), (make_attack("ramp:3"), 1.0)], 0.0, "both")
    simulation = Simulation(scenario, pool, num_runs=12, seed=5)
    simulation.reset()
    simulation.resolve()
    simulation.observe()
    follows = pool.carrier(simulation.epoch)
    np.testing.assert_array_equal(follows, pool.member == 1)
    assert 0 < follows.sum() < 12  # of 12 runs with an even chance each, all alike once in 2048 seeds


def test_it_is_spelled_as_it_is_built_and_does_not_nest():
    attack = make_attack(f"code-only:{INSIDE}")
    assert make_attack(attack.name).name == attack.name == f"code-only:{INSIDE}"
    with pytest.raises(ValueError, match="must not leave the carriers true itself"):
        make_attack("code-only:code-only:ramp:1")


def test_a_filter_on_fixes_is_refused():
    with pytest.raises(ValueError, match="needs ranges to satellites"):
        Simulation(make_scenario("liu-flight"), make_attack("code-only:ramp:1"), seed=0)
