"""A recorded log as a game: a synthetic log with known truth, and real ones where they are at hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import spoofgym  # noqa: F401
from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.geodesy import displace, position_difference
from spoofgym.logs.log import interpolate, read_log
from spoofgym.logs.log_warning import LogWarning
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.simulation import Simulation
from spoofgym.trajectory import Straight, Turn, fly

NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SENSOR_OF_FRD = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
RATE = 50
IMU_HEADER = "t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2"
GNSS_HEADER = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps"
SIGMAS = ",sd_n_m,sd_e_m,sd_d_m"
PHONE = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw"


def rows(columns: list[np.ndarray]) -> str:
    return "".join(",".join(f"{value:.12g}" for value in row) + "\n" for row in np.column_stack(columns))


def write_log(
    folder: Path,
    *,
    seed: int = 0,
    reference: bool = True,
    velocity: bool = True,
    gap: float | None = None,
    slow: bool = False,
) -> Path:
    """120 s with turns; fixes at 1 Hz with 0.5 m noise, two left out, none at an IMU sample; the reference is true."""
    generator = np.random.default_rng(seed)
    turn = math.radians(90.0)
    manoeuvres = [Straight(25.0), Turn(turn, 10.0), Straight(20.0), Turn(-turn, 10.0), Straight(20.0), Turn(turn, 15.0)]
    truth = fly(
        [*manoeuvres, Straight(20.0)],
        position=(math.radians(45.0), math.radians(9.0), 100.0),
        speed=1.0 if slow else 12.0,
        heading=0.5,
        rate=RATE,
    )
    steps = truth.num_steps
    bias = np.array([0.002, -0.001, 0.003, 0.1, -0.1, 0.05])
    noise = np.repeat([0.001, 0.02], 3) * generator.standard_normal((steps, 6))
    body = np.hstack([truth.angular_rate, truth.specific_force]) + bias + noise
    sensor = np.hstack([part @ NED_OF_ENU.T @ SENSOR_OF_FRD.T for part in (body[:, :3], body[:, 3:])])
    middle = truth.time[:-1] + 0.5 / RATE
    keep = np.ones(steps, dtype=bool) if gap is None else (middle < gap) | (middle > gap + 0.8)
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "log.toml").write_text(
        'name = "synthetic"\nimu_to_body_frd = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]\nimu_delay_s = 2.0\nstart_s = 5.0\n'
    )
    (folder / "imu.csv").write_text(IMU_HEADER + "\n" + rows([middle[keep] + 2.0, sensor[keep]]))
    every = np.arange(RATE // 5, steps, RATE // 5)
    fixes = np.arange(RATE, steps, RATE)
    fixes = fixes[(fixes != 33 * RATE) & (fixes != 34 * RATE)]

    def table(index: np.ndarray, error: np.ndarray, with_sigmas: bool) -> str:
        position = displace(truth.position[index], error)
        columns = [truth.time[index], np.degrees(position[:, 0]), np.degrees(position[:, 1]), position[:, 2]]
        header = GNSS_HEADER
        if velocity:
            columns += list((truth.velocity[index] @ NED_OF_ENU.T).T)
        else:
            header = header[: header.index(",vn")]
        if with_sigmas:
            header += SIGMAS
            columns += [np.full(len(index), 0.5)] * 3
        return header + "\n" + rows(columns)

    noise = 0.5 * generator.standard_normal((len(fixes), 3))
    (folder / "gnss.csv").write_text(table(fixes, noise, True))
    if reference:
        (folder / "reference.csv").write_text(table(every, np.zeros((len(every), 3)), False))
    return folder


def play(scenario, attack=None, detectors=()) -> tuple[Simulation, np.ndarray]:
    simulation = Simulation(scenario, attack, detectors, num_runs=2, seed=3, fidelity="strapdown")
    simulation.reset()
    simulation.resolve()
    errors = [simulation.error]
    for _ in range(scenario.timeline.num_epochs):
        simulation.observe()
        simulation.resolve()
        errors.append(simulation.error)
    return simulation, np.array(errors)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("logs") / "drive")


def test_the_filter_is_good_on_a_clean_log(folder: Path) -> None:
    scenario = recorded(str(folder))
    assert scenario.dimension == 6
    _, errors = play(scenario)
    horizontal = np.hypot(errors[:, 0, 0], errors[:, 0, 1])
    assert np.median(horizontal) < 0.5
    assert horizontal.max() < 1.5
    np.testing.assert_array_equal(errors[:, 0], errors[:, 1])  # one realisation


def test_timeline_follows_the_fixes(folder: Path) -> None:
    scenario = recorded(str(folder), onset=30.4, horizon=10)
    assert scenario.timeline.start == pytest.approx(30.0)
    assert scenario.timeline.interval == pytest.approx(1.0)
    np.testing.assert_allclose(scenario.times(2), [28, 29, 30, 31, 32, 35, 36, 37, 38, 39, 40, 41, 42])
    assert scenario.velocity().shape == scenario.track().shape == (11, 3)
    assert np.linalg.norm(scenario.velocity()[0]) == pytest.approx(12.0, abs=0.01)
    assert recorded(str(folder)).timeline.start == pytest.approx(5.0 + (119.0 - 5.0) / 3, abs=1.0)


@pytest.mark.parametrize("velocity", [None, False])
def test_a_ramp_moves_the_solution(folder: Path, velocity: bool | None) -> None:
    scenario = recorded(str(folder), onset=30.0, velocity=velocity)
    _, errors = play(scenario, make_attack("ramp:0.5"))
    spoofed = 0.5 * (scenario.times(0)[-1] - 30.0)
    assert errors[-1, 0, 0] == pytest.approx(spoofed, abs=2.0)
    assert abs(errors[-1, 0, 1]) < 2.0


def test_without_a_reference_the_unspoofed_run_is_the_truth(tmp_path: Path) -> None:
    scenario = recorded(str(write_log(tmp_path / "log", reference=False)), onset=40.0)
    _, errors = play(scenario)
    assert np.abs(errors).max() < 1e-6
    assert play(scenario, make_attack("ramp:0.5"))[1][-1, 0, 0] > 35.0


def test_without_velocity(tmp_path: Path) -> None:
    folder = str(write_log(tmp_path / "log", velocity=False))
    scenario = recorded(folder)
    assert scenario.dimension == 3
    assert np.median(np.hypot(*play(scenario)[1][:, 0, :2].T)) < 0.6
    with pytest.raises(ValueError, match="gives no velocity"):
        recorded(folder, velocity=True)


def test_the_game_does_not_depend_on_where_its_model_starts(folder: Path) -> None:
    scenario = recorded(str(folder), onset=50.0)
    plain = play(scenario)[1]
    windowed = play(scenario, None, [make_detector("windowed:n=20,p_fa=1e-9")])[1]
    np.testing.assert_allclose(windowed, plain, atol=1e-9)


def test_an_alarm_in_the_clean_epochs_is_no_reason_to_draw_again(folder: Path) -> None:
    simulation, _ = play(recorded(str(folder), onset=50.0), None, [make_detector("windowed:n=20,threshold=1e-3")])
    assert simulation.alarm.all()


def test_specification_and_environment(folder: Path) -> None:
    name = f"recorded:{folder},grade=tactical,onset=60,horizon=8"
    scenario = make_scenario(name)
    assert scenario.name == name
    play = {"scenario": name, "fidelity": "strapdown", "knowledge": "blind", "action": "rate"}
    with pytest.warns(LogWarning, match="an IMU that is worse than its grade"):
        env = gymnasium.make("spoofgym/Spoofer-v0", **play)
    env.reset(seed=0)
    steps = 0
    done = False
    while not done:
        _, _, terminated, truncated, _ = env.step(np.zeros(env.action_space.shape, dtype=np.float32))
        done = terminated or truncated
        steps += 1
    assert steps == 8
    env.close()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"onset": 500.0}, "onset 500 s lies outside the log: valid from"),
        ({"onset": 1.0}, "onset 1 s lies outside the log"),
        ({"onset": math.nan}, "onset must be a finite number"),
        ({"onset": 100.0, "horizon": 50}, "horizon 50 does not fit: valid from 1 to 19"),
        ({"horizon": 0}, "horizon 0 does not fit"),
        ({"grade": "gold"}, "unknown IMU grade 'gold'; valid grades"),
        ({"sigma_floor": 0.0}, "sigma_floor must be"),
        ({"noise_factor": -1.0}, "noise_factor must be"),
        ({"noise_factor": 1e5}, r"recorded: noise_factor must be .*, from 0\.001 to 1000\.?0?, got 100000\.0"),
        ({"noise_factor": 1e-5}, "recorded: noise_factor must be .*, got 1e-05"),
        ({"noise_factor": 1e300}, r"recorded: noise_factor must be .*, got 1e\+300"),
    ],
)
def test_bad_options(folder: Path, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        recorded(str(folder), **options)


def test_what_a_log_cannot_do(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="comma"):
        recorded("a,b")
    scenario = recorded(str(folder), onset=10.0)
    with pytest.raises(ValueError, match="no linear model: knowledge must be 'blind' and action 'rate'"):
        scenario.linear_model()
    with pytest.raises(ValueError, match="valid fidelities: strapdown"):
        Simulation(scenario, fidelity="linear")
    with pytest.raises(ValueError, match="looks back 19 epochs"):
        Simulation(scenario, None, [make_detector("windowed:n=20,p_fa=1e-5")], fidelity="strapdown")
    with pytest.raises(ValueError, match="must move at 5 m/s or more"):
        recorded(str(write_log(tmp_path / "slow", slow=True)))


def test_an_imu_gap_is_refused_inside_the_game_only(tmp_path: Path) -> None:
    folder = str(write_log(tmp_path / "log", gap=80.5))
    with pytest.raises(ValueError, match=r"IMU has a gap of 0\.8.* s at 80\.\d+ s"):
        recorded(folder)
    assert recorded(folder, onset=40.0, horizon=20).timeline.num_epochs == 20


def test_a_wrong_mounting_is_refused(folder: Path, tmp_path: Path) -> None:
    other = write_log(tmp_path / "log")
    notes = (other / "log.toml").read_text()
    (other / "log.toml").write_text(notes.replace("[0, -1, 0], [0, 0, -1]", "[0, 1, 0], [0, 0, 1]"))
    with pytest.raises(ValueError, match=r"the specific force points down: .* turn imu_to_body_frd by 180 degrees"):
        recorded(str(other))


def test_fixes_from_ranges_need_ranges(folder: Path) -> None:
    assert recorded(str(folder), fixes="phone").name == recorded(str(folder)).name
    with pytest.raises(ValueError, match=r"has no ranges \(ranges.csv, ephemeris.csv\)"):
        recorded(str(folder), fixes="ranges")
    with pytest.raises(ValueError, match="fixes must be one of phone, ranges, got 'rtk'"):
        recorded(str(folder), fixes="rtk")


def test_a_vertical_velocity_of_zero_throughout_is_not_believed(folder: Path) -> None:
    level = recorded(str(folder))
    assert level.family.log.fixes.velocity is not None
    rising = replace(level.family.log.fixes, velocity=level.family.log.fixes.velocity + np.array([0.0, 0.0, 0.1]))
    sigma = [
        np.sqrt(np.diagonal(scenario.family.model.measurement_covariance, axis1=1, axis2=2))
        for scenario in (level, level.changed(log=replace(level.family.log, fixes=rising)))
    ]
    assert (sigma[0][:, 5] >= 100.0).all()
    assert (sigma[1][:, 5] < 1.0).all()
    np.testing.assert_array_equal(sigma[0][:, :5], sigma[1][:, :5])


@pytest.mark.skipif(not PHONE.is_dir(), reason="../shared/data, real logs for tests, is absent")
@pytest.mark.parametrize("fixes", ["phone", "ranges"])
def test_a_phone_of_unknown_mounting(fixes: str) -> None:
    """The filter stays within metres of the phone's own fixes in the median, whichever fixes it takes."""
    scenario = make_scenario(f"recorded:{PHONE},fixes={fixes}")
    phone = read_log(PHONE).fixes
    gap = np.flatnonzero(np.diff(phone.time) > 1.5)
    time = scenario.family.epoch_time
    inside = (time > phone.time[gap[0] + 1] + 30.0) & (time < phone.time[gap[1]])
    place, _ = interpolate(phone, time[inside])
    error = position_difference(scenario.family.clean.position[1:][inside], place)
    assert np.median(np.hypot(error[:, 0], error[:, 1])) < 4.0
