"""An attack that leaves the velocity of the fix true: what the receiver shows, and who refuses it."""

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.envs.opponents import spoofer_pool
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SIGMA = (0.1, 0.1, 0.2)
INSIDE = "ramp:0.5/direction=135"


@pytest.fixture(scope="module")
def flight():
    """The Liu flight with a receiver that gives velocity, too."""
    plain = make_scenario("liu-flight:horizon=40")
    receiver, tuning = plain.family.receiver, plain.family.tuning
    return plain.changed(
        name="with velocity",
        receiver=replace(receiver, velocity_sigma=SIGMA),
        tuning=replace(tuning, measurement_sigma=(*tuning.measurement_sigma, *SIGMA)),
    )


def play(scenario, attack, num_runs=3, epochs=40):
    """Innovations (epochs, N, 6) and errors (epochs, N, 3) of epochs 1, 2, ..."""
    simulation = Simulation(scenario, make_attack(attack), num_runs=num_runs, seed=5)
    simulation.reset()
    residuals, errors = [], []
    for _ in range(epochs):
        simulation.resolve()
        residuals.append(simulation.observe().innovation.residual.copy())
        errors.append(simulation.error.copy())
    return np.array(residuals), np.array(errors)


def test_the_first_spoofed_innovation_has_the_offset_and_no_rate(flight):
    """z = p_INS - p_GNSS, so that an offset s and its rate enter as -s and -ds/dt."""
    clean = play(flight, "none", epochs=1)[0][0]
    s = 0.5 * np.array([np.sin(np.radians(135.0)), np.cos(np.radians(135.0)), 0.0])
    consistent = play(flight, "ramp:0.5,direction=135", epochs=1)[0][0] - clean
    alone = play(flight, f"position-only:{INSIDE}", epochs=1)[0][0] - clean
    np.testing.assert_allclose(consistent, np.tile([*-s, *-s], (3, 1)), atol=1e-9)
    np.testing.assert_allclose(alone, np.tile([*-s, 0.0, 0.0, 0.0], (3, 1)), atol=1e-9)


def test_the_mean_innovations_are_those_of_the_recursion(flight):
    """The mean of a linear filter: d = Φ d+, z = H d - [s, 0], d+ = d - U L⁻¹ z, over epochs 1..40."""
    model = flight.linear_model()
    measured = play(flight, f"position-only:{INSIDE}")[0] - play(flight, "none")[0]
    rate = 0.5 * np.array([np.sin(np.radians(135.0)), np.cos(np.radians(135.0)), 0.0])
    state = np.zeros(15)
    for k in range(1, 41):
        state = model.transition[k] @ state
        z = model.observation[k] @ state[:9] - np.concatenate([rate * k, np.zeros(3)])
        np.testing.assert_allclose(measured[k - 1], np.tile(z, (3, 1)), atol=1e-6)
        state = state - model.whitened_gain[k].T @ np.linalg.solve(model.innovation_factor[k], z)


def test_the_filter_follows_it_less(flight):
    clean = play(flight, "none")[1][-1]
    attacks = (f"position-only:{INSIDE}", "ramp:0.5,direction=135")
    alone, consistent = (np.linalg.norm(play(flight, attack)[1][-1] - clean, axis=1) for attack in attacks)
    assert np.all(alone < 0.9 * consistent)


def test_an_offset_from_outside_brings_its_rate(flight):
    simulation = Simulation(flight, make_attack(f"position-only:{INSIDE}"), num_runs=1, seed=5)
    simulation.reset()
    simulation.resolve()
    residual = simulation.observe(np.array([[1.0, 0.0, 0.0]])).innovation.residual[0]
    clean = play(flight, "none", num_runs=1, epochs=1)[0][0, 0]
    np.testing.assert_allclose(residual - clean, [-1.0, 0.0, 0.0, -1.0, 0.0, 0.0], atol=1e-9)


def test_each_run_of_a_pool_has_the_velocity_of_its_own_opponent(flight):
    pool = AttackPool([(make_attack("ramp:0.5"), 1.0), (make_attack("position-only:ramp:2"), 1.0)], clean=0.3)
    simulation = Simulation(flight, pool, num_runs=100, seed=0)
    simulation.reset()
    clean = Simulation(flight, num_runs=100, seed=0)
    clean.reset()
    for run in (simulation, clean):
        run.resolve()
        run.observe()
    change = simulation.epoch.innovation.residual - clean.epoch.innovation.residual
    assert set(pool.member.tolist()) == {-1, 0, 1}  # one lacks with a probability below 3 x 0.7^100 < 1e-14
    np.testing.assert_allclose(change[:, 0], np.choose(pool.member + 1, [0.0, -0.5, -2.0]), atol=1e-9)
    np.testing.assert_allclose(change[:, 3], np.choose(pool.member + 1, [0.0, -0.5, 0.0]), atol=1e-9)


@pytest.mark.parametrize("outer", ["tracking-error:position-only:{},sigma=0", "position-only:tracking-error:{}"])
def test_a_tracking_error_leaves_the_velocity_true(flight, outer):
    clean = play(flight, "none", epochs=1)[0][0]
    residual = play(flight, outer.format("circle:15"), epochs=1)[0][0]
    np.testing.assert_array_equal(residual[:, 3:], clean[:, 3:])
    assert np.all(residual[:, :2] != clean[:, :2])


def test_a_population_plays_with_true_velocities(flight):
    attack = make_attack("position-only:training:clean=0")
    plain = make_attack("training:clean=0")
    for each in (attack, plain):
        each.bind(flight.timeline, 8)
        each.follow(flight.velocity())
    streams = [Simulation(flight, num_runs=8, seed=3).streams for _ in range(2)]
    runs = np.arange(8)
    np.testing.assert_array_equal(attack.episode(runs, streams[0]), plain.episode(runs, streams[1]))


def test_run_i_is_the_same_for_any_number_of_runs(flight):
    whole = play(flight, "position-only:random-ramp", 20)[0]
    np.testing.assert_array_equal(play(flight, "position-only:random-ramp", 4)[0], whole[:, :4])


@pytest.mark.parametrize("make", [make_attack, lambda text: spoofer_pool(text, 0.5)])
def test_fixes_of_position_alone_refuse_it(make):
    with pytest.raises(ValueError, match=r"needs fixes with velocity \(m = 6\), scenario 'liu-flight' has fixes of"):
        Simulation(make_scenario("liu-flight"), make("position-only:ramp:1"))


def test_the_model_reaches_the_attack_inside():
    assert make_attack("position-only:noise-matched:2").needs_model


@pytest.mark.parametrize("name", [f"position-only:{INSIDE}", "position-only:foi-3", "position-only:training:clean=0.1"])
def test_the_name_builds_the_same_attack(name):
    assert make_attack(name).name == name


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("position-only", "needs 'attack'"),
        ("position-only:drift", "unknown attack 'drift'"),
        ("position-only:position-only:none", "attack must not leave the velocity true itself"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)
