"""A reference with holes: no error is made up, none is NaN, and what contradicts the fixes is told."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import spoofgym  # noqa: F401
from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.geodesy import displace
from spoofgym.logs.log import Fixes, covered
from spoofgym.logs.log_warning import LogWarning
from spoofgym.logs.reference import frozen_rows
from spoofgym.scenarios.recorded import recorded
from tests.scenarios.test_recorded import write_log

Row = list[float]


def edited(folder: Path, keep: Callable[[float], bool], change: Callable[[Row], Row] = lambda row: row) -> Path:
    """A log whose reference has only the rows of some times, changed."""
    write_log(folder)
    file = folder / "reference.csv"
    header, *lines = file.read_text().splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    text = "".join(",".join(map(repr, change(row))) + "\n" for row in rows if keep(row[0]))
    file.write_text(header + "\n" + text)
    return folder


def largest(folder: Path, attack: str = "none", **options: float) -> dict[str, float]:
    scenario = recorded(str(folder), onset=40.0, **options)  # type: ignore[arg-type]
    return evaluate_recorded(scenario, [make_attack(attack)], [make_detector("snapshot")])[0]


def test_a_hole_is_not_bridged_where_it_is_long() -> None:
    def at(own: list[float], time: list[float]) -> list[bool]:
        zeros = np.zeros((len(own), 3))
        return covered(Fixes(np.array(own), zeros, None, None, None), np.array(time)).tolist()

    tenths = [0.1 * k for k in range(11)] + [1.9, 3.0, 3.1, 3.2]
    asked = [-0.1, 0.0, 0.55, 1.0, 1.5, 1.9, 2.5, 3.0, 3.15, 3.2, 3.3]
    assert at(tenths, asked) == [False, True, True, True, True, True, False, True, True, True, False]
    assert at([0.0, 1.0, 2.0, 5.0, 6.0, 9.5, 10.5], [1.5, 4.0, 8.0]) == [True, True, False]
    assert at([0.0, 10.0, 20.0], [5.0, 10.0]) == [False, True]


@pytest.mark.parametrize("hole", [(60.0, 100.0), (60.0, 70.0), (0.0, 70.0), (35.0, 45.0)])
def test_epochs_in_a_hole_have_no_error(tmp_path: Path, hole: tuple[float, float]) -> None:
    whole = largest(write_log(tmp_path / "whole"))
    row = largest(edited(tmp_path / "hole", lambda time: not hole[0] < time < hole[1]))
    assert row["max_error_m"] <= whole["max_error_m"]
    assert row["clean_error_p95_m"] < 1.5
    inside = np.arange(41.0, 120.0)
    inside = inside[(inside != 33) & (inside != 34)]
    assert whole["error_epochs"] == len(inside)
    assert row["error_epochs"] == np.sum((inside <= hole[0]) | (inside >= hole[1]))


def test_a_game_goes_on_in_a_hole(tmp_path: Path) -> None:
    """Its rewards are finite, and its errors those of the whole reference to the clean filter's own."""
    errors = []
    for folder in (write_log(tmp_path / "whole"), edited(tmp_path / "hole", lambda time: not 60.0 < time < 100.0)):
        env = gymnasium.make(
            "spoofgym/Spoofer-v0",
            scenario=f"recorded:{folder},onset=50,horizon=60",
            fidelity="strapdown",
            knowledge="blind",
            action="rate",
        )
        env.reset(seed=0)
        action, rewards, error = np.ones(env.action_space.shape, dtype=np.float32), [], []
        for _ in range(60):
            _, reward, terminated, _, _ = env.step(action)
            rewards.append(float(reward))
            error.append(env.unwrapped.game.simulation.error[0].copy())  # type: ignore[attr-defined]
            if terminated:
                break
        assert np.all(np.isfinite(rewards))
        errors.append(np.array(error))
        env.close()
    assert errors[0].shape == errors[1].shape
    assert np.abs(errors[0] - errors[1]).max() < 1.5


def test_the_position_in_a_hole_joins_its_ends(tmp_path: Path) -> None:
    scenario = recorded(str(edited(tmp_path / "log", lambda time: not 60.0 < time < 100.0)))
    truth = recorded(str(write_log(tmp_path / "whole"))).family.true_position
    metres = (scenario.family.true_position - truth) * [6.37e6, 4.5e6, 1.0]
    hole = np.abs(metres).max(axis=1) > 1e-6
    np.testing.assert_array_equal(np.flatnonzero(~scenario.family.compared), np.flatnonzero(hole))
    assert np.abs(metres).max() < 2.0
    assert np.abs(metres[~scenario.family.compared][[0, -1]]).max() < 1.0
    assert np.all(np.isfinite(scenario.family.true_velocity))


def test_a_reference_that_begins_or_ends_within_the_game(tmp_path: Path) -> None:
    late = largest(edited(tmp_path / "late", lambda time: time > 80.0))
    assert late["error_epochs"] == 39
    early = largest(edited(tmp_path / "early", lambda time: time < 80.0))
    assert early["error_epochs"] == 39
    folder = str(edited(tmp_path / "again", lambda time: time < 80.0))
    with pytest.raises(ValueError, match=r"horizon 60 does not fit: valid from 1 to 39 epochs"):
        recorded(folder, onset=40.0, horizon=60)
    with pytest.raises(ValueError, match="the reference ends at 3 s, before the alignment at"):
        recorded(str(edited(tmp_path / "gone", lambda time: time < 3.1)))


