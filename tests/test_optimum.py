"""What attacks are worth, and the best of simple forms, on a small synthetic filter; bad input; and the Liu flight."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import ncx2

from spoofgym.optimum import (
    best_budget,
    best_ramp,
    bounded_optimum,
    dynamic_programme,
    expected_play,
    noncentrality_optimum,
    upper_bound,
)
from spoofgym.optimum.response import error_response, increment_maps
from spoofgym.scenarios.liu_flight import liu_flight
from tests.synthetic_filter import ramp_offsets, synthetic_model

THRESHOLD = 25.9

# What a sequence of offsets is worth


@pytest.mark.parametrize("dimension", [3, 6])
def test_expected_play_agrees_with_the_simulated_filter(dimension):
    """Survival and both components of the mean error given survival, within 5 standard errors.

    False-failure probability 3 x 5.7e-7; the seed is fixed.
    """
    model, threshold, runs = synthetic_model(12, dimension), 9.0 + dimension, 40_000
    offsets = ramp_offsets(model, 0.8 if dimension == 3 else 0.2, 60.0)
    expected = expected_play(model, offsets, threshold)
    survived, error = simulate(model, expected.offsets, threshold, runs, np.random.default_rng(1))
    sigma = np.sqrt(expected.survival * (1.0 - expected.survival) / runs)
    assert 0.3 < expected.survival < 0.9
    assert abs(survived.mean() - expected.survival) < 5.0 * sigma
    left = error[survived]
    standard_error = left.std(axis=0) / np.sqrt(len(left))
    assert (np.abs(left.mean(axis=0) - expected.final_error) < 5.0 * standard_error).all()


def simulate(model, offsets, threshold, runs, generator):
    """The stochastic recursion, step by step: (survived (runs,), horizontal error after the last epoch (runs, 2))."""
    posterior = model.covariance[0] - model.whitened_gain[0].T @ model.whitened_gain[0]
    error = generator.multivariate_normal(np.zeros(15), posterior, runs, method="eigh")
    survived = np.ones(runs, dtype=bool)
    previous = np.zeros(3)
    for k, offset in enumerate(offsets, start=1):
        rate = (offset - previous) / (model.time[k] - model.time[k - 1])
        spoofing = np.concatenate((offset, rate))[: model.dimension]
        previous = offset
        process = generator.multivariate_normal(np.zeros(15), model.process_noise[k], runs, method="eigh")
        error = error @ model.transition[k].T + process
        receiver = generator.standard_normal((runs, model.dimension)) * np.sqrt(np.diag(model.measurement_covariance))
        residual = error[:, :9] @ model.observation[k].T - spoofing - receiver
        whitened = np.linalg.solve(model.innovation_factor[k], residual.T).T
        survived &= (whitened**2).sum(axis=1) <= threshold
        error = error - whitened @ model.whitened_gain[k]
    return survived, error[:, 6:8]


@pytest.mark.parametrize("dimension", [3, 6])
def test_a_batch_gives_the_same_bits_as_single_plays(dimension):
    model = synthetic_model(9, dimension)
    offsets = np.random.default_rng(2).normal(size=(5, 9, 3)).cumsum(axis=1)
    batch = expected_play(model, offsets, THRESHOLD)
    assert batch.whitened.shape == (5, 9, dimension)
    for b in range(5):
        single = expected_play(model, offsets[b], THRESHOLD)
        for name in ("whitened", "final_error", "log_survival", "survival", "score"):
            np.testing.assert_array_equal(getattr(single, name), getattr(batch, name)[b])


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_linear_maps_agree_with_the_recursion(dimension):
    model = synthetic_model(9, dimension, interval=0.5)
    increments = np.random.default_rng(3).normal(size=(9, 3))
    played = expected_play(model, increments.cumsum(axis=0), THRESHOLD)
    innovations, error = increment_maps(model)
    np.testing.assert_allclose(innovations @ increments.ravel(), played.whitened.ravel(), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(error @ increments.ravel(), played.final_error, rtol=1e-10)
    response = error_response(model, 9)
    np.testing.assert_allclose(np.einsum("jkm,km->j", response, played.whitened), played.final_error, rtol=1e-10)


def test_nothing_sent_moves_nothing():
    model = synthetic_model(9)
    played = expected_play(model, np.zeros((9, 3)), THRESHOLD)
    assert played.score == 0.0
    np.testing.assert_allclose(played.survival, ncx2.cdf(THRESHOLD, 3, 1e-300) ** 9)


def test_an_absurd_attack_is_worth_nothing_and_gives_no_nan():
    played = expected_play(synthetic_model(9), ramp_offsets(synthetic_model(9), 1e6, 90.0), THRESHOLD)
    assert played.score == 0.0
    assert np.isfinite(played.log_survival)


# The closed form


def test_closed_form_offsets_provoke_its_innovations():
    model = synthetic_model(20)
    attack = noncentrality_optimum(model, 20, 100.0)
    played = expected_play(model, attack.offsets, THRESHOLD)
    np.testing.assert_allclose(played.whitened, attack.whitened, atol=1e-10)
    np.testing.assert_allclose((attack.whitened**2).sum(), 100.0)
    np.testing.assert_allclose(np.hypot(*played.final_error), attack.final_error)
    assert 0.0 <= attack.azimuth < 180.0


def test_closed_form_beats_random_search():
    model = synthetic_model(20)
    attack = noncentrality_optimum(model, 4, 9.0)
    whitened = np.random.default_rng(4).normal(size=(20_000, 4, 3))
    whitened *= 3.0 / np.linalg.norm(whitened, axis=(1, 2))[:, None, None]
    reached = np.linalg.norm(np.einsum("jkm,bkm->bj", error_response(model, 4), whitened), axis=1)
    assert 0.8 * attack.final_error < reached.max() <= attack.final_error


def test_closed_form_is_what_a_general_optimiser_finds():
    model = synthetic_model(5)
    attack = noncentrality_optimum(model, 5, 9.0)
    innovations, error = increment_maps(model)
    found = minimize(
        lambda v: -np.linalg.norm(error @ v),
        np.ones(15),
        jac=lambda v: -error.T @ (error @ v) / np.linalg.norm(error @ v),
        constraints={
            "type": "ineq",
            "fun": lambda v: 9.0 - ((innovations @ v) ** 2).sum(),
            "jac": lambda v: -2.0 * innovations.T @ (innovations @ v),
        },
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert found.success
    np.testing.assert_allclose(-found.fun, attack.final_error, rtol=1e-6)


def test_best_budget_beats_every_other_budget():
    model = synthetic_model(40)
    attack, played = best_budget(model, THRESHOLD)
    budgets = np.geomspace(0.1, 10.0, 401) * attack.budget
    offsets = np.sqrt(budgets / attack.budget)[:, None, None] * attack.offsets
    scores = expected_play(model, offsets, THRESHOLD).score
    assert scores.max() <= played.score * (1.0 + 1e-12)
    assert scores.max() > played.score * (1.0 - 1e-4)


# The best ramp


@pytest.mark.parametrize("limit", [None, (4.0, 1.0, 4.0)])
def test_best_ramp_beats_a_brute_grid(limit):
    model = synthetic_model(20)
    best = best_ramp(model, THRESHOLD, None if limit is None else np.array(limit))
    azimuth, rate = np.meshgrid(np.arange(0.0, 180.0, 2.0), np.arange(0.05, 5.0, 0.05))
    offsets = np.stack([ramp_offsets(model, r, a) for r, a in zip(rate.ravel(), azimuth.ravel(), strict=True)])
    allowed = np.ones(len(offsets), dtype=bool)
    if limit is not None:
        allowed = (np.abs(offsets[:, 0]) <= np.array(limit) + 1e-12).all(axis=1)
        assert (np.abs(best.outcome.offsets[0]) <= np.array(limit) + 1e-9).all()
    scores = expected_play(model, offsets[allowed], THRESHOLD).score
    assert best.outcome.score * (1.0 - 3e-3) < scores.max() <= best.outcome.score
    np.testing.assert_allclose(best.outcome.offsets, ramp_offsets(model, best.rate, best.azimuth), atol=1e-9)


def test_best_ramp_in_a_given_direction():
    model = synthetic_model(20)
    east = best_ramp(model, THRESHOLD, azimuth=90.0)
    west = best_ramp(model, THRESHOLD, azimuth=270.0)
    assert (east.azimuth, west.azimuth) == (90.0, 270.0)
    np.testing.assert_allclose(east.outcome.score, west.outcome.score)
    assert east.outcome.score <= best_ramp(model, THRESHOLD).outcome.score


# Bad input


@pytest.mark.parametrize("num_epochs", [0, 6])
def test_epochs_that_the_model_does_not_have_are_refused(num_epochs):
    with pytest.raises(ValueError, match=r"num_epochs must lie in 1\.\.5"):
        noncentrality_optimum(synthetic_model(5), num_epochs, 1.0)


@pytest.mark.parametrize("budget", [-1.0, np.nan, np.inf])
def test_an_impossible_budget_is_refused(budget):
    with pytest.raises(ValueError, match="budget"):
        noncentrality_optimum(synthetic_model(5), 5, budget)


def test_the_closed_form_needs_position_fixes():
    model = synthetic_model(5, 6)
    with pytest.raises(ValueError, match="m = 6"):
        noncentrality_optimum(model, 5, 1.0)
    with pytest.raises(ValueError, match="m = 6"):
        best_budget(model, THRESHOLD)


@pytest.mark.parametrize("threshold", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_threshold_is_refused(threshold):
    model = synthetic_model(5)
    for call in (best_budget, best_ramp, upper_bound):
        with pytest.raises(ValueError, match="threshold"):
            call(model, threshold)
    with pytest.raises(ValueError, match="threshold"):
        bounded_optimum(model, threshold, 1.0)
    with pytest.raises(ValueError, match="threshold"):
        dynamic_programme(model, threshold, 0.0)
    with pytest.raises(ValueError, match="threshold"):
        expected_play(model, np.zeros((5, 3)), threshold)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, (1.0, 1.0), (1.0, 0.0, 1.0)])
def test_an_impossible_drag_off_rate_is_refused(rate):
    for call in (best_ramp, bounded_optimum):
        with pytest.raises(ValueError, match="drag_off_rate"):
            call(synthetic_model(5), THRESHOLD, rate)


@pytest.mark.parametrize("offsets", [np.zeros((4, 3)), np.zeros((5, 2)), np.zeros(3), np.full((5, 3), np.nan)])
def test_wrong_offsets_are_refused(offsets):
    with pytest.raises(ValueError, match="offsets"):
        expected_play(synthetic_model(5), offsets, THRESHOLD)


def test_a_tolerance_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="tolerance"):
        dynamic_programme(synthetic_model(5), THRESHOLD, 0.0, tolerance=0.0)


# The Liu flight


def test_liu_flight_comes_out_as_in_the_prototype():
    """The prototype flew other shapes of the manoeuvres (Liu 2018 gives them as a figure only): within 1.5 percent."""
    short, long = liu_flight().linear_model(), liu_flight(horizon=300).linear_model()
    ramp = best_ramp(short, THRESHOLD, 4.0)
    closed_form, played = best_budget(short, THRESHOLD)
    ours = [noncentrality_optimum(long, epochs, 1.0).gain for epochs in (60, 120, 300)]
    ours += [upper_bound(short, THRESHOLD).score]
    ours += [bounded_optimum(short, THRESHOLD, limit).score for limit in (4.0, 0.5)]
    ours += [float(played.score), float(ramp.outcome.score), closed_form.budget, ramp.rate]
    prototype = [1.727, 3.721, 15.58, 57.9, 57.8, 54.1, 51.2, 46.6, 270.0, 0.45]
    np.testing.assert_allclose(ours[:8], prototype[:8], rtol=0.015)
    np.testing.assert_allclose(ours[8:], prototype[8:], rtol=0.05)
    assert ramp.azimuth == pytest.approx(135.0, abs=5.0)
