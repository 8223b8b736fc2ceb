"""Results as JSON rows: the schemas that programs print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.metrics import AttackerScore
from spoofgym.scenario import Scenario
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.scenarios.recorded_family import recorded_family
from spoofgym.scenarios.recorded_resting import SIMULATED, RestingRanges

SCHEMA_VERSION = 1


def detector_entry(detectors: Sequence[Detector], scenario: Scenario) -> dict[str, Any]:
    """``{"name", "threshold", "arl0"}``; several detectors are named together and have no common threshold.

    ARL₀ is null unless the threshold was calibrated in the scenario, or the scenario's innovations are white and theory
    gives it.
    """
    if len(detectors) != 1:
        return {"name": " + ".join(detector.name for detector in detectors), "threshold": None, "arl0": None}
    detector = detectors[0]
    known = detector.calibrated or scenario.matched
    return {"name": detector.name, "threshold": detector.threshold, "arl0": detector.arl0 if known else None}


def attacker_row(
    name: str, knowledge: str, score: AttackerScore | None, exact: float | None, optimum: float | None
) -> dict[str, Any]:
    """One row of an ``"attackers"`` report.

    Args:
        name: of the attacker.
        knowledge: of the victim that it needs.
        score: from simulation; None where nothing was played.
        exact: its exact undetected error, m, where it is known.
        optimum: of the game, m, where it is known. The fraction is of the exact score where there is one, else of the
            simulated.
    """
    row: dict[str, Any] = {
        "attacker": name,
        "knowledge": knowledge,
        "episodes": None,
        "mean_undetected_error_m": None,
        "ci95_m": None,
        "exact_undetected_error_m": exact,
        "detection_probability": None,
        "median_time_to_detect_s": None,
        "error_at_detection_m": None,
        "fraction_of_optimum": None,
    }
    if score is not None:
        row |= {
            "episodes": score.episodes,
            "mean_undetected_error_m": score.mean_undetected_error,
            "ci95_m": list(score.interval),
            "detection_probability": score.detection_probability,
            "median_time_to_detect_s": score.median_time_to_detect,
            "error_at_detection_m": score.error_at_detection,
        }
    achieved = exact if exact is not None else row["mean_undetected_error_m"]
    if optimum and achieved is not None:  # where the optimum is nothing there is no fraction of it
        row["fraction_of_optimum"] = achieved / optimum
    return row


def attackers_report(
    scenario: Scenario, fidelity: str, detectors: Sequence[Detector], rows: list[dict[str, Any]]
) -> dict[str, Any]:
    """A whole ``"attackers"`` report."""
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "attackers",
        "scenario": scenario.name,
        "fidelity": fidelity,
        "detector": detector_entry(detectors, scenario),
        "rows": rows,
    }


def defenders_report(
    scenario: Scenario,
    fidelity: str,
    kinds: dict[str, str],
    rows: list[dict[str, Any]],
    comparisons: list[dict[str, Any]],
    gaps: list[dict[str, Any]],
) -> dict[str, Any]:
    """A whole ``"defenders"`` report.

    Args:
        scenario: of the games.
        fidelity: of the simulation.
        kinds: of each defender, by its name.
        rows: of each defender and attack.
        comparisons: paired differences between learned defenders and the others.
        gaps: shares of the gap to the best depth in hindsight that learned defenders close.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "defenders",
        "scenario": scenario.name,
        "fidelity": fidelity,
        "kinds": kinds,
        "rows": rows,
        "comparisons": comparisons,
        "gaps": gaps,
    }


def recorded_report(scenario: Scenario, detectors: Sequence[Detector], rows: list[dict[str, Any]]) -> dict[str, Any]:
    """A whole ``"recorded"`` report."""
    family = recorded_family(scenario)
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "recorded",
        "scenario": scenario.name,
        "fidelity": "strapdown",
        "alignment": family.alignment.told(family.log),
        "imu": f"{SIMULATED}: {family.imu.name}" if isinstance(family, RestingRanges) else RECORDED,
        "clean_scene": clean_scene(scenario).name,
        "detector": detector_entry(detectors, scenario),
        "rows": rows,
    }
