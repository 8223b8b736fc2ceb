"""Recorded ranges as a game on the tightly coupled filter: synthetic drives with known truth, and a phone's."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import spoofgym  # noqa: F401
from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.geodesy import position_difference
from spoofgym.logs.log import interpolate, read_log
from spoofgym.logs.ranges_log import read_ranges
from spoofgym.navigation.tight.states import CLOCK
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.simulation import Simulation
from tests.logs.range_drive import DELAY, write_drive
from tests.logs.test_ranges_log import CLOCK as CLOCK_OFFSET
from tests.logs.test_ranges_log import DRIFT, FIRST
from tests.scenarios.test_recorded import write_log

PHONE = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw"
ONSET = FIRST + 60.0


def tight(folder: Path, **options: object) -> Scenario:
    scenario = recorded(str(folder), coupling="tight", **options)
    assert isinstance(scenario.family, RecordedRanges)
    return scenario


def play(scenario, attack=None, detectors=(), offset=None) -> tuple[Simulation, dict[str, np.ndarray]]:
    """Errors and clock errors after each epoch, nis and degrees of freedom; ``offset`` (4,) is held."""
    simulation = Simulation(scenario, attack, detectors, num_runs=2, seed=3, fidelity="strapdown")
    simulation.reset()
    simulation.resolve()
    seen: dict[str, list] = {"error": [], "clock": [], "nis": [], "degrees": []}
    for _ in range(scenario.timeline.num_epochs):
        epoch = simulation.observe(None if offset is None else np.tile(offset, (2, 1)))
        simulation.resolve()
        seen["error"].append(simulation.error[0].copy())
        seen["clock"].append(simulation.navigator.clock_error[0])
        seen["nis"].append(epoch.innovation.nis[0])
        seen["degrees"].append(epoch.innovation.degrees[0])
        np.testing.assert_array_equal(simulation.error[0], simulation.error[1])  # one realisation
    return simulation, {name: np.array(values) for name, values in seen.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives") / "noisy"
    write_drive(folder)
    return folder


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives") / "exact"
    write_drive(folder, noise=0.0, turns=4)
    return folder


def test_exact_ranges_give_the_true_motion_and_clock(exact: Path) -> None:
    """What is left are IMU noise and 3 ms of delay, found from the drive, at 12 m/s."""
    scenario = tight(exact)
    assert scenario.family.epochs.geometry.time[0] - scenario.family.epochs.time[0] == pytest.approx(DELAY, abs=0.02)
    settled = scenario.family.epoch_time > FIRST + 30.0
    error = position_difference(scenario.family.clean.position[1:], scenario.family.true_position)[settled]
    assert np.abs(error).max() < 0.4
    ranges = scenario.family.ranges
    reference = ranges.clock[0] + ranges.clock_drift[0] * (ranges.time - ranges.time[0])
    # the first epoch is one second after the start of the drive
    truth = CLOCK_OFFSET + DRIFT * (ranges.geometry.time - FIRST - DELAY - 1.0)
    np.testing.assert_allclose((reference + scenario.family.clean.state[1:, CLOCK] - truth)[settled], 0.0, atol=0.5)


def test_white_noise_gives_the_innovations_that_the_filter_expects(folder: Path) -> None:
    """The noise is the filter's own; it believes in slow errors that are not there, so that it is cautious."""
    _, seen = play(tight(folder, onset=FIRST + 40.0))
    assert seen["degrees"].sum() > 2000
    # the mean of 2000 squares has a standard deviation of 0.032: 6 of them above 1
    assert 0.6 < seen["nis"].sum() / seen["degrees"].sum() < 1.19
    assert np.median(np.hypot(*seen["error"][:, :2].T)) < 2.0


def test_a_pull_of_all_ranges_moves_the_position_and_leaves_no_residual_for_raim(folder: Path) -> None:
    scenario = tight(folder, onset=ONSET)
    attack = make_attack("ramp:0.5,direction=0")
    simulation, pulled = play(scenario, attack, [make_detector("raim:p_fa=1e-9")])
    _, clean = play(scenario)
    moved = (pulled["error"] - clean["error"])[-1]
    assert moved[1] == pytest.approx(0.5 * (scenario.timeline.end - scenario.timeline.start), abs=1.0)
    assert np.abs(moved[[0, 2]]).max() < 1.0
    assert not simulation.alarm.any()


