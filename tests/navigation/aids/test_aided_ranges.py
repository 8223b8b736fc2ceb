"""The aided filter on ranges against dense matrices, the mean filter and Monte Carlo; what GNSS does not own stays."""

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import NO_DEMANDS, Decision, Demands
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FIDELITIES = ("linear", "strapdown")
CHANCE = 1e-7
FLIGHT = "liu-flight:horizon=30,onset=60,coupling=tight,imu=industrial"
AIDED = f"{FLIGHT},aids=barometer+magnetometer:rate=0.5"
EXCLUDES = Demands(excludes=True, history=8, auxiliary=True)


def game(text, fidelity="linear", demands=NO_DEMANDS, runs=6, decide=lambda k: None, offset=None):
    scenario = make_scenario(text)
    simulation = Simulation(scenario, num_runs=runs, seed=1, fidelity=fidelity, demands=demands)
    simulation.reset()
    told = []
    for k in range(scenario.timeline.num_epochs):
        simulation.resolve(decide(k))
        simulation.observe(None if offset is None else offset(k))
        if scenario.facts.aids:
            told.append(simulation.epoch.view.aid_innovations)
    return simulation, told


def dense_step(dynamics, k):
    """Φ, Q, H and R of an epoch at which no satellite rises."""
    n = dynamics.num_states
    phi, noise = np.diag(dynamics.decay), np.diag(dynamics.variance)
    phi[:9], noise[:9] = 0.0, 0.0
    phi[:9, :15], noise[:9, :9] = dynamics.transition[k], dynamics.process_noise[k]
    phi[15, 16], noise[15:17, 15:17] = dynamics.intervals[k], dynamics.clock_noise
    h = np.zeros((dynamics.dimension, n))
    for row, (columns, values) in enumerate(zip(dynamics.columns, dynamics.values[k], strict=True)):
        np.add.at(h[row], columns, values)
    return phi, noise, h, np.diag(dynamics.noise_variance[k])


def joseph(covariance, h, noise):
    gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + noise)
    rest = np.eye(len(covariance)) - gain @ h
    return rest @ covariance @ rest.T + gain @ noise @ gain.T, rest


def test_the_covariance_is_that_of_a_dense_filter():
    model = make_scenario(AIDED).tight_model()
    dynamics, covariance = model.dynamics, model.prior_covariance
    assert not dynamics.started.any()
    n = dynamics.num_states
    for k in range(31):
        phi, noise, h, variance = dense_step(dynamics, k)
        covariance = phi @ covariance @ phi.T + noise
        height = np.zeros((1, n))
        height[0, 8] = height[0, n - 2] = 1.0
        covariance, closed = joseph(covariance, height, np.array([[0.25]]))
        if (60 + k) % 2 == 0:  # epoch 0 is at 60 s, and the magnetometer reads every two seconds
            azimuth = np.zeros((1, n))
            dip = np.tan(np.radians(60.0))
            azimuth[0, [1, 2, n - 1]] = dip, 1.0, -1.0  # the field points north: d = φ_U + tan(dip) φ_N - error
            covariance, rest = joseph(covariance, azimuth, np.array([[np.radians(2.0) ** 2]]))
            closed = rest @ closed
        scale = np.sqrt(np.diagonal(covariance))
        assert np.all(np.abs(model.covariance[k] - covariance) <= 1e-6 * np.outer(scale, scale) + 1e-300)
        np.testing.assert_allclose(model.aided[k], closed, atol=1e-6)
        covariance, _ = joseph(covariance, h, variance)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_innovations_are_white_and_errors_are_what_the_filter_believes(fidelity):
    simulation, told = game(AIDED, fidelity, runs=200)
    whitened = np.array([each.whitened for each in told])
    heard = np.array([each.count for each in told]) > 0
    np.testing.assert_array_equal(heard[:, 0, 0], True)
    np.testing.assert_array_equal(heard[:, 0, 1], np.arange(1, 31) % 2 == 0)
    for row in range(2):
        low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], heard[:, :, row].sum())
        assert low <= np.square(whitened[:, :, row]).sum() <= high
    covariance = simulation.navigator.position_covariance
    square = np.einsum("ni,nij,nj->n", simulation.error, np.linalg.inv(covariance), simulation.error).sum()
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], 600)
    slack = 1.0 if fidelity == "linear" else 1.1
    assert low / slack <= square <= high * slack


