"""A log whose receiver gave nothing for a while: attacks, players and filters go by its times, not by its epochs."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.simulation import Simulation
from tests.logs.range_drive import write_drive
from tests.scenarios.test_recorded import write_log

ONSET, BEGIN, END = 40.0, 55.0, 85.0
"""Epoch 0, the last fix before the outage and the first after it, s; there are two turns between them."""


def silenced(folder: Path, begin: float, end: float, table: str = "gnss.csv", column: int = 0) -> Path:
    """A copy of a log without the lines between two times, whose fixes (or ranges) there are not."""
    copy = folder.with_name(f"{folder.name}-{begin:g}-{end:g}")
    shutil.copytree(folder, copy, dirs_exist_ok=True)
    header, *lines = (folder / table).read_text().splitlines()
    kept = [line for line in lines if not begin + 1e-6 < float(line.split(",")[column]) < end - 1e-6]
    (copy / table).write_text("\n".join([header, *kept]) + "\n")
    return copy


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("logs") / "drive")


@pytest.fixture(scope="module")
def silent(whole: Path) -> Path:
    return silenced(whole, BEGIN, END)


def offsets(folder: Path, attack: str) -> dict[float, np.ndarray]:
    """What an attack adds at each epoch, by its time."""
    scenario = recorded(str(folder), onset=ONSET)
    simulation = Simulation(scenario, make_attack(attack), seed=0, fidelity="strapdown")
    simulation.reset()
    added = {}
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        time = float(simulation.observe().time[0])
        added[time] = simulation.offset[0].copy()
    return added


def test_the_timeline_has_the_times_of_the_epochs(silent: Path) -> None:
    scenario = recorded(str(silent), onset=ONSET)
    np.testing.assert_array_equal(scenario.timeline.times, scenario.times(0))
    assert scenario.timeline.interval == 1.0
    assert scenario.timeline.start == ONSET
    assert scenario.timeline.end == scenario.family.epoch_time[-1] > 110.0


PROFILES = [
    "ramp:0.5",
    "ramp:0.5,onset=70",
    "ramp:0.5,onset=105",
    "jump-ramp:0.5,jump=10,onset=95",
    "exponential:0.2,time=40",
    "circle:20,onset=60",
    "fusion-ripper:2",
    "fusion-ripper:2,onset=90",
    "meaconing:5,onset=90",
]


@pytest.mark.parametrize("attack", PROFILES)
def test_an_attack_is_where_it_would_be_without_the_outage(attack: str, whole: Path, silent: Path) -> None:
    expected, found = offsets(whole, attack), offsets(silent, attack)
    assert not any(BEGIN < time < END for time in found)
    assert any(offset.any() for offset in found.values())
    for time, offset in found.items():
        # to the error of the vehicle's course by inertial samples; a ripper is at right angles to it
        np.testing.assert_allclose(offset, expected[time], atol=0.01 * np.abs(offset).max() + 1e-9)


FOLLOWING = [("meaconing:5", 1.5), ("azimuth:10", 3.0), ("azimuth:10,onset=70", 3.0)]


@pytest.mark.parametrize(("attack", "within"), FOLLOWING)
def test_an_attack_that_follows_the_vehicle_follows_it_through_the_outage(
    attack: str, within: float, whole: Path, silent: Path
) -> None:
    """By its inertial samples; velocities at the epochs alone would leave out two turns, 60 m and more."""
    expected, found = offsets(whole, attack), offsets(silent, attack)
    for time, offset in found.items():
        np.testing.assert_allclose(offset, expected[time], atol=within)


@pytest.mark.parametrize("attack", ["jump:20,onset=95", "slow-change:onset=95", "jump:20,onset=70,end=95"])
def test_a_random_attack_begins_and_ends_in_time(attack: str, whole: Path, silent: Path) -> None:
    spoofed = [{time for time, offset in offsets(folder, attack).items() if offset.any()} for folder in (whole, silent)]
    assert spoofed[1] == {time for time in spoofed[0] if not BEGIN < time < END}
    assert spoofed[1]


def test_a_slow_change_goes_on_in_the_outage(silent: Path) -> None:
    """0.5 m a second for 45 s, of which 30 without a fix; the sum of 45 normals, 6 sigma."""
    added = offsets(silent, "slow-change")[END]
    np.testing.assert_allclose(added[:2], 0.5 * (END - ONSET), atol=6.0 * np.sqrt(0.05 * (END - ONSET)))


def test_an_onset_of_a_population_is_a_time(whole: Path, silent: Path) -> None:
    """Drawn from the same numbers it is the same, whatever is missing."""
    attacks = []
    for folder in (whole, silent):
        scenario, attack = recorded(str(folder), onset=20.0), make_attack("random-jump:manoeuvre=0")
        attack.bind(scenario.timeline, 1)
        attacks.append(attack)
    draws = np.random.default_rng(0).random((50, 12))
    np.testing.assert_allclose(*(attack._schedule(draws)[0] for attack in attacks), rtol=1e-12)


def test_a_detection_takes_the_seconds_that_it_takes(whole: Path, silent: Path) -> None:
    delays = []
    for folder in (whole, silent):
        scenario = recorded(str(folder), onset=ONSET)
        detector = calibrated(make_detector("snapshot"), scenario, "strapdown")
        delays.append(evaluate_recorded(scenario, [make_attack("jump:30,onset=95")], [detector])[0]["time_to_detect_s"])
    assert delays == [1.0, 1.0]


def test_a_spoofer_moves_so_many_metres_in_a_second(silent: Path) -> None:
    scenario = recorded(str(silent), onset=ONSET)
    config = SpooferConfig(
        scenario=scenario, knowledge="blind", fidelity="strapdown", detector="snapshot:threshold=1e9", on_alarm="end"
    )
    game = SpooferGame(config, 2)
    game.reset(np.arange(2))
    while not game.step(np.array([[1.0, 0.5, 0.0]] * 2)).terminated.all():
        since = game.simulation.epoch.time[0] - ONSET
        np.testing.assert_allclose(game.seat.offset, [[4.0 * since, 2.0 * since, 0.0]] * 2, rtol=1e-9)
    assert since > 70.0


def test_what_a_defender_sees_of_time(silent: Path) -> None:
    """Coasting time and acceleration before, across and after the outage, every fix used."""
    scenario = recorded(str(silent), onset=BEGIN - 3.0)
    config = DefenderConfig(
        scenario=scenario, fidelity="strapdown", detectors=("snapshot",), attacks="ramp:0.1", clean=1.0, outage=0.0,
        multipath=0.0,
    )
    game = DefenderGame(config, 1)
    game.reset(np.arange(1))
    coasting, acceleration = (
        [field.name for field in game.fields].index(name) for name in ("coasting time", "acceleration")
    )
    seen, speeds = [], []
    for _ in range(6):
        seen.append(game.seat.features._raw[0].copy())
        speeds.append(game.simulation.epoch.view.velocity[0].copy())
        game.step(np.array([[0, 0]]))
    np.testing.assert_allclose([row[coasting] for row in seen], [0.0, 0.0, 0.0, 0.0, END - BEGIN - 1.0, 0.0])
    changes = np.linalg.norm(np.diff(speeds, axis=0), axis=1) / [1.0, 1.0, 1.0, END - BEGIN, 1.0]
    np.testing.assert_allclose([row[acceleration] for row in seen[1:]], changes)
    game.reset(np.arange(1))
    for _ in range(5):
        game.step(np.array([[1, 0]]))
    # none used since before epoch 0, and two more after the outage
    assert game.seat.features._raw[0, coasting] == END - BEGIN + 4.0


# --- the filter -------------------------------------------------------------------------------------------------------


def played(folder: Path, use: Callable[[float], bool], until: float) -> Simulation:
    """A game in which the fixes at some times are left out, up to a time."""
    scenario = recorded(str(folder), onset=ONSET)
    simulation = Simulation(
        scenario, seed=0, fidelity="strapdown", demands=Demands(excludes=True, history=60, auxiliary=True)
    )
    epoch = simulation.reset()
    while epoch.time[0] < until - 1e-6:
        simulation.resolve(Decision(np.array([use(float(epoch.time[0]))])))
        epoch = simulation.observe()
    return simulation


@pytest.mark.parametrize("length", [10.0, 30.0, 60.0])
def test_an_outage_is_as_uncertain_as_fixes_that_are_left_out(length: float, whole: Path) -> None:
    """An outage is gone through in parts of a second, as fixes are that are there and left out.

    The parts end at inertial samples, up to 10 ms from the fixes. That changes what is of second order in a part, a few
    percent, by as many percent of itself: the whole by less than 1e-3. In one step the sigmas are up to 1.45 times as
    large.
    """
    end = BEGIN + length
    out = played(whole, lambda time: not BEGIN < time < end, end)
    silent = played(silenced(whole, BEGIN, end), lambda time: True, end)
    sigma = [np.sqrt(np.diagonal(each.navigator.covariance[0])) for each in (silent, out)]
    np.testing.assert_allclose(*sigma, rtol=1e-3)
    np.testing.assert_allclose(silent.error, out.error, atol=1e-3)
    np.testing.assert_allclose(silent.epoch.innovation.nis, out.epoch.innovation.nis, rtol=1e-2)


def test_the_unaided_solution_goes_through_an_outage(whole: Path) -> None:
    """Without a fix it moves as the filter's; what lies between them moves to first order, by parts of a second."""
    out = played(whole, lambda time: not BEGIN < time < END, END)
    silent = played(silenced(whole, BEGIN, END), lambda time: True, END)
    np.testing.assert_allclose(silent.navigator.auxiliary_offset, out.navigator.auxiliary_offset, rtol=5e-3, atol=0.05)


