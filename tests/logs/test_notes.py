"""``log.toml``: every key is known or refused by name, every value checked, and bytes at its beginning are accepted."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.notes import Notes

GOOD = "imu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nstart_s = 2.0\n"
DATA = Path(__file__).parents[3] / "shared" / "data"


def notes(folder: Path, text: str, encoding: str = "utf-8") -> Notes:
    path = folder / "log.toml"
    path.write_bytes(text.encode(encoding))
    return Notes(path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("imu_delay = 0.5", "unknown key 'imu_delay' (did you mean 'imu_delay_s'?)"),
        ("imu_delay_ms = 500", "unknown key 'imu_delay_ms' (did you mean 'imu_delay_s'?)"),
        ("Imu_Delay_S = 0.5", "unknown key 'Imu_Delay_S' (did you mean 'imu_delay_s'?)"),
        ("GNSS_DELAY_S = 0.5", "unknown key 'GNSS_DELAY_S' (did you mean 'gnss_delay_s'?)"),
        ("lever_arm = [1, 2, 3]", "unknown key 'lever_arm' (did you mean 'antenna_lever_arm_m'?)"),
        ("Vehicle = 'car'", "unknown key 'Vehicle' (did you mean 'vehicle'?)"),
        ("colour = 'red'", "unknown key 'colour'; valid are name, imu_to_body_frd, start_s"),
        ("imu.delay_s = 0.5", "imu must not be a table"),
        ("vehicle = {mass = 3}", "vehicle must not be a table"),
        ("[sensor]\nimu_delay_s = 0.5", "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [sensor]"),
        ("[notes]\nimu_delay_s = 0.5", "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [notes]"),
        ("[notes]\nIMU_delay = 0.5", "'imu_delay_s' must stand above all tables, got 'IMU_delay' in [notes]"),
        ("[[imu]]\nimu_delay_s = 0.1", "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [imu]"),
        ("imu = [{imu_delay_s = 1}]", "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [imu]"),
        ("imu = [1, {a = [{start_s = 1}]}]", "'start_s' must stand above all tables, got 'start_s' in [imu.a]"),
        ("[[imu]]\nmaker = 'x'", "imu must not be a table"),
        ("[[notes]]\nimu_delay_s = 0.1", "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [notes]"),
        ("[[notes]]\nmaker = 'x'", "notes must be one table [notes], not a list of tables"),
        (
            "[notes.sub]\nimu_delay_s = 0.1",
            "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [notes.sub]",
        ),
        ("[notes.a.b]\nantenna_lever_arm_m = [1, 0, 0]", "got 'antenna_lever_arm_m' in [notes.a.b]"),
        (
            "[[notes.a]]\nGNSS_delay_s = 1",
            "'gnss_delay_s' must stand above all tables, got 'GNSS_delay_s' in [notes.a]",
        ),
        ('[notes]\nimu_delay_s = "0.1"', "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [notes]"),
        ('[notes]\nimu_delay = "0.1"', "'imu_delay_s' must stand above all tables, got 'imu_delay' in [notes]"),
        ('[notes]\nimu_delay_s = "half"', "'imu_delay_s' must stand above all tables, got 'imu_delay_s' in [notes]"),
        (
            "[notes]\nlever_arm = [1, 0, 0]",
            "'antenna_lever_arm_m' must stand above all tables, got 'lever_arm' in [notes]",
        ),
        ("notes = 3", "notes must be a table, got 3"),
        ("notes = []", "notes must be a table, got []"),
        ("[sensor]\nmaker = 'x'", "unknown table [sensor]"),
    ],
)
def test_an_unknown_key_is_refused_with_the_one_that_is_meant(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        notes(tmp_path, GOOD + line + "\n")


def test_remarks_and_a_table_of_notes_are_welcome(tmp_path: Path) -> None:
    text = GOOD + "vehicle = 'car'\nweek = 2000\n[notes]\ncolour = 'red'\nweight = 3\nname = 'x'\n[notes.more]\na = 1\n"
    text += "start = 'in a garage'\n[[notes.people]]\nname = 'y'\n"
    assert notes(tmp_path, text).name("log") == "log"


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_the_sample_logs_have_no_unknown_key() -> None:
    paths = sorted(DATA.glob("*/log.toml"))
    assert paths
    for path in paths:
        Notes(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_byte_order_mark_and_windows_lines(tmp_path: Path, encoding: str) -> None:
    read = notes(tmp_path, GOOD.replace("\n", "\r\n"), encoding)
    assert read.seconds("start_s", None) == 2.0
    np.testing.assert_array_equal(read.mounting(), [[0, 1, 0], [1, 0, 0], [0, 0, -1]])


@pytest.mark.parametrize(
    "value",
    ["'0.5'", "true", "[1]", "nan", "inf", "1" + 400 * "0", "2020-01-01"],
    ids=["text", "bool", "list", "nan", "inf", "huge", "date"],
)
def test_a_time_of_another_type_is_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(ValueError, match="imu_delay_s must be a finite number of seconds, got"):
        notes(tmp_path, GOOD + f"imu_delay_s = {value}\n").seconds("imu_delay_s", 0.0)


@pytest.mark.parametrize("key", ["imu_delay_s", "gnss_delay_s", "start_s"])
def test_a_time_has_a_limit(tmp_path: Path, key: str) -> None:
    text = "imu_to_body_frd = []\n" + f"{key} = 1e300\n"
    with pytest.raises(ValueError, match=rf"log\.toml: {key} must be .*1e\+12, got 1e\+300$"):
        notes(tmp_path, text).seconds(key, 0.0)


@pytest.mark.parametrize(
    "value",
    [
        *("5", "'a'", "[['1',0,0],[0,1,0],[0,0,1]]", "[[true,0,0],[0,1,0],[0,0,1]]", "[[[1]],[2],[3]]"),
        *("[[1e400,0,0],[0,1,0],[0,0,1]]", "[1,0,0,0,1,0,0,0,1]", "[[1,0,0],[0,1,0],[0,0]]"),
    ],
)
def test_a_mounting_of_another_type_is_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(ValueError, match="imu_to_body_frd must be a rotation, 3 rows of 3 numbers"):
        notes(tmp_path, f"imu_to_body_frd = {value}\nstart_s = 2.0\n").mounting()


@pytest.mark.parametrize("value", ["[1, 2]", "'x'", "[1, 2, 1e9]", "[true, 0, 0]", "3", "[nan, 0, 0]"])
def test_a_lever_arm_of_another_type_is_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(ValueError, match="antenna_lever_arm_m must be 3 numbers"):
        notes(tmp_path, GOOD + f"antenna_lever_arm_m = {value}\n").lever_arm()


def test_a_lever_arm_is_turned_to_right_forward_up(tmp_path: Path) -> None:
    np.testing.assert_array_equal(notes(tmp_path, GOOD).lever_arm(), np.zeros(3))
    read = notes(tmp_path, GOOD + "antenna_lever_arm_m = [1, 2, -3.5]\n")
    np.testing.assert_array_equal(read.lever_arm(), [2.0, 1.0, 3.5])


@pytest.mark.parametrize(
    "text",
    ["a = ", "x = " + 3000 * "[" + 3000 * "]", "x = 1" + 5000 * "0", "start_s = 1\nstart_s = 2"],
    ids=["cut", "nested", "digits", "twice"],
)
def test_what_is_no_toml_is_named(tmp_path: Path, text: str) -> None:
    with pytest.raises(ValueError, match=r"log\.toml: not valid TOML: "):
        notes(tmp_path, text)


def test_no_text_no_name_and_too_much(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not valid TOML"):
        notes(tmp_path, GOOD, "utf-16")
    with pytest.raises(ValueError, match="name must be a text, got 5"):
        notes(tmp_path, GOOD + "name = 5\n").name("log")
    with pytest.raises(ValueError, match="valid are 1000000 at most"):
        notes(tmp_path, GOOD + 1_000_000 * "#")
