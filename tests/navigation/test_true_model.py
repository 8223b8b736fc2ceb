"""What really acts: of a matched scenario the filter's own model, of others what a filter should believe."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.navigation.loose.true_model import true_model
from spoofgym.optimum.bayes.filtering import best_filter, look_ahead, run_filter
from spoofgym.optimum.play import HORIZONTAL
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation


def test_of_a_matched_scenario_it_is_the_filters() -> None:
    scenario = make_scenario("foi-drive:horizon=30")
    model, acts = scenario.linear_model(), true_model(scenario.family)
    filter_ = best_filter(acts, np.ones(31, bool), np.zeros(31), look_ahead(acts, 0))
    expected = np.linalg.inv(model.innovation_factor)
    np.testing.assert_allclose(filter_.whiten, expected, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(filter_.gain, expected.transpose(0, 2, 1) @ model.whitened_gain, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("name", ["liu-flight:horizon=60,imu=tactical", "foi-drive:receiver=foi,horizon=60"])
def test_of_others_innovations_are_white_and_the_covariance_is_right(name: str) -> None:
    """Each of the bounds is six standard deviations wide: it fails by chance with a probability of 2e-9."""
    scenario, runs = make_scenario(name), 200
    epochs = scenario.timeline.num_epochs + 1
    acts = true_model(scenario.family)
    found = best_filter(acts, np.ones(epochs, bool), np.zeros(epochs), look_ahead(acts, 0))
    simulation = Simulation(scenario, None, (), make_response("always-exclude"), runs, seed=11)
    simulation.reset()
    residual, error = np.empty((runs, epochs, 3)), np.empty((runs, epochs, 2))
    for k in range(epochs):
        if k:
            simulation.observe()
        residual[:, k] = simulation.epoch.innovation.residual
        simulation.resolve()
        error[:, k] = simulation.error[:, :2]
    whitened, estimate = run_filter(found, residual)
    count = whitened.size
    assert (whitened**2).mean() == pytest.approx(1.0, abs=6.0 * np.sqrt(2.0 / count))
    assert (whitened[:, 1:] * whitened[:, :-1]).mean() == pytest.approx(0.0, abs=6.0 / np.sqrt(count))
    missed = error[:, -1] - estimate[:, -1, HORIZONTAL]
    squares = np.einsum("gi,ij,gj->g", missed, np.linalg.inv(found.covariance[-1]), missed)
    assert squares.mean() == pytest.approx(2.0, abs=6.0 * 2.0 / np.sqrt(runs))
