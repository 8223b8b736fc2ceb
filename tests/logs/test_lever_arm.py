"""An antenna metres away from the IMU."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spoofgym.geodesy import displace, position_difference
from spoofgym.logs.log import read_log
from spoofgym.logs.log_warning import LogWarning
from spoofgym.scenarios.recorded import recorded
from spoofgym.trajectory import Accelerate, Straight, Turn, fly
from tests.logs.range_drive import write_drive

# an antenna far ahead turns before the vehicle does, which the check of clocks takes for early fixes
pytestmark = pytest.mark.filterwarnings("ignore::spoofgym.logs.log_warning.LogWarning")

ARM = np.array([1.0, 3.0, 2.0])
"""Right, forward, up, m."""


def write(folder: Path, notes: str) -> Path:
    """Fixes of an antenna at the arm, good to 5 cm and 3 cm/s, on a drive that turns and hardly banks.

    The reference is the IMU's.
    """
    generator = np.random.default_rng(3)
    turns = [Turn(np.radians(side * 90.0), 8.0) for side in (1.0, -1.0, 1.0, 1.0)]
    parts = [part for turn in turns for part in (Straight(8.0), turn, Accelerate(2.0, 4.0), Accelerate(-2.0, 4.0))]
    truth = fly(parts, position=(0.8, 0.2, 300.0), speed=3.0, heading=1.0, rate=50)
    frd, sign = [1, 0, 2], np.array([1.0, 1.0, -1.0])
    samples = np.hstack([truth.angular_rate[:, frd] * sign, truth.specific_force[:, frd] * sign])
    samples += np.repeat([1e-3, 0.02], 3) * generator.standard_normal(samples.shape)
    every = np.arange(50, truth.num_steps, 50)
    arm = truth.attitude[every] @ ARM
    turning = 0.5 * (truth.angular_rate[every - 1] + truth.angular_rate[every])
    moved = np.einsum("nij,nj->ni", truth.attitude[every], np.cross(turning, ARM))

    def table(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        degrees = np.degrees(position[:, :2])
        down, sigmas = -velocity[:, 2], np.full((len(every), 3), 0.03)
        return np.column_stack([truth.time[every], degrees, position[:, 2], velocity[:, [1, 0]], down, sigmas])

    error = 0.05 * generator.standard_normal((len(every), 3))
    fixes = table(displace(truth.position[every], arm + error), truth.velocity[every] + moved + 0.6 * error)
    reference = table(truth.position[every], truth.velocity[every])
    header = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps,sd_vn_mps,sd_ve_mps,sd_vd_mps"
    imu = np.column_stack([truth.time[:-1] + 0.01, samples])
    folder.mkdir()
    for name, columns, values in (
        ("imu", "t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", imu),
        ("gnss", header, fixes),
        ("reference", header, reference),
    ):
        np.savetxt(folder / f"{name}.csv", values, delimiter=",", header=columns, comments="", fmt="%.11f")
    folder.joinpath("log.toml").write_text(f"imu_to_body_frd = [[1,0,0],[0,1,0],[0,0,1]]\nstart_s = 1.0\n{notes}")
    return folder


def errors(folder: Path) -> np.ndarray:
    scenario = recorded(str(folder))
    return position_difference(scenario.family.clean.position[1:], scenario.family.true_position)[20:]


def test_the_filter_knows_where_the_antenna_is(tmp_path: Path) -> None:
    known = errors(write(tmp_path / "known", "antenna_lever_arm_m = [3.0, 1.0, -2.0]\n"))
    assert np.median(np.linalg.norm(known, axis=1)) < 0.3
    unknown = errors(write(tmp_path / "unknown", ""))
    assert np.median(np.linalg.norm(unknown, axis=1)) > 3.0


def test_velocities_become_those_of_the_imu(tmp_path: Path) -> None:
    scenario = recorded(str(write(tmp_path / "log", "antenna_lever_arm_m = [3.0, 1.0, -2.0]\n")))
    assert scenario.family.log.fixes.velocity is not None
    assert scenario.family.log.reference is not None
    assert scenario.family.log.reference.velocity is not None
    antenna = read_log(tmp_path / "log").fixes.velocity
    assert np.abs(antenna - scenario.family.log.reference.velocity).max() > 0.4
    # 3.7 m at 0.37 rad/s with 9 degrees of bank, and the noise
    assert np.abs(scenario.family.log.fixes.velocity - scenario.family.log.reference.velocity).max() < 0.35


def test_a_tightly_coupled_filter_says_that_it_knows_none(tmp_path: Path) -> None:
    write_drive(tmp_path / "log", turns=3)
    notes = tmp_path / "log" / "log.toml"
    notes.write_text(notes.read_text() + "antenna_lever_arm_m = [3.0, 4.0, 0.0]\n")
    with pytest.warns(LogWarning, match="coupling=tight does not know antenna_lever_arm_m .* by up to 5.0 m"):
        scenario = recorded(str(tmp_path / "log"), coupling="tight")
    np.testing.assert_array_equal(scenario.family.log.lever_arm, np.zeros(3))
