"""The error processes of an IMU against an independent Allan library and the data sheet; bad grades."""

import dataclasses

import allantools
import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from spoofgym.sensors.imu import GRADES, ImuGrade, gauss_markov_step, grade, white_sample
from tests.sensors.imu_errors import simulate

HUMP = ImuGrade(
    name="hump",
    gyro_bias=5.0,
    gyro_random_walk=0.03,
    gyro_instability=3.0,
    accelerometer_bias=500.0,
    accelerometer_random_walk=20.0,
    accelerometer_instability=60.0,
    correlation_time=20.0,
    source="made up: an instability that stands well above the white noise",
)
STEP = 0.1
SAMPLES = 400_000
TAUS = (0.1, 1.0, 10.0, 40.0, 200.0)
DEGREE_PER_HOUR = np.pi / 648000.0
FALSE_FAILURE = 1e-9


def allan_variance(imu, tau, axis):
    """White noise N²/τ plus a Gauss-Markov process (IEEE Std 952, eq. B.18): σ², correlation time T."""
    time = imu.correlation_time
    sigma = imu.instability_sigma[axis]
    if sigma == 0.0:
        return imu.noise_density[axis] ** 2 / tau
    ratio = tau / time
    markov = 2.0 * sigma**2 / ratio * (1.0 - (3.0 - 4.0 * np.exp(-ratio) + np.exp(-2.0 * ratio)) / (2.0 * ratio))
    return imu.noise_density[axis] ** 2 / tau + markov


def degrees_of_freedom(count, step, length):
    """Of the non-overlapping Allan variance, rounded down: (M - 1) / 2 for M clusters."""
    clusters = int(count * step / length)
    return (clusters - 1) / 2.0


@pytest.fixture(scope="module")
def errors():
    return simulate(HUMP, SAMPLES, STEP, STEP, np.random.default_rng(20))


@pytest.mark.parametrize("tau", TAUS)
@pytest.mark.parametrize("axis", range(6))
def test_allan_deviation_is_that_of_the_specification(errors, tau, axis):
    """The mean square of M-1 differences is taken as chi-square with (M-1)/2 degrees of freedom, fewer than it has.

    (Differences of white clusters: variance of their mean square 3/M, so 2M/3 degrees.) Each of the 30 cases then
    fails by chance with less than 1e-9.
    """
    (got_tau,), (deviation,), _, _ = allantools.adev(errors[:, axis], rate=1.0 / STEP, data_type="freq", taus=[tau])
    assert got_tau == pytest.approx(tau)
    degrees = degrees_of_freedom(SAMPLES, STEP, tau)
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees) / degrees
    expected = allan_variance(HUMP, tau, axis)
    assert low < deviation**2 / expected < high


def test_the_bands_tell_the_parts_apart():
    """The white part alone at the hump, and the hump alone at short tau, lie outside the bands."""
    quiet = dataclasses.replace(HUMP, gyro_instability=0.0, accelerometer_instability=0.0)
    for axis in (0, 3):
        assert allan_variance(quiet, 0.1, axis) > 0.9 * allan_variance(HUMP, 0.1, axis)
        degrees = degrees_of_freedom(SAMPLES, STEP, 40.0)
        low = chi2.ppf(FALSE_FAILURE / 2, degrees) / degrees
        assert allan_variance(quiet, 40.0, axis) < low * allan_variance(HUMP, 40.0, axis)


@pytest.mark.parametrize("name", GRADES)
def test_angle_random_walk_of_every_grade(name):
    """At one second the white part of each grade dominates; chi-square band, less than 1e-9 per axis and grade."""
    imu = grade(name)
    samples = simulate(imu, 400_000, 0.01, 1.0, np.random.default_rng(21))
    degrees = degrees_of_freedom(400_000, 0.01, 1.0)
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees) / degrees
    for axis in range(6):
        _, (deviation,), _, _ = allantools.adev(samples[:, axis], rate=100.0, data_type="freq", taus=[1.0])
        # the instability is held over each second: from one cluster to the next it moves by 2 σ² (1 - exp(-1/T)) / 2
        moved = imu.instability_sigma[axis] ** 2 * (1.0 - np.exp(-1.0 / imu.correlation_time))
        assert low < deviation**2 / (imu.noise_density[axis] ** 2 + moved) < high


