"""Antennas that rest, without an IMU: the simulated one, attacks in the ranges, and the real ones of TEXBAT."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.cli.main import main
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.evaluation.recorded_matrix import play, starts
from spoofgym.geodesy import position_difference
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.simulation import Simulation
from spoofgym.studies.check_log import check_log
from tests.logs.resting import INTERVAL, pull, write_resting
from tests.logs.test_ranges_log import FIRST, START
from tests.scenarios.test_recorded import write_log

DATA = Path(__file__).parents[3] / "shared" / "data"
EPOCHS = 500
EFFECT = 300
"""Epoch of the first effect."""
NOISE = 0.2
OPTIONS = "imu=simulated:tactical"


def resting(folder: Path, options: str = "") -> Scenario:
    return make_scenario(f"recorded:{folder},{OPTIONS}{options}")


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_resting(tmp_path_factory.mktemp("resting") / "clean", epochs=EPOCHS, noise=NOISE)


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its own ranges are spoofed: the clock is pulled with 0.5 m/s² for 20 s, then at 10 m/s."""
    clock = pull(EPOCHS, EFFECT, 0.5, EFFECT + 100)
    lines = f"first_effect_s = {FIRST + INTERVAL * EFFECT}\npull_start_s = {FIRST + INTERVAL * EFFECT}\n"
    folder = tmp_path_factory.mktemp("resting") / "pulled"
    return write_resting(folder, epochs=EPOCHS, noise=NOISE, seed=1, clock=clock, lines=lines)


def run(scenario: Scenario, runs: int, seed: int = 3, attack: str | None = None) -> np.ndarray:
    """Errors after each epoch, (K, N, 3), m."""
    spoofer = None if attack is None else make_spoofer(attack)
    simulation = Simulation(scenario, spoofer, [], num_runs=runs, seed=seed, fidelity="strapdown")
    simulation.reset()
    simulation.resolve()
    errors = []
    for _ in range(scenario.timeline.num_epochs):
        simulation.observe()
        simulation.resolve()
        errors.append(simulation.error.copy())
    return np.array(errors)


def test_the_filter_finds_the_antenna(clean: Path) -> None:
    """White noise of 0.8 m of code on more than ten satellites, averaged over a minute: well below a metre."""
    scenario = resting(clean)
    position = scenario.family.true_position
    np.testing.assert_allclose(position_difference(position, np.tile(START, (len(position), 1))), 0.0, atol=1e-6)
    error = run(scenario, 2)
    assert np.abs(error).max() < 1.5
    assert scenario.family.clean.nis_per_degree(150) < 1.0


def test_each_run_has_an_imu_of_its_own(clean: Path) -> None:
    """Runs differ, and run i is what it is alone."""
    scenario = resting(clean)
    scenario = scenario.changed(horizon=20)
    three, alone = run(scenario, 3, seed=3), run(scenario, 1, seed=4)
    assert np.abs(three[:, 0] - three[:, 1]).max() > 1e-6
    np.testing.assert_array_equal(three[:, 1], alone[:, 0])


def test_the_simulated_imu_has_the_white_noise_of_its_grade(clean: Path) -> None:
    """Ranges of no weight leave free inertia: over T from a start at rest the horizontal velocity of two runs parts by
    the random walk of the accelerometers, 2 σ² T, the drift of their biases, and little else."""
    scenario = resting(clean)
    grade, runs, epochs = scenario.family.imu, 200, 10
    scenario = scenario.changed(horizon=epochs)
    simulation = Simulation(scenario, None, [], num_runs=runs, seed=0, fidelity="strapdown")
    simulation.reset()
    begin = simulation.navigator.velocity.copy()
    bias = (simulation.navigator.true_bias - simulation.navigator.bias)[:, 5].copy()
    for _ in range(epochs):
        simulation.navigator.propagate()
    elapsed = INTERVAL * epochs
    change = simulation.navigator.velocity[:, 2] - begin[:, 2] - elapsed * bias
    wandering = 2.0 * grade.instability_sigma[5] ** 2 / grade.correlation_time
    expected = grade.noise_density[5] ** 2 * elapsed + wandering * elapsed**3 / 3.0
    low, high = stats.chi2.ppf([1e-7, 1.0 - 1e-7], runs - 1) / (runs - 1)
    assert low < np.var(change, ddof=1) / expected < high


