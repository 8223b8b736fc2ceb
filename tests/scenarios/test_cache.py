"""Scenarios that are kept: freed when they are dropped, and never older than the files that they were read from."""

from __future__ import annotations

import copy
import gc
import os
import pickle
import shutil
import weakref
from pathlib import Path

import numpy as np
import pytest

from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.cache import ScenarioCache, array_bytes
from spoofgym.scenarios.recorded_family import RecordedFamily
from tests.scenarios.test_recorded import write_log

SPEC = "shadmehri-flight:speed={},onset=5"


def used(speed: float):
    scenario = make_scenario(SPEC.format(speed))
    scenario.linear_model()
    return scenario


def test_a_scenario_whose_models_were_computed_is_freed_once_it_is_dropped() -> None:
    cache, size = ScenarioCache(limit=1), 0
    refs = []
    for speed in (100.0, 110.0, 120.0):
        scenario = cache.get(speed, lambda speed=speed: copy.copy(used(speed)))
        scenario.linear_model(burn_in=3)
        refs.append(weakref.ref(scenario))
        size = array_bytes([scenario])
    del scenario
    gc.collect()
    assert size > 100_000
    assert [ref() is None for ref in refs] == [True, True, False]


def test_the_cache_is_bounded_by_what_its_scenarios_have_grown_to() -> None:
    one = used(130.0)
    both = array_bytes([one, used(140.0)])
    assert both > array_bytes([one])
    cache = ScenarioCache(limit=both)
    kept = cache.get("a", lambda: used(130.0))
    cache.get("b", lambda: used(140.0))
    assert cache.get("a", lambda: used(150.0)) is kept
    kept.linear_model(burn_in=7)
    cache.get("c", lambda: used(160.0))
    assert cache.get("a", lambda: used(150.0)) is not kept


def test_an_array_counts_once_whoever_holds_it() -> None:
    whole = np.zeros(1000)
    assert array_bytes([whole, {"view": whole[10:]}, [whole.reshape(10, 100)], (np.zeros(1),)]) == 8008


def test_results_are_kept_per_argument_and_object_and_in_copies() -> None:
    scenario = used(170.0)
    model = scenario.linear_model()
    assert scenario.linear_model(0) is model
    assert scenario.linear_model(burn_in=0) is model
    assert scenario.linear_model(2) is not model
    again = pickle.loads(pickle.dumps(scenario))
    np.testing.assert_array_equal(again.linear_model().prior_covariance, model.prior_covariance)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "with space" / "log")


def epochs(text: str) -> int:
    return make_scenario(text).timeline.num_epochs


def test_an_unchanged_log_is_read_once(log: Path, tmp_path: Path) -> None:
    scenario = make_scenario(f"recorded:{log}")
    assert make_scenario(f"recorded:{log}") is scenario
    (log / "remarks.txt").write_text("nothing that is read")
    assert make_scenario(f"recorded:{log}") is scenario


@pytest.mark.parametrize("name", ["gnss.csv", "imu.csv", "reference.csv", "log.toml"])
def test_an_edit_that_keeps_size_and_time_is_seen(log: Path, name: str) -> None:
    """Such as a copy that restores times; only the time of the entry's own change tells it."""
    scenario = make_scenario(f"recorded:{log}")
    file = log / name
    times, text = file.stat(), file.read_text()
    edited = text.replace("5", "6", 1) if name == "log.toml" else text[:-2] + ("1" if text[-2] != "1" else "2") + "\n"
    file.write_text(edited)
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert file.stat().st_size == times.st_size
    assert make_scenario(f"recorded:{log}") is not scenario


def test_a_log_that_is_cut_replaced_by_an_archive_or_removed(log: Path) -> None:
    whole = epochs(f"recorded:{log}")
    lines = (log / "gnss.csv").read_text().splitlines(keepends=True)
    (log / "gnss.csv").write_text("".join(lines[:80]))
    assert epochs(f"recorded:{log}") < whole
    (log / "reference.csv").unlink()
    scenario = make_scenario(f"recorded:{log}")
    assert isinstance(scenario.family, RecordedFamily)
    assert scenario.family.log.reference is None
    shutil.rmtree(log)
    with pytest.raises(ValueError, match="is no folder"):
        make_scenario(f"recorded:{log}")


def test_a_relative_path_is_that_of_the_present_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for place, keep in (("a", 119), ("b", 60)):
        folder = tmp_path / place / "log"
        write_log(folder)
        lines = (folder / "gnss.csv").read_text().splitlines(keepends=True)
        (folder / "gnss.csv").write_text("".join(lines[:keep]))
        monkeypatch.chdir(folder.parent)
        found.append(epochs("recorded:log"))
    assert found[1] < found[0]


def test_a_link_that_points_elsewhere_is_another_log(log: Path, tmp_path: Path) -> None:
    other = write_log(tmp_path / "other", reference=False)
    link = tmp_path / "link"
    link.symlink_to(log)
    first = make_scenario(f"recorded:{link}")
    assert make_scenario(f"recorded:{link}") is first
    link.unlink()
    link.symlink_to(other)
    assert make_scenario(f"recorded:{link}").family.log.reference is None  # type: ignore[attr-defined]
