"""The aided filter against a dense Kalman filter, closed forms, and Monte Carlo; what GNSS does not own stays."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import binom, chi2

from spoofgym.navigation.interface import NO_DEMANDS, Decision, Demands
from spoofgym.navigation.linear_model import error_dynamics
from spoofgym.navigation.loose.warm_start import cold_start
from spoofgym.optimum.bayes.estimates import Bayesian
from spoofgym.parallel import RunSlices
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from tests.navigation.test_fidelities import RUNS, SEED, common_noise

FIDELITIES = ("linear", "strapdown")
CHANCE = 1e-7
ON_THE_ROAD = "foi-drive:horizon=30,imu=automotive,aids=barometer+wheel-speed:rate=5"
IN_THE_AIR = "liu-flight:horizon=30,onset=60,imu=industrial,aids="


def dense_filter(family, epochs):
    """P before and after each fix from the start of the trajectory on, by textbook matrices."""
    aids, receiver = family.aids, family.receiver
    per_epoch = round(max(aid.rate for aid in aids) / receiver.rate)
    rate = per_epoch * receiver.rate
    steps = error_dynamics(
        family.truth.trajectory,
        family.grade,
        dataclasses.replace(receiver, rate=rate),
        family.tuning,
        family.true_position_random_walk,
        per_epoch * epochs,
    )
    own = sum(aid.num_states for aid in aids)
    sigma = np.concatenate([aid.states.sigma for aid in aids])
    walk = np.concatenate([aid.states.walk for aid in aids])
    start = cold_start(family.grade, receiver, family.tuning).filter_covariance
    covariance = block_diag(start, np.diag(sigma**2))
    before, after = [], []
    for step in range(per_epoch * epochs):
        phi = block_diag(steps.transition[step], np.eye(own))
        noise = block_diag(steps.process_noise[step], np.diag(walk**2) / rate)
        covariance = phi @ covariance @ phi.T + noise
        first = 15
        for aid in aids:
            if (step + 1) % round(rate / aid.rate) == 0:
                sample = round((step + 1) * family.truth.trajectory.rate / rate)
                covariance = joseph(covariance, dense_h(family, aid, sample, first, 15 + own), np.square(aid.noise))
            first += aid.num_states
        if (step + 1) % per_epoch == 0:
            before.append(covariance)
            h = np.zeros((3, 15 + own))
            h[:, :9] = steps.observation[step]
            covariance = joseph(covariance, h, np.square(family.tuning.measurement_sigma))
            after.append(covariance)
    return np.array(before), np.array(after)


def joseph(covariance, h, variance):
    gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + np.diag(variance))
    rest = np.eye(len(covariance)) - gain @ h
    return rest @ covariance @ rest.T + gain @ np.diag(variance) @ gain.T


def dense_h(family, aid, sample, first, n):
    """H of an aid at a sample of the truth, written once more."""
    trajectory = family.truth.trajectory
    attitude, velocity = trajectory.attitude[sample], trajectory.velocity[sample]
    h = np.zeros((aid.dimension, n))
    if aid.kind == "barometer":
        h[0, 8] = h[0, first] = 1.0
    else:
        order, speed = [1, 0, 2], float(attitude[:, 1] @ velocity)
        turned = np.cross(np.eye(3), velocity)  # row i: e_i x v, what a turn about axis i makes of the velocity
        h[:, 3:6] = attitude.T[order]
        h[:, 0:3] = (attitude.T @ turned.T)[order]
        h[range(3), range(first, first + 3)] = speed
    return h


def test_the_covariance_is_that_of_a_dense_filter():
    scenario = make_scenario(ON_THE_ROAD)
    family = scenario.family
    first = family.truth.first(0)
    before, after = dense_filter(family, first + 31)
    model = family.linear_model()
    scale = np.sqrt(np.diagonal(before[first:], axis1=1, axis2=2))
    tolerance = 1e-7 * scale[:, :, None] * scale[:, None, :]
    assert np.all(np.abs(model.covariance - before[first:]) <= tolerance)
    np.testing.assert_array_less(np.abs(model.prior_covariance - after[first - 1]), 1e-7 * np.outer(scale[0], scale[0]))
    own = scenario.family.navigator("linear", Demands(excludes=True), 0, 1, RunSlices(1))
    streams = RunStreams.from_seed(0, 1)
    own.reset(np.array([0]), family.draw_initial(np.array([0]), 0, streams), streams)
    for k in range(31):
        own.propagate()
        assert np.all(np.abs(own.covariance[0] - before[first + k]) <= tolerance[k])
        own.innovate(np.zeros((1, 3)))
        own.resolve(Decision(np.ones(1, dtype=bool)))


def test_a_barometer_without_any_offset_adds_its_information_to_that_of_the_fix():
    """With b known to be zero both measure the height at once: 1/R' = 1/R + 1/r, whatever else there is."""
    common = "liu-flight:horizon=20,onset=60"
    aided = make_scenario(f"{common},aids=barometer:sigma=2/offset=0/walk=0").linear_model()
    plain = make_scenario(common)
    variance = np.diag([3.7**2, 3.7**2, 1.0 / (1.0 / 36.0 + 1.0 / 4.0)])
    tuning = dataclasses.replace(plain.family.tuning, measurement_sigma=tuple(np.sqrt(np.diag(variance))))
    model = plain.changed(tuning=tuning).linear_model()

    def after(model):
        gain = model.whitened_gain
        return (model.covariance - gain.transpose(0, 2, 1) @ gain)[:, :15, :15]

    scale = np.sqrt(np.diagonal(after(model), axis1=1, axis2=2))
    assert np.all(np.abs(after(aided) - after(model)) <= 1e-7 * scale[:, :, None] * scale[:, None, :])


