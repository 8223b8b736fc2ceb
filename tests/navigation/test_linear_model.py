"""The linear model of a flight: Φ and Q by matrix exponentials, the warm filter against the prototype's figures, the
joint covariance of truth and filter against a plain simulation from power-on."""

import dataclasses

import numpy as np
import pytest
from pyins.kalman import compute_process_matrices
from scipy.stats import chi2

from spoofgym.navigation.error_model import navigation_dynamics
from spoofgym.navigation.linear_model import semidefinite_factor
from spoofgym.navigation.loose.warm_start import COLOUR, CONSTANT_BIAS, ERROR, INSTABILITY, cold_start, warm_up
from spoofgym.navigation.tuning import ARCSECOND, FilterTuning
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.sensors.imu import DEGREE_PER_HOUR, MICRO_G, grade
from spoofgym.sensors.receiver import Receiver

FALSE_FAILURE = 1e-9
IN_A_TURN = 160


@pytest.fixture(scope="module")
def flight():
    return liu_flight(onset=1098.0, horizon=2)


def dense_dynamics(trajectory, i):
    """F of one IMU sample, (15, 15)."""
    attitude = 0.5 * (trajectory.attitude[i] + trajectory.attitude[i + 1])
    block = np.empty((9, 9))
    navigation_dynamics(trajectory.velocity[i], trajectory.position[i], attitude @ trajectory.specific_force[i], block)
    full = np.zeros((15, 15))
    full[:9, :9] = block
    full[:3, 9:12], full[3:6, 12:15] = -attitude, attitude
    return full


def van_loan(dynamics, density, step):
    """Φ and Q of samples (n, 15, 15) by the series of van Loan's exponential, to rounding: |F dt| is below 0.2."""
    n = len(dynamics)
    block = np.zeros((n, 30, 30))
    block[:, :15, :15], block[:, :15, 15:] = dynamics * step, density * step
    block[:, 15:, 15:] = -dynamics.transpose(0, 2, 1) * step
    total = term = np.broadcast_to(np.eye(30), block.shape)
    for order in range(1, 19):
        term = term @ block / order
        total = total + term
    transition = total[:, :15, :15]
    return transition, total[:, :15, 15:] @ transition.transpose(0, 2, 1)


