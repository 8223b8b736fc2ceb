"""The geometric median of a mixture of Gaussians, against sampling and against a search."""

import numpy as np
import pytest
from scipy.optimize import minimize

from spoofgym.optimum.bayes.median import expected_distance, geometric_median, rice

MIXTURE = np.array([[0.5, 0.0, 0.0, 0.3], [0.3, 4.0, 1.0, 1.0], [0.15, -2.0, 6.0, 0.5], [0.05, 30.0, -10.0, 2.0]])


def test_expected_distance_is_that_of_draws() -> None:
    """Six standard errors: it fails by chance with a probability of 2e-9."""
    rng = np.random.default_rng(3)
    member = rng.choice(len(MIXTURE), 400_000, p=MIXTURE[:, 0])
    points = MIXTURE[member, 1:3] + MIXTURE[member, 3:] * rng.standard_normal((len(member), 2))
    for x, y in ((0.0, 0.0), (1.0, 2.0), (20.0, -30.0)):
        distance = np.hypot(points[:, 0] - x, points[:, 1] - y)
        error = distance.std() / np.sqrt(len(distance))
        assert expected_distance(MIXTURE, x, y, rice()) == pytest.approx(distance.mean(), abs=6.0 * error)


def test_no_point_is_nearer() -> None:
    found = np.array(geometric_median(MIXTURE, (2.0, 1.0), rice()))
    searched = minimize(lambda point: expected_distance(MIXTURE, *point, rice()), found + 0.5, method="Nelder-Mead")
    np.testing.assert_allclose(found, searched.x, atol=0.02)
    assert expected_distance(MIXTURE, *found, rice()) == pytest.approx(searched.fun, rel=1e-5)


def test_of_one_gaussian_it_is_the_middle() -> None:
    alone = np.array([[1.0, -3.0, 2.0, 0.7]])
    np.testing.assert_allclose(geometric_median(alone, (5.0, 5.0), rice()), (-3.0, 2.0), atol=2e-3)
    assert expected_distance(alone, -3.0, 2.0, rice()) == pytest.approx(0.7 * np.sqrt(0.5 * np.pi), rel=1e-9)
