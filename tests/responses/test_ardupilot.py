"""ArduPilot's gates, timer, reset and clipping: closed forms, a plain loop, and the filter's correction."""

import math

import numpy as np
import pytest

from spoofgym.navigation.interface import Demands
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

GLITCH, CLIP = "ardupilot-glitch", "ardupilot-clip"


def test_the_horizontal_gate_is_joint(scripts):
    """S = 4 on both axes: the edge is at 5 sqrt(8) = 14.14 m in any direction, and lies outside."""
    edge = 5.0 * math.sqrt(8.0)
    for angle in np.radians([0.0, 30.0, 45.0, 200.0]):
        for length, used in ((0.999, True), (1.001, False)):
            script = scripts.quiet(2, 1)
            script.residual[1, 0, :2] = length * edge * np.array([math.cos(angle), math.sin(angle)])
            assert scripts.play(make_response(GLITCH), script).use[:, 0].tolist() == [True, used]


@pytest.mark.parametrize(("axes", "edge"), [([2], 10.0), ([3, 4, 5], 5.0 * math.sqrt(12.0))])
def test_height_and_velocity_have_gates_of_their_own(scripts, axes, edge):
    for length, used in ((0.999, True), (1.001, False)):
        script = scripts.quiet(2, 1, 6)
        script.residual[1, 0, axes] = length * edge / math.sqrt(len(axes))
        assert scripts.play(make_response(GLITCH), script).use[:, 0].tolist() == [True, used]


@pytest.mark.parametrize(("dimension", "retry"), [(3, 7), (6, 10)])
def test_a_glitch_ends_in_a_reset_after_the_retry_time(scripts, dimension, retry):
    script = scripts.quiet(30, 1, dimension)
    script.residual[3:, 0, 0] = 50.0
    decisions = scripts.play(make_response(GLITCH), script)
    first = 2 + retry + 1
    assert np.flatnonzero(decisions.reset[:, 0]).tolist() == list(range(first, 30, retry + 1))
    assert decisions.reset[first, 0] == pytest.approx(12.5**2)
    assert np.flatnonzero(decisions.use[:first, 0]).tolist() == [0, 1, 2]


def test_a_filter_that_is_lost_is_reset_by_a_fix_that_passes(scripts):
    """P_E + P_N > 625 m²; a fix that fails waits for the timer all the same."""
    script = scripts.quiet(6, 2)
    script.covariance[3:] = 400.0 * np.eye(3)
    script.position_covariance[3:] = 312.0 * np.eye(3)
    script.position_covariance[4:] = 313.0 * np.eye(3)
    script.residual[4, 1, 0] = 500.0
    decisions = scripts.play(make_response(GLITCH), script)
    assert decisions.reset.tolist() == [[0, 0]] * 4 + [[156.25, 0], [156.25, 156.25]]
    assert decisions.use[4].tolist() == [True, False]
    wide = scripts.play(make_response("ardupilot-glitch:glitch_radius=30"), script)
    assert not wide.reset.any()


def test_the_first_fix_after_a_long_outage_resets(scripts):
    script = scripts.quiet(16, 1)
    script.available[2:12] = False
    assert np.flatnonzero(scripts.play(make_response(GLITCH), script).reset[:, 0]).tolist() == [12]
    clipped = scripts.play(make_response(CLIP), script)
    assert np.flatnonzero(clipped.reset[:, 0]).tolist() == [12]
    assert clipped.reset[12, 0] == pytest.approx(1e-4)
    script.available[8] = True
    assert not scripts.play(make_response(GLITCH), script).reset.any()


def test_clipping_rejects_nothing_and_scales_the_innovation_variance_by_the_ratio(scripts):
    """R = 3, P = 1: S + (scale - 1) R = ratio S on the axes of the group that needs most."""
    script = scripts.quiet(5, 1, 6)
    script.residual[1, 0, 0] = 14.0
    script.residual[2, 0, 0] = 28.284271
    script.residual[3, 0, 2] = 30.0
    script.residual[3, 0, 0] = 20.0
    script.residual[4, 0, 3] = 50.0
    decisions = scripts.play(make_response(CLIP), script)
    assert decisions.use.all()
    ratio = np.array([1.0, 1.0, 4.0, 9.0, 2500.0 / 300.0])
    expected = 1.0 + (ratio - 1.0) * np.array([0, 0, 4.0 / 3.0, 4.0 / 3.0, 1.0])
    assert decisions.noise_scale[:, 0] == pytest.approx(expected)
    assert 4.0 + (decisions.noise_scale[2, 0] - 1.0) * 3.0 == pytest.approx(4.0 * 4.0)


