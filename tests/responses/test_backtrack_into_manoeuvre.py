"""A backtrack that ends inside a turn: a correct filter pays no more for it, and knows what it pays."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RUNS = 400
DEPTH = 20
AFTER = 10
STRAIGHT, INSIDE = 100.0, 135.0
"""Scenario times of the backtracks, s: they end at 80 s, on the straight, and at 115 s, in the middle of a turn."""


def coasted(at: float, fidelity: str) -> tuple[np.ndarray, np.ndarray]:
    """Position errors AFTER epochs after a backtrack, GNSS left out from there on, (N, 3), and P of run 0."""
    scenario = make_scenario("foi-drive")
    demands = Demands(excludes=True, history=DEPTH)
    simulation = Simulation(scenario, None, (), None, RUNS, 0, fidelity=fidelity, demands=demands, threads=2)
    simulation.reset()
    epoch = round(at - scenario.timeline.start)
    for k in range(epoch + AFTER):
        back = np.full(RUNS, DEPTH if k == epoch else 0)
        simulation.resolve(Decision(np.full(RUNS, k < epoch), backtrack=back))
        simulation.observe()
    return simulation.error, simulation.navigator.position_covariance[0]


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_the_error_after_it_is_that_of_the_covariance_and_no_larger_than_on_the_straight(fidelity):
    """NEES of 400 runs within its chi-square band of false-failure probability 1e-8; means of the errors within 25 %.

    Both means have a standard error of 3 %, so that 25 % is more than 5 of them.
    """
    means = {}
    for at in (STRAIGHT, INSIDE):
        error, covariance = coasted(at, fidelity)
        nees = np.einsum("ni,ij,nj->", error, np.linalg.inv(covariance), error)
        low, high = stats.chi2.ppf([5e-9, 1.0 - 5e-9], 3 * RUNS)
        assert low < nees < high
        means[at] = np.hypot(*error[:, :2].T).mean()
    assert means[INSIDE] == pytest.approx(means[STRAIGHT], rel=0.25)
