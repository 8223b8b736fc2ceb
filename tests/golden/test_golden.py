"""What a short seeded game computes is what it computed when the golden arrays were made."""

import dataclasses
from functools import cache
from pathlib import Path

import pytest

from spoofgym.calibration import thresholds
from tests.golden import calibration, store

CALIBRATED = ("game defender default", "game alone Defender-v0")
"""Episodes of the default detectors of a defender, whose thresholds are golden, too."""
EPISODES = [(kind, name) for kind in store.KINDS for name in store.names(store.FOLDER, kind)]
"""As they are written; that they are all episodes is a test below."""
EXPECTED = cache(store.read)


@pytest.mark.parametrize(("kind", "name"), EPISODES)
def test_golden(kind: str, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if name in CALIBRATED:
        found = calibration.read()[calibration.DEFAULT]
        monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
        monkeypatch.setattr(thresholds, "_KNOWN", {})
        monkeypatch.setattr(thresholds, "_find", lambda missing, *_: {one.name: found[one.name] for one in missing})
    expected = EXPECTED(store.FOLDER, kind)[name]
    played = store.KINDS[kind]()[name]()
    assert store.differences(expected, played, store.tolerances().get(name, {})) == []


def test_thresholds_of_few_clean_runs(tmp_path: Path) -> None:
    """What the default defender needs, in small: windows on white innovations, and a slope and a threshold on runs."""
    expected, found = calibration.read()[calibration.FEW], calibration.find(calibration.FEW, tmp_path)
    assert found.keys() == expected.keys()
    for name, setting in found.items():
        assert dataclasses.astuple(setting) == pytest.approx(dataclasses.astuple(expected[name]), rel=1e-9), name


def test_every_episode_has_golden_arrays_and_none_are_left_over() -> None:
    for kind, episodes in store.KINDS.items():
        assert set(store.names(store.FOLDER, kind)) == episodes().keys()
