"""What a recorded game says of its log: innovations that are too large, a lost filter, times with all digits."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.log_warning import LogWarning
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded import recorded
from tests.logs.range_drive import write_drive
from tests.scenarios.test_recorded import write_log

DATA = Path(__file__).parents[3] / "shared" / "data"
UNIX = 1732340000.0
SAMPLES = ["car-comma", "car-kaist", "car-long-loop", "car-loop", "car-phone-raw", "car-rtk", "uav-octa", "uav-thor"]


def edit(folder: Path, name: str, change: Callable[[np.ndarray], np.ndarray]) -> Path:
    file = folder / f"{name}.csv"
    header = file.read_text().splitlines()[0]
    values = change(np.loadtxt(file, delimiter=",", skiprows=1))
    np.savetxt(file, values, delimiter=",", header=header, comments="", fmt="%.10f")
    return folder


def later(seconds: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.column_stack([values[:, 0] + seconds, values[:, 1:]])


def put(row: int, column: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(values: np.ndarray) -> np.ndarray:
        values[row, column] = value
        return values

    return change


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("gnss", later(1.0)),
        ("imu", put(4000, 4, 900.0)),
    ],
    ids=["a second late", "spike"],
)
def test_innovations_that_are_too_large_are_told(tmp_path: Path, name: str, change: Callable) -> None:
    folder = edit(write_log(tmp_path / "log", reference=False), name, change)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the clocks
        scenario = recorded(str(folder))
    with pytest.warns(LogWarning, match=r"mean NIS .* per degree of freedom, .* line \d+ of gnss\.csv; likely") as seen:
        assert scenario.family.clean.nis_per_degree(30) > 1.5
    assert [str(warning.filename) for warning in seen] == [str(folder)]


def test_once_and_as_one_line(tmp_path: Path) -> None:
    folder = edit(write_log(tmp_path / "log", reference=False), "gnss", later(1.0))
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("default")
        for onset in (50.0, 60.0):
            assert recorded(str(folder), onset=onset).family.clean.nis.shape == (112,)
    seen = [warning for warning in seen if "innovations" in str(warning.message)]
    assert len(seen) == 1
    said = warnings.formatwarning(seen[0].message, seen[0].category, seen[0].filename, seen[0].lineno)
    assert said.startswith(f"{folder}:1: LogWarning: clean innovations are")
    assert said.count("\n") == 1


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data, real logs for tests, is absent")
@pytest.mark.parametrize("name", SAMPLES)
def test_the_sample_logs_give_no_reason_to_warn(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", LogWarning)
        scenario = recorded(str(DATA / name))
        assert scenario.family.clean.nis_per_degree(0) < 1.0


def test_a_good_drive_with_ranges_gives_none(tmp_path: Path) -> None:
    write_drive(tmp_path / "log", turns=3)
    with warnings.catch_warnings():
        warnings.simplefilter("error", LogWarning)
        assert 0.3 < recorded(str(tmp_path / "log"), coupling="tight").family.clean.nis_per_degree(0) < 1.3


def test_fixes_that_stay_far_away_are_named(tmp_path: Path) -> None:
    def far(values: np.ndarray) -> np.ndarray:
        values[60:70, 1] += 20.0
        return values

    folder = edit(write_log(tmp_path / "log", reference=False), "gnss", far)
    with pytest.warns(LogWarning, match=r"the largest is .* at 63 s, line 62 of gnss\.csv"):
        _ = recorded(str(folder)).family.clean


def test_a_filter_that_is_lost_names_the_line(tmp_path: Path) -> None:
    """It falls through the Earth while there are no fixes."""
    folder = edit(
        write_log(tmp_path / "log", reference=False),
        "gnss",
        lambda values: values[(values[:, 0] < 70.0) | (values[:, 0] > 112.0)],
    )
    edit(folder, "imu", lambda values: np.where((values[:, :1] > 77.0) & (np.arange(7) == 6), -9000.0, values))
    with pytest.raises(ValueError, match=r"diverges on this log; .* first too large at 113 s, line 69 of gnss\.csv"):
        _ = recorded(str(folder)).family.clean


@pytest.fixture(scope="module")
def unix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_log(tmp_path_factory.mktemp("unix") / "log")
    for name in ("imu", "gnss", "reference"):
        edit(folder, name, later(UNIX + 0.25))
    notes = folder / "log.toml"
    notes.write_text(notes.read_text().replace("start_s = 5.0", f"start_s = {UNIX + 5.25}"))
    return folder


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            "onset=1732350000",
            "onset 1732350000 s lies outside the log: valid from 1732340006.25 s (the first fix after the alignment) "
            "to 1732340118.25 s",
        ),
        ("onset=1732340030.25,horizon=900", "horizon 900 does not fit: valid from 1 to 87 epochs after 1732340030.25"),
    ],
)
def test_unix_times_keep_their_digits(unix: Path, options: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        make_scenario(f"recorded:{unix},{options}")
    assert f"recorded:{unix},{options}" in str(caught.value)


@pytest.mark.parametrize("onset", ["1732340050", "1732340050.5"])
def test_a_name_with_a_unix_time_builds_the_scenario(unix: Path, onset: str) -> None:
    scenario = make_scenario(f"recorded:{unix},onset={onset}")
    assert scenario.name == f"recorded:{unix},onset={onset}"
    assert scenario.timeline.start == UNIX + 50.25 if onset.endswith("5") else UNIX + 49.25


def test_a_gap_of_the_imu_at_a_unix_time(unix: Path, tmp_path: Path) -> None:
    folder = tmp_path / "log"
    folder.mkdir()
    for file in unix.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    edit(folder, "imu", lambda values: values[(values[:, 0] < UNIX + 82.0) | (values[:, 0] > UNIX + 83.0)])
    with pytest.raises(ValueError, match=r"at 17323400\d\d\.\d+ s; .* alignment at 1732340005\.25 s .* at 17323401"):
        recorded(str(folder))
