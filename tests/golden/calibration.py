"""Golden thresholds: of the default defender, which take 15 s to find, and of few clean runs, found in a test."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from spoofgym.calibration import calibrated_all, thresholds
from spoofgym.calibration.cache import Setting
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DEFENDER_DETECTORS, DefenderConfig
from spoofgym.scenarios import make_scenario

FILE = Path(__file__).parent / "arrays" / "thresholds.json"
DEFAULT, FEW = "default defender", "few clean runs"
PLAYED = {
    DEFAULT: (DefenderConfig().scenario, DEFENDER_DETECTORS),
    FEW: ("foi-drive:horizon=40", ("windowed:n=5,arl0=100", "relative-motion:k=20,arl0=100", "cusum:arl0=100")),
}
FEWER = {"RUNS": 1000, "SLOPE_RUNS": 500, "FIRST_ALARMS": 100, "SIMULATED_FIRST_ALARMS": 100}
Settings = dict[str, Setting]


def find(name: str, cache: Path) -> Settings:
    """Calibrate the detectors of this name anew, in an empty folder ``cache``; by detector."""
    scenario, specifications = PLAYED[name]
    found: Settings = {}
    real = thresholds._find

    def noted(*arguments: object) -> Settings:
        found.update(real(*arguments))  # type: ignore[arg-type]
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPOOFGYM_CACHE", str(cache))
        patch.setattr(thresholds, "_KNOWN", {})
        patch.setattr(thresholds, "_find", noted)
        for variable, value in FEWER.items() if name == FEW else ():
            patch.setattr(thresholds, variable, value)
        calibrated_all([make_detector(each) for each in specifications], make_scenario(scenario))
    return found


def read() -> dict[str, Settings]:
    """The golden thresholds, by name and detector."""
    return {
        name: {detector: Setting(**setting) for detector, setting in settings.items()}
        for name, settings in json.loads(FILE.read_text()).items()
    }


def write(cache: Path) -> None:
    """Find all of them anew; ``cache`` is an empty folder."""
    content = {
        name: {detector: dataclasses.asdict(setting) for detector, setting in find(name, cache / name).items()}
        for name in PLAYED
    }
    FILE.write_text(json.dumps(content, indent=1) + "\n")
