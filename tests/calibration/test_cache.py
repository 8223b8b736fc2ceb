"""Results of calibration on disk: read only by the code that made them, and no trouble where there is no disk."""

import ast
import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import spoofgym
from spoofgym.calibration import cache as calibration_cache
from spoofgym.calibration import calibrated, calibrated_all
from spoofgym.calibration import thresholds as calibration
from spoofgym.calibration.cache import Setting
from spoofgym.detectors import Windowed, make_detector
from spoofgym.scenarios import make_scenario

SCENARIO = "liu-flight:horizon=30"
NAME = "0" * 64
PACKAGE = Path(spoofgym.__file__).parent
SETTING = Setting(12.5, 1000.25, 0.1 + 0.2)


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    """An empty folder, and a program that remembers nothing."""
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    return tmp_path / "cache"


def new_program(monkeypatch, *, may_calibrate):
    """Forget what is in memory."""
    monkeypatch.setattr(calibration, "_KNOWN", {})
    if not may_calibrate:
        for name in ("calibrate", "calibrate_together"):
            monkeypatch.setattr(calibration, name, lambda *_, **__: pytest.fail("calibrated again"))


def test_a_result_comes_back_to_the_last_bit(place):
    assert calibration_cache.load(NAME) is None
    for setting in (SETTING, Setting(3.0, 5.0), Setting(slope=-0.25)):
        calibration_cache.store(NAME, setting, "a remark")
        assert calibration_cache.load(NAME) == setting
    assert [path.name for path in place.iterdir()] == [f"{NAME}.json"]


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[1]",
        "{}",
        '{"setting": null}',
        '{"setting": {}}',
        '{"setting": {"threshold": "3"}}',
        '{"setting": {"threshold": NaN}}',
        '{"setting": {"threshold": -1.0}}',
        '{"setting": {"other": 1.0}}',
        b"\xff\xfe",
        pytest.param("[" * 50_000, id="nested"),
        pytest.param("1" * 50_000, id="digits"),
    ],
)
def test_a_damaged_file_is_none(place, content):
    calibration_cache.store(NAME, SETTING, "")
    path = place / f"{NAME}.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert calibration_cache.load(NAME) is None
    calibration_cache.store(NAME, SETTING, "")
    assert calibration_cache.load(NAME) == SETTING