def test_van_loans_series_is_pyins(flight):
    """The oracle of the next test against that of pyins (whose expm is slow beside other threads)."""
    density = np.diag(flight.family.tuning.noise_density(flight.family.grade))
    dynamics = dense_dynamics(flight.truth.trajectory, 16_050)
    (transition,), (noise,) = van_loan(dynamics[None], density, 0.01)
    expected, added = compute_process_matrices(dynamics, density, 0.01)
    np.testing.assert_allclose(transition, expected, atol=1e-15)
    np.testing.assert_allclose(noise, added, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("epoch", [IN_A_TURN, 900])
def test_an_epoch_is_the_product_of_van_loans_exponentials(flight, epoch):
    """Sample by sample. Q: the kernel puts the noise of a sample at its end, half a sample late: half a percent of 1 s.

    Measured: Φ within 1e-10 of its largest elements (10 m/s per rad/s), Q within 4e-4.
    """
    dynamics, trajectory = flight.family.dynamics, flight.truth.trajectory
    samples = np.array([dense_dynamics(trajectory, i) for i in range(epoch * 100, (epoch + 1) * 100)])
    transition, noise = np.eye(15), np.zeros((15, 15))
    density = np.diag(flight.family.tuning.noise_density(flight.family.grade))
    for one, added in zip(*van_loan(samples, density, 0.01), strict=True):
        transition = one @ transition
        noise = one @ noise @ one.T + added
    np.testing.assert_allclose(dynamics.transition[epoch], transition, atol=1e-9)
    sigma = np.sqrt(np.diag(noise))
    sigma[9:] = 1.0
    deviation = (dynamics.process_noise[epoch] - noise) / np.outer(sigma, sigma)
    np.testing.assert_allclose(deviation, 0.0, atol=0.005)
    np.testing.assert_allclose(dynamics.true_noise[epoch], dynamics.process_noise[epoch][:9, :9], rtol=1e-12)


def test_one_exponential_is_not_enough_in_a_turn(flight):
    """The product differs from the exponential of the mean F by far more than the tolerance above."""
    mean = np.mean([dense_dynamics(flight.truth.trajectory, i) for i in range(17_000, 17_100)], axis=0)
    (single,), _ = van_loan(mean[None] / 8.0, np.zeros((15, 15)), 1.0)
    difference = np.abs(np.linalg.matrix_power(single, 8) - flight.family.dynamics.transition[170])[3:6, 9:12].max()
    assert difference > 1e-3


def test_warm_filter_has_the_prototypes_uncertainty(flight):
    """sqrt(P) at 1100 s, 1 Hz: row "ours 1 Hz" of the table in the reference on Liu 2018, N, E, U turned to E, N, U.

    Attitude 4.1 4.2 18.1 arcsec, velocity .0138 .0136 .0042 m/s, position .68 .67 .62 m, gyro .0117 .0128 .0253 deg/h,
    accelerometer 8.1 7.7 1.07 µg, within 10 %: our manoeuvres have other shapes.
    """
    model = flight.linear_model()
    gain = model.whitened_gain[-1].T
    sigma = np.sqrt(np.diag(model.covariance[-1] - gain @ gain.T))
    unit = np.repeat([ARCSECOND, 1.0, 1.0, DEGREE_PER_HOUR, MICRO_G], 3)
    navigation = [4.1, 4.2, 18.1, 0.0138, 0.0136, 0.0042, 0.68, 0.67, 0.62]
    prototype = np.array([*navigation, 0.0117, 0.0128, 0.0253, 8.1, 7.7, 1.07])
    np.testing.assert_allclose(sigma / unit, prototype, rtol=0.1)


def test_gains_are_those_of_the_covariance(flight):
    model = flight.linear_model()
    for k in range(model.num_epochs + 1):
        observation = np.hstack([model.observation[k], np.zeros((3, 6))])
        innovation = observation @ model.covariance[k] @ observation.T + model.measurement_covariance
        np.testing.assert_allclose(model.innovation_covariance[k], innovation, rtol=1e-10)
        np.testing.assert_allclose(model.innovation_factor[k] @ model.innovation_factor[k].T, innovation, rtol=1e-10)
        gain = model.covariance[k] @ observation.T @ np.linalg.inv(innovation)
        np.testing.assert_allclose(
            model.whitened_gain[k].T @ np.linalg.inv(model.innovation_factor[k]), gain, rtol=1e-8, atol=1e-15
        )


COLOURED = Receiver(white_sigma=(1.0, 1.5, 2.0), markov_sigma=(2.0, 3.0, 4.0), markov_time=20.0)
UNSTABLE = dataclasses.replace(
    grade("tactical"), gyro_instability=3.0, accelerometer_instability=500.0, correlation_time=15.0
)
TUNING = FilterTuning(initial_scale=2.0, process_noise_scale=1.7, measurement_sigma=(3.0, 2.0, 5.0))


@pytest.fixture(scope="module")
def simulated():
    """4000 plain simulations of 40 epochs from power-on: every noise drawn by itself; gains by a dense recursion."""
    base = liu_flight(onset=60.0, horizon=1)
    scenario = base.changed(grade=UNSTABLE, receiver=COLOURED, tuning=TUNING, true_position_random_walk=0.05)
    dynamics, count, runs = scenario.family.epochs(0, 40), 40, 4000
    rng = np.random.default_rng(8)
    covariance = np.diag((TUNING.initial_scale * TUNING.initial_sigma(UNSTABLE)) ** 2)
    constant = UNSTABLE.bias_sigma * rng.standard_normal((runs, 6))
    drift = UNSTABLE.instability_sigma * rng.standard_normal((runs, 6))
    slow = np.array(COLOURED.markov_sigma) * rng.standard_normal((runs, 3))
    error = np.zeros((runs, 15))
    error[:, :9] = TUNING.initial_sigma(UNSTABLE)[:9] * rng.standard_normal((runs, 9))
    error[:, 9:] = constant + drift
    for k in range(count):
        covariance = dynamics.transition[k] @ covariance @ dynamics.transition[k].T + dynamics.process_noise[k]
        observation = np.hstack([dynamics.observation[k], np.zeros((3, 6))])
        innovation = observation @ covariance @ observation.T + TUNING.measurement_covariance
        gain = covariance @ observation.T @ np.linalg.inv(innovation)
        covariance = (np.eye(15) - gain @ observation) @ covariance
        error = error @ dynamics.transition[k].T
        error[:, :9] += rng.multivariate_normal(np.zeros(9), dynamics.true_noise[k], runs, method="eigh")
        a = np.exp(-1.0 / UNSTABLE.correlation_time)
        moved = a * drift + np.sqrt(1 - a * a) * UNSTABLE.instability_sigma * rng.standard_normal((runs, 6))
        error[:, 9:] += moved - drift
        drift = moved
        b = np.exp(-1.0 / COLOURED.markov_time)
        slow = b * slow + np.sqrt(1 - b * b) * np.array(COLOURED.markov_sigma) * rng.standard_normal((runs, 3))
        fix = slow + COLOURED.white_sigma * rng.standard_normal((runs, 3))
        error -= (error @ observation.T - fix) @ gain.T
    joint = np.hstack([error, drift, slow, constant])
    start = cold_start(UNSTABLE, COLOURED, TUNING)
    return joint, covariance, warm_up(start, dynamics, UNSTABLE, COLOURED, TUNING)


def test_filter_covariance_is_the_dense_recursion(simulated):
    _, covariance, warm = simulated
    sigma = np.sqrt(np.diag(covariance))
    deviation = (warm.filter_covariance - covariance) / np.outer(sigma, sigma)
    np.testing.assert_allclose(deviation, 0.0, atol=1e-6)


def test_joint_covariance_is_that_of_the_simulation(simulated):
    """Each variance: chi-square with 4000 degrees, less than 1e-9 per state (30 states)."""
    joint, _, warm = simulated
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], len(joint))
    total = np.sum(joint**2, axis=0) / np.diag(warm.joint_covariance)
    assert np.all((low < total) & (total < high))


