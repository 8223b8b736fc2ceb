"""Leaving fixes out in a simulation: what it makes of the error and the covariance."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SCENARIO = "liu-flight:horizon=30"
ONSET = 5
"""The jump starts after this epoch: from epoch 6 on every fix alarms."""


def simulate(num_runs, response, attack="jump:500,onset=805", detector="snapshot:1000", fidelity="linear"):
    parts = (make_attack(attack), [make_detector(detector)], make_response(response))
    simulation = Simulation(make_scenario(SCENARIO), *parts, num_runs, seed=40, fidelity=fidelity)
    simulation.reset()
    return simulation


def advance(simulation, epochs):
    """Error and alarm of each epoch, (E, N, 3) and (E, N)."""
    errors, alarms = [], []
    for _ in range(epochs):
        simulation.resolve()
        simulation.observe()
        errors.append(simulation.error.copy())
        alarms.append(simulation.alarm.copy())
    return np.array(errors), np.array(alarms)


def test_the_error_of_excluded_epochs_is_that_of_the_ins_alone():
    """Error and covariance by matrices from the last accepted fix on: x <- Phi x + w, P <- Phi P Phi' + Q."""
    simulation = simulate(4, "exclude")
    navigator = simulation.navigator
    model = navigator.model
    _, alarms = advance(simulation, ONSET + 1)
    assert not alarms[:-1].any()
    assert alarms[-1].all()
    state, covariance = navigator.state.copy(), navigator.covariance.copy()
    for k in range(ONSET + 2, 31):
        simulation.resolve()
        simulation.observe()
        assert simulation.alarm.all()
        for run in range(4):
            noise = np.zeros(15)
            noise[:9] = model.noise_factor[k] @ navigator.normals[run, k]
            state[run] = model.transition[k] @ state[run] + noise
            covariance[run] = model.transition[k] @ covariance[run] @ model.transition[k].T + model.process_noise[k]
        assert simulation.error == pytest.approx(state[:, 6:9], rel=1e-9, abs=1e-9)
        assert navigator.covariance[:, 6:9, 6:9] == pytest.approx(covariance[:, 6:9, 6:9], rel=1e-9)
        assert np.all(np.abs(simulation.error) < 100.0)  # the jump of 500 m never comes in


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_what_is_excluded_leaves_no_trace(fidelity):
    """Two attacks that are left out from the same epoch on give the same errors to the last bit."""
    errors = [
        advance(simulate(3, "exclude", f"jump:{size},onset=805", fidelity=fidelity), 20)[0] for size in (500, 5000)
    ]
    assert np.array_equal(*errors)


def test_without_an_alarm_nothing_is_excluded():
    """The same errors as with shared gains; both recursions compute the same gain."""
    errors = [advance(simulate(3, response, "ramp:0.3"), 30)[0] for response in ("exclude", "always-use")]
    assert errors[0] == pytest.approx(errors[1], abs=1e-7)


def test_runs_are_excluded_one_by_one():
    """An offset in run 1 only: run 1 coasts, the others are as if it were alone."""
    simulation, clean = (simulate(3, "exclude", "none") for _ in range(2))
    offset = np.zeros((3, 3))
    offset[1, 0] = 500.0
    for _ in range(10):
        simulation.resolve()
        clean.resolve()
        simulation.observe(offset)
        clean.observe(np.zeros((3, 3)))
        assert simulation.alarm.tolist() == [False, True, False]
    assert np.array_equal(simulation.error[[0, 2]], clean.error[[0, 2]])
    assert not np.array_equal(simulation.error[1], clean.error[1])
    growth = simulation.navigator.position_covariance[1, 0, 0] / clean.navigator.position_covariance[1, 0, 0]
    assert growth > 1.0


def test_fixes_are_used_again_when_the_alarm_ends():
    simulation = simulate(2, "exclude", "none")
    for k in range(20):
        simulation.resolve()
        simulation.observe(np.full((2, 3), 500.0 if 5 <= k < 12 else 0.0))
    coasted = simulate(2, "exclude", "none")
    for k in range(20):
        coasted.resolve()
        coasted.observe(np.full((2, 3), 500.0 if k >= 5 else 0.0))
    assert not simulation.alarm.any()
    trace = [np.trace(s.navigator.position_covariance[0]) for s in (simulation, coasted)]
    assert trace[0] < trace[1]


def test_staggered_resets_and_any_number_of_runs():
    """A restart brings back the warm covariance; run i is bit-identical for N = 1, 7 and 64."""

    def play(num_runs):
        simulation = simulate(num_runs, "exclude", "jump:500,onset=803")
        rows = []
        for step in range(25):
            due = np.array([run for run in range(num_runs) if (step + 4 * run) % (9 + run % 5) == 0], dtype=np.int64)
            simulation.resolve()
            simulation.restart(due)
            simulation.observe()
            rows.append(np.concatenate([simulation.error, simulation.navigator.position_covariance[:, 0]], axis=1))
            assert np.array_equal(simulation.alarm, simulation.epoch.index > 3)
        return np.array(rows)

    one, seven, many = (play(n) for n in (1, 7, 64))
    assert np.array_equal(one, many[:, :1])
    assert np.array_equal(seven, many[:, :7])