def test_a_log_without_an_imu_says_how_to_play_it(clean: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match=r"has no imu\.csv, and its antenna is static: .*imu=simulated:tactical"):
        make_scenario(f"recorded:{clean}")
    assert main(["evaluate", "recorded", str(clean)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_sigmas_of_ranges_can_be_scaled(clean: Path) -> None:
    """The noise is a fifth of what follows from C/N0: a filter that is told so has a NIS per degree near 1."""
    usual, told = (resting(clean, options) for options in ("", ",code_scale=0.2,rate_scale=0.2"))
    sigma = usual.family.dynamics.noise_variance[200] ** 0.5
    there = sigma != 1.0  # an empty slot
    np.testing.assert_allclose((told.family.dynamics.noise_variance[200] ** 0.5)[there], 0.2 * sigma[there])
    assert usual.family.clean.nis_per_degree(150) < 0.1
    assert 0.5 < told.family.clean.nis_per_degree(150) < 1.2
    assert told.name.endswith("code_scale=0.2,rate_scale=0.2")
    assert resting(clean, ",code_scale=1,rate_scale=1.0").name == usual.name


def test_scales_of_ranges_are_not_for_fixes(tmp_path: Path) -> None:
    write_log(tmp_path)
    with pytest.raises(ValueError, match="code_scale and rate_scale are of ranges: coupling=tight is needed"):
        make_scenario(f"recorded:{tmp_path},code_scale=0.5")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("imu=tactical", "imu must be simulated:GRADE"),
        ("imu=simulated:golden", r"imu: unknown IMU grade 'golden'; valid grades: .*tactical"),
        (f"{OPTIONS},coupling=loose", "needs coupling=tight"),
        (f"{OPTIONS},alignment=static", "alignment and least_speed are not for imu=simulated"),
        (f"{OPTIONS},code_scale=0", "code_scale must be"),
        (f"{OPTIONS},rate_scale=1000", "rate_scale must be"),
        (f"{OPTIONS},oscillator=sundial", "oscillator must be one of tcxo, ocxo, rubidium"),
        (f"{OPTIONS},clean=elsewhere", "attack is not given"),
        (f"{OPTIONS},attack=ramp", "attack must be one of recorded"),
        (f"{OPTIONS},attack=recorded", "it holds none on its ranges"),
        ("velocity=true,imu=simulated:tactical", "velocity, sigma_floor and fixes are of fixes"),
    ],
)
def test_options_that_do_not_fit_are_refused(clean: Path, options: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        assert make_scenario(f"recorded:{clean},{options}").timeline


def test_a_log_with_an_imu_keeps_it(tmp_path: Path) -> None:
    write_log(tmp_path)
    with pytest.raises(ValueError, match=r"is for a log without imu\.csv"):
        resting(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("static = true", "static = 1", "static must be true or false"),
        ("static = true", "static = false", "needs an antenna that rests"),
        ("antenna_h_m = 300.0", "", "static = true needs antenna_h_m"),
        ("antenna_h_m = 300.0", "antenna_h_m = 1e9", "antenna_h_m, a number between"),
        ("start_s = 400001.0", "start_s = 1.0", "lies outside the ranges"),
        ("static = true", "static = true\niono_alpha = [1, 2]", "iono_alpha must be 4 numbers"),
        ("static = true", "static = true\nfirst_effect_s = 9.0\npull_end_s = 3.0", "pull_end_s = 3 lies before"),
    ],
)
def test_faults_of_the_notes_are_named(clean: Path, tmp_path: Path, old: str, new: str, message: str) -> None:
    for name in ("ranges.csv", "ephemeris.csv"):
        (tmp_path / name).symlink_to(clean / name)
    text = (clean / "log.toml").read_text()
    assert old in text
    (tmp_path / "log.toml").write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=message):
        resting(tmp_path)


def test_a_log_that_is_spoofed_itself_ends_before_its_attack(pulled: Path) -> None:
    scenario = resting(pulled)
    assert scenario.timeline.end < FIRST + INTERVAL * EFFECT
    with pytest.raises(ValueError, match="its own option attack=recorded plays them"):
        run(scenario, 1, attack="recorded")


def test_its_attack_is_played_from_before_the_first_effect(pulled: Path) -> None:
    scenario = resting(pulled, ",attack=recorded")
    effect = FIRST + INTERVAL * EFFECT
    assert scenario.timeline.start < effect - 19.0
    attack = make_spoofer("recorded")
    simulation = Simulation(scenario, attack, [], num_runs=2, seed=0, fidelity="strapdown")
    simulation.reset()
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        time = float(simulation.observe().time[0])
        assert simulation.attacked.tolist() == [time > effect - 0.5 * INTERVAL] * 2
    moved = simulation.navigator.clock_error[0]
    assert attack.onset == pytest.approx(effect - INTERVAL, abs=1e-3)
    assert attack.end is None
    assert abs(moved) < 0.5  # the clean run, with a perfect IMU, is the victim's own
    assert np.abs(simulation.error).max() < 1.5  # a pull of the clock moves no position