def test_a_pull_of_the_clock_moves_the_clock_alone(folder: Path) -> None:
    scenario = tight(folder, onset=ONSET)
    _, clean = play(scenario)
    _, pulled = play(scenario, offset=np.array([0.0, 0.0, 0.0, 30.0]))
    assert np.abs(clean["clock"]).max() < 0.05
    assert (pulled["clock"] - clean["clock"])[-1] == pytest.approx(30.0, abs=0.5)
    assert np.abs(pulled["error"] - clean["error"])[-20:].max() < 0.5


def test_the_model_of_the_game_has_the_covariances_of_the_clean_run(folder: Path) -> None:
    """The navigator forms its covariance run by run in its own code; the model by the recursion of the linear one."""
    scenario = tight(folder, onset=ONSET, horizon=60)
    model, first = scenario.tight_model(10), scenario.family.first - 10
    for k in (0, 10, 70):
        after = model.covariance[k] - model.whitened_gain[k].T @ model.whitened_gain[k]
        navigated = scenario.family.clean.covariance[first + k + 1]
        np.testing.assert_allclose(after, navigated, rtol=1e-6, atol=1e-9 * navigated.max())
    with pytest.raises(ValueError, match="no linear model"):
        scenario.linear_model()


def test_without_a_reference_the_unspoofed_run_is_the_truth(tmp_path: Path) -> None:
    write_drive(tmp_path / "log", reference=False, turns=4)
    _, seen = play(tight(tmp_path / "log", onset=ONSET))
    assert np.abs(seen["error"]).max() < 0.01


def test_the_game_does_not_depend_on_where_its_model_starts(folder: Path) -> None:
    scenario = tight(folder, onset=ONSET, horizon=30)
    _, plain = play(scenario)
    _, windowed = play(scenario, None, [make_detector("ci:n=20,p_fa=1e-12")])
    np.testing.assert_allclose(windowed["error"], plain["error"], atol=1e-9)


def test_windows_of_separation_know_the_ranges_before_the_game(folder: Path) -> None:
    """The same epochs as a beginning and in the midst of a longer game: the same windows, up to the noise of Φ."""
    said = []
    for onset, horizon in ((ONSET, 20), (ONSET - 30.0, 50)):
        bank = make_detector("separation-bank:n=15,direction=horizontal")
        simulation = Simulation(
            tight(folder, onset=onset, horizon=horizon), None, [bank], None, 1, 0, fidelity="strapdown"
        )
        simulation.reset()
        levels, statistics, times = [], [], []
        for _ in range(horizon):
            simulation.resolve()
            epoch = simulation.observe()
            times.append(epoch.time[0])
            levels.append(bank.protection_level[0])
            statistics.append(epoch.statistics[bank.name][0])
        said.append((np.array(times)[-20:], np.array(levels)[-20:], np.array(statistics)[-20:]))
    np.testing.assert_allclose(said[0][0], said[1][0], atol=0.01)
    np.testing.assert_allclose(said[0][1], said[1][1], rtol=1e-3)
    np.testing.assert_allclose(said[0][2], said[1][2], atol=5e-3)


def test_silence_is_coasted_through_and_satellites_are_known_again(tmp_path: Path) -> None:
    write_drive(tmp_path / "log", silent=(80, 95), turns=5)
    scenario = tight(tmp_path / "log", onset=ONSET)
    counted = scenario.family.ranges.geometry.present.sum(axis=1)
    np.testing.assert_allclose(np.diff(scenario.family.epoch_time), 1.0, atol=1e-5)
    silent = np.flatnonzero(counted == 0)
    assert len(silent) == 15
    assert (np.diff(silent) == 1).all()
    assert not scenario.family.ranges.started[silent[-1] + 1 :].any()
    sigma = np.sqrt(np.trace(scenario.family.clean.covariance[:, 6:9, 6:9], axis1=1, axis2=2))
    assert sigma[silent[-1] + 1] > 1.5 * sigma[silent[0]]
    _, seen = play(scenario)
    assert (seen["degrees"] == 0).sum() == 15
    assert (seen["nis"][seen["degrees"] == 0] == 0.0).all()
    assert np.hypot(*seen["error"][-20:, :2].T).max() < 5.0


def test_a_faulty_range_is_left_out(tmp_path: Path, folder: Path) -> None:
    write_drive(tmp_path / "log", fault=2000.0)
    whole, faulty = tight(folder), tight(tmp_path / "log")
    lost = np.argwhere(whole.family.epochs.geometry.present & ~faulty.family.epochs.geometry.present)
    assert lost[:, 0].tolist() == [60]
    assert np.abs(position_difference(faulty.family.clean.position[70], whole.family.clean.position[70])).max() < 2.0