@pytest.mark.parametrize("depth", [2, 8])
def test_backtracking_through_an_outage_is_leaving_out(depth: int, silent: Path) -> None:
    """Bit for bit, with the long epoch among those that are gone through again."""
    stop = END + 3.0
    back = played(silent, lambda time: True, stop)
    times = back.scenario.timeline.times
    first = times[int(back.epoch.index[0]) - depth]
    out = played(silent, lambda time: time < first, stop)
    back.resolve(Decision(np.array([True]), np.array([depth])))
    out.resolve(Decision(np.array([True])))
    assert back.navigator.backtracked[0] == depth
    for name in ("position", "velocity", "attitude", "bias", "covariance"):
        np.testing.assert_array_equal(getattr(back.navigator, name), getattr(out.navigator, name))


def test_ranges_every_two_seconds_are_gone_through_in_parts(tmp_path: Path) -> None:
    """The model of the game, which multiplies them, has the covariances of the filter, which goes part by part."""
    write_drive(tmp_path / "log", turns=6)
    path = tmp_path / "log" / "ranges.csv"
    header, *lines = path.read_text().splitlines()
    kept = set(sorted({line.split(",")[1] for line in lines}, key=float)[::2])
    path.write_text("\n".join([header, *(line for line in lines if line.split(",")[1] in kept)]) + "\n")
    scenario = recorded(str(tmp_path / "log"), coupling="tight", horizon=20)
    assert isinstance(scenario.family, RecordedRanges)
    steps = scenario.family.model.steps
    bounds, places = steps.bounds, steps.places
    np.testing.assert_array_equal(np.diff(places), 2)
    lengths = np.add.reduceat(scenario.family.model.step, bounds[:-1])
    assert 0.97 < lengths.min() <= lengths.max() < 1.03
    model = scenario.tight_model()
    after = model.covariance - np.swapaxes(model.whitened_gain, 1, 2) @ model.whitened_gain
    navigated = scenario.family.clean.covariance[scenario.family.first + 1 : scenario.family.last + 2]
    np.testing.assert_allclose(after, navigated, rtol=1e-6, atol=1e-9 * navigated.max())
