"""The optimum within the limits of the game, and the upper bound of any attack, on a small synthetic filter."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from spoofgym.optimum import (
    best_budget,
    best_ramp,
    bounded_optimum,
    dynamic_programme,
    expected_play,
    upper_bound,
)
from spoofgym.optimum.bounded import LogScore
from spoofgym.optimum.response import error_response
from spoofgym.optimum.upper_bound import aimed_gain, separable_optimum
from tests.synthetic_filter import ramp_offsets, synthetic_model

THRESHOLD = 25.9
LIMITS = (0.2, 0.5, 1.0, 2.0, 4.0, None)


# The optimum within limits


@pytest.mark.parametrize("dimension", [3, 6])
def test_gradient_agrees_with_finite_differences(dimension):
    log_score = LogScore(synthetic_model(8, dimension), THRESHOLD)
    generator = np.random.default_rng(5)
    for _ in range(5):
        increments = generator.normal(size=24)
        _, gradient = log_score.loss(increments)
        step = 1e-6
        for i in range(24):
            shift = step * np.eye(24)[i]
            slope = (log_score.loss(increments + shift)[0] - log_score.loss(increments - shift)[0]) / (2.0 * step)
            np.testing.assert_allclose(gradient[i], slope, rtol=1e-5, atol=1e-7)


@cache
def optima():
    return [bounded_optimum(synthetic_model(40), THRESHOLD, limit) for limit in LIMITS]


def test_bounded_optimum_lies_between_its_neighbours():
    model = synthetic_model(40)
    bound = upper_bound(model, THRESHOLD)
    closed_form, _ = best_budget(model, THRESHOLD)
    increments = np.diff(closed_form.offsets, axis=0, prepend=np.zeros((1, 3)))
    for limit, best in zip(LIMITS, optima(), strict=True):
        step = np.inf if limit is None else limit
        clipped = expected_play(model, np.clip(increments, -step, step).cumsum(axis=0), THRESHOLD)
        ramp = best_ramp(model, THRESHOLD, limit)
        assert best.score <= bound.score
        assert best.score >= clipped.score
        assert best.score >= ramp.outcome.score * (1.0 - 1e-9)
        assert best.score == pytest.approx(float(best.outcome.score))
        if limit is not None:
            assert np.abs(best.actions).max() <= 1.0
            np.testing.assert_allclose(best.actions.cumsum(axis=0) * limit, best.outcome.offsets, atol=1e-9)


def test_bounded_optimum_grows_with_the_limit_up_to_the_upper_bound():
    scores = [best.score for best in optima()]
    assert (np.diff(scores) > 0.0).all()
    np.testing.assert_allclose(scores[-1], upper_bound(synthetic_model(40), THRESHOLD).score, rtol=1e-4)


@pytest.mark.parametrize("index", [1, 2, 3, 4])
def test_bounded_optimum_is_certified_for_its_direction(index):
    """There the log-score is concave: its maximum exceeds a point by at most the tangent plane's gain on the box."""
    limit, best = LIMITS[index], optima()[index]
    increments = (best.actions * limit).ravel()
    gradient = -LogScore(synthetic_model(40), THRESHOLD).loss(increments)[1]
    gap = np.abs(gradient).sum() * limit - gradient @ increments
    assert abs(gap) < 1e-5


@pytest.mark.parametrize("index", [2, 4])
def test_no_other_direction_of_start_finds_more(index):
    limit, best = LIMITS[index], optima()[index]
    log_score = LogScore(synthetic_model(40), THRESHOLD)
    generator = np.random.default_rng(6)
    for _ in range(6):
        start = np.repeat(generator.uniform(-0.5, 0.5, (1, 3)), 40, axis=0).ravel()
        found = minimize(log_score.loss, start, jac=True, method="L-BFGS-B", bounds=[(-limit, limit)] * 120)
        assert np.exp(-found.fun) <= best.score * (1.0 + 1e-9)


def test_bounded_optimum_with_velocity_fixes():
    model = synthetic_model(20, 6)
    limits = np.array([0.1, 0.2, 0.1])
    best, free = bounded_optimum(model, THRESHOLD, limits), bounded_optimum(model, THRESHOLD, None)
    assert best_ramp(model, THRESHOLD, limits).outcome.score <= best.score < free.score
    assert free.score < upper_bound(model, THRESHOLD).score


# The upper bound


def test_upper_bound_is_attained_by_a_play():
    bound = upper_bound(synthetic_model(40), THRESHOLD)
    assert bound.attained <= bound.score <= bound.attained * (1.0 + 2e-4)
    assert bound.spending.shape == (40,)


def test_dynamic_programme_agrees_with_the_dual_in_every_direction():
    model = synthetic_model(20)
    for azimuth in (0.0, 50.0, 130.0):
        gain = aimed_gain(error_response(model, 20), np.array([azimuth]))
        _, attained, bound = separable_optimum(gain, 3, THRESHOLD)
        lattice = dynamic_programme(model, THRESHOLD, azimuth)
        assert lattice.change < 1e-3
        assert np.exp(bound[0]) * (1.0 - 1e-3) < lattice.score <= np.exp(bound[0])
        assert attained[0] <= bound[0] < attained[0] + 1e-4


def test_random_attacks_stay_below_the_upper_bound():
    model = synthetic_model(20)
    generator = np.random.default_rng(7)
    offsets = generator.normal(size=(2000, 20, 3)).cumsum(axis=1) + ramp_offsets(model, 1.0, 30.0)
    assert expected_play(model, offsets, THRESHOLD).score.max() < upper_bound(model, THRESHOLD).score
