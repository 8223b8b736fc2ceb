"""Vehicles that leave their paths, in evaluations, in a played game and on a log."""

import json
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.evaluation.defenders import NOBODY, defenders_reports
from spoofgym.evaluation.departure_rows import departure_entry
from spoofgym.evaluation.departures import Departures
from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import BACK, LEFT, GameTrace
from spoofgym.evaluation.monte_carlo import watch_attack
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.policies.classical import parse
from spoofgym.program import last_of
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.evaluation.test_recorded import write_log
from tests.golden.parts import ready

DRIVE = "foi-drive:horizon=16,guidance=first-order:1/corridor=2"
PULL = "ramp:1,direction=0"


def driven(detectors):
    """The distance of three vehicles from their paths at epochs 0..K, and the alarms, (K+1, 3) each."""
    simulation = Simulation(make_scenario(DRIVE), make_attack(PULL), detectors, None, 3, 5)
    simulation.reset()
    distance, alarm = [np.zeros(3)], [np.zeros(3, dtype=bool)]
    for _ in range(16):
        simulation.resolve()
        simulation.observe()
        distance.append(simulation.steering.distance)
        alarm.append(simulation.alarm)
    return np.array(distance), np.array(alarm)


@pytest.mark.parametrize("threshold", [1e8, 40.0])
def test_spoofers_are_told_what_the_vehicle_did_until_the_alarm(threshold: float) -> None:
    watch = [ready("windowed:n=3", threshold)]
    distance, alarm = driven(watch)
    games = watch_attack(make_scenario(DRIVE), make_attack(PULL), watch, 3, 5)
    assert alarm.any() == (threshold < 1e8)
    for seen in (games.together(), games.of(0)):
        for run in range(3):
            last = int(alarm[:, run].argmax()) if alarm[:, run].any() else 16
            until = distance[: last + 1, run]
            assert seen.departures.largest[run] == until.max()
            assert seen.departures.time_outside[run] == np.count_nonzero(until > 1.0)


def test_games_without_a_detector_go_to_the_end() -> None:
    distance, _ = driven(())
    games = watch_attack(make_scenario(DRIVE), make_attack(PULL), [], 3, 5).together()
    assert np.array_equal(games.departures.largest, distance.max(axis=0))


def test_an_entry_has_the_exact_interval_of_the_share() -> None:
    games = 20
    entry = departure_entry(Departures(np.linspace(0.0, 1.9, games), np.zeros(games), 4.0))["deviation"]
    assert entry["left_corridor"] == 0.0
    assert entry["left_corridor_ci95"] == pytest.approx([0.0, 1.0 - 0.025 ** (1.0 / games)])
    assert entry["largest_m"] == pytest.approx(0.95)
    assert departure_entry(Departures(np.array([2.1]), np.ones(1), 4.0))["deviation"]["left_corridor"] == 1.0
    assert departure_entry(None) == {}


def test_defenders_are_told_of_the_vehicle() -> None:
    def report(text):
        given = [parse("snapshot:threshold=30/exclude"), parse("snapshot:threshold=1e8/exclude")]
        reports = defenders_reports(make_scenario(text), "linear", [], given, [PULL], NOBODY, 40, 0, 1)
        return last_of(reports)["rows"]

    plain, rows = report("foi-drive:horizon=16"), report(DRIVE)
    assert [{name: value for name, value in row.items() if name != "deviation"} for row in rows] == plain
    pulled = [row["deviation"] for row in rows if row["attack"].startswith("ramp")]
    watching, blind = pulled
    assert blind["left_corridor"] > 0.5, "all but those in which an outage hides the attack"
    assert watching["largest_m"] < blind["largest_m"]
    clean = next(row["deviation"] for row in rows if row["attack"] == "none")
    assert clean["largest_m"] < watching["largest_m"]


def test_a_played_game_tells_where_the_vehicle_is() -> None:
    plain = play_game("foi-drive:horizon=16", PULL, ("snapshot:threshold=1e8",))
    game = play_game(DRIVE, PULL, ("snapshot:threshold=1e8",))
    assert plain.departure is None
    assert "departure" not in plain.to_json()
    assert game.departure is not None
    assert np.hypot(*(game.true - plain.true)[:, :2].T) == pytest.approx(game.departure.deviation)
    assert game.error == pytest.approx(plain.error)
    (left,) = (event.epoch for event in game.events if event.kind == LEFT)
    assert game.departure.deviation[left - 1] <= 1.0 < game.departure.deviation[left]
    again = GameTrace.from_json(json.loads(json.dumps(game.to_json())))
    assert again.departure is not None
    assert again.departure.deviation == pytest.approx(game.departure.deviation, abs=1e-3)
    assert again.departure.corridor == 2.0
    assert game.columns()["deviation_m"] == game.departure.deviation.tolist()


def test_a_vehicle_that_comes_back_is_told() -> None:
    game = play_game(DRIVE.replace("16", "40"), "jump:4,end=30", ("snapshot",))
    kinds = [event.kind for event in game.events]
    assert kinds.index(LEFT) < kinds.index(BACK)


def test_a_log_is_played_with_the_vehicle_steered(tmp_path) -> None:
    folder = write_log(tmp_path / "log")
    detectors = [make_detector("snapshot")]
    attacks = [make_attack("none"), make_attack("ramp:1")]
    plain = evaluate_recorded(make_scenario(f"recorded:{folder}"), attacks, detectors)
    rows = evaluate_recorded(make_scenario(f"recorded:{folder},guidance=first-order:1"), attacks, detectors)
    assert [{name: value for name, value in row.items() if name != "deviation"} for row in rows] == plain
    clean, pulled = (row["deviation"] for row in rows)
    assert clean["left_corridor"] == 0.0
    assert clean["largest_m"] < 1.0, "fixes of 0.3 m"
    assert pulled["left_corridor"] == 1.0
    assert pulled["largest_m"] < rows[1]["max_error_m"] + 1.0
    assert pulled["time_outside_s"] > 30.0


def test_some_games_and_others_in_their_place() -> None:
    one, other = (Departures(np.full(3, value), np.full(3, 2.0 * value), 4.0) for value in (1.0, 5.0))
    mixed = one.where(np.array([True, False, True]), other)
    assert mixed.largest.tolist() == [1.0, 5.0, 1.0]
    assert mixed.time_outside.tolist() == [2.0, 10.0, 2.0]
    assert mixed.of(np.array([1])).left.tolist() == [True]
    assert replace(mixed, corridor=20.0).left.tolist() == [False] * 3
