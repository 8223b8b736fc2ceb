"""Rows that are no fix are left out and told, unknown sigmas are not believed, and nothing else is touched."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.fix_rows import known_sigmas, usable_rows, wild_fixes, wild_velocities
from spoofgym.logs.log_warning import LogWarning

ROWS = 40


def table(**changes: object) -> dict[str, np.ndarray]:
    """A drive north at 12 m/s, a row each second."""
    north = np.arange(ROWS) * 12.0
    columns = {
        "t_s": np.arange(ROWS, dtype=float),
        "lat_deg": 45.0 + np.degrees(north / 6.37e6),
        "lon_deg": np.full(ROWS, 9.0),
        "h_m": np.full(ROWS, 100.0),
        "vn_mps": np.full(ROWS, 12.0),
        "ve_mps": np.zeros(ROWS),
        "vd_mps": np.zeros(ROWS),
        **{name: np.full(ROWS, 1.5) for name in ("sd_n_m", "sd_e_m", "sd_d_m")},
        **{name: np.full(ROWS, 0.1) for name in ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")},
    }
    assert set(changes) <= set(columns)
    return columns | {name: np.asarray(value) for name, value in changes.items()}


def put(rows: dict[str, np.ndarray], index: object, **values: float) -> dict[str, np.ndarray]:
    for name, value in values.items():
        rows[name][index] = value
    return rows


def lines(folder: Path, rows: dict[str, np.ndarray], start: float = 0.0) -> np.ndarray:
    return usable_rows(folder / "gnss.csv", rows, start)[1]


def test_good_rows_stay_without_a_word(tmp_path: Path) -> None:
    rows = table()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kept, numbers = usable_rows(tmp_path / "gnss.csv", rows, 0.0)
        kept = known_sigmas(tmp_path / "gnss.csv", kept, numbers, 0.0)
    np.testing.assert_array_equal(numbers, np.arange(ROWS) + 2)
    for name, values in rows.items():
        np.testing.assert_array_equal(kept[name], values)


@pytest.mark.parametrize("height", [0.0, -17.2])
@pytest.mark.parametrize("first", [0, 7, ROWS - 3])
def test_rows_of_zeros_are_left_out(tmp_path: Path, first: int, height: float) -> None:
    rows = put(table(), slice(first, first + 3), lat_deg=0.0, lon_deg=0.0, h_m=height)
    with pytest.warns(LogWarning, match=rf"gnss\.csv: 3 of 40 rows have lat_deg = .* the first is line {first + 2}"):
        left = lines(tmp_path, rows)
    assert set(range(2, ROWS + 2)) - set(left) == set(range(first + 2, first + 5))


def test_before_the_start_of_a_log_they_are_expected(tmp_path: Path) -> None:
    rows = put(table(), slice(0, 5), lat_deg=0.0, lon_deg=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert lines(tmp_path, rows, 5.0)[0] == 7
    with pytest.warns(LogWarning, match="1 of 40"):
        lines(tmp_path, rows, 4.0)


def test_a_log_at_latitude_and_longitude_zero(tmp_path: Path) -> None:
    rows = table()
    rows["lat_deg"], rows["lon_deg"] = rows["lat_deg"] - 45.0, rows["lon_deg"] - 9.0
    assert len(lines(tmp_path, rows)) == ROWS


@pytest.mark.parametrize("sigma", [99.0, 99.99, 9999.0, 4294967.295, 1e9])
@pytest.mark.parametrize("column", ["sd_n_m", "sd_e_m"])
def test_a_horizontal_sigma_that_no_fix_has(tmp_path: Path, column: str, sigma: float) -> None:
    with pytest.warns(LogWarning, match=r"2 of 40 rows have a horizontal sigma of 99 m or more.* line 12"):
        left = lines(tmp_path, put(table(), [10, 20], **{column: sigma}))
    assert set(range(2, ROWS + 2)) - set(left) == {12, 22}


@pytest.mark.parametrize(
    ("index", "change"),
    [
        ([20], {"lat_deg": 0.1}),
        ([20], {"lat_deg": 0.01}),
        ([20], {"lon_deg": -0.002}),
        ([20], {"h_m": 5000.0}),
        ([0], {"lat_deg": 0.1}),
        ([1], {"lat_deg": 0.1}),
        ([ROWS - 1], {"lat_deg": 0.1}),
        ([20, 21, 22], {"lat_deg": 0.1}),
        ([5, 20], {"lat_deg": 0.1}),
    ],
)
def test_single_fixes_out_of_reach_are_left_out(tmp_path: Path, index: list[int], change: dict[str, float]) -> None:
    rows = table()
    for name, value in change.items():
        rows[name][index] += value
    with pytest.warns(LogWarning, match=rf"{len(index)} of 40 rows .* impossible.* the first is line {index[0] + 2}"):
        left = lines(tmp_path, rows)
    assert set(range(2, ROWS + 2)) - set(left) == {place + 2 for place in index}


def test_two_that_err_apart() -> None:
    track = np.column_stack([np.zeros(ROWS), 12.0 * np.arange(ROWS), np.zeros(ROWS)])
    track[20, 0], track[21, 0] = 1e4, -1e4
    np.testing.assert_array_equal(np.flatnonzero(wild_fixes(np.arange(ROWS, dtype=float), track)), [20, 21])


def test_an_attack_that_jumps_and_stays_is_kept() -> None:
    time = np.arange(ROWS, dtype=float)
    for stretch in (slice(20, 26), slice(20, ROWS)):
        track = np.column_stack([np.zeros(ROWS), 12.0 * time, np.zeros(ROWS)])
        track[stretch, 0] = 1e4
        assert not wild_fixes(time, track).any()


def test_a_track_that_leaps_once_has_no_wild_fix() -> None:
    """At 5 Hz the vehicle could have gone that far soon; where the leap goes is the track, whatever came before it."""
    time = 0.2 * np.arange(200)
    track = np.column_stack([np.zeros(200), 12.0 * time, np.zeros(200)])
    track[100:, 0] += 65.0
    assert not wild_fixes(time, track, 15).any()
    track[108:, 0] -= 65.0
    np.testing.assert_array_equal(np.flatnonzero(wild_fixes(time, track, 15)), np.arange(100, 108))


def test_a_vehicle_that_stands_longer_than_it_drives_is_no_wild_one() -> None:
    """Its median speed is zero; fast straight flight, holes in the fixes and a turn back are still believed."""
    time = np.concatenate([np.arange(60.0), np.arange(70.0, 100.0)])
    east = np.where(time < 60.0, 0.0, 80.0 * (time - 60.0))
    track = np.column_stack([np.minimum(east, 3200.0 - east), np.zeros(len(time)), np.zeros(len(time))])
    assert not wild_fixes(time, track).any()


def test_a_velocity_that_contradicts_the_positions(tmp_path: Path) -> None:
    with pytest.warns(LogWarning, match=r"1 of 40 rows .* the first is line 22"):
        assert 22 not in lines(tmp_path, put(table(), 20, vn_mps=5000.0))
    assert len(lines(tmp_path, put(table(), 20, vn_mps=0.0))) == ROWS
    time = np.arange(ROWS) * 0.1
    track = np.column_stack([3.0 * (np.arange(ROWS) % 2), np.zeros(ROWS), np.zeros(ROWS)])  # noise of a receiver
    assert not wild_velocities(time, track, np.zeros((ROWS, 3))).any()


def test_nothing_is_left(tmp_path: Path) -> None:
    rows = put(table(), slice(1, None), lat_deg=0.0, lon_deg=0.0)
    with pytest.warns(LogWarning), pytest.raises(ValueError, match=r"gnss\.csv, lines 2 to 41: 2 rows or more must be"):
        lines(tmp_path, rows)


def known(folder: Path, rows: dict[str, np.ndarray], start: float = 0.0) -> dict[str, np.ndarray]:
    return known_sigmas(folder / "gnss.csv", rows, np.arange(len(rows["t_s"])) + 2, start)


@pytest.mark.parametrize(
    ("column", "default"),
    [("sd_n_m", 2.5), ("sd_e_m", 2.5), ("sd_d_m", 5.0), ("sd_vn_mps", 0.3), ("sd_ve_mps", 0.3), ("sd_vd_mps", 0.5)],
)
def test_a_sigma_of_zero_is_unknown(tmp_path: Path, column: str, default: float) -> None:
    rows = put(table(), [4, 6], **{column: 0.0})
    with pytest.warns(LogWarning, match=rf"2 of 40 rows have a sigma of 0 \({column}\).*: {default:g}; .* line 6"):
        found = known(tmp_path, rows)
    assert list(found[column][[3, 4, 5, 6]]) == [rows[column][3], default, rows[column][5], default]
    assert rows[column][4] == 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert known(tmp_path, rows, 7.0)[column][4] == default


@pytest.mark.parametrize("column", ["sd_d_m", "sd_vn_mps", "sd_vd_mps"])
def test_a_component_of_unknown_sigma_is_not_measured(tmp_path: Path, column: str) -> None:
    with pytest.warns(
        LogWarning, match=rf"1 of 40 rows have a sigma of 99 or more \({column}\), .* not measured; .* line 6$"
    ):
        found = known(tmp_path, put(table(), 4, **{column: 4294967.295}))
    assert found[column][4] == 1000.0
    assert found[column][5] < 2.0


def test_sigmas_that_are_not_measured_are_told_from_the_start_on_in_one_line(tmp_path: Path) -> None:
    rows = put(table(), slice(10, 30), sd_vn_mps=9999.0, sd_ve_mps=9999.0)
    rows = put(rows, slice(None), sd_d_m=999.0)
    with pytest.warns(LogWarning, match=r"40 of 40 rows .* \(sd_d_m, sd_ve_mps, sd_vn_mps\)") as caught:
        known(tmp_path, rows)
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        known(tmp_path, put(table(), 4, sd_d_m=999.0), 5.0)


def test_a_table_without_sigmas(tmp_path: Path) -> None:
    rows = {name: values for name, values in table().items() if not name.startswith("sd_")}
    assert known(tmp_path, rows).keys() == rows.keys()
    assert len(lines(tmp_path, rows)) == ROWS
