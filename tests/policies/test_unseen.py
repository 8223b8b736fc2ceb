"""The optimal attack that no test sees: what it costs and what it gains in the game itself."""

import numpy as np
import pytest

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.duels import play_cell
from spoofgym.optimum import game_gain
from spoofgym.policies.unseen import Unseen
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

DRIVE = "foi-drive:horizon=60"


def test_its_mean_innovations_have_the_budget() -> None:
    """Two runs of equal noise, one of them attacked: all is linear, so that their difference is the mean."""
    scenario = make_scenario(DRIVE)
    runs = [Simulation(scenario, attack, num_runs=1, seed=4) for attack in (make_spoofer("unseen:9"), None)]
    for simulation in runs:
        simulation.reset()
    noncentrality = 0.0
    for _ in range(60):
        for simulation in runs:
            simulation.resolve()
            simulation.observe()
        attacked, clean = (simulation.epoch.innovation.whitened[0] for simulation in runs)
        noncentrality += ((attacked - clean) ** 2).sum()
    for simulation in runs:
        simulation.resolve()
    assert noncentrality == pytest.approx(9.0, rel=1e-9)
    gain = game_gain(scenario.linear_model())
    final = runs[0].error[0, :2] - runs[1].error[0, :2]
    np.testing.assert_allclose(final, 3.0 * gain.error[-1], rtol=1e-9)


def test_it_does_more_than_ramps_of_its_noncentrality_where_all_fixes_are_used() -> None:
    config = DuelConfig(scenario=DRIVE, detectors="snapshot", clean=0.0, outage=0.0, multipath=0.0)
    found = play_cell(config, "unseen:100", "always-use", 50, 1).mean
    gain = game_gain(make_scenario(DRIVE).linear_model()).gain
    # a mean is below the root of the mean square, and the filter's own error of a metre comes on top
    assert 0.7 * 10.0 * gain < found < 10.0 * gain + 2.0


def test_bad_budgets_and_receivers_are_refused() -> None:
    with pytest.raises(ValueError, match="unseen: budget must be"):
        Unseen(-1.0)
    with pytest.raises(ValueError, match="budget"):
        make_spoofer("unseen")
    assert make_spoofer("unseen:4").name == "unseen:4"