def test_a_reference_that_knows_no_epoch(tmp_path: Path) -> None:
    row = largest(edited(tmp_path / "log", lambda time: time in (0.2, 119.2)))
    assert row["error_epochs"] == 0
    assert row["max_error_m"] is None
    assert row["clean_error_median_m"] is None


@pytest.mark.parametrize(
    ("place", "said"), [((0.0, 0.0, 0.0), "lat_deg = lon_deg = 0"), ((45.01, 9.0, 100.0), "impossible")]
)
def test_a_row_of_zeros_or_out_of_reach_is_no_truth(tmp_path: Path, place: Row, said: str) -> None:
    def change(row: Row) -> Row:
        return [row[0], *place, *row[4:]] if row[0] == 80.0 else row

    with pytest.warns(LogWarning, match=rf"reference\.csv: 1 of \d+ rows .*{said}"):
        row = largest(edited(tmp_path / "log", lambda time: True, change))
    assert row["max_error_m"] < 1.5


def between(first: float, last: float, change: Callable[[Row], Row]) -> Callable[[Row], Row]:
    """A change of the rows from one time to another."""
    return lambda row: change(row) if first - 1e-6 < row[0] < last - 1e-6 else row


def far(row: Row) -> Row:
    return [row[0], row[1] + 1.0, *row[2:]]


def test_a_stretch_of_three_seconds_that_is_out_of_reach_is_no_truth(tmp_path: Path) -> None:
    """At 5 Hz it has more rows than the three that a receiver is forgiven."""
    with pytest.warns(LogWarning, match=r"reference\.csv: 8 of \d+ rows .*impossible"):
        row = largest(edited(tmp_path / "log", lambda time: True, between(80.0, 81.6, far)))
    assert row["max_error_m"] < 1.5


def test_a_longer_stretch_far_from_the_fixes_is_told(tmp_path: Path) -> None:
    folder = edited(tmp_path / "log", lambda time: True, between(80.0, 90.0, far))
    with pytest.warns(
        LogWarning, match=r"reference\.csv: 50 of \d+ rows lie more than 50 m .*up to 11\d+ m, .* line 401"
    ):
        recorded(str(folder))


@pytest.mark.parametrize("column", [1, 2])
def test_a_row_with_half_a_position_is_no_truth(tmp_path: Path, column: int) -> None:
    def change(row: Row) -> Row:
        return [*row[:column], 0.0, *row[column + 1 :]]

    with pytest.warns(LogWarning, match=r"reference\.csv: 50 of \d+ rows have lat_deg = 0 or lon_deg = 0"):
        row = largest(edited(tmp_path / "log", lambda time: True, between(80.0, 90.0, change)))
    assert row["max_error_m"] < 1.5


@pytest.mark.parametrize("last", [88.0, 200.0])
@pytest.mark.parametrize("columns", [4, 7])
def test_a_frozen_reference_is_no_truth(tmp_path: Path, columns: int, last: float) -> None:
    held: Row = []

    def change(row: Row) -> Row:
        held[:] = held or row
        return [row[0], *held[1:columns], *row[columns:]]

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        row = largest(edited(tmp_path / "log", lambda time: True, between(80.0, last, change)))
    assert any("rows repeat a position for more than 1 s" in str(warning.message) for warning in caught)
    assert row["max_error_m"] < 1.5


def test_the_reference_of_a_vehicle_that_stands_stays() -> None:
    """Its fixes wander; and where a spoofer carries them away, the vehicle still stands."""
    time = np.arange(0.0, 100.0, 0.2)
    north = 12.0 * np.minimum(time, 40.0) + np.where(time > 70.0, 1.5 * np.square(time - 70.0), 0.0)
    north -= np.where(time < 40.0, 0.5 * 3.0 * 4.0**2 * np.square(np.clip((time - 36.0) / 4.0, 0.0, 1.0)), 24.0)
    start = np.array([np.radians(45.0), np.radians(9.0), 100.0])
    place = displace(start, np.column_stack([0.0 * time, north, 0.0 * time]))
    place[(time >= 40.0) & (time <= 70.0)] = place[np.searchsorted(time, 40.0)]
    reference = Fixes(time, place, None, None, None)
    generator = np.random.default_rng(0)
    for pull in (0.0, 3.0):
        moved = generator.standard_normal((100, 3)) + np.outer(pull * np.clip(time[::5] - 45.0, 0.0, 20.0), [1, 0, 0])
        fixes = Fixes(time[::5], displace(place[::5], moved), None, np.ones((100, 3)), None)
        assert not frozen_rows(reference, fixes).any()


@pytest.mark.parametrize(("late", "shift"), [(1.0, "-1.0"), (-2.0, r"\+(1\.9|2\.0)")])
def test_a_reference_on_another_clock_is_told(tmp_path: Path, late: float, shift: str) -> None:
    folder = edited(tmp_path / "log", lambda time: True, lambda row: [row[0] + late, *row[1:]])
    with pytest.warns(LogWarning, match=rf"the fixes lie .* with the times of the reference {shift}\d* s it is"):
        recorded(str(folder))


def test_a_good_reference_is_not(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _ = recorded(str(write_log(tmp_path / "log"))).family.clean
