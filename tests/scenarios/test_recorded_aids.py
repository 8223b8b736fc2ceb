"""Aids of a recorded log: a synthetic drive whose sensors are known, and real logs where they are at hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.aid_tables import EXPONENT, SCALE, SEA_LEVEL, heights, speeds
from spoofgym.logs.log import read_log
from spoofgym.logs.log_warning import LogWarning
from spoofgym.logs.standstill import standing_times
from spoofgym.navigation.aids import make_aids
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.log_aids import read_aid, thinned
from spoofgym.simulation import Simulation
from spoofgym.trajectory import Straight, Trajectory, Turn, fly
from tests.scenarios.test_recorded import NED_OF_ENU, RATE, SENSOR_OF_FRD, rows, write_log

DELAY = 2.0
"""Of the IMU's clock in `write_log`, s: its other tables are on that clock."""
OFFSET, STRETCH, DECLINATION = 40.0, 1.015, 4.0
DATA = Path(__file__).parents[3] / "shared" / "data"


def drive() -> Trajectory:
    """The truth of `write_log`."""
    turn = math.radians(90.0)
    manoeuvres = [Straight(25.0), Turn(turn, 10.0), Straight(20.0), Turn(-turn, 10.0), Straight(20.0), Turn(turn, 15.0)]
    start = (math.radians(45.0), math.radians(9.0), 100.0)
    return fly([*manoeuvres, Straight(20.0)], position=start, speed=12.0, heading=0.5, rate=RATE)


def add_tables(folder: Path, wild: float | None = None) -> None:
    """Barometer at 10 Hz, wheels at 25 Hz, magnetometer at 5 Hz, with constant errors; ten heights may be wild."""
    truth, generator = drive(), np.random.default_rng(5)
    for name, header, step in (("barometer", "baro_m", 5), ("wheels", "rear_left_mps,rear_right_mps", 2),
                               ("magnetometer", "mx_ut,my_ut,mz_ut", 10)):
        index = np.arange(0, truth.num_steps, step)
        attitude, velocity = truth.attitude[index], truth.velocity[index]
        if name == "barometer":
            height = truth.position[index, 2] + OFFSET + 0.3 * generator.standard_normal(len(index))
            height[400:410] += 0.0 if wild is None else wild
            columns = [height]
        elif name == "wheels":
            speed = STRETCH * np.einsum("nij,ni->nj", attitude, velocity)[:, 1]
            columns = [speed + 0.05 * generator.standard_normal(len(index)) for _ in range(2)]
        else:
            field = np.array([math.sin(math.radians(DECLINATION)), math.cos(math.radians(DECLINATION)), -1.5])
            body = np.einsum("nij,i->nj", attitude, field) + 0.03 * generator.standard_normal((len(index), 3))
            columns = [20.0 * axis for axis in (body @ NED_OF_ENU.T @ SENSOR_OF_FRD.T).T]
        table = f"t_s,{header}\n" + rows([truth.time[index] + DELAY, *columns])
        (folder / f"{name}.csv").write_text(table)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = write_log(tmp_path_factory.mktemp("logs") / "drive")
    add_tables(made)
    return made


def test_the_filter_finds_what_is_wrong_with_the_sensors(folder: Path) -> None:
    """Within five of its own sigmas: a false failure of one of three has a probability of 2e-6 at most."""
    aids = "barometer+wheel-speed+magnetometer:declination=0/offset=10"
    family = make_scenario(f"recorded:{folder},aids={aids}").family
    clean = family.clean
    deviation = np.sqrt(np.diagonal(clean.covariance[-1]))[15:]
    for place, truth in ((0, OFFSET), (1, STRETCH - 1.0), (4, math.radians(DECLINATION))):
        assert abs(clean.state[-1, place] - truth) < 5.0 * deviation[place]
        assert deviation[place] < 0.5 * abs(truth)
    assert clean.nis_per_degree(30) < 1.0


