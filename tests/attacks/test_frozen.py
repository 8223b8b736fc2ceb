"""A frozen fix: position and velocity of the receiver stay those of a vehicle that stopped at the onset."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.scenarios.test_recorded import write_log


@pytest.mark.parametrize("onset", [None, 40.0])
def test_what_the_receiver_shows_stands_still(onset: float | None) -> None:
    scenario = make_scenario("foi-drive:horizon=60")
    first = 0 if onset is None else int(np.flatnonzero(scenario.timeline.times <= onset)[-1])
    spelled = "frozen" if onset is None else f"frozen:onset={scenario.timeline.times[first]:g}"
    simulation = Simulation(scenario, make_attack(spelled), [], num_runs=2, seed=0)
    simulation.reset()
    track = scenario.track()
    for k in range(1, scenario.timeline.num_epochs + 1):
        simulation.resolve()
        simulation.observe()
        shown = track[k] + simulation.offset
        wanted = track[k] if k <= first else track[first]
        np.testing.assert_allclose(shown, np.tile(wanted, (2, 1)), atol=0.02)


def test_the_velocity_of_the_fix_is_zero_or_within_position_only_the_true_one(tmp_path: Path) -> None:
    scenario = make_scenario(f"recorded:{write_log(tmp_path)}")
    residuals = {}
    for text in ("none", "frozen", "position-only:frozen"):
        simulation = Simulation(scenario, make_attack(text), [], num_runs=1, seed=0, fidelity="strapdown")
        simulation.reset()
        simulation.resolve()
        residuals[text] = simulation.observe().innovation.residual[0].copy()
    velocity = scenario.velocity()[1]
    assert np.linalg.norm(velocity) > 5.0
    # a residual is the solution less the fix
    np.testing.assert_allclose(residuals["frozen"][3:] - residuals["none"][3:], velocity, atol=1e-9)
    np.testing.assert_allclose(residuals["position-only:frozen"][3:], residuals["none"][3:], atol=1e-9)
