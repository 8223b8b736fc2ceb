"""What a short seeded game computes is what it computed when the golden arrays were made."""

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from spoofgym.calibration import thresholds
from tests.golden import calibration, store
from tests.golden.__main__ import _make_new

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


def test_new_quantities_are_added_and_the_others_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "FOLDER", tmp_path)
    store.write(tmp_path, "toys", {"one": {"error": np.zeros(2), "gone": np.ones(1)}, "old": {"error": np.zeros(1)}})
    games = {"one": {"error": np.ones(2), "statistic": np.full(3, 2.0)}, "two": {"error": np.full(1, 3.0)}}
    monkeypatch.setattr(store, "KINDS", {"toys": lambda: {name: (lambda n=name: games[n]) for name in games}})
    assert _make_new("toys") == {"one": {"statistic"}, "two": {"error"}}
    held = store.read(tmp_path, "toys")
    assert {name: sorted(arrays) for name, arrays in held.items()} == {"one": ["error", "statistic"], "two": ["error"]}
    assert held["one"]["error"].tolist() == [0.0, 0.0]  # not what it is now: the test of golden episodes tells
    assert _make_new("toys") == {}


def test_other_machines_may_round_and_nothing_more() -> None:
    expected = {"bias": np.array([1e-3, -2e-3]), "chosen": np.array([3])}
    rounded = {"bias": expected["bias"] * (1.0 + 5e-12), "chosen": np.array([3])}
    assert store.differences(expected, rounded, {}) == []
    assert len(store.differences(expected, rounded)) == 1  # on one machine all bits are equal
    assert len(store.differences(expected, {**rounded, "bias": expected["bias"] * (1.0 + 5e-11)}, {})) == 1
    assert len(store.differences(expected, {**rounded, "chosen": np.array([4])}, {})) == 1


def test_the_arrays_are_small() -> None:
    """Together under 2 MB: shorten an episode, or thin its quantities, before another is added beyond that."""
    assert sum(path.stat().st_size for path in store.FOLDER.iterdir()) < 2e6