def test_truth_and_filter_begin_as_one_where_the_filter_is_matched():
    """The joint covariance of all that is random in the truth holds the filter's own, which is right there."""
    scenario = make_scenario(ON_THE_ROAD.replace("automotive", "fog"))
    assert scenario.matched
    start = scenario.family.warm_start()
    places = [*range(15), *range(30, 34)]
    joint, own = start.joint_covariance[np.ix_(places, places)], start.filter_covariance
    scale = np.sqrt(np.diag(own))
    assert np.all(np.abs(joint - own) <= 1e-7 * np.outer(scale, scale))


@pytest.mark.parametrize("options", ["receiver=foi", "imu=fog,process_noise=5", "imu=automotive,bias_states=false"])
def test_aids_that_tell_nothing_leave_the_start_as_it_is(options):
    """Also where the filter is wrong about its noises: coloured fixes, other process noise, biases it does not know."""
    deaf = "barometer:sigma=1e7/rate=2+wheel-speed:sigma=1e7/lateral=1e7/vertical=1e7"
    plain, aided = (
        make_scenario(f"foi-drive:horizon=20,{options}{aids}").family.warm_start() for aids in ("", f",aids={deaf}")
    )
    scale = np.sqrt(np.maximum(np.diag(plain.joint_covariance), 1e-30))
    apart = np.abs(aided.joint_covariance[:30, :30] - plain.joint_covariance)
    # the position's random walk and the IMU's noise come in halves of an epoch, which is the same to first order
    assert np.all(apart <= 1e-3 * np.outer(scale, scale))
    np.testing.assert_allclose(aided.joint_covariance[30, 30], 300.0**2 + 20.0 * 0.05**2, rtol=1e-6)


def game(text, fidelity, demands=NO_DEMANDS, runs=256, seed=1, decide=lambda k: None, offset=None):
    scenario = make_scenario(text)
    simulation = Simulation(scenario, num_runs=runs, seed=seed, fidelity=fidelity, demands=demands)
    simulation.reset()
    told = []
    for k in range(scenario.timeline.num_epochs):
        simulation.resolve(decide(k))
        simulation.observe(None if offset is None else offset(k))
        told.append(simulation.epoch.view.aid_innovations)
    return simulation, told


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_innovations_of_fixes_and_aids_are_white_and_errors_are_what_the_filter_believes(fidelity):
    simulation, told = game(ON_THE_ROAD.replace("automotive", "fog"), fidelity, Demands(excludes=True))
    assert simulation.scenario.matched
    navigator = simulation.navigator
    whitened = np.array([each.whitened for each in told])
    assert np.all(np.array([each.count for each in told]) == [1, 5])
    for row in whitened.T:  # of a matched filter: independent of run to run and of epoch to epoch
        low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], row.size)
        assert low <= np.square(row).sum() <= high
    covariance = navigator.position_covariance
    square = np.einsum("ni,nij,nj->n", simulation.error, np.linalg.inv(covariance), simulation.error).sum()
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], 3 * len(covariance))
    slack = 1.0 if fidelity == "linear" else 1.05  # the strapdown filter is linearised
    assert low / slack <= square <= high * slack