def test_the_clean_scene_is_what_comes_before_or_the_log_that_is_named(clean: Path, pulled: Path) -> None:
    scenario = resting(pulled, ",attack=recorded")
    before = clean_scene(scenario)
    assert before.timeline.end < FIRST + INTERVAL * EFFECT
    assert before.timeline.start >= before.family.align_time + 30.0 - INTERVAL
    other = clean_scene(resting(pulled, f",attack=recorded,clean={clean}"))
    assert other.family.log.folder == clean
    assert clean_scene(resting(clean)) is resting(clean)


def test_rows_tell_false_alarms_detection_and_the_pull(clean: Path, pulled: Path) -> None:
    """The oscillator is better than an ovenized crystal, 0.5 m/s² is 60 of its sigmas in a second."""
    scenario = resting(pulled, f",oscillator=ocxo,attack=recorded,clean={clean}")
    [row] = evaluate_recorded(scenario, [make_spoofer("recorded")], [make_detector("clock-drift:p_fa=1e-9")])
    assert row["false_alarms"] == row["alarms_before_onset"] == 0
    assert row["detected"]
    assert row["time_to_detect_s"] < 4.0
    assert row["alarm_after_pull_s"] == pytest.approx(row["time_to_detect_s"], abs=INTERVAL + 1e-3)
    assert row["clean_error_median_m"] < 1.0
    [blind] = evaluate_recorded(scenario, [make_spoofer("recorded")], [make_detector("px4-gate")])
    assert not blind["detected"]
    with pytest.raises(ValueError, match="its ranges hold the recorded attack already"):
        evaluate_recorded(scenario, [make_attack("ramp:1")], [make_detector("px4-gate")])


def test_a_matrix_is_not_made_of_spoofed_games(pulled: Path) -> None:
    with pytest.raises(ValueError, match="is one game, that of the attack in its ranges"):
        starts(resting(pulled, ",attack=recorded"), [], 3)


