"""PX4's gates, timer and reset: closed forms, and a plain loop over each run."""

import numpy as np
import pytest

from spoofgym.responses import make_response

BOTH = ["px4-auto", "px4-dead-reckoning"]


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize(("dimension", "axis"), [(3, 0), (3, 1), (3, 2), (6, 4), (6, 5)])
def test_the_gate_is_five_sigma_on_every_axis(scripts, name, dimension, axis):
    """S = 4: the edge is at 10 m (m/s), and lies within."""
    for value, used in ((9.999, True), (10.0, True), (10.001, False), (-10.001, False)):
        script = scripts.quiet(2, 1, dimension)
        script.residual[1, 0, axis] = value
        assert scripts.play(make_response(name), script).use[:, 0].tolist() == [True, used]


@pytest.mark.parametrize("name", BOTH)
def test_axes_are_tested_one_by_one(scripts, name):
    """9.9 m on each of three axes, NIS 73.5, is within; position and velocity have gates of their own."""
    script = scripts.quiet(2, 1)
    script.residual[1] = 9.9
    assert scripts.play(make_response(name), script).use.all()
    script = scripts.quiet(3, 1, 6)
    script.residual[1, 0, 1], script.residual[2, 0, 4] = 7.0, 7.0
    response = f"{name}:position_gate=3,velocity_gate=4"
    assert scripts.play(make_response(response), script).use[:, 0].tolist() == [True, False, True]
    assert make_response(response).name == response


def test_auto_resets_after_more_than_seven_seconds(scripts):
    """The last good fix is at epoch 2, so epoch 9 is 7 s later and epoch 10 is more."""
    script = scripts.quiet(30, 1)
    script.residual[3:, 0, 0] = 50.0
    decisions = scripts.play(make_response("px4-auto"), script)
    assert np.flatnonzero(decisions.use[:, 0]).tolist() == [0, 1, 2, 10, 18, 26]
    assert np.flatnonzero(decisions.reset[:, 0]).tolist() == [10, 18, 26]
    # R = S - P = 3 m² in east and in north
    assert decisions.reset[10, 0] == pytest.approx(6.0)


def test_the_timer_counts_seconds_not_epochs(scripts):
    """At 10 Hz the 70th rejected fix is 7 s after the last good one, the 71st resets."""
    script = scripts.quiet(100, 1, interval=0.1)
    script.residual[5:, 0, 1] = 50.0
    decisions = scripts.play(make_response("px4-auto"), script)
    assert np.flatnonzero(decisions.reset[:, 0]).tolist() == [4 + 71]


def test_the_variance_of_a_reset_is_no_less_than_the_least_noise(scripts):
    script = scripts.quiet(12, 1)
    script.position_covariance[:] = 3.99 * np.eye(3)
    script.residual[1:, 0, 0] = 50.0
    assert scripts.play(make_response("px4-auto"), script).reset[8, 0] == pytest.approx(2.0 * 0.5**2)


def test_a_good_fix_stops_the_timer(scripts):
    script = scripts.quiet(30, 1)
    script.residual[3:, 0, 0] = 50.0
    script.residual[9] = 0.0
    assert np.flatnonzero(scripts.play(make_response("px4-auto"), script).reset[:, 0]).tolist() == [17, 25]


def test_after_a_long_outage_the_first_bad_fix_resets(scripts):
    script = scripts.quiet(16, 2)
    script.available[2:12] = False
    script.residual[12, 0, 0] = 50.0
    decisions = scripts.play(make_response("px4-auto"), script)
    assert decisions.reset[12].tolist() == [pytest.approx(6.0), 0.0]
    assert decisions.use[12].all()
    assert not decisions.use[2:12].any()


def test_dead_reckoning_latches_and_never_resets(scripts):
    script = scripts.quiet(40, 1)
    script.residual[3:30, 0, 0] = 50.0
    response = make_response("px4-dead-reckoning")
    decisions = scripts.play(response, script)
    assert not decisions.reset.any()
    assert np.flatnonzero(~decisions.use[:, 0]).tolist() == list(range(3, 30))


def test_the_fault_begins_after_seven_seconds_and_ends_with_the_horizontal_position(scripts):
    script = scripts.quiet(20, 1)
    script.residual[3:14, 0, 0] = 50.0
    script.residual[14:16, 0, 2] = 50.0
    response = make_response("px4-dead-reckoning")
    response.bind(1)
    response.reset(np.arange(1))
    faults, used = [], []
    for k in range(20):
        used.append(bool(response.decide(script.epoch(k), script.alarm[k]).use[0]))
        faults.append(bool(response.fault[0]))
    assert np.flatnonzero(faults).tolist() == [10, 11, 12, 13]
    assert np.flatnonzero(used).tolist() == [0, 1, 2, 16, 17, 18, 19]


def test_a_growing_covariance_lets_a_standing_offset_in(scripts):
    """|ν| = 50 m passes once S exceeds 100 m²: a ratio of exactly 1 does not end the fault."""
    script = scripts.quiet(120, 1)
    script.residual[3:, 0, 0] = 50.0
    script.covariance[:] = (4.0 + np.arange(120.0))[:, None, None, None] * np.eye(3)
    used = scripts.play(make_response("px4-dead-reckoning"), script).use[:, 0]
    assert np.flatnonzero(used).tolist() == [0, 1, 2, *range(97, 120)]


def test_a_new_episode_starts_its_timer_and_has_no_fault(scripts):
    """Reset at epoch 7 of a rejection since epoch 3: run 1 waits 7 s from there, run 0 goes on."""
    script = scripts.quiet(30, 2)
    script.residual[3:, :, 0] = 50.0
    decisions = scripts.play(make_response("px4-auto"), script, [(7, [1])])
    assert [np.flatnonzero(decisions.reset[:, run])[0] for run in range(2)] == [10, 15]
    response = make_response("px4-dead-reckoning")
    scripts.play(response, script)
    assert response.fault.all()
    response.reset(np.array([1]))
    assert response.fault.tolist() == [True, False]


def plain(script, resets):
    """use and reset of run 0."""
    last, used, variances = script.time[0, 0], [], []
    for k in range(len(script.time)):
        fix, time = script.available[k, 0], script.time[k, 0]
        ratios = [
            script.residual[k, 0, a] ** 2 / (25.0 * script.covariance[k, 0, a, a])
            for a in range(script.residual.shape[-1])
        ]
        good = fix and max(ratios) <= 1.0
        jump = resets and fix and not good and time - last > 7.0 + 1e-9
        noise = [script.covariance[k, 0, a, a] - script.position_covariance[k, 0, a, a] for a in range(2)]
        if good or jump:
            last = time
        used.append(bool(good or jump))
        variances.append(sum(max(value, 0.25) for value in noise) if jump else 0.0)
    return used, variances


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("dimension", [3, 6])
def test_every_run_decides_as_a_plain_loop_does(scripts, name, dimension):
    script = scripts.eventful(300, 5, dimension, seed=20)
    decisions = scripts.play(make_response(name), script)
    for run in range(5):
        used, variances = plain(script.of([run]), name == "px4-auto")
        assert decisions.use[:, run].tolist() == used
        assert decisions.reset[:, run] == pytest.approx(variances)
    assert (decisions.reset > 0.0).any() == (name == "px4-auto")


@pytest.mark.parametrize("name", BOTH)
def test_the_detectors_are_not_heard(scripts, name):
    script = scripts.quiet(20, 2)
    script.alarm[:] = True
    assert scripts.play(make_response(name), script).use.all()