CHANGES = [
    lambda text: text.replace("12.5", "13.5"),
    lambda text: text.replace("12.5", "12.500000000000002"),
    lambda text: text.replace("12.5", "NaN"),
    lambda text: text.replace("12.5", '"12.5"'),
    lambda text: text.replace("12.5", "null"),
    lambda text: text.replace("1000.25", "1000"),
    lambda text: text.replace('"slope"', '"low"'),
    lambda text: text.replace("a remark", "another remark"),
    lambda text: text.replace('"checksum"', '"sum"'),
    lambda text: text[: len(text) // 2],
    lambda text: text + text,
]


@pytest.mark.parametrize("change", CHANGES, ids=range(len(CHANGES)))
def test_a_well_formed_file_that_was_changed_is_none(place, change):
    calibration_cache.store(NAME, SETTING, "a remark")
    path = place / f"{NAME}.json"
    assert change(path.read_text()) != path.read_text()
    path.write_text(change(path.read_text()))
    assert calibration_cache.load(NAME) is None


def test_every_character_counts(place):
    """Each flipped in turn: the setting comes back as it was, or not at all."""
    calibration_cache.store(NAME, SETTING, "a remark")
    path = place / f"{NAME}.json"
    whole = path.read_bytes()
    for at in range(len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert calibration_cache.load(NAME) in (None, SETTING)
        path.write_bytes(whole[:at])
        assert calibration_cache.load(NAME) in (None, SETTING)


def test_a_result_under_another_name_is_none(place):
    calibration_cache.store(NAME, SETTING, "")
    (place / f"{NAME}.json").rename(place / f"{'1' * 64}.json")
    assert calibration_cache.load("1" * 64) is None


@pytest.mark.parametrize(
    "change",
    [*CHANGES[-2:], lambda text: text.replace('"threshold": ', '"threshold": 1')],
    ids=["cut", "twice", "other"],
)
def test_a_changed_threshold_is_computed_and_written_again(place, monkeypatch, change):
    scenario, text = make_scenario(SCENARIO), "windowed:n=3,arl0=50"
    right = calibrated(make_detector(text), scenario)
    (path,) = place.glob("*.json")
    whole = path.read_text()
    path.write_text(change(whole))
    new_program(monkeypatch, may_calibrate=True)
    again = calibrated(make_detector(text), scenario)
    assert (again.threshold, again.arl0) == (right.threshold, right.arl0)
    assert path.read_text() == whole


def test_a_folder_that_cannot_be_written_is_no_error(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path / "file" / "below"))
    calibration_cache.store(NAME, SETTING, "")
    assert calibration_cache.load(NAME) is None
    assert calibrated(make_detector("windowed:n=2,arl0=20"), make_scenario(SCENARIO)).calibrated


def test_a_write_that_fails_leaves_nothing(place, monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(os, "replace", full)
    calibration_cache.store(NAME, SETTING, "")
    assert list(place.iterdir()) == []


def test_an_interrupted_write_leaves_nothing(place, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        calibration_cache.store(NAME, SETTING, "")
    assert list(place.iterdir()) == []


def test_the_next_program_reads_what_this_one_found(place, monkeypatch):
    """White innovations and simulated runs, with a slope and without a threshold."""
    texts = ("windowed:n=3,arl0=50", "relative-motion:k=5,arl0=100", "relative-motion:k=5,preset=foi")
    first = calibrated_all([make_detector(text) for text in texts], make_scenario(SCENARIO))
    assert len(list(place.glob("*.json"))) == 3
    new_program(monkeypatch, may_calibrate=False)
    again = calibrated_all([make_detector(text) for text in texts], make_scenario(SCENARIO))
    for one, other in zip(first, again, strict=True):
        assert (one.name, one.threshold, one.arl0) == (other.name, other.threshold, other.arl0)
    assert [detector.slope for detector in first[1:]] == [detector.slope for detector in again[1:]]
    remarks = {json.loads(path.read_text())["what"] for path in place.glob("*.json")}
    assert remarks == {f"{text} in {SCENARIO}, linear" for text in texts}


def test_other_code_or_settings_make_another_result(place, monkeypatch):
    scenario, text = make_scenario(SCENARIO), "windowed:n=3,arl0=50"
    first = calibrated(make_detector(text), scenario)
    changes = [(calibration_cache, "SOURCE", "other"), (calibration, "RUNS", 4000), (calibration, "FIRST_ALARMS", 300)]
    for count, (module, name, value) in enumerate(changes, start=2):
        monkeypatch.setattr(module, name, value)
        new_program(monkeypatch, may_calibrate=True)
        other = calibrated(make_detector(text), scenario)
        assert len(list(place.glob("*.json"))) == count
    assert other.threshold != first.threshold
    different = [("a", "b", "c"), ("a", "c", "b"), ("ab", "c", ""), ("a", "b,c")]
    assert len({calibration_cache.key(*parts) for parts in different}) == len(different)


def imported_by(module: str) -> set[Path]:
    """The modules of the package that a module imports, directly or through others, itself included.

    The statements are read, and not followed at run time, so that an import within a function counts, too.
    """
    found: set[Path] = set()
    names = [module]
    while names:
        name = names.pop()
        path = file_of(name)
        if path is None or path in found:
            continue
        found.add(path)
        names.append(name.rpartition(".")[0])
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0
                names += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
    return found


def file_of(module: str) -> Path | None:
    if module.partition(".")[0] != "spoofgym":
        return None
    place = PACKAGE.parent.joinpath(*module.split("."))
    return next((path for path in (place / "__init__.py", place.with_suffix(".py")) if path.is_file()), None)


def test_every_byte_of_what_a_threshold_depends_on_is_in_the_digest(monkeypatch, package_copy):
    depends = {path.relative_to(PACKAGE) for path in imported_by("spoofgym.calibration.thresholds")}
    assert {"simulation.py", "sensors", "navigation", "detectors", "scenarios"} <= {path.parts[0] for path in depends}
    assert any(len(path.parts) > 2 for path in depends)  # a folder within a folder
    monkeypatch.setattr(spoofgym, "__file__", str(package_copy / "__init__.py"))
    before = calibration_cache._source()
    assert before == calibration_cache._source() != ""
    silent = []
    for path in sorted(depends):
        whole = (package_copy / path).read_bytes()
        (package_copy / path).write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]) if whole else b"#")
        if calibration_cache._source() == before:
            silent.append(path.as_posix())
        (package_copy / path).write_bytes(whole)
    assert silent == []
    assert before == calibration_cache._source()


