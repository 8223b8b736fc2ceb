"""One specification has one threshold, whatever plays the scenario, and in every fidelity."""

import ast
from pathlib import Path

import pytest

import spoofgym
import train
from spoofgym.calibration import calibrated, calibrated_for_play
from spoofgym.calibration import thresholds as calibration
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.evaluation import defenders
from spoofgym.evaluation.matrix_games import Matrix
from spoofgym.learning import defender
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.classical import ClassicalDefender
from spoofgym.scenarios import make_scenario

SCENARIO = "liu-flight:horizon=22,markov_sigma=2,markov_time=30"
DETECTORS = ("snapshot:arl0=50", "relative-motion:k=3,arl0=60")
"""On simulated clean runs both: the filter is not matched, and the second looks at the motion."""
PACKAGES = [Path(str(package.__path__[0])) for package in (spoofgym, train)]
COMPARES_FIDELITIES = "studies/fidelity_of_thresholds.py"


@pytest.fixture(autouse=True)
def _few_runs(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    for name, value in (("RUNS", 300), ("SLOPE_RUNS", 200), ("SIMULATED_FIRST_ALARMS", 20)):
        monkeypatch.setattr(calibration, name, value)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_games_evaluation_and_training_have_the_same_thresholds(fidelity, monkeypatch):
    scenario = make_scenario(SCENARIO)
    ready = calibrated_for_play([make_detector(text) for text in DETECTORS], scenario, fidelity)
    expected = {detector.name: detector.threshold for detector in ready}
    assert all(detector.calibrated for detector in ready)
    spoofer = SpooferGame(SpooferConfig(scenario=SCENARIO, detector=DETECTORS, fidelity=fidelity), 1)
    config = DefenderConfig(scenario=SCENARIO, detectors=DETECTORS, fidelity=fidelity)
    defended = DefenderGame(config, 1)
    trained = defender._validation_world(config)
    for game in (spoofer, defended):
        assert {name: detector.threshold for name, detector in game.simulation.detectors.items()} == expected
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ())
    listed = [ClassicalDefender("named", text, "exclude") for text in DETECTORS]
    evaluated = defenders.world_of(scenario, "training", fidelity, 1, (), [], listed)
    compared = Matrix(scenario, fidelity, 100.0, 2, 0, 1)._detectors(DETECTORS)
    for detectors in (trained.detectors, evaluated.detectors, compared):
        assert {detector.name: detector.threshold for detector in detectors} == expected


def test_a_threshold_is_the_one_of_the_linear_fidelity():
    scenario = make_scenario(SCENARIO)
    linear = calibrated(make_detector(DETECTORS[0]), scenario, "linear")
    for fidelity in FIDELITIES:
        (ready,) = calibrated_for_play([make_detector(DETECTORS[0])], scenario, fidelity)
        assert ready.threshold == linear.threshold


def test_nothing_that_plays_has_a_way_of_its_own_to_a_threshold():
    """Outside the room of calibration every threshold comes from `calibrated_for_play`."""
    own = []
    for package in PACKAGES:
        for path in package.rglob("*.py"):
            place = path.relative_to(package).as_posix()
            if place.startswith("calibration/") or place == COMPARES_FIDELITIES:
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and str(node.module).startswith("spoofgym.calibration"):
                    own += [place for alias in node.names if alias.name in ("calibrated", "calibrated_all")]
    assert own == []
