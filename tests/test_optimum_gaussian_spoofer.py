"""The spoofer that draws its pull: its filters against the victim's own and known limits, and the bound it gives."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.optimum.gaussian_spoofer import (
    Posterior,
    best_estimate,
    beyond_loss,
    draw_games,
    error_loss,
    infer,
    lower_bound,
    posteriors,
    risks,
)
from spoofgym.optimum.pull_process import drift_pull, no_pull, unseen_pull
from spoofgym.scenarios import make_scenario

CAP = 200.0


@pytest.fixture(scope="module")
def model():
    return make_scenario("liu-flight:horizon=40,imu=tactical").linear_model()


def used(model):
    """Variance per axis after every fix of epochs 1..K is used."""
    gain = model.whitened_gain
    after = model.covariance - np.einsum("kmi,kmj->kij", gain, gain)
    return 0.5 * (after[1:, 6, 6] + after[1:, 7, 7])


def test_without_a_pull_it_is_the_filter_that_uses_every_fix(model):
    fixes, _, pulls = draw_games(model, no_pull(model), 3, np.random.default_rng(1))
    _, variance, _ = infer(model, no_pull(model), fixes)
    assert not pulls.any()
    np.testing.assert_allclose(variance, used(model), rtol=1e-8)


def test_an_endless_pull_leaves_the_inertial_drift(model):
    """Horizontal fixes of which nothing is known tell nothing: the covariance is that of a filter without them."""
    fixes, _, _ = draw_games(model, no_pull(model), 2, np.random.default_rng(1))
    _, variance, _ = infer(model, drift_pull(model, 1e4), fixes)
    _, smaller, _ = infer(model, drift_pull(model, 1e-3), fixes)
    covariance, found = model.prior_covariance.copy(), []
    for k in range(model.num_epochs + 1):
        covariance = model.transition[k] @ covariance @ model.transition[k].T + model.process_noise[k]
        rows = np.zeros((3, 15))
        rows[:, :9] = model.observation[k]
        rows = rows if k == 0 else rows[2:]  # the height is not pulled, and nobody attacks at epoch 0
        noise = model.measurement_covariance[-len(rows) :, -len(rows) :]
        gain = np.linalg.solve(rows @ covariance @ rows.T + noise, rows @ covariance)
        covariance = covariance - covariance @ rows.T @ gain
        found.append(0.5 * (covariance[6, 6] + covariance[7, 7]))
    # at its onset the pull has no offset of its own, so that the first fixes still tell the position
    np.testing.assert_allclose(variance[20:], found[21:], rtol=0.05)
    np.testing.assert_allclose(smaller, used(model), rtol=1e-4)


@pytest.mark.parametrize("make", [drift_pull, unseen_pull])
def test_what_is_inferred_is_as_certain_as_it_says(model, make):
    """Errors over their deviations, at the end of 2,000 games, by chi-square; a right filter fails with 1e-7."""
    pull = make(model, 2.0)
    (found,) = posteriors(model, [pull], 2000, np.random.default_rng(2))
    off = (found.error - found.mean[0])[:, -1]
    total = np.sum(off**2) / found.variance[0, -1]
    # two axes whose variances are not quite the same
    low, high = stats.chi2.interval(1 - 1e-7, 2 * len(off))
    assert 0.95 * low < total < 1.05 * high


def test_unseen_pulls_have_the_noncentrality_they_say(model):
    pull = unseen_pull(model, 3.0)
    _, _, pulls = draw_games(model, pull, 4, np.random.default_rng(3))
    clean, dirty = np.zeros((4, model.num_epochs + 1, 3)), np.zeros((4, model.num_epochs + 1, 3))
    dirty[:, :, :2] = -pulls
    _, _, quiet = infer(model, no_pull(model), clean)
    _, _, loud = infer(model, no_pull(model), dirty)
    noncentrality = 2.0 * (quiet - loud)[:, -1]
    # the height of these attacks is left out, which is a small part of them
    amplitudes = np.linalg.lstsq(pull.observation[1:].reshape(-1, 2), pulls[:, 1:].reshape(4, -1).T, rcond=None)[0]
    np.testing.assert_allclose(noncentrality, 9.0 * np.sum(amplitudes**2, axis=0), rtol=0.01)


@pytest.mark.parametrize("loss", [error_loss(CAP), beyond_loss(2.0)])
def test_the_best_estimate_costs_less_than_trust_and_than_distrust(model, loss):
    pulls = [no_pull(model), drift_pull(model, 2.0), unseen_pull(model, 3.0)]
    games = posteriors(model, pulls, 150, np.random.default_rng(4))
    shares = np.array([0.5, 0.2, 0.3])
    best = shares @ [cost.mean() for cost in risks(games, shares, loss)]
    for fixed in (0, 1, 2):
        costs = [loss.of(np.linalg.norm(game.error - game.mean[fixed], axis=2)).mean() for game in games]
        assert best <= shares @ costs


def test_a_sure_hypothesis_is_believed(model):
    found, _ = posteriors(model, [no_pull(model), drift_pull(model, 3.0)], 5, np.random.default_rng(5))
    sure = Posterior(found.mean, found.variance, found.log_likelihood * 0.0, found.error)
    for shares, mean in (([1.0, 1e-12], found.mean[0]), ([1e-12, 1.0], found.mean[1])):
        np.testing.assert_allclose(best_estimate(sure, np.log(shares), error_loss(CAP)), mean, atol=1e-9)


def test_the_bound_lies_between_a_clean_game_and_coasting(model):
    pulls = [drift_pull(model, 2.0), unseen_pull(model, 3.0)]
    bound = lower_bound(model, error_loss(CAP), pulls, games=40)
    clean = np.sqrt(0.5 * np.pi * used(model)).mean()
    _, coasting, _ = infer(model, drift_pull(model, 1e4), np.zeros((1, model.num_epochs + 1, 3)))
    assert 1.2 * clean < bound.value < np.sqrt(0.5 * np.pi * coasting).mean()
    assert bound.value == pytest.approx(0.5 * (bound.clean + bound.attacked), rel=1e-9)
    assert sum(bound.shares.values()) == pytest.approx(1.0)
    assert bound == lower_bound(model, error_loss(CAP), pulls, games=40)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pulls": []}, "at least one pull"),
        ({"clean": 1.0}, "clean must be"),
        ({"games": 1}, "games must be"),
    ],
)
def test_what_makes_no_bound_is_refused(model, options, message):
    with pytest.raises(ValueError, match=message):
        lower_bound(model, **{"loss": error_loss(CAP), "pulls": [drift_pull(model, 1.0)], **options})