def test_what_a_program_imports_to_calibrate_is_what_its_statements_say():
    """The imports that are read above leave out none that happens."""
    command = "import sys, spoofgym.calibration; print(*(name for name in sys.modules if name.startswith('spoofgym')))"
    names = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True).stdout.split()
    assert len(names) > 50
    assert {file_of(name) for name in names} <= imported_by("spoofgym.calibration.thresholds")


def test_the_digest_leaves_out_what_uses_calibration_only(monkeypatch, package_copy):
    """A change of an environment or of a program throws no thresholds away; a new room counts, at any depth."""
    monkeypatch.setattr(spoofgym, "__file__", str(package_copy / "__init__.py"))
    before = calibration_cache._source()
    for name in ("envs/spoofer.py", "evaluation/metrics.py", "console.py"):
        (package_copy / name).write_text("# another one\n")
    assert calibration_cache._source() == before
    digests = {before}
    for folder in (package_copy, package_copy / "navigation", package_copy / "annex" / "attic"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "added.py").write_text("")
        digests.add(calibration_cache._source())
    assert len(digests) == 4


def test_a_detector_that_its_name_does_not_build_stays_in_memory(place):
    class Own(Windowed):
        """A user's class that keeps the name of its base."""

    scenario = make_scenario(SCENARIO)
    other = scenario.changed(horizon=25)
    assert other.name == scenario.name
    assert calibration_cache.spelled_out_scenario(scenario)
    assert calibration_cache.spelled_out_scenario(dataclasses.replace(scenario))
    assert not calibration_cache.spelled_out_scenario(other)
    assert not calibration_cache.spelled_out_scenario(scenario.changed(name="unheard-of"))
    assert calibrated(Own(3, arl0=50.0), scenario).calibrated
    assert not place.exists()


def test_a_scenario_that_its_name_does_not_build_is_told_by_all_that_it_consists_of(place):
    """The same parts, built a second time, find the result on disk; another value, or a class of a user's, does not."""

    class Own(type(make_scenario(SCENARIO).family)):
        """A user's kind of filter."""

    def built(**changes):
        return make_scenario(SCENARIO).changed(horizon=25, **changes)

    one, same, other = built(), built(), built(error_scale=11.0)
    assert calibration_cache.identity(one) == calibration_cache.identity(same) != calibration_cache.identity(other)
    assert calibrated(make_detector("windowed:n=4,arl0=50"), one).calibrated
    assert len(list(place.iterdir())) == 1
    fields = {item.name: getattr(one.family, item.name) for item in dataclasses.fields(one.family)}
    strange = one.changed(family=Own(**fields))
    assert calibration_cache.identity(strange) is strange


def test_together_is_the_same_as_alone(monkeypatch, tmp_path):
    """Coloured noise: the burn-in that one detector needs must not change the runs of another."""
    for name, value in (("RUNS", 200), ("SLOPE_RUNS", 200), ("SIMULATED_FIRST_ALARMS", 100)):
        # few runs a pass, so that the detectors need several passes, and not the same number
        monkeypatch.setattr(calibration, name, value)
    scenario = make_scenario("liu-flight:horizon=30,markov_sigma=2,markov_time=30")
    texts = ("snapshot:arl0=100", "windowed:n=4,arl0=60", "relative-motion:k=5,arl0=100", "signed-mean:arl0=80")
    together = calibrated_all([make_detector(text) for text in texts], scenario)
    for text, detector in zip(texts, together, strict=True):
        monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path / text))
        new_program(monkeypatch, may_calibrate=True)
        alone = calibrated(make_detector(text), scenario)
        assert (alone.threshold, alone.arl0) == (detector.threshold, detector.arl0)
        assert getattr(alone, "slope", None) == getattr(detector, "slope", None)