def test_shared_gains_are_those_of_every_run():
    shared, _ = game(ON_THE_ROAD, "linear", Demands(auxiliary=True), runs=8)
    own, _ = game(ON_THE_ROAD, "linear", Demands(excludes=True, auxiliary=True), runs=8)
    assert type(shared.navigator).__name__ == "AidedNavigator"
    assert type(own.navigator).__name__ == "AidedOwnNavigator"
    np.testing.assert_allclose(shared.navigator.state, own.navigator.state, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(shared.navigator.auxiliary, own.navigator.auxiliary, rtol=1e-6, atol=1e-8)
    gated, _ = game(ON_THE_ROAD.replace("barometer", "barometer:gate=1e-9"), "linear", runs=8)
    assert type(gated.navigator).__name__ == "AidedOwnNavigator"
    np.testing.assert_allclose(gated.navigator.state, own.navigator.state, rtol=1e-8, atol=1e-10)


def test_an_attack_does_to_the_mean_what_the_mean_filter_says():
    """The linear filter is linear: the difference of two games with the same noise is the mean filter's error."""
    scenario = make_scenario(ON_THE_ROAD)
    offsets = np.cumsum(np.random.default_rng(0).standard_normal((30, 1, 3)), axis=0)
    clean, _ = game(ON_THE_ROAD, "linear", runs=1)
    moved, _ = game(ON_THE_ROAD, "linear", runs=1, offset=lambda k: offsets[k])
    mean = scenario.family.mean_filter(1, RunSlices(1))
    nothing = np.zeros((1, 3))
    mean.advance(np.array([0]), nothing, nothing, np.ones(1))
    for k in range(1, 31):
        previous = offsets[k - 2] if k > 1 else nothing
        mean.advance(np.array([k]), offsets[k - 1], previous, np.ones(1))
        if k == 29:
            expected = mean.error.copy()
    # the last fix is not resolved yet
    model = scenario.linear_model()
    np.testing.assert_allclose(
        moved.navigator.state - clean.navigator.state, expected @ model.transition[30].T, rtol=1e-7, atol=1e-9
    )


@pytest.mark.parametrize("aids", ["barometer", "barometer+magnetometer"])
def test_both_fidelities_agree_on_common_noise(aids):
    """As `test_fidelities`, whose tolerance for a horizontal error of such an IMU it keeps."""
    scenario = make_scenario(IN_THE_AIR.replace("industrial", "tactical") + aids)
    runs, streams, slices = np.arange(RUNS), RunStreams.from_seed(SEED, RUNS), RunSlices(1)
    family = scenario.family
    pair = [family.navigator(fidelity, Demands(excludes=True), 0, RUNS, slices) for fidelity in ("strapdown", "linear")]
    initial = family.draw_initial(runs, 0, streams)
    noise = family.draw_receiver_noise(runs, initial, 0, streams)
    pair[0].reset(runs, initial, streams)
    streams = RunStreams.from_seed(SEED, RUNS)  # the aids draw from their stream once more
    pair[1].reset(runs, initial, streams)
    factors = pair[1].model.aid_steps.noise_columns.transpose(0, 2, 1)
    pair[1].model = dataclasses.replace(pair[1].model, noise_factor=np.ascontiguousarray(factors))
    common_noise(scenario, *pair, initial)
    for k in range(scenario.truth.horizon + 1):
        told, nis = [], []
        for navigator in pair:
            navigator.propagate()
            nis.append(navigator.innovate(noise[:, k]).whitened)
            told.append(navigator.aid_innovations(runs).whitened)
            navigator.resolve(Decision(np.full(RUNS, not 5 <= k < 15)))
        np.testing.assert_allclose(pair[0].error, pair[1].error, atol=0.05)
        np.testing.assert_allclose(nis[0], nis[1], atol=0.02)
        np.testing.assert_allclose(told[0], told[1], atol=0.05)
        np.testing.assert_allclose(pair[0].aid_error, pair[1].state[:, 15:], atol=0.05)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_without_gnss_a_barometer_holds_the_height(fidelity):
    """The offset b walks 0.05 m/√s, so that after T seconds the height is known to about 0.05 √T m and what it was."""
    demands, out = Demands(excludes=True), lambda k: Decision(np.zeros(128, dtype=bool))
    text = "liu-flight:horizon=100,onset=60,imu=industrial"
    aided, _ = game(f"{text},aids=barometer", fidelity, demands, 128, decide=out)
    deviation = math.sqrt(aided.navigator.position_covariance[0, 2, 2])
    assert 0.05 * math.sqrt(100.0) < deviation < 3.0
    height = aided.error[:, 2]
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], len(height))
    assert low <= np.square(height / deviation).sum() <= high
    plain = Simulation(make_scenario(text), num_runs=128, seed=1, fidelity=fidelity, demands=demands)
    plain.reset()
    for _ in range(100):
        plain.resolve(out(0))
        plain.observe()
    assert np.sqrt(np.mean(plain.error[:, 2] ** 2)) > 10.0 * np.sqrt(np.mean(height**2))


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_aids_act_again_where_fixes_are_taken_back(fidelity):
    """Fixes that are taken back equal fixes that were left out, bit for bit, readings and their gates included."""
    demands = Demands(excludes=True, history=8)
    text = ON_THE_ROAD.replace("barometer", "barometer:gate=0.2")
    push = lambda k: np.full((6, 3), 1.5 * k)  # noqa: E731
    back = lambda k: Decision(np.full(6, k < 14), np.arange(6) if k == 14 else None)  # noqa: E731
    one, told = game(text, fidelity, demands, 6, decide=back, offset=push)
    other, _ = game(text, fidelity, demands, 6, decide=lambda k: Decision(k < 14 - np.arange(6)), offset=push)
    np.testing.assert_array_equal(one.error, other.error)
    np.testing.assert_array_equal(one.navigator.covariance, other.navigator.covariance)
    np.testing.assert_array_equal(
        one.navigator.aid_innovations(np.arange(6)).whitened, other.navigator.aid_innovations(np.arange(6)).whitened
    )
    assert sum(each.rejected.sum() for each in told) > 0


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_gate_leaves_out_what_it_says(fidelity):
    """Of good readings the stated share; a wild one for certain, and the filter is as if it had never come."""
    share = 0.05
    text = f"{IN_THE_AIR}barometer:gate={share}"
    _, told = game(text, fidelity)
    rejected, count = (sum(getattr(each, name).sum() for each in told) for name in ("rejected", "count"))
    # a reading that is left out makes the next gates wider, so that the share is a little less
    assert binom.ppf(CHANCE, count, 0.9 * share) <= rejected <= binom.ppf(1.0 - CHANCE, count, share)

    def with_one(value, gate):
        scenario = make_scenario(f"{IN_THE_AIR}barometer:gate={gate}")
        simulation = Simulation(scenario, num_runs=1, seed=0, fidelity=fidelity)
        simulation.reset()
        simulation.navigator.aid_normals[0, 1] = value
        simulation.resolve()
        simulation.observe()
        return simulation.navigator

    wild, wilder = with_one(1e4, 1e-6), with_one(1e5, 1e-6)
    assert wild.aid_innovations(np.array([0])).rejected[0, 0] == 1
    np.testing.assert_array_equal(wild.error, wilder.error)
    assert np.abs(with_one(1e4, 0).error - wild.error)[0, 2] > 10.0


