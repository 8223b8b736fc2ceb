"""The closed form as a player: what it costs and where it is at the end, in the game itself."""

import numpy as np
import pytest

from spoofgym.envs.opponents import make_spoofer
from spoofgym.optimum import noncentrality_optimum
from spoofgym.policies.furthest import Furthest
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

DRIVE = "foi-drive:horizon=30"


def test_its_noncentrality_is_the_budget_and_its_last_error_that_of_the_closed_form() -> None:
    """Two runs of equal noise, one of them attacked: all is linear, so that their difference is the mean."""
    scenario = make_scenario(DRIVE)
    runs = [Simulation(scenario, attack, num_runs=1, seed=4) for attack in (make_spoofer("closed-form:25"), None)]
    for simulation in runs:
        simulation.reset()
    noncentrality = 0.0
    for _ in range(30):
        for simulation in runs:
            simulation.resolve()
            simulation.observe()
        attacked, clean = (simulation.epoch.innovation.whitened[0] for simulation in runs)
        noncentrality += ((attacked - clean) ** 2).sum()
    for simulation in runs:
        simulation.resolve()
    assert noncentrality == pytest.approx(25.0, rel=1e-9)
    moved = np.linalg.norm(runs[0].error[0, :2] - runs[1].error[0, :2])
    model = scenario.linear_model()
    assert moved == pytest.approx(noncentrality_optimum(model, model.num_epochs, 25.0).final_error, rel=1e-9)


def test_at_the_end_it_is_further_away_than_the_attack_on_the_whole_game() -> None:
    errors = []
    for name in ("closed-form:1e4", "unseen:1e4"):
        simulation = Simulation(make_scenario(DRIVE), make_spoofer(name), num_runs=1, seed=4)
        simulation.reset()
        for _ in range(30):
            simulation.resolve()
            simulation.observe()
        simulation.resolve()
        errors.append(float(np.linalg.norm(simulation.error[0, :2])))
    assert errors[0] > errors[1]


def test_bad_budgets_are_refused() -> None:
    with pytest.raises(ValueError, match="closed-form: budget must be"):
        Furthest(-1.0)
    assert make_spoofer("closed-form:4").name == "closed-form:4"
