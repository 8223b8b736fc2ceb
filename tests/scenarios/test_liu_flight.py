"""The Liu flight's receiver noise as an option."""

import numpy as np
import pytest

from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.liu_flight import liu_flight


def test_default_is_the_papers() -> None:
    scenario = liu_flight()
    assert scenario.name == "liu-flight"
    assert scenario.receiver.white_sigma == scenario.tuning.measurement_sigma == (3.7, 3.7, 6.0)
    assert make_scenario("liu-flight:sigma=3.7").name == "liu-flight"


@pytest.mark.parametrize("sigma", [1.85, 7.4])
def test_receiver_and_filter_have_the_sigma_alike(sigma: float) -> None:
    scenario = make_scenario(f"liu-flight:horizon=20,sigma={sigma}")
    assert scenario.name == f"liu-flight:horizon=20,sigma={sigma}"
    assert scenario.matched
    vertical = sigma * 6.0 / 3.7
    np.testing.assert_allclose(scenario.receiver.white_deviation, [sigma, sigma, vertical], rtol=1e-12)
    measured = np.sqrt(np.diag(scenario.linear_model().measurement_covariance))
    np.testing.assert_allclose(measured, [sigma, sigma, vertical], rtol=1e-12)


def test_coloured_noise_keeps_the_ratio_of_the_axes() -> None:
    east, north, up = liu_flight(sigma=7.4, markov_sigma=2.0, markov_time=30.0).receiver.markov_sigma
    assert east == north == 2.0
    assert up == pytest.approx(2.0 * 6.0 / 3.7, rel=1e-12)


@pytest.mark.parametrize("sigma", ["0", "-1", "nan", "inf"])
def test_bad_sigma(sigma: str) -> None:
    with pytest.raises(ValueError, match="liu-flight: sigma must be a finite number greater than 0"):
        make_scenario(f"liu-flight:sigma={sigma}")