def test_the_solution_without_gnss_keeps_its_aids():
    """It is carried by what the epoch makes of an error, corrections by the aids included, and moves with no fix."""
    simulation = Simulation(make_scenario(ON_THE_ROAD), num_runs=4, seed=0, demands=Demands(auxiliary=True))
    simulation.reset()
    model, difference = simulation.navigator.model, np.zeros((4, simulation.navigator.state.shape[1]))
    for k in range(1, 20):
        before = simulation.navigator.state.copy()
        simulation.resolve()
        difference += before - simulation.navigator.state
        simulation.observe()
        difference = difference @ model.transition[k].T
        np.testing.assert_allclose(simulation.navigator.auxiliary, difference, rtol=1e-7, atol=1e-9)
        np.testing.assert_array_equal(simulation.navigator.auxiliary_offset, simulation.navigator.auxiliary[:, 6:9])


def test_games_without_aids_meet_the_noise_of_games_with_them():
    plain, aided = (
        Simulation(make_scenario(f"liu-flight:horizon=9{aids}"), num_runs=3, seed=0) for aids in ("", ",aids=barometer")
    )
    plain.reset(), aided.reset()
    np.testing.assert_array_equal(plain._noise, aided._noise)
    np.testing.assert_array_equal(plain.navigator.normals, aided.navigator.normals)


def test_parts_that_know_no_aids_refuse_them():
    scenario = make_scenario("foi-drive:aids=wheel-speed")
    with pytest.raises(ValueError, match="response 'multiple-hypothesis' needs coasting on inertia alone"):
        Simulation(scenario, response=make_response("multiple-hypothesis"))
    with pytest.raises(ValueError, match="Bayesian bound knows no aids"):
        Bayesian(scenario)
