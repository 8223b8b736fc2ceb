"""The alignment that a log gets: what it states, then what its tables and its motion allow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.alignment import align
from spoofgym.logs.log import read_log
from spoofgym.logs.notes import StatedHeading
from spoofgym.scenarios import make_scenario
from tests.logs.alignment.made_logs import at_rest, made_log, to_and_fro
from tests.scenarios.test_recorded import write_log

DATA = Path(__file__).parents[4] / "shared" / "data"


def gently(time: np.ndarray) -> np.ndarray:
    """It hovers: centimetres a second, without any acceleration to speak of."""
    return np.column_stack([0.05 * np.sin(0.1 * time), 0.05 * np.cos(0.1 * time), np.zeros(len(time))])


def test_a_drive_forward_is_aligned_by_its_course(tmp_path: Path) -> None:
    found = align(read_log(write_log(tmp_path)))
    assert found.method == "course"
    np.testing.assert_allclose(np.degrees(found.attitude_sigma), [5.0, 5.0, 10.0])


def test_a_flight_sideways_is_not(tmp_path: Path) -> None:
    """The velocity turns slowly, so that a course could be read off it; the vehicle looks elsewhere all the time."""
    def sweeping(time):
        return np.column_stack([8.0 * np.sin(0.1 * time), 8.0 * np.cos(0.1 * time), np.zeros(len(time))])

    log = made_log(tmp_path, sweeping, heading=np.radians(98.0), noise=0.05)
    found = align(log)
    assert found.method == "coarse"
    assert np.cos(found.heading - np.radians(98.0)) > np.cos(np.radians(10.0))
    assert align(log, "course").method == "course"


@pytest.mark.parametrize("motion", [at_rest, gently])
def test_what_does_not_move_starts_level_with_an_unknown_heading(motion, tmp_path: Path) -> None:
    found = align(made_log(tmp_path, motion, heading=2.0, pitch=0.1, noise=0.05))
    assert found.method == "static"
    assert found.source == "heading unknown"
    assert np.degrees(found.attitude_sigma[2]) == pytest.approx(180.0 / np.sqrt(3.0))
    assert np.arcsin(found.attitude[2, 1]) == pytest.approx(0.1, abs=0.01)
    assert np.hypot(*found.velocity[:2]) == 0.0


def test_a_stated_heading_counts_first(tmp_path: Path) -> None:
    log = made_log(tmp_path, at_rest, heading=2.0)
    found = align(replace(log, heading=StatedHeading(2.0, 0.05)))
    assert (found.method, found.attitude_sigma[2]) == ("heading", 0.05)
    assert found.heading == pytest.approx(2.0)
    moving = made_log(tmp_path, to_and_fro, heading=2.0)
    found = align(replace(moving, heading=StatedHeading(2.0, 0.05)))
    assert found.method == "heading"
    assert found.heading == pytest.approx(2.0)
    assert np.linalg.norm(found.velocity) > 0.5


@pytest.mark.parametrize(("declination", "sigma"), [(None, 20.0), (0.05, 10.0)])
def test_the_magnetometer_tells_the_heading_at_rest(declination: float | None, sigma: float, tmp_path: Path) -> None:
    """A field that points 0.05 rad east of north and steeply down, seen from a tilted body that looks to 2 rad."""
    log = made_log(tmp_path, at_rest, heading=2.0, pitch=0.2, roll=-0.1)
    attitude = align(replace(log, heading=StatedHeading(2.0, 0.05))).attitude
    field = attitude.T @ np.array([20.0 * np.sin(0.05), 20.0 * np.cos(0.05), -45.0])
    rows = "".join(f"{t},{field[0]},{field[1]},{field[2]}\n" for t in (0.0, 1.0, 2.0, 3.0, 4.0))
    (tmp_path / "magnetometer.csv").write_text("t_s,mx_ut,my_ut,mz_ut\n" + rows)
    found = align(replace(log, declination=declination))
    assert found.heading == pytest.approx(2.0 - (0.05 if declination is None else 0.0), abs=1e-3)
    assert np.degrees(found.attitude_sigma[2]) == pytest.approx(sigma)


def attitude_table(folder: Path, roll: float, pitch: float, yaw: float, unit: str = "rad") -> None:
    """The same attitude at all times."""
    values = [angle if unit == "rad" else np.degrees(angle) for angle in (roll, pitch, yaw)]
    rows = "".join(f"{time},{values[0]},{values[1]},{values[2]}\n" for time in np.arange(0.0, 60.0, 0.5))
    (folder / "attitude.csv").write_text(f"t_s,roll_{unit},pitch_{unit},yaw_{unit}\n" + rows)


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_the_attitude_of_the_log_itself(unit: str, tmp_path: Path) -> None:
    log = made_log(tmp_path, gently, heading=2.0, pitch=0.1, roll=0.3, noise=0.05)
    attitude_table(tmp_path, 0.3, 0.1, 2.0, unit)
    found = align(log)
    assert found.method == "attitude"
    assert found.heading == pytest.approx(2.0)
    assert found.attitude[2, 1] == pytest.approx(np.sin(0.1))


def test_an_attitude_of_other_axes_is_refused(tmp_path: Path) -> None:
    log = made_log(tmp_path, gently, heading=2.0, pitch=0.1, roll=0.4, noise=0.05)
    attitude_table(tmp_path, -0.4, 0.1, 2.0)
    with pytest.raises(ValueError, match=r"the vertical of attitude\.csv is 4[67]° off that of the specific force"):
        align(log, "attitude")
    # nobody asked for it: the log is aligned without it
    assert align(log).method == "static"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('alignment = "guess"', "alignment must be one of auto, static, attitude, course, coarse, got 'guess'"),
        ("heading_deg = 400", "heading_deg must be a number between -360 and 360, got 400"),
        ("heading_sigma_deg = 3", "heading_sigma_deg stands alone; heading_deg is missing"),
        ('declination_deg = "2"', "declination_deg must be a number between -180 and 180, got '2'"),
        ("headng_deg = 3", "did you mean 'heading_deg'"),
    ],
)
def test_what_a_log_states_is_checked(line: str, message: str, tmp_path: Path) -> None:
    folder = write_log(tmp_path)
    path = folder / "log.toml"
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(ValueError, match=message):
        read_log(folder)


def test_a_scenario_says_how_its_log_is_aligned(tmp_path: Path) -> None:
    folder = write_log(tmp_path)
    scenario = make_scenario(f"recorded:{folder},alignment=coarse,horizon=20")
    assert scenario.name == f"recorded:{folder},horizon=20,alignment=coarse"
    assert scenario.family.alignment.method == "coarse"
    with pytest.raises(ValueError, match=r"alignment attitude: attitude\.csv .* is missing"):
        _ = make_scenario(f"recorded:{folder},alignment=attitude").family.clean
    with pytest.raises(ValueError, match="recorded: alignment must be one of auto"):
        make_scenario(f"recorded:{folder},alignment=guess")


def test_a_boat_of_two_metres_a_second_states_its_least_speed(tmp_path: Path) -> None:
    """Its fixes are too coarse for a course at that speed, unless the log says so."""
    folder = write_log(tmp_path, slow=True)
    with pytest.raises(ValueError, match="must move at 3 m/s or more"):
        _ = make_scenario(f"recorded:{folder},alignment=course,least_speed=3").family.clean
    family = make_scenario(f"recorded:{folder},alignment=course,least_speed=0.9").family
    assert family.alignment.method == "course"


def test_a_static_antenna_and_a_hovering_copter_can_be_filtered(tmp_path: Path) -> None:
    if not (DATA / "uav-octa").is_dir():
        pytest.skip("the recorded logs are not at hand")
    family = make_scenario(f"recorded:{DATA / 'uav-octa'}").family
    assert family.alignment.method == "attitude"
    assert family.clean.nis_per_degree(0) < 1.5