def test_programs_say_that_the_imu_is_simulated(pulled: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "recorded", f"{pulled},{OPTIONS}", "--attack", "recorded", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["imu"] == "simulated: tactical"
    assert "imu=simulated:tactical" in report["scenario"]
    assert "attack=recorded" in report["scenario"]
    assert [row["attack"] for row in report["rows"]] == ["recorded"]
    assert "IMU simulated: tactical" in report["alignment"]


def test_check_log_tells_what_there_is(pulled: Path) -> None:
    report = check_log(str(pulled))
    told = "\n".join(row["told"] for row in report["findings"])
    assert "the antenna rests and there is no imu.csv" in told
    assert "fixes of the ranges lie" in told
    assert "ranges.csv itself is spoofed from 400060" in told
    assert {row["severity"] for row in report["findings"]} == {"note"}
    assert "IMU simulated: tactical" in report["clean"]["alignment"]


def test_check_log_finds_an_antenna_in_the_wrong_place(clean: Path, tmp_path: Path) -> None:
    for name in ("ranges.csv", "ephemeris.csv"):
        (tmp_path / name).symlink_to(clean / name)
    text = (clean / "log.toml").read_text().replace("antenna_h_m = 300.0", "antenna_h_m = 400.0")
    (tmp_path / "log.toml").write_text(text)
    warned = [row["told"] for row in check_log(str(tmp_path))["findings"] if row["severity"] == "warning"]
    assert any("-100.0 m above it" in text or "-99." in text for text in warned)


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Clean ranges, and beside them those of a victim whose clock is pulled from 60 to 80 s."""
    begin, end = FIRST + INTERVAL * EFFECT, FIRST + INTERVAL * (EFFECT + 100)
    folder = tmp_path_factory.mktemp("resting") / "beside"
    write_resting(folder, epochs=EPOCHS, noise=NOISE, lines=f"attack_start_s = {begin}\nattack_end_s = {end}\n")
    clock = pull(EPOCHS, EFFECT, 0.5, EFFECT + 100)
    return write_resting(folder, epochs=EPOCHS, noise=NOISE, clock=clock, table="ranges_spoofed")


def test_the_victim_gets_the_ranges_that_were_recorded(beside: Path) -> None:
    """Both tables have one noise, so that they differ by the pull alone: code by its size, rate by its rate."""
    scenario = resting(beside, f",onset={FIRST + 50.0}")
    ranges = scenario.family.epochs
    slots, clock = scenario.slots, pull(EPOCHS, EFFECT, 0.5, EFFECT + 100)
    inside = slice(EFFECT, EFFECT + 101)
    assert ranges.spoofed[inside].all()
    assert ranges.spoofed.sum() == 101
    added = np.where(ranges.geometry.present, ranges.added[:, :slots], np.nan)
    np.testing.assert_allclose(np.nanmax(added, axis=1)[inside], clock[inside], atol=2e-6)
    np.testing.assert_allclose(np.nanmin(added, axis=1)[inside], clock[inside], atol=2e-6)
    assert not ranges.added[: EFFECT - 1].any()
    assert not ranges.added[EFFECT + 101 :].any()
    spoofed = Simulation(scenario, make_spoofer("recorded"), [], num_runs=1, seed=0, fidelity="strapdown")
    unspoofed = Simulation(scenario, None, [], num_runs=1, seed=0, fidelity="strapdown")
    for each in (spoofed, unspoofed):
        each.reset()
    while float(spoofed.epoch.time[0]) < FIRST + INTERVAL * (EFFECT + 1) - 0.5 * INTERVAL:
        for each in (spoofed, unspoofed):
            each.resolve()
            each.observe()
    index = int(np.argmin(np.abs(ranges.time - spoofed.epoch.time[0])))
    difference = (unspoofed.epoch.innovation.residual - spoofed.epoch.innovation.residual)[0]
    np.testing.assert_allclose(difference, ranges.added[index], atol=0.05)


def test_the_rows_of_an_attack_beside_the_true_ranges_tell_its_end(beside: Path) -> None:
    scenario = resting(beside, ",oscillator=ocxo,attack=recorded")
    [row] = evaluate_recorded(scenario, [make_spoofer("recorded")], [make_detector("clock-drift:p_fa=1e-9")])
    assert row["detected"]
    assert row["time_to_detect_s"] < 4.0
    assert row["alarms_after_end"] > 0  # the clock returns by 50 m at once
    assert row["recovery_s"] is not None


def test_a_table_without_an_interval_is_named(beside: Path, tmp_path: Path) -> None:
    for name in ("ranges.csv", "ephemeris.csv", "ranges_spoofed.csv"):
        (tmp_path / name).symlink_to(beside / name)
    text = (beside / "log.toml").read_text()
    (tmp_path / "log.toml").write_text(text[: text.index("attack_start_s")])
    with pytest.raises(ValueError, match=r"ranges_spoofed\.csv: log\.toml must state attack_start_s and attack_end_s"):
        resting(tmp_path)


TEXBAT = {name: DATA / f"texbat-{name}" for name in ("clean", "ds2", "ds3")}
HORIZONS = {"clean": 900, "ds2": 560, "ds3": 830}
POSITION_TESTS = ("px4-gate", "ardupilot-gate", "raim")
MONITORS = (*POSITION_TESTS, "snapshot:p_fa=1e-5", "clock-drift:p_fa=1e-5", "code-minus-carrier:threshold=2.0")


def texbat(name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times, and alarms of `MONITORS`, on a recording of TEXBAT with an ovenized oscillator."""
    if not TEXBAT[name].is_dir():
        pytest.skip(f"{TEXBAT[name]} is absent")
    options = "" if name == "clean" else ",attack=recorded"
    scenario = resting(TEXBAT[name], f",oscillator=ocxo,onset=477960,horizon={HORIZONS[name]}{options}")
    detectors = [make_detector(text) for text in MONITORS]
    course = play(scenario, None if name == "clean" else make_spoofer("recorded"), detectors)
    alarms = [values > detector.threshold for values, detector in zip(course.statistic, detectors, strict=True)]
    return course.time, dict(zip(MONITORS, alarms, strict=True))


def test_nothing_alarms_in_the_clean_scene_of_texbat() -> None:
    _, alarms = texbat("clean")
    assert {name: int(values.sum()) for name, values in alarms.items()} == dict.fromkeys(MONITORS, 0)


def test_the_clock_shows_the_time_push_of_texbat_that_position_tests_do_not_see() -> None:
    """ds2: 614 m of clock from 478015.3 to 478185.0 s, positions within 5 m."""
    time, alarms = texbat("ds2")
    pull_start = 478015.3
    for name in POSITION_TESTS:
        assert not alarms[name].any(), name
    drift = alarms["clock-drift:p_fa=1e-5"]
    assert not drift[time < pull_start].any()
    assert time[np.argmax(drift)] - pull_start < 4.0
    within = (time > pull_start + 4.0) & (time < 478064.0)
    assert drift[within].mean() > 0.9


def test_codes_that_part_from_their_carriers_show_the_attack_of_texbat_that_captured_nothing() -> None:
    """ds3: carriers stay with the authentic signals, codes err by up to 55 m between 478001 and 478122 s."""
    time, alarms = texbat("ds3")
    assert not alarms["clock-drift:p_fa=1e-5"].any()
    parted = alarms["code-minus-carrier:threshold=2.0"]
    assert not parted[time < 477996.3].any()
    assert parted[(time > 478040.0) & (time < 478110.0)].mean() > 0.8