def test_specification_detectors_and_environment(folder: Path) -> None:
    name = f"recorded:{folder},onset={ONSET + 0.5},horizon=6,coupling=tight"
    scenario = make_scenario(name)
    assert scenario.name == name
    assert make_scenario(f"recorded:{folder},onset={ONSET + 0.5},horizon=6", "tight").name == name
    present = scenario.family.satellites(np.array([0, 3]), 0)
    assert (present >= -1).all()
    assert set(present[present > 0]) <= set(read_ranges(folder).ephemeris.satellites)
    for text in ("snapshot", "cpi:n=20", "separation-bank:n=10"):
        play(scenario, None, [make_detector(text)])
    env = gymnasium.make("spoofgym/Spoofer-v0", scenario=name, fidelity="strapdown", knowledge="blind")
    assert env.action_space.shape == (4,)
    env.reset(seed=0)
    for k in range(6):
        _, _, terminated, truncated, _ = env.step(np.zeros(4, dtype=np.float32))
        assert (terminated or truncated) == (k == 5)
    env.close()


def test_what_a_log_of_ranges_cannot_do(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="velocity, sigma_floor and fixes are of fixes; coupling=tight takes none"):
        tight(folder, fixes="ranges")
    with pytest.raises(ValueError, match="coupling must be one of loose, tight, got 'deep'"):
        recorded(str(folder), coupling="deep")
    with pytest.raises(ValueError, match="valid fidelities: strapdown"):
        Simulation(tight(folder), fidelity="linear")
    with pytest.raises(ValueError, match=r"has no ranges \(ranges.csv, ephemeris.csv\) for a filter to take"):
        tight(write_log(tmp_path / "bare"))
    write_drive(tmp_path / "log", turns=4)
    lines = (tmp_path / "log" / "ranges.csv").read_text().splitlines()
    moved = [line.split(",") for line in lines[1:]]
    last = moved[-1][1]
    rows = [",".join([row[0], f"{float(row[1]) + 0.4:.9f}" if row[1] == last else row[1], *row[2:]]) for row in moved]
    (tmp_path / "log" / "ranges.csv").write_text("\n".join([lines[0], *rows]))
    with pytest.raises(ValueError, match=r"must come at a steady rate: after .* the next come 1\.4 s later"):
        tight(tmp_path / "log")


@pytest.mark.parametrize(
    ("late", "message"),
    [
        (
            604_800.0,
            r"ranges\.csv leaves out 6\.048e\+05 epochs of 1 s, valid are 20000 at most: after 4\d+\.\d+ s the next",
        ),
        (1e300, r"ranges\.csv, line \d+: t_s must be between"),
    ],
)
def test_a_late_epoch_does_not_fill_the_memory(tmp_path: Path, late: float, message: str) -> None:
    write_drive(tmp_path, turns=4)
    header, *lines = (tmp_path / "ranges.csv").read_text().splitlines()
    number, time, *rest = lines[-1].split(",")
    lines[-1] = ",".join([number, repr(float(time) + late), *rest])
    (tmp_path / "ranges.csv").write_text("\n".join([header, *lines]))
    tracemalloc.start()
    with pytest.raises(ValueError, match=message):
        tight(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 3e8
    tracemalloc.stop()


@pytest.mark.skipif(not PHONE.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_a_phone_in_a_city() -> None:
    """The filter stays within metres of the phone's own fixes, which are made from the same signals."""
    scenario = tight(PHONE)
    assert scenario.slots <= 9
    phone = read_log(PHONE).fixes
    gap = np.flatnonzero(np.diff(phone.time) > 1.5)
    time = scenario.family.epoch_time
    inside = (time > phone.time[gap[0] + 1] + 30.0) & (time < phone.time[gap[1]])
    place, _ = interpolate(phone, time[inside])
    error = position_difference(scenario.family.clean.position[1:][inside], place)
    assert np.median(np.hypot(error[:, 0], error[:, 1])) < 4.0
    # the clock of the phone keeps its rate: pseudoranges and range rates tell the same
    drift = np.diff(scenario.family.epochs.clock) / scenario.family.epochs.interval
    assert np.median(drift) == pytest.approx(np.median(scenario.family.epochs.clock_drift), abs=1.0)
