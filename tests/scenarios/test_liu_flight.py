"""The Liu flight's receiver noise as an option."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import binom, norm

from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.sensors.receiver import ZERO, Receiver
from spoofgym.simulation import Simulation


def test_default_is_the_papers() -> None:
    scenario = liu_flight()
    assert scenario.name == "liu-flight"
    assert scenario.family.receiver.white_sigma == scenario.family.tuning.measurement_sigma == (3.7, 3.7, 6.0)
    assert make_scenario("liu-flight:sigma=3.7").name == "liu-flight"


@pytest.mark.parametrize("sigma", [1.85, 7.4])
def test_receiver_and_filter_have_the_sigma_alike(sigma: float) -> None:
    scenario = make_scenario(f"liu-flight:horizon=20,sigma={sigma}")
    assert scenario.name == f"liu-flight:horizon=20,sigma={sigma}"
    assert scenario.matched
    vertical = sigma * 6.0 / 3.7
    np.testing.assert_allclose(scenario.family.receiver.white_deviation, [sigma, sigma, vertical], rtol=1e-12)
    measured = np.sqrt(np.diag(scenario.linear_model().measurement_covariance))
    np.testing.assert_allclose(measured, [sigma, sigma, vertical], rtol=1e-12)


def test_coloured_noise_keeps_the_ratio_of_the_axes() -> None:
    east, north, up = liu_flight(sigma=7.4, markov_sigma=2.0, markov_time=30.0).family.receiver.markov_sigma
    assert east == north == 2.0
    assert up == pytest.approx(2.0 * 6.0 / 3.7, rel=1e-12)


@pytest.mark.parametrize("sigma", ["0", "-1", "nan", "inf"])
def test_bad_sigma(sigma: str) -> None:
    with pytest.raises(ValueError, match="liu-flight: sigma must be a finite number greater than 0"):
        make_scenario(f"liu-flight:sigma={sigma}")


def test_fixes_from_ranges_keep_the_filter() -> None:
    """Table 1 on the constellation: a few metres that stay, and white noise of a metre (2 m in height)."""
    scenario = make_scenario("liu-flight:horizon=20,noise=ranges")
    assert scenario.name == "liu-flight:horizon=20,noise=ranges"
    assert not scenario.matched
    assert scenario.family.tuning.measurement_sigma == (3.7, 3.7, 6.0)
    whole = np.sqrt(np.diag(scenario.family.ranges.covariance(800)))
    white = np.sqrt(np.diag(scenario.family.ranges.white_covariance(800)))
    assert np.all((whole > [2.0, 2.0, 4.0]) & (whole < [5.0, 5.0, 9.0]))
    budget = np.array([0.67, 0.94, 0.5, 4.0, 0.2])
    np.testing.assert_allclose(white / whole, np.linalg.norm(budget[:2]) / np.linalg.norm(budget), rtol=1e-9)


def test_the_filters_bound_is_broken_without_an_attack() -> None:
    """Liu's table 1: the error of the filter is that of the fixes, its own sigma averages them away.

    The share of runs beyond three sigma is that of a normal; 1000 runs, binomial band, 1e-8.
    """
    scenario = make_scenario("liu-flight:horizon=5,noise=ranges")
    warm = scenario.family.warm_start()
    own, true = (np.sqrt(c[6, 6]) for c in (warm.filter_covariance, warm.joint_covariance))
    assert own < 0.8 < 2.0 < true
    simulation = Simulation(scenario, num_runs=1000, seed=4)
    simulation.reset()
    simulation.resolve()
    expected = 2.0 * norm.sf(3.0 * own / true)
    low, high = binom.ppf([5e-9, 1.0 - 5e-9], 1000, expected)
    # the fix of epoch 0 moves neither sigma by more than a percent
    assert 0.97 * low < np.sum(np.abs(simulation.error[:, 0]) > 3.0 * own) < 1.03 * high


def test_tight_coupling_takes_the_ranges_themselves() -> None:
    scenario = make_scenario("liu-flight:horizon=20,onset=60,coupling=tight")
    assert scenario.name == "liu-flight:horizon=20,onset=60,coupling=tight"
    assert (scenario.family.coupling, scenario.dimension) == ("tight", 2 * scenario.slots)
    assert scenario.tight_model().num_epochs == 20


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("noise=pink", "liu-flight: noise must be one of white, ranges, got 'pink'"),
        ("coupling=deep", "liu-flight: coupling must be one of loose, tight, got 'deep'"),
        ("noise=ranges,markov_sigma=1,markov_time=3", "markov_sigma and markov_time go with noise=white"),
        ("coupling=tight,sigma=2", "are of fixes; coupling=tight has none"),
        ("coupling=tight,noise=ranges", "are of fixes; coupling=tight has none"),
    ],
)
def test_options_that_do_not_go_together(options: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_scenario(f"liu-flight:{options}")


def test_ranges_must_cover_the_game_and_give_no_velocity() -> None:
    base = make_scenario("liu-flight:horizon=20,noise=ranges")
    ranges = base.family.ranges
    short = dataclasses.replace(ranges, mapping=ranges.mapping[:700])
    with pytest.raises(ValueError, match="ranges have 700 epochs, the game needs 820"):
        base.changed(ranges=short)
    receiver = Receiver(white_sigma=ZERO, velocity_sigma=(0.1, 0.1, 0.1))
    tuning = dataclasses.replace(base.family.tuning, measurement_sigma=(3.7, 3.7, 6.0, 0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="fixes from ranges are of position alone"):
        base.changed(receiver=receiver, tuning=tuning)