def excluded(text: str, runs: int = 1) -> Simulation:
    """A game on the drive without any fix after 40 s."""
    scenario = make_scenario(text)
    simulation = Simulation(
        scenario, num_runs=runs, seed=0, fidelity="strapdown", demands=Demands(excludes=True, history=5)
    )
    simulation.reset()
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve(Decision(np.zeros(runs, dtype=bool)))
        simulation.observe()
    return simulation


def test_aids_stay_when_gnss_is_left_out(folder: Path) -> None:
    free = excluded(f"recorded:{folder},onset=40,horizon=60")
    held = excluded(f"recorded:{folder},onset=40,horizon=60,aids=barometer+wheel-speed")
    error, deviation = held.error[0], np.sqrt(np.diagonal(held.navigator.position_covariance[0]))
    assert np.linalg.norm(free.error[0, :2]) > 3.0 * np.linalg.norm(error[:2])
    assert np.all(np.abs(error) < 5.0 * deviation)
    assert np.all(deviation < 0.2 * np.sqrt(np.diagonal(free.navigator.position_covariance[0])))


def test_fixes_taken_back_equal_fixes_left_out_of_a_log(folder: Path) -> None:
    def play(decide):
        scenario = make_scenario(f"recorded:{folder},onset=40,horizon=20,aids=barometer+wheel-speed:rate=5")
        demands = Demands(excludes=True, history=6)
        simulation = Simulation(scenario, num_runs=5, seed=0, fidelity="strapdown", demands=demands)
        simulation.reset()
        for k in range(15):
            simulation.resolve(decide(k))
            simulation.observe(np.full((5, 3), 1.0 * k))
        return simulation

    depth = np.arange(5)
    back = play(lambda k: Decision(np.full(5, k < 12), depth if k == 12 else None))
    out = play(lambda k: Decision(k < 12 - depth))
    np.testing.assert_array_equal(back.error, out.error)
    np.testing.assert_array_equal(back.navigator.covariance, out.navigator.covariance)


def test_a_wild_reading_is_left_out(tmp_path: Path) -> None:
    folder = write_log(tmp_path / "log")
    add_tables(folder, wild=500.0)
    text = f"recorded:{folder},onset=30,horizon=11,aids="
    assert abs(excluded(f"{text}barometer").error[0, 2]) < 1.0
    with pytest.warns(LogWarning, match="clean innovations are"):
        without_gate = excluded(f"{text}barometer:gate=0")
    assert abs(without_gate.error[0, 2]) > 20.0


@pytest.mark.parametrize(
    ("aids", "message"),
    [
        ("barometer", r"does not hold a barometer: there is no barometer.csv or aux.csv \(or .csv.gz\); needed: t_s"),
        ("magnetometer", "does not hold a magnetometer"),
        ("wheel-speed", "does not hold wheel speeds"),
    ],
)
def test_what_a_log_does_not_hold_is_refused_in_one_line(tmp_path: Path, aids: str, message: str) -> None:
    folder = write_log(tmp_path / "log")
    with pytest.raises(ValueError, match=message) as caught:
        make_scenario(f"recorded:{folder},aids={aids}")
    assert "\n" not in str(caught.value)


def test_other_options_that_do_not_go_together(folder: Path) -> None:
    with pytest.raises(ValueError, match="the magnetometer needs the declination: declination_deg"):
        make_scenario(f"recorded:{folder},aids=magnetometer")
    with pytest.raises(ValueError, match="recorded: aids go with coupling=loose"):
        make_scenario(f"recorded:{folder},coupling=tight,aids=barometer")


