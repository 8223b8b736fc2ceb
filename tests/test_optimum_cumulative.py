"""The worst case against the cumulative test, in closed form."""

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from spoofgym.optimum import cumulative_optimum, expected_play, missed_magnitude
from spoofgym.optimum.response import error_response
from spoofgym.scenarios import make_scenario


@pytest.mark.parametrize(("window", "magnitude"), [(30, 6.78), (60, 7.71), (120, 8.87)])
def test_one_channel_misses_biases_of_a_known_size(window, magnitude):
    """P_FA 1e-5, P_MD one half, one channel."""
    assert missed_magnitude(chi2.isf(1e-5, window), window) == pytest.approx(magnitude, abs=0.005)


@pytest.mark.parametrize("missed", [1e-3, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("degrees", [1, 3, 90, 360])
def test_the_noncentrality_solves_the_equation(degrees, missed):
    threshold = chi2.isf(1e-4, degrees)
    magnitude = missed_magnitude(threshold, degrees, missed)
    assert ncx2.cdf(threshold, degrees, magnitude**2) == pytest.approx(missed, rel=1e-7)


@pytest.fixture(scope="module")
def model():
    return make_scenario("liu-flight:horizon=30").linear_model()


def test_the_attack_moves_the_error_by_the_largest_singular_value(model):
    threshold = chi2.isf(1e-5, 3 * 20)
    attack, magnitude = cumulative_optimum(model, 20, threshold, 0.3)
    assert ncx2.cdf(threshold, 60, magnitude**2) == pytest.approx(0.3)
    assert np.sum(attack.whitened**2) == pytest.approx(magnitude**2)
    largest = np.linalg.svd(error_response(model, 20).reshape(2, -1), compute_uv=False)[0]
    assert attack.final_error == pytest.approx(magnitude * largest)


def test_no_attack_that_is_missed_as_often_goes_further(model):
    attack, magnitude = cumulative_optimum(model, 30, chi2.isf(1e-5, 90))
    played = expected_play(model, attack.offsets, 25.9)
    np.testing.assert_allclose(played.whitened, attack.whitened, atol=1e-9)
    assert np.hypot(*played.final_error) == pytest.approx(attack.final_error)
    others = np.random.default_rng(0).normal(size=(500, 90)) + 3.0 * attack.whitened.reshape(-1)
    others *= magnitude / np.linalg.norm(others, axis=1)[:, None]
    errors = others @ error_response(model, 30).reshape(2, -1).T
    assert np.hypot(*errors.T).max() < attack.final_error


def test_what_cannot_be_is_refused(model):
    with pytest.raises(
        ValueError, match=r"without any bias .* is passed with probability 0\.000226, not more than 0.5"
    ):
        missed_magnitude(10.0, 30)
    with pytest.raises(ValueError, match=r"missed must be greater than 0 and less than 1, got 1.0"):
        missed_magnitude(50.0, 30, 1.0)
    with pytest.raises(ValueError, match="degrees must be a whole number, 1 or more, got 0"):
        missed_magnitude(50.0, 0)
    with pytest.raises(ValueError, match="threshold must be a finite number greater than 0"):
        missed_magnitude(-1.0, 30)
    with pytest.raises(ValueError, match=r"num_epochs must lie in 1..30"):
        cumulative_optimum(model, 31, 200.0)