def test_an_attack_does_to_the_mean_what_the_mean_filter_says():
    scenario = make_scenario(AIDED)
    offsets = 0.1 * np.cumsum(np.random.default_rng(0).standard_normal((30, 1, 4)), axis=0)
    clean, _ = game(AIDED, runs=1)
    moved, _ = game(AIDED, runs=1, offset=lambda k: offsets[k])
    mean = scenario.family.mean_filter(1, RunSlices(1))
    nothing = np.zeros((1, 4))
    mean.advance(np.array([0]), nothing, nothing, np.ones(1))
    for k in range(1, 30):
        mean.advance(np.array([k]), offsets[k - 1], offsets[k - 2] if k > 1 else nothing, np.ones(1))
    # the last ranges are not resolved yet
    np.testing.assert_allclose(moved.navigator.state - clean.navigator.state, mean.prior, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_without_gnss_a_barometer_holds_the_height(fidelity):
    out = lambda k: Decision(np.zeros(64, dtype=bool))  # noqa: E731
    text = FLIGHT.replace("horizon=30", "horizon=200").replace("industrial", "automotive")
    aided, _ = game(f"{text},aids=barometer", fidelity, EXCLUDES, 64, out)
    plain, _ = game(text, fidelity, EXCLUDES, 64, out)
    deviation = np.sqrt(aided.navigator.position_covariance[0, 2, 2])
    assert 0.5 < deviation < 8.0  # slow errors of the ranges leave the offset unknown by 5 m
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], 64)
    assert low <= np.square(aided.error[:, 2] / deviation).sum() <= 1.1 * high
    assert np.std(plain.error[:, 2]) > 5.0 * np.std(aided.error[:, 2])


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_aids_act_again_where_ranges_are_taken_back(fidelity):
    text = AIDED.replace("barometer", "barometer:gate=0.2")
    push = lambda k: np.full((6, 3), 1.5 * k)  # noqa: E731
    back = lambda k: Decision(np.full(6, k < 14), np.arange(6) if k == 14 else None)  # noqa: E731
    one, told = game(text, fidelity, EXCLUDES, 6, back, push)
    other, _ = game(text, fidelity, EXCLUDES, 6, lambda k: Decision(k < 14 - np.arange(6)), push)
    np.testing.assert_array_equal(one.error, other.error)
    np.testing.assert_array_equal(one.navigator.covariance, other.navigator.covariance)
    assert sum(each.rejected.sum() for each in told) > 0


def test_the_solution_without_gnss_keeps_its_aids():
    """Carried by Φ of the inertial states and by what the aids make of an error, with the gains of each run."""
    simulation = Simulation(make_scenario(AIDED), num_runs=3, seed=0, demands=Demands(auxiliary=True))
    simulation.reset()
    navigator, model = simulation.navigator, simulation.navigator.model
    n = navigator.state.shape[1]
    kept = [*range(15), n - 2, n - 1]
    difference = np.zeros((3, n))
    for k in range(1, 20):
        before = navigator.state.copy()
        simulation.resolve()
        difference[:, kept] += (before - navigator.state)[:, kept]
        simulation.observe()
        phi, *_ = dense_step(model.dynamics, k)
        difference = difference @ phi.T @ model.aided[k].T
        others = [i for i in range(n) if i not in kept]
        difference[:, others] = 0.0  # no aid observes them
        np.testing.assert_allclose(navigator.auxiliary, difference[:, :15], rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(navigator.auxiliary_aids, difference[:, n - 2 :], rtol=1e-6, atol=1e-8)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="the rate of barometer must be 1 Hz or a whole fraction of it, got 3 Hz"):
        make_scenario(f"{FLIGHT},aids=barometer:rate=3")
    with pytest.raises(ValueError, match="detector 'separation-bank' needs coasting on inertia alone, which scenario"):
        Simulation(make_scenario(AIDED), None, [make_detector("separation-bank")])
    with pytest.raises(ValueError, match="kujur-flight: aids do not go together with fixes that are made from ranges"):
        make_scenario("kujur-flight:coupling=loose,aids=barometer")
    assert make_scenario("kujur-flight:horizon=5,onset=30,aids=barometer").name.endswith("aids=barometer")
