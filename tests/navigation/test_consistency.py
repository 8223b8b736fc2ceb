"""The filter's covariance against the errors that it makes, in both fidelities (Bar-Shalom, Li, Kirubarajan, 5.4).

Runs are independent, so a sum of normalised squared errors at one epoch over N runs is chi-square with N times the
dimension; clean innovations are white, so the nis of all epochs add up too. Every band has a false-failure probability
of 2e-8; the seeds are arbitrary.
"""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.geodesy import position_difference
from spoofgym.navigation.loose.warm_start import ERROR
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.imu import grade
from spoofgym.sensors.range_fix import range_fix_along
from spoofgym.sensors.ranging import KUJUR
from spoofgym.sensors.receiver import ZERO, Receiver
from spoofgym.simulation import Simulation

FALSE_FAILURE = 2e-8
ONSET, HORIZON = 140.0, 60
"""Into a turn that begins at 150 s, with the warm-up before it."""
RUNS = {"linear": 2000, "strapdown": 200}
PARTS = {"all": slice(0, 15), "attitude": slice(0, 3), "velocity": slice(3, 6), "position": slice(6, 9)}


def band(degrees):
    """Of the mean: chi-square over its degrees of freedom."""
    return chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees) / degrees


def matched(**changes):
    """The Liu flight with a filter that also starts with the truth's own uncertainty: its model is exact."""
    base = liu_flight(onset=ONSET, horizon=HORIZON)
    sigma = changes.pop("sigma", base.family.tuning.measurement_sigma)
    tuning = dataclasses.replace(base.family.tuning, initial_scale=1.0, measurement_sigma=sigma)
    scenario = base.changed(tuning=tuning, **changes)
    assert scenario.matched
    return scenario


SCENARIOS = {
    "position": matched,
    "velocity": lambda: matched(
        receiver=Receiver(velocity_sigma=(0.1, 0.1, 0.2)), sigma=(3.7, 3.7, 6.0, 0.1, 0.1, 0.2)
    ),
    "arm-and-latency": lambda: matched(
        receiver=Receiver(
            white_sigma=(0.5, 0.5, 1.0), velocity_sigma=(0.05, 0.05, 0.1), latency=0.2, lever_arm=(1.0, -8.0, 2.0)
        ),
        sigma=(0.5, 0.5, 1.0, 0.05, 0.05, 0.1),
    ),
}


def true_error(simulation, scenario):
    """Estimate minus truth in the filter's 15 states (biases: truth minus estimate), (N, 15)."""
    navigator = simulation.navigator
    if hasattr(navigator, "state"):
        return navigator.state.copy()
    sample = round(simulation.epoch.time[0] * scenario.truth.trajectory.rate)
    truth = scenario.truth.trajectory
    # C_hat = (I - [φ x]) C, so C C_hat' = I + [φ x]
    turned = np.einsum("ij,nkj->nik", truth.attitude[sample], navigator.attitude)
    error = np.empty((len(turned), 15))
    for axis, (row, column) in enumerate([(2, 1), (0, 2), (1, 0)]):
        error[:, axis] = 0.5 * (turned[:, row, column] - turned[:, column, row])
    error[:, 3:6] = navigator.velocity - truth.velocity[sample]
    error[:, 6:9] = position_difference(navigator.position, truth.position[sample])
    error[:, 9:] = navigator.true_bias - navigator.bias
    return error


def play(scenario, fidelity, runs, seed):
    """Clean epochs up to the end of the game; the nis of epochs 1..K and the error after the last fix."""
    simulation = Simulation(scenario, num_runs=runs, seed=seed, fidelity=fidelity)
    simulation.reset()
    nis = []
    for _ in range(scenario.truth.horizon):
        simulation.resolve()
        nis.append(simulation.observe().innovation.nis)
    simulation.resolve()
    return np.array(nis), true_error(simulation, scenario), simulation


def posterior(scenario):
    """The filter's P after the last fix."""
    model = scenario.linear_model()
    return model.covariance[-1] - model.whitened_gain[-1].T @ model.whitened_gain[-1]


@pytest.fixture(scope="module", params=[(name, fidelity) for name in SCENARIOS for fidelity in RUNS], ids="-".join)
def played(request):
    name, fidelity = request.param
    scenario = SCENARIOS[name]()
    return scenario, fidelity, *play(scenario, fidelity, RUNS[fidelity], 40)


@pytest.mark.parametrize("part", PARTS)
def test_errors_have_the_filters_covariance(played, part):
    """NEES of one epoch per run. Strapdown uses each run's own P."""
    scenario, fidelity, _, error, simulation = played
    states = PARTS[part]
    covariance = simulation.navigator.covariance if fidelity == "strapdown" else posterior(scenario)[None]
    inner, x = covariance[:, states, states], error[:, states]
    sigma = np.sqrt(np.diagonal(inner, axis1=1, axis2=2))
    inner = inner / (sigma[:, :, None] * sigma[:, None, :])
    nees = np.einsum("ni,ni->n", x / sigma, np.linalg.solve(inner, (x / sigma)[..., None])[..., 0])
    low, high = band(x.size)
    assert low < nees.sum() / x.size < high


