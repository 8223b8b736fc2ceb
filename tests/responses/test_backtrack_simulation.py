"""Exclusion with a backtrack in a simulation: a run in which the fixes had been left out from the start."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation

SCENARIO = "liu-flight:horizon=40,imu=tactical"
ALARM = 26
"""The jump comes in this epoch, after a ramp since epoch 0 that no test sees."""
ATTACK = "jump-ramp:0.05,jump=400,onset=825"


def simulation(response=None, num_runs=4, fidelity="linear", **options):
    parts = (make_attack(ATTACK), [make_detector("snapshot:1000")])
    result = Simulation(make_scenario(SCENARIO), *parts, response, num_runs, seed=3, fidelity=fidelity, **options)
    result.reset()
    return result


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
@pytest.mark.parametrize(("name", "depth"), [("exclude-and-backtrack:9", 9), ("onset-depth", 3)])
def test_it_equals_a_run_with_the_fixes_left_out(fidelity, name, depth):
    """Jump without a lead: the onset is the epoch of the alarm, n = 1, depth 3."""
    responding = simulation(make_response(name), fidelity=fidelity)
    by_hand = simulation(fidelity=fidelity, demands=Demands(excludes=True))
    for k in range(1, 40):
        left_out = ALARM - depth <= k - 1
        responding.resolve()
        by_hand.resolve(Decision(np.full(4, not left_out)))
        responding.observe()
        by_hand.observe()
        if not ALARM - depth <= k <= ALARM:  # until its alarm the one still uses what the other leaves out
            assert responding.error == pytest.approx(by_hand.error, rel=1e-9, abs=1e-6)
            assert responding.navigator.position_covariance == pytest.approx(
                by_hand.navigator.position_covariance, rel=1e-9
            )
    assert (responding.alarm == (responding.epoch.index >= ALARM)).all()


def test_a_run_does_not_depend_on_how_many_there_are():
    """Restarts at different epochs, alarms at different epochs; N = 1, 5 and 40, to the last bit."""

    def play(num_runs):
        playing = simulation(make_response("constant-velocity-start:6,reuse=3"), num_runs)
        rows = []
        for step in range(60):
            due = np.array([run for run in range(num_runs) if (step + 5 * run) % 35 == 34], dtype=np.int64)
            playing.resolve()
            playing.restart(due)
            playing.observe()
            rows.append(np.concatenate([playing.error, playing.used[:, None]], axis=1))
        return np.array(rows)

    one, five, many = (play(n) for n in (1, 5, 40))
    assert np.array_equal(one, many[:, :1])
    assert np.array_equal(five, many[:, :5])
    assert 0.1 < many[:, :, 3].mean() < 0.99


@pytest.mark.parametrize("name", ["exclude-and-backtrack:10", "onset-depth", "constant-velocity-start:10"])
def test_an_outage_alone_takes_nothing_back(name):
    scenario = make_scenario(SCENARIO)
    confounders = Confounders(Disturbances(outage_share=1.0, outage_duration=(5.0, 8.0), multipath_share=0.0))
    playing = Simulation(
        scenario, None, [make_detector("snapshot:1000")], make_response(name), 30, seed=1, confounders=confounders
    )
    playing.reset()
    coasted = np.zeros(30, dtype=int)
    for _ in range(40):
        playing.resolve()
        assert not playing.navigator.backtracked.any()
        assert np.array_equal(playing.used, playing.epoch.available)
        coasted += ~playing.used
        playing.observe()
    assert np.count_nonzero(coasted) > 20


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_an_autopilot_is_reset_onto_the_spoofer(fidelity):
    """The jump of 400 m is held out for 7 s; then the position is the spoofed fix, with its variance."""
    playing = simulation(make_response("px4-auto"), fidelity=fidelity)
    for epoch in range(ALARM + 7):
        playing.resolve()
        assert (playing.used == (epoch < ALARM)).all()
        assert (np.abs(playing.error[:, 0]) < 50.0).all()
        playing.observe()
    offset = playing.error - playing.epoch.innovation.residual
    playing.resolve()
    assert playing.used.all()
    assert playing.error == pytest.approx(offset, rel=1e-6, abs=1e-3)
    assert playing.error[:, 0] == pytest.approx(400.0, abs=40.0)
    assert playing.navigator.position_covariance[:, 0, 0] == pytest.approx(2.0 * 3.7**2, rel=1e-6)