def test_tables_in_other_forms(tmp_path: Path) -> None:
    """Pressure by the standard atmosphere, several sensors in one table, ways in place of speeds, foreign columns."""
    folder = write_log(tmp_path / "log")
    log = read_log(folder)
    metres = np.array([0.0, 150.0, 1000.0])
    pressure = SEA_LEVEL * (1.0 - metres / SCALE) ** (1.0 / EXPONENT)
    (folder / "barometer.csv").write_text("t_s,pressure_hpa\n" + rows([np.arange(3.0) + 2.0, pressure / 100.0]))
    found = heights(log)
    np.testing.assert_allclose(found.value[:, 0], metres, atol=1e-6)
    np.testing.assert_allclose(found.time, [0.0, 1.0, 2.0])
    assert pressure[2] == pytest.approx(89_875.0, abs=10.0)  # ICAO, 1000 m
    (folder / "barometer.csv").unlink()
    (folder / "aux.csv").write_text("t_s,flow_x,baro_m\n" + rows([np.arange(3.0), metres, metres + 1.0]))
    np.testing.assert_allclose(heights(log).value[:, 0], metres + 1.0)
    way = 0.5 * 0.2 * np.arange(9.0) ** 2
    (folder / "wheels.csv").write_text("t_s,distance_0_m,distance_1_m\n" + rows([np.arange(9.0), way, way + 3.0]))
    np.testing.assert_allclose(speeds(log).value[1:-1, 0], 0.2 * np.arange(1.0, 8.0))
    (folder / "wheels.csv").write_text("t_s,wheel_0_radps\n" + rows([np.arange(9.0), way]))
    with pytest.raises(ValueError, match=r"wheels.csv, aux.csv has no column of it; needed: t_s and rear_left_mps"):
        speeds(log)
    thin = thinned(found, 0.5)
    np.testing.assert_allclose(thin.time, [0.0, 2.0])


def test_a_standstill_is_told_by_the_inertial_samples(tmp_path: Path) -> None:
    log = read_log(write_log(tmp_path / "log"))
    log.specific_force[:] += 0.2 * np.random.default_rng(0).standard_normal(log.specific_force.shape)
    assert not len(standing_times(log))
    with pytest.raises(ValueError, match="zero-velocity: the vehicle never stands, by its inertial samples"):
        read_aid(log, make_aids("test", "zero-velocity")[0])
    quiet = (log.imu_time > 50.0) & (log.imu_time < 55.0)
    log.angular_rate[quiet], log.specific_force[quiet] = [0.001, -0.002, 0.003], [0.1, 0.2, 9.8]
    standing = standing_times(log)
    assert standing[0] == pytest.approx(51.0, abs=0.2)
    assert standing[-1] == pytest.approx(55.0, abs=0.2)


def test_a_quiet_glide_that_passes_for_a_standstill_is_left_to_the_gate(folder: Path) -> None:
    """The synthetic drive shakes less than a car that stands, at 12 m/s: each zero velocity is far beyond the gate."""
    family = make_scenario(f"recorded:{folder},aids=zero-velocity").family
    assert len(family.readings[0].time) > 50
    with pytest.warns(LogWarning, match="the gate of zero-velocity leaves out .* readings"):
        assert family.clean.rejected.sum() > 50
    clean, plain = family.clean, make_scenario(f"recorded:{folder}").family.clean
    np.testing.assert_array_equal(clean.state, np.zeros((len(plain.nis) + 1, 0)))
    np.testing.assert_allclose(clean.nis, plain.nis, rtol=0.05, atol=0.05)


@pytest.mark.parametrize(
    ("name", "aids"),
    [("uav-octa", "barometer+magnetometer:declination=3/sigma=5"), ("car-comma", "wheel-speed:gate=0/mounting=5")],
)
def test_real_logs(name: str, aids: str) -> None:
    """The gyro of car-comma is off by 3.8 deg/s, and there is no turn: fixes alone leave its heading far off."""
    if not (DATA / name).is_dir():
        pytest.skip(f"{DATA / name} is absent")
    clean = make_scenario(f"recorded:{DATA / name},aids={aids}").family.clean
    assert clean.nis_per_degree(30) < 1.0
    assert not clean.rejected.any()
    if name == "car-comma":
        east, north = clean.attitude[-1, :2, 1]
        assert abs(math.degrees(math.atan2(east, north)) - 2.0) < 5.0
        assert math.degrees(clean.bias[-1, 2]) == pytest.approx(-3.8, abs=0.5)
