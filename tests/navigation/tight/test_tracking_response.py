"""The response to a tracking error against the filter itself, fed with nothing but that error."""

import numpy as np
import pytest

from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.tight.tracking_response import projected_response, tracking_response
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario

CARRIER = make_scenario("kujur-flight:onset=60,horizon=12")
RISING = make_scenario("kujur-flight:onset=60,horizon=12,hour=0.25")
RATE = make_scenario("liu-flight:coupling=tight,onset=200,horizon=12")
UP, SLANTED = np.array([0.0, 0.0, 1.0]), np.array([0.48, -0.6, 0.64])


def impulses(scenario, direction):
    """Whitened innovations at epochs 1..K, (K, m, K): run j of a filter without noise has a metre of error at j + 1."""
    epochs = scenario.timeline.num_epochs
    navigator = scenario.family.navigator("linear", Demands(), 0, epochs, RunSlices(1))
    whitened, before = [], np.zeros((epochs, 3))
    for k in range(epochs + 1):
        offset = np.zeros((epochs, 3))
        if k:
            offset[k - 1] = direction
        rate, nothing = (offset - before) / scenario.timeline.interval, np.zeros(epochs)
        navigator.propagate()
        spoof = Spoof(offset, rate, nothing, nothing)
        innovation = navigator.innovate(scenario.family.spoofed("linear", navigator.index, 0, spoof))
        navigator.resolve(Decision(np.ones(epochs, dtype=bool)))
        whitened.append(innovation.whitened.copy())
        before = offset
    assert not np.any(whitened[0])
    return np.array(whitened[1:]).transpose(0, 2, 1)


@pytest.mark.parametrize("direction", [UP, SLANTED], ids=["up", "slanted"])
@pytest.mark.parametrize("scenario", [CARRIER, RISING, RATE], ids=["carrier", "rising", "rate"])
def test_it_is_that_of_a_filter_without_noise(scenario, direction):
    expected = impulses(scenario, direction)
    response = tracking_response(scenario.tight_model(), direction)
    np.testing.assert_allclose(response, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    # later errors have no effect, and those of the present epoch have one
    places = np.arange(len(response))
    assert not np.any(response.transpose(0, 2, 1)[places[:, None] < places])
    assert np.all(np.abs(response[places, :, places]).max(axis=1) > 0.1)


@pytest.mark.parametrize("scenario", [CARRIER, RATE], ids=["carrier", "rate"])
def test_the_projection_is_that_of_the_monitor(scenario):
    """s = u'H'S⁻¹z with a general solver, over the root of u'H'S⁻¹H u."""
    model = scenario.tight_model()
    direct = np.empty((model.num_epochs, model.num_epochs))
    response = tracking_response(model, SLANTED)
    for k in range(1, model.num_epochs + 1):
        factor = model.innovation_factor[k]
        design = factor @ model.position_response[k] @ SLANTED
        residual = factor @ response[k - 1]
        weighted = np.linalg.solve(model.innovation_covariance[k], design)
        direct[k - 1] = weighted @ residual / np.sqrt(weighted @ design)
    np.testing.assert_allclose(projected_response(model, SLANTED), direct, rtol=1e-7, atol=1e-9)


def test_with_carrier_phase_an_innovation_sees_the_first_difference():
    """What a prototype of another filter on the same ranges had: 1, -1.00, -0.02, 0.00 in units of the first."""
    response = projected_response(make_scenario("kujur-flight:horizon=12").tight_model(), UP)
    size = np.sqrt(np.sum((make_scenario("kujur-flight:horizon=12").tight_model().position_response @ UP) ** 2, axis=1))
    # measured minus predicted has the other sign
    np.testing.assert_allclose(np.diag(response), -size[1:], rtol=1e-9)
    lags = np.array([np.diag(response, -lag)[0] / response[0, 0] for lag in range(5)])
    np.testing.assert_allclose(lags, [1.0, -1.0, -0.02, 0.0, 0.0], atol=0.05)


def test_an_error_that_stays_is_forgotten():
    """A constant offset is a place like any other: innovations go back to zero."""
    constant = projected_response(CARRIER.tight_model(), UP).sum(axis=1)
    assert np.abs(constant[1:]).max() < 0.05 * abs(constant[0])