def test_units_of_the_data_sheet():
    """Liu 2018, table 1, and the KVH 1775's class, converted by hand."""
    imu = grade("navigation")
    np.testing.assert_allclose(imu.bias_sigma[[0, 3]], [4.8481368e-8, 9.80665e-4], rtol=1e-7)
    np.testing.assert_allclose(imu.noise_density[[0, 3]], [1.4544410e-6, 1.96133e-4], rtol=1e-7)
    np.testing.assert_array_equal(imu.instability_sigma, np.zeros(6))
    fog = grade("fog")
    np.testing.assert_allclose(fog.bias_sigma[[0, 3]], [4.8481368e-7, 4.903325e-4], rtol=1e-7)
    np.testing.assert_allclose(fog.noise_density[[0, 3]], [3.4906585e-6, 1.176798e-3], rtol=1e-7)
    np.testing.assert_array_equal(fog.instability_sigma, np.zeros(6))
    np.testing.assert_allclose(HUMP.instability_sigma[[0, 3]], [3.0 * DEGREE_PER_HOUR, 60e-6 * 9.80665], rtol=1e-7)


def test_start_has_the_variance_of_bias_and_instability():
    """2000 first samples: each sum of squares is chi-square with 2000 degrees; less than 1e-9 per axis."""
    first = np.array([simulate(HUMP, 1, STEP, STEP, np.random.default_rng(i))[0] for i in range(2000)])
    variance = HUMP.bias_sigma**2 + HUMP.instability_sigma**2 + HUMP.noise_density**2 / STEP
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], 2000)
    total = np.sum(first**2 / variance, axis=0)
    assert np.all((low < total) & (total < high))


def test_the_instability_is_held_over_an_interval():
    quiet = dataclasses.replace(HUMP, gyro_random_walk=0.0, accelerometer_random_walk=0.0)
    held = simulate(quiet, 25, 0.1, 0.5, np.random.default_rng(0)).reshape(5, 5, 6)
    np.testing.assert_array_equal(held, np.broadcast_to(held[:, :1], held.shape))
    assert np.all(np.diff(held[:, 0], axis=0) != 0.0)


def test_steps_follow_their_equations():
    normals = np.random.default_rng(3).standard_normal(50)
    decay, sigma = np.exp(-1.0 / 7.0), 2.5
    value, path = 1.5, []
    for normal in normals:
        value = gauss_markov_step(value, sigma, decay, normal)
        path.append(value)
    driving = sigma * np.sqrt(-np.expm1(-2.0 / 7.0)) * normals
    expected, _ = lfilter([1.0], [1.0, -decay], driving, zi=[decay * 1.5])
    np.testing.assert_allclose(path, expected, rtol=1e-12)
    assert white_sample(0.3, 0.01, -2.0) == pytest.approx(-6.0)


def test_an_unknown_grade_lists_the_valid_ones():
    valid = "unknown IMU grade 'tactic'; valid grades: navigation, fog, tactical, industrial, automotive"
    with pytest.raises(ValueError, match=valid):
        grade("tactic")


@pytest.mark.parametrize(
    "name",
    [
        "gyro_bias",
        "gyro_random_walk",
        "gyro_instability",
        "accelerometer_bias",
        "accelerometer_random_walk",
        "accelerometer_instability",
        "correlation_time",
    ],
)
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_a_value_that_is_no_size_is_refused(name, value):
    with pytest.raises(ValueError, match=f"IMU grade 'hump': {name} must be .*, got {value}"):
        dataclasses.replace(HUMP, **{name: value})


def test_a_correlation_time_of_zero_is_refused():
    with pytest.raises(ValueError, match="correlation_time must be a finite number greater than 0, got 0"):
        dataclasses.replace(HUMP, correlation_time=0.0)