def test_innovations_have_their_covariance(played):
    scenario, _, nis, _, _ = played
    degrees = nis.size * scenario.dimension
    low, high = band(degrees)
    assert low < nis.sum() / degrees < high


def test_innovations_are_chi_square_not_only_on_average(played):
    """The share above the 1 % quantile is binomial; 6 sigma is 2e-9, and 8 leaves room for its skewness."""
    scenario, _, nis, _, _ = played
    share = np.mean(nis > chi2.isf(0.01, scenario.dimension))
    assert abs(share - 0.01) < 8.0 * np.sqrt(0.01 * 0.99 / nis.size)


def test_strapdown_covariance_is_that_of_the_linear_model(played):
    scenario, fidelity, _, _, simulation = played
    if fidelity == "linear":
        simulation = play(scenario, "strapdown", 1, 41)[2]
    sigma = np.sqrt(np.diag(posterior(scenario)))
    own = np.sqrt(np.diagonal(simulation.navigator.covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(own, np.broadcast_to(sigma, own.shape), rtol=0.01)


def test_the_band_sees_a_lever_arm_that_the_filter_does_not_know():
    """The same noise, but the filter takes the antenna for the IMU: the nis leaves the band."""
    scenario = SCENARIOS["arm-and-latency"]()
    simulation = Simulation(scenario, num_runs=20, seed=3, fidelity="strapdown")
    simulation.navigator.model = dataclasses.replace(simulation.navigator.model, lever_arm=np.zeros(3))
    simulation.reset()
    nis = []
    for _ in range(40):
        simulation.resolve()
        nis.append(simulation.observe().innovation.nis)
    degrees = np.size(nis) * 6
    assert np.sum(nis) / degrees > band(degrees)[1]


def rising():
    """Fixes from ranges, two of whose satellites give way to others after half a minute."""
    noise = range_fix_along(KUJUR, gps_24(), liu_flight().truth.trajectory, 1.0)
    slots = noise.white.shape[2]
    started = noise.started.copy()
    for slot in (1, 3):
        started[30 + slot, [slot, slot + slots, slot + 2 * slots]] = True
    return dataclasses.replace(noise, started=started)


MISMATCHED = {
    "ranges": {"receiver": Receiver(white_sigma=ZERO)},
    "coloured": {"receiver": Receiver(white_sigma=(1.0, 1.0, 2.0), markov_sigma=(3.0, 2.0, 4.0), markov_time=60.0)},
    "tactical": {"grade": grade("tactical")},
    "both": {
        "receiver": Receiver(white_sigma=(1.0, 1.0, 2.0), markov_sigma=(3.0, 2.0, 4.0), markov_time=60.0),
        "grade": dataclasses.replace(grade("tactical"), gyro_instability=3.0, correlation_time=40.0),
    },
}


def mismatched(name):
    """The Liu flight with noise that the filter does not model; `rising` is built when a test asks for it."""
    return liu_flight().changed(**MISMATCHED[name], **({"ranges": rising()} if name == "ranges" else {}))


@pytest.mark.parametrize("fidelity", RUNS)
@pytest.mark.parametrize("name", MISMATCHED)
def test_joint_covariance_predicts_the_errors_of_a_mismatched_filter(name, fidelity):
    """Played from power-on, compared with the recursion to the same epoch. 15 variances and the NEES, 2e-8 each."""
    epochs = 60
    base = mismatched(name)
    scenario = base.changed(onset=2.0, horizon=epochs)
    later = base.changed(onset=3.0 + epochs, horizon=1)
    assert not scenario.matched
    joint = later.family.warm_start().joint_covariance[ERROR, ERROR]
    _, error, _ = play(scenario, fidelity, RUNS[fidelity], 42)
    sigma = np.sqrt(np.diag(joint))
    low, high = band(len(error))
    ratio = np.mean((error / sigma) ** 2, axis=0)
    assert np.all((low < ratio) & (ratio < high))
    scaled = error / sigma
    nees = np.einsum("ni,ni->", scaled, np.linalg.solve(joint / np.outer(sigma, sigma), scaled.T).T)
    low, high = band(error.size)
    assert low < nees / error.size < high


@pytest.mark.parametrize("name", MISMATCHED)
def test_the_filters_own_covariance_is_another_one(name):
    """So that the test above has something to tell."""
    scenario = mismatched(name).changed(onset=63.0, horizon=1)
    warm = scenario.family.warm_start()
    ratio = np.diag(warm.joint_covariance)[:15] / np.diag(warm.filter_covariance)
    low, high = band(RUNS["linear"])
    assert np.any((ratio < low) | (ratio > high))
