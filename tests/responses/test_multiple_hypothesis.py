"""The multiple-hypothesis defender in whole games: what it chooses from, and what it loses."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.navigation.error_model import POSITION
from spoofgym.navigation.interface import Decision
from spoofgym.optimum import game_gain
from spoofgym.policies.classical import keeps_within
from spoofgym.responses import make_response
from spoofgym.responses.multiple_hypothesis import MultipleHypothesis
from spoofgym.responses.solutions import exceedance, expected_loss
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RUNS = 6


def games(attack, response, fidelity="linear", runs=RUNS, epochs=60, scenario="foi-drive"):
    """Errors, (epochs, N, 3), and the simulation after them."""
    simulation = Simulation(
        make_scenario(scenario), make_attack(attack), (), make_response(response), runs, 7, fidelity=fidelity
    )
    simulation.reset()
    errors = []
    for _ in range(epochs):
        simulation.resolve()
        errors.append(simulation.error.copy())
        simulation.observe()
    return np.array(errors), simulation


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_the_solutions_that_it_chooses_from_are_those_that_the_filter_takes(fidelity):
    """Whatever it decides next, the filter's error becomes what it has compared."""
    response = MultipleHypothesis(hypotheses=4, history=12)
    simulation = Simulation(
        make_scenario("foi-drive"), make_attack("ramp:1"), (), response, 4, 3, fidelity=fidelity
    )
    simulation.reset()
    rng = np.random.default_rng(4)
    atol = 1e-9 if fidelity == "linear" else 2e-3  # the strapdown filter moves in curved coordinates
    for k in range(40):
        navigator, before = simulation.navigator, simulation.navigator.auxiliary.copy()
        unaided = navigator.error + navigator.auxiliary[:, POSITION]
        depth = np.minimum(rng.integers(0, 5, 4) * (k > 5), simulation.epoch.index)
        expected = unaided - response._past[np.arange(4), depth][:, POSITION]
        used = rng.random(4) < 0.5
        correction = np.einsum("nmi,nm->ni", navigator.fix_gain, simulation.epoch.innovation.whitened)
        expected = np.where((used & (depth == 0))[:, None], unaided - (before + correction)[:, POSITION], expected)
        simulation.resolve(Decision(used, depth))
        told = ~used | (depth == 0)
        np.testing.assert_allclose(simulation.error[told], expected[told], atol=atol)
        simulation.observe()


def test_it_is_the_same_for_any_number_of_runs():
    many, _ = games("ramp:0.5", "multiple-hypothesis:hypotheses=8")
    one, _ = games("ramp:0.5", "multiple-hypothesis:hypotheses=8", runs=1)
    assert np.array_equal(many[:, :1], one)


def mean_error(response, pulls):
    """Mean horizontal error of 20 games, m, in which the fixes are pulled by offsets (K, 3)."""
    simulation = Simulation(make_scenario("foi-drive"), None, (), make_response(response), 20, 11)
    simulation.reset()
    errors = []
    for pull in pulls:
        simulation.resolve()
        simulation.observe(np.tile(pull, (20, 1)))
        errors.append(np.hypot(*simulation.error[:, :2].T))
    return float(np.mean(errors))


def test_an_attack_that_no_test_sees_costs_it_less_and_clean_games_hardly_more():
    """The games are seeded. Over many, the defender errs half as much as one that uses every fix."""
    pulls = 4.0 * game_gain(make_scenario("foi-drive").linear_model()).offsets
    response = "multiple-hypothesis:hypotheses=8"
    assert mean_error(response, pulls) < 0.75 * mean_error("always-use", pulls)
    assert mean_error(response, 0.0 * pulls) < mean_error("always-use", 0.0 * pulls) + 0.5


@pytest.mark.parametrize("distance", [0.0, 20.0, 49.0, 60.0, 200.0])
@pytest.mark.parametrize("sigma", [1e-7, 1.0, 10.0, 30.0, 300.0])
def test_the_probability_of_exceeding_a_limit_is_that_of_a_noncentral_chi_square(distance, sigma):
    exact = stats.ncx2.sf((50.0 / sigma) ** 2, 2, (distance / sigma) ** 2)
    assert exceedance(distance**2, 2.0 * sigma**2, 50.0) == pytest.approx(exact, abs=0.02)


def test_a_limit_takes_the_solution_that_keeps_within_it():
    """One solution is right in nine of ten cases and else 120 m off; the other is 75 m off, and else 45 m."""
    weight, variances = np.array([0.9, 0.1]), np.full((2, 2), 1.0)
    means = np.array([[0.0, 0.0] * 2, [120.0, 0.0] * 2])
    likely, safe = np.zeros(4), np.array([75.0, 0.0] * 2)

    def loss(solution, limit):
        return expected_loss(weight, means, variances, solution, limit)

    assert loss(likely, 0.0) < loss(safe, 0.0)
    assert loss(safe, 80.0) < loss(likely, 80.0)


def test_the_name_builds_it_again():
    given = "multiple-hypothesis:hypotheses=8,hidden=0,onset=300"
    assert make_response(given).name == "multiple-hypothesis:hypotheses=8,onset=300,hidden=0"
    assert make_response("multiple-hypothesis").name == "multiple-hypothesis"
    assert make_response(keeps_within(50.0)).name == keeps_within(50.0)


@pytest.mark.parametrize(
    ("scenario", "response", "message"),
    [
        ("song-robot", "multiple-hypothesis", "needs inertial solution"),
        ("liu-flight:coupling=tight", "multiple-hypothesis", "needs .*linear model"),
        ("foi-drive", "multiple-hypothesis:end=0.5", "end must be longer than two epochs"),
        ("foi-drive", "multiple-hypothesis:hypotheses=1", "hypotheses must be"),
        ("foi-drive", "multiple-hypothesis:hidden=1.5", "hidden must be"),
        ("foi-drive", "multiple-hypothesis:amplitude=0", "amplitude must be"),
        ("foi-drive", "multiple-hypothesis:limit=-1", "limit must be"),
    ],
)
def test_what_does_not_fit_is_refused(scenario, response, message):
    with pytest.raises(ValueError, match=message):
        Simulation(make_scenario(scenario), None, (), make_response(response), 1, 0)
