"""In every filter: fixes taken back equal fixes left out, and nothing depends on threads, with biases that drift."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RUNS = 24
AT = 14
EPOCHS = 20
DEPTHS = np.arange(RUNS) % 10
EVERY = np.ones(RUNS, dtype=bool)
GAMES = (
    ("liu-flight:horizon=30,onset=300,imu=industrial", "linear"),
    ("liu-flight:horizon=30,onset=300,imu=industrial", "strapdown"),
    ("kujur-flight:horizon=30,onset=60,imu=industrial", "linear"),
    ("kujur-flight:horizon=30,onset=60,imu=industrial", "strapdown"),
    ("shadmehri-flight:filter=self-tuning,window=10,guard=all", "linear"),
    ("shadmehri-flight:filter=self-tuning,window=10,guard=all", "strapdown"),
    ("song-robot", "linear"),
)


def play(scenario, fidelity, decide, threads=1):
    simulation = Simulation(
        make_scenario(scenario),
        make_attack("ramp:1"),
        num_runs=RUNS,
        seed=3,
        fidelity=fidelity,
        threads=threads,
        demands=Demands(excludes=True, history=10),
    )
    simulation.reset()
    errors, innovations = [], []
    for k in range(EPOCHS):
        simulation.resolve(decide(k))
        errors.append(simulation.error.copy())
        innovations.append(simulation.observe().innovation.whitened.copy())
    return np.array(errors), np.array(innovations), simulation.navigator


def taken_back(k):
    return Decision(np.full(RUNS, k < AT), DEPTHS if k == AT else None)


def left_out(k):
    return Decision(k < AT - DEPTHS)


@pytest.mark.parametrize(("scenario", "fidelity"), GAMES)
def test_fixes_taken_back_equal_fixes_left_out(scenario, fidelity):
    back, back_innovations, navigator = play(scenario, fidelity, taken_back)
    out, out_innovations, reference = play(scenario, fidelity, left_out)
    np.testing.assert_array_equal(back[AT:], out[AT:])
    np.testing.assert_array_equal(back_innovations[AT:], out_innovations[AT:])
    np.testing.assert_array_equal(navigator.covariance, reference.covariance)
    if hasattr(navigator, "true_bias"):
        np.testing.assert_array_equal(navigator.true_bias, reference.true_bias)


@pytest.mark.parametrize("threads", [2, 8])
@pytest.mark.parametrize(("scenario", "fidelity"), GAMES)
def test_results_do_not_depend_on_threads(scenario, fidelity, threads):
    alone, alone_innovations, navigator = play(scenario, fidelity, taken_back)
    several, several_innovations, other = play(scenario, fidelity, taken_back, threads)
    np.testing.assert_array_equal(several, alone)
    np.testing.assert_array_equal(several_innovations, alone_innovations)
    if hasattr(navigator, "true_bias"):
        np.testing.assert_array_equal(other.true_bias, navigator.true_bias)