def plain(script):
    """use and reset of run 0 with the glitch radius."""
    last, used, resets = script.time[0, 0], [], []
    dimension = script.residual.shape[-1]
    groups = [(0, 1), (2,)] + ([(3, 4, 5)] if dimension == 6 else [])
    for k in range(len(script.time)):
        fix, time = script.available[k, 0], script.time[k, 0]
        ratios = [
            sum(script.residual[k, 0, a] ** 2 for a in group)
            / (25.0 * sum(script.covariance[k, 0, a, a] for a in group))
            for group in groups
        ]
        good = fix and max(ratios) < 1.0
        late = time - last > (10.0 if dimension == 6 else 7.0) + 1e-9
        lost = script.position_covariance[k, 0, 0, 0] + script.position_covariance[k, 0, 1, 1] > 20.0**2
        jump = fix and (late or (good and lost))
        if good or jump:
            last = time
        used.append(bool(good or jump))
        resets.append(100.0 if jump else 0.0)
    return used, resets


@pytest.mark.parametrize("dimension", [3, 6])
def test_every_run_decides_as_a_plain_loop_does(scripts, dimension):
    script = scripts.eventful(300, 5, dimension, seed=21)
    script.position_covariance[::17] += 250.0 * np.eye(3)
    decisions = scripts.play(make_response("ardupilot-glitch:glitch_radius=20"), script)
    for run in range(5):
        used, resets = plain(script.of([run]))
        assert decisions.use[:, run].tolist() == used
        assert decisions.reset[:, run].tolist() == resets
    assert 10 < np.count_nonzero(decisions.reset) < np.count_nonzero(decisions.use)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_the_filter_moves_by_what_the_clipped_fix_allows(fidelity):
    """A jump of 300 m: the correction is P H' (H P H' + s R)⁻¹ ν, and in the direction of the jump P ν / (ratio S)."""
    scenario = make_scenario("liu-flight:horizon=5,imu=tactical")
    simulation = Simulation(scenario, None, (), make_response(CLIP), 3, seed=5, fidelity=fidelity)
    simulation.reset()
    simulation.resolve()
    offset = np.zeros((3, 3))
    offset[:, 0] = 300.0
    epoch = simulation.observe(offset)
    before, covariance = simulation.error.copy(), epoch.view.position_covariance.copy()
    simulation.resolve()
    moved = simulation.error - before
    for run in range(3):
        residual, total = epoch.innovation.residual[run], epoch.innovation.covariance[run]
        ratio = (residual[0] ** 2 + residual[1] ** 2) / (25.0 * (total[0, 0] + total[1, 1]))
        noise = np.diag(np.diag(total - covariance[run]))
        scale = 1.0 + (ratio - 1.0) * (total[0, 0] + total[1, 1]) / (noise[0, 0] + noise[1, 1])
        correction = -covariance[run] @ np.linalg.solve(total + (scale - 1.0) * noise, residual)
        assert moved[run] == pytest.approx(correction, rel=1e-6, abs=1e-6)
        east = -covariance[run][0, 0] * residual[0] / (ratio * total[0, 0])
        assert moved[run, 0] == pytest.approx(east, rel=0.02)
        assert 0.1 < moved[run, 0] < 5.0


@pytest.mark.parametrize("name", [GLITCH, CLIP])
def test_the_detectors_are_not_heard(scripts, name):
    script = scripts.quiet(20, 2)
    script.alarm[:] = True
    decisions = scripts.play(make_response(name), script)
    assert decisions.use.all()
    assert not decisions.reset.any()
    assert (decisions.noise_scale == 1.0).all()
    assert make_response(name).demands == Demands(excludes=True)
