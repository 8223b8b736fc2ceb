"""Learned spoofers within attacks that change part of another attack: tracking errors, satellites, true velocities."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.attacks.base import Attack
from spoofgym.envs.opponents import make_spoofer, spoofer_pool
from spoofgym.evaluation.matrix_games import Matrix
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.run_folders import defender, spoofer

FLIGHT = "liu-flight:horizon=22,onset=300"
SKY = "kujur-flight:horizon=12,onset=60"
LANES, SEED = 3, 5


def played(scenario: Scenario, attack: Attack | None, epochs: int) -> tuple[Any, Any]:
    """Offsets and innovations of epochs 1.., (epochs, N, 3) and (epochs, N, m)."""
    simulation = Simulation(scenario, attack, num_runs=LANES, seed=SEED)
    simulation.reset()
    offsets, residuals = [], []
    for _ in range(epochs):
        simulation.resolve()
        residuals.append(simulation.observe().innovation.residual.copy())
        offsets.append(simulation.offset.copy())
    return np.array(offsets), np.array(residuals)


def test_a_policy_has_the_tracking_error_that_any_attack_has(tmp_path: Path) -> None:
    """Its shadow filter sees what it meant to send, so that its own offsets stay as they are."""
    scenario = make_scenario(FLIGHT)
    text = spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, tmp_path / "x")
    wrapped = make_spoofer(f"tracking-error:{text},sigma=2")
    assert (wrapped.name, wrapped.knowledge) == (f"tracking-error:{text},sigma=2", "shadow")
    errors = []
    for rough, smooth in ((wrapped, text), ("tracking-error:ramp:1,sigma=2", "ramp:1")):
        errors.append(played(scenario, make_spoofer(rough), 22)[0] - played(scenario, make_spoofer(smooth), 22)[0])
    assert np.abs(errors[0]).min() > 0.0
    np.testing.assert_allclose(errors[0], errors[1], atol=1e-9)


def test_a_policy_on_part_of_the_satellites(tmp_path: Path) -> None:
    """Ranges of the slots that are not captured are those of a clean game, until the filter has taken a false one."""
    scenario = make_scenario(SKY)
    text = spoofer({"scenario": SKY, "knowledge": "shadow"}, tmp_path / "x")
    attack = make_spoofer(f"partial:{text},satellites=2")
    offsets, spoofed = played(scenario, attack, 1)
    moved = (spoofed - played(scenario, None, 1)[1]).reshape(LANES, 2, scenario.slots)
    assert offsets.any()
    assert np.all(moved[:, :, :2] != 0.0)
    assert not moved[:, :, 2:].any()


def test_a_policy_that_leaves_the_velocity_true(tmp_path: Path) -> None:
    sigma = (0.1, 0.1, 0.2)
    plain = make_scenario(FLIGHT)
    family = plain.family
    tuning = replace(family.tuning, measurement_sigma=(*family.tuning.measurement_sigma, *sigma))
    scenario = plain.changed(receiver=replace(family.receiver, velocity_sigma=sigma), tuning=tuning)
    text = spoofer({"scenario": FLIGHT, "knowledge": "blind"}, tmp_path / "x")
    clean = played(scenario, None, 1)[1]
    consistent, inside = (
        played(scenario, make_spoofer(name), 1)[1] - clean for name in (text, f"position-only:{text}")
    )
    assert np.all(consistent != 0.0)
    np.testing.assert_array_equal(inside[..., :3], consistent[..., :3])
    assert not inside[..., 3:].any()


def test_a_pool_takes_a_policy_within_an_attack(tmp_path: Path) -> None:
    text = spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, tmp_path / "x")
    pool = spoofer_pool([f"tracking-error:{text},sigma=2", "none"], 0.0)
    simulation = Simulation(make_scenario(FLIGHT), pool, num_runs=20, seed=SEED)
    simulation.reset()
    simulation.resolve()
    simulation.observe()
    playing = pool.member == 0
    assert 0 < playing.sum() < 20
    np.testing.assert_array_equal(pool.first[playing], 1)
    np.testing.assert_array_equal(simulation.offset.any(axis=1), playing)


def test_what_cannot_be_within_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rough = {"scenario": FLIGHT, "knowledge": "shadow", "tracking_sigma": 1.0}
    with pytest.raises(ValueError, match="attack must have no tracking error of its own, got 'policy:"):
        make_spoofer(f"tracking-error:{spoofer(rough, tmp_path / 'rough')}")
    with pytest.raises(ValueError, match="attack must have no tracking error of its own"):
        make_spoofer("tracking-error:position-only:tracking-error:none")
    with pytest.raises(ValueError, match=r"^partial: attack: 'nobody' is no run folder and no published agent"):
        make_spoofer("partial:policy:nobody")
    other = defender({"scenario": FLIGHT, "attacks": "none", "detectors": ["snapshot"]}, tmp_path / "d")
    with pytest.raises(ValueError, match=r"attack: .* is the run folder of a defender, not of a spoofer"):
        make_spoofer(f"tracking-error:{other}")
    deep = "can be spelled within one other part, not within two"
    for text in ("pool:partial:policy:runs/x/satellites=2+jump", "tracking-error:partial:policy:runs/x"):
        with pytest.raises(ValueError, match=deep):
            make_spoofer(text)
    monkeypatch.chdir(tmp_path)
    spoofer({"scenario": FLIGHT, "knowledge": "blind"}, tmp_path / "x")
    pool = make_spoofer("pool:partial:policy:x/satellites=2+jump")
    assert pool.names == ("partial:policy:x,satellites=2", "jump")


def test_a_matrix_refuses_a_policy_that_sees_its_detector_wherever_it_stands(tmp_path: Path) -> None:
    text = spoofer({"scenario": FLIGHT, "knowledge": "full", "detector": ["snapshot"]}, tmp_path / "full")
    matrix = Matrix(make_scenario(FLIGHT), "linear", 1000.0, 20, 3, 1)
    for attack in (text, f"tracking-error:{text}", f"pool:jump+{text}"):
        with pytest.raises(ValueError, match=r"sees the statistics of its own detector \(knowledge 'full'\)"):
            matrix.names([attack], [])
