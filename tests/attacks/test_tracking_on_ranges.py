"""A spoofer's tracking error as a receiver of ranges meets it: one place, seen along every line of sight."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Decision
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-8
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=30")
RATE = make_scenario("liu-flight:coupling=tight,onset=200,horizon=30")


def ranges(scenario, specification, runs, fidelity="linear"):
    """What the attack adds to the ranges at epochs 1..K, (K, N, m), and the offsets it tells, (K, N, 3)."""
    kept = []
    for attack in (make_attack(specification), None):
        simulation = Simulation(scenario, attack, num_runs=runs, seed=7, fidelity=fidelity)
        simulation.reset()
        navigator, deviations, offsets = simulation.navigator, [], []
        innovate = navigator.innovate

        def record(deviation, runs=None, innovate=innovate, deviations=deviations):
            deviations.append(deviation.copy())
            return innovate(deviation, runs)

        navigator.innovate = record
        for _ in range(scenario.timeline.num_epochs):
            simulation.resolve(Decision(np.ones(runs, dtype=bool)))
            simulation.observe()
            offsets.append(simulation.offset.copy())
        kept.append((np.array(deviations), np.array(offsets)))
    return kept[0][0] - kept[1][0], kept[0][1]


def sights(scenario):
    return scenario.tight_model().dynamics.line_of_sight[1:]


@pytest.mark.parametrize("axis", ["", ",axis=up"], ids=["all", "up"])
def test_code_and_carrier_err_along_every_line_of_sight(axis):
    added, offset = ranges(FLIGHT, f"tracking-error:ramp:0,sigma=0.2,time=5{axis}", 4)
    expected = -np.einsum("ksi,kni->kns", sights(FLIGHT), offset)
    np.testing.assert_allclose(added, np.concatenate([expected, expected], axis=2), atol=1e-9)
    errs = np.any(offset, axis=(0, 1))
    assert errs.tolist() == ([False, False, True] if axis else [True, True, True])


def test_range_rates_err_by_the_change_of_the_error():
    added, offset = ranges(RATE, "tracking-error:ramp:0,sigma=0.2", 4)
    rate = np.diff(offset, axis=0, prepend=np.zeros((1, 4, 3))) / RATE.timeline.interval
    slots = RATE.slots
    np.testing.assert_allclose(added[:, :, :slots], -np.einsum("ksi,kni->kns", sights(RATE), offset), atol=1e-9)
    np.testing.assert_allclose(added[:, :, slots:], -np.einsum("ksi,kni->kns", sights(RATE), rate), atol=1e-9)


def test_in_the_strapdown_fidelity_they_are_differences_of_distances():
    """Of an error of a metre the square over twice the distance is 1e-7 m at most."""
    added, offset = ranges(FLIGHT, "tracking-error:ramp:0,sigma=1", 1, "strapdown")
    expected = -np.einsum("ksi,kni->kns", sights(FLIGHT), offset)
    np.testing.assert_allclose(added, np.concatenate([expected, expected], axis=2), atol=1e-5)


@pytest.mark.parametrize(("sigma", "time"), [(0.05, 0.0), (0.4, 4.0)], ids=["white", "gauss-markov"])
def test_the_place_behind_the_ranges_has_the_error_that_was_asked_for(sigma, time):
    """The place by least squares from the ranges, 400 runs of 30 epochs: variance, and product of neighbours.

    Each epoch by itself is a sample of 1200 normals; false-failure probability 1e-8 per epoch and figure.
    """
    added, _ = ranges(FLIGHT, f"tracking-error:ramp:0,sigma={sigma},time={time}", 400)
    slots = FLIGHT.slots
    place = np.array(
        [np.linalg.lstsq(-e, code[:, :slots].T, rcond=None)[0].T for e, code in zip(sights(FLIGHT), added, strict=True)]
    )
    low, high = stats.chi2.ppf([FALSE_FAILURE / 2, 1.0 - FALSE_FAILURE / 2], 1200)
    squares = np.sum(place**2, axis=(1, 2)) / sigma**2
    assert np.all((low < squares) & (squares < high))
    decay = np.exp(-0.5 / time) if time else 0.0
    fresh = (place[1:] - decay * place[:-1]) / (sigma * np.sqrt(1.0 - decay**2))
    fresh_squares = np.sum(fresh**2, axis=(1, 2))
    assert np.all((low < fresh_squares) & (fresh_squares < high))
    products = fresh * place[:-1] / sigma
    assert np.abs(products.mean(axis=(1, 2))).max() < 6.0 / np.sqrt(1200)