def test_joint_correlations_are_those_of_the_simulation(simulated):
    """Sums and differences of every two states, scaled by their sigmas, are chi-square too: 2 x 435 bands of 1e-11."""
    joint, _, warm = simulated
    sigma = np.sqrt(np.diag(warm.joint_covariance))
    low, high = chi2.ppf([5e-12, 1 - 5e-12], len(joint))
    scaled, correlation = joint / sigma, warm.joint_covariance / np.outer(sigma, sigma)
    for sign in (1.0, -1.0):
        variance = 2.0 + 2.0 * sign * correlation
        total = np.array([[np.sum((scaled[:, i] + sign * scaled[:, j]) ** 2) for j in range(30)] for i in range(30)])
        pairs = np.triu_indices(30, 1)
        ratio = total[pairs] / variance[pairs]
        assert np.all((low < ratio) & (ratio < high))


def test_the_filters_own_covariance_would_not_pass(simulated):
    """The truth of this case is not the filter's model, so the two covariances differ by more than the band."""
    _, covariance, warm = simulated
    ratio = np.diag(warm.joint_covariance)[:15] / np.diag(covariance)
    assert np.abs(np.log(ratio)).max() > 0.5


def test_joint_and_filter_agree_where_the_model_is_exact():
    base = liu_flight(onset=300.0, horizon=1)
    scenario = base.changed(tuning=dataclasses.replace(base.family.tuning, initial_scale=1.0))
    warm = scenario.family.warm_start()
    sigma = np.sqrt(np.diag(warm.filter_covariance))
    np.testing.assert_allclose(
        warm.joint_covariance[ERROR, ERROR] / np.outer(sigma, sigma),
        warm.filter_covariance / np.outer(sigma, sigma),
        atol=1e-6,
    )
    assert not warm.joint_covariance[INSTABILITY].any()
    assert not warm.joint_covariance[COLOUR].any()
    variance = np.diag(warm.joint_covariance[CONSTANT_BIAS, CONSTANT_BIAS])
    np.testing.assert_allclose(variance, base.family.grade.bias_sigma**2)


def test_factor_of_definite_and_singular_matrices():
    rng = np.random.default_rng(9)
    sizes = 10.0 ** rng.uniform(-9, 3, 12)
    for rank in (12, 5):
        root = rng.standard_normal((12, rank)) * sizes[:, None]
        covariance = root @ root.T
        covariance[3], covariance[:, 3] = 0.0, 0.0
        factor = semidefinite_factor(covariance)
        scale = np.where(np.diag(covariance) > 0, np.sqrt(np.diag(covariance)), 1.0)
        deviation = (factor @ factor.T - covariance) / np.outer(scale, scale)
        np.testing.assert_allclose(deviation, 0.0, atol=1e-12)
        assert not factor[3].any()
    definite = np.diag([4.0, 9.0]) + 1.0
    np.testing.assert_allclose(semidefinite_factor(definite), np.linalg.cholesky(definite), rtol=1e-14)
