"""Receiver noise: its covariance, its correlation in time, what it draws; and what bad receivers are told."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from spoofgym.sensors.receiver import Receiver, draw_noise

ZERO = np.zeros(3)
FALSE_FAILURE = 1e-9
SIGMA = np.array([3.7, 2.1, 6.0])
TIME = 8.0


def chi_square_band(degrees):
    return chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees)


def fisher_band(pairs):
    """Of the correlation of ``pairs`` independent pairs of uncorrelated normals."""
    return np.tanh(norm.isf(FALSE_FAILURE / 2) / np.sqrt(pairs - 3))


def test_white_noise_has_its_covariance_and_no_memory():
    """Squares: chi-square; correlations of axes and of neighbours in time: Fisher's z. Less than 1e-9 each of 27."""
    receiver = Receiver(white_sigma=tuple(SIGMA), velocity_sigma=(0.1, 0.2, 0.3))
    epochs = 20_000
    noise = draw_noise(receiver, epochs, np.random.default_rng(1), ZERO) / [*SIGMA, 0.1, 0.2, 0.3]
    assert noise.shape == (epochs, 6)
    low, high = chi_square_band(epochs)
    total = np.sum(noise**2, axis=0)
    assert np.all((low < total) & (total < high))
    correlation = np.corrcoef(noise, rowvar=False)[np.triu_indices(6, 1)]
    assert np.abs(correlation).max() < fisher_band(epochs)
    for axis in range(6):
        # the even and the odd epochs make independent pairs
        assert abs(np.corrcoef(noise[::2, axis], noise[1::2, axis])[0, 1]) < fisher_band(epochs // 2)


@pytest.fixture(scope="module")
def coloured():
    """5000 independent stretches of 41 fixes, 2 Hz, Gauss-Markov only, started in the stationary distribution."""
    receiver = Receiver(rate=2.0, white_sigma=(0.0, 0.0, 0.0), markov_sigma=tuple(SIGMA), markov_time=TIME)
    rng = np.random.default_rng(2)
    return np.array([draw_noise(receiver, 41, rng, SIGMA * rng.standard_normal(3)) for _ in range(5000)]) / SIGMA


@pytest.mark.parametrize("epoch", [0, 1, 10, 40])
def test_coloured_noise_is_stationary(coloured, epoch):
    """Over independent stretches; chi-square with 5000 degrees, less than 1e-9 per axis and epoch."""
    low, high = chi_square_band(len(coloured))
    total = np.sum(coloured[:, epoch] ** 2, axis=0)
    assert np.all((low < total) & (total < high))


@pytest.mark.parametrize("lag", [1, 4, 16, 40])
def test_coloured_noise_decays_exponentially(coloured, lag):
    """First and lag-th value of independent stretches: what is left after the prediction is chi-square, and
    uncorrelated with the first. Less than 1e-9 per axis, lag and statement.
    """
    decay = np.exp(-lag * 0.5 / TIME)
    left = (coloured[:, lag] - decay * coloured[:, 0]) / np.sqrt(1.0 - decay**2)
    low, high = chi_square_band(len(coloured))
    total = np.sum(left**2, axis=0)
    assert np.all((low < total) & (total < high))
    for axis in range(3):
        correlation = np.corrcoef(left[:, axis], coloured[:, 0, axis])[0, 1]
        assert abs(correlation) < fisher_band(len(coloured))


def test_the_value_before_carries_on():
    """Two stretches drawn one after the other are one long one."""
    receiver = Receiver(white_sigma=(0.0, 0.0, 0.0), markov_sigma=(1.0, 2.0, 3.0), markov_time=5.0)
    whole = draw_noise(receiver, 30, np.random.default_rng(4), np.array([1.0, -2.0, 3.0]))
    rng = np.random.default_rng(4)
    first = draw_noise(receiver, 12, rng, np.array([1.0, -2.0, 3.0]))
    np.testing.assert_allclose(np.vstack([first, draw_noise(receiver, 18, rng, first[-1])]), whole, rtol=1e-12)
    calm = Receiver(white_sigma=(0.0, 0.0, 0.0), markov_sigma=(1e-12, 0.0, 0.0), markov_time=5.0)
    decayed = draw_noise(calm, 3, np.random.default_rng(4), np.array([1.0, 0.0, 0.0]))[:, 0]
    np.testing.assert_allclose(decayed, np.exp(-np.arange(1, 4) / 5.0), atol=1e-10)


def test_parts_add_up_and_the_velocity_stays_white():
    """White and coloured noise together are the coloured noise, then the white, of the same stream."""
    both = Receiver(
        white_sigma=(1.0, 2.0, 3.0), markov_sigma=(2.0, 2.0, 2.0), markov_time=9.0, velocity_sigma=(0.1, 0.1, 0.1)
    )
    got = draw_noise(both, 50, np.random.default_rng(5), ZERO)
    rng = np.random.default_rng(5)
    slow = Receiver(white_sigma=(0.0, 0.0, 0.0), markov_sigma=(2.0, 2.0, 2.0), markov_time=9.0)
    expected = np.hstack([draw_noise(slow, 50, rng, ZERO), np.zeros((50, 3))])
    expected += rng.standard_normal((50, 6)) * [1.0, 2.0, 3.0, 0.1, 0.1, 0.1]
    np.testing.assert_allclose(got, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("receiver", "drawn"),
    [
        (Receiver(white_sigma=(0.0, 0.0, 0.0)), 0),
        (Receiver(), 30),
        (Receiver(velocity_sigma=(0.1, 0.1, 0.1)), 60),
        (Receiver(white_sigma=(0.0, 0.0, 0.0), markov_sigma=(1.0, 0.0, 0.0), markov_time=3.0), 30),
        (Receiver(markov_sigma=(1.0, 0.0, 0.0), markov_time=3.0), 60),
    ],
)
def test_a_part_that_is_off_draws_nothing(receiver, drawn):
    rng, counter = np.random.default_rng(6), np.random.default_rng(6)
    noise = draw_noise(receiver, 10, rng, ZERO)
    counter.standard_normal(drawn)
    assert rng.bit_generator.state == counter.bit_generator.state
    if drawn == 0:
        np.testing.assert_array_equal(noise, np.zeros((10, 3)))


def test_samples_per_fix():
    assert Receiver(rate=1.0).samples_per_fix(100.0) == 100
    assert Receiver(rate=100.0).samples_per_fix(100.0) == 1
    assert Receiver(rate=10.0, latency=0.03).samples_per_fix(100.0) == 10
    assert Receiver(rate=4.0).interval == 0.25
    assert (Receiver().dimension, Receiver(velocity_sigma=(0.0, 0.0, 0.0)).dimension) == (3, 6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Receiver(rate=-1.0), "receiver: rate must be a finite number greater than 0, got -1.0"),
        (lambda: Receiver(rate=0.0), "receiver: rate must be"),
        (lambda: Receiver(white_sigma=(1.0, -2.0, 1.0)), "white_sigma must be a finite number, 0 or more, got -2.0"),
        (lambda: Receiver(white_sigma=(1.0, 2.0)), r"white_sigma must be three numbers \(E, N, U\), got \(1.0, 2.0\)"),
        (lambda: Receiver(velocity_sigma=(1.0, 2.0)), "velocity_sigma must be three numbers"),
        (lambda: Receiver(markov_sigma=(1.0, 1.0, np.nan), markov_time=3.0), "markov_sigma must be a finite number"),
        (lambda: Receiver(markov_sigma=(1.0, 1.0, 1.0)), "markov_time must be a finite number greater than 0, got 0.0"),
        (lambda: Receiver(markov_time=3.0), "markov_time 3.0 needs a markov_sigma beside it"),
        (lambda: Receiver(latency=-0.1), "latency must be a finite number, 0 or more, got -0.1"),
        (lambda: Receiver(rate=2.0, latency=0.5), "latency must be less than the interval of 0.5 s, got 0.5"),
        (lambda: Receiver(lever_arm=(1.0, np.inf, 0.0)), "lever_arm must be a finite number, got inf"),
        (lambda: Receiver(lever_arm=(1.0, 2.0)), "lever_arm must be three numbers"),
        (lambda: Receiver(rate=3.0).samples_per_fix(100.0), "rate 3 Hz must divide the IMU's 100 Hz"),
        (lambda: Receiver(rate=200.0).samples_per_fix(100.0), "rate 200 Hz must divide the IMU's 100 Hz"),
        (lambda: Receiver(latency=0.005).samples_per_fix(100.0), "latency 0.005 s must be a multiple of 0.01 s"),
    ],
)
def test_bad_input_is_told_what_is_valid(make, message):
    with pytest.raises(ValueError, match=message):
        make()
