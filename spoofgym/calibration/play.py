"""Detectors ready to play: one specification has one threshold in games, in evaluation and in training."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.calibration.thresholds import calibrated_all
from spoofgym.detectors.base import Detector
from spoofgym.scenario import Scenario


def calibrated_for_play(detectors: Sequence[Detector], scenario: Scenario, fidelity: str) -> list[Detector]:
    """The detectors with the thresholds that they have where a scenario is played.

    Everything that plays gets its detectors here: environments, evaluation and training.

    Args:
        detectors: as `calibrated_all` takes them; they are not changed.
        scenario: that is played, with its coupling.
        fidelity: in which it is played.

    Returns:
        The detectors in order, copies where a threshold was set.

    Raises:
        ValueError: what `calibrated_all` refuses.
    """
    return calibrated_all(detectors, scenario, calibration_fidelity(scenario, fidelity))


def calibration_fidelity(scenario: Scenario, fidelity: str) -> str:
    """The fidelity of the clean runs that calibrate a detector for play.

    Thresholds of the linear fidelity keep their ARL₀ in the strapdown fidelity (`docs/reference/detectors.md`), where
    clean runs take 2 to 14 times as long. So every fidelity of a scenario that has the linear one uses its thresholds.
    """
    return "linear" if "linear" in scenario.fidelities else fidelity
