import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_defender
from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import (
    ALARM,
    BACKTRACK,
    END,
    EXCLUSION,
    ONSET,
    REUSE,
    GameTrace,
)
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

DEFENDER = "signed-mean:n=5 > onset-depth:reuse=12"


@pytest.fixture(scope="module")
def game() -> GameTrace:
    return play_game("foi-drive:horizon=60", "jump:30", ("snapshot",), DEFENDER, seed=7)


def test_a_game_is_the_simulation_that_it_was_played_in(game: GameTrace) -> None:
    scenario = make_scenario("foi-drive:horizon=60")
    watching = [make_detector(name) for name in ("snapshot", "signed-mean:n=5")]
    detectors = calibrated_for_play(watching, scenario, "linear")
    simulation = Simulation(
        scenario, make_attack("jump:30"), detectors, make_defender(DEFENDER, scenario, detectors), 1, seed=7
    )
    simulation.reset()
    for epoch in range(61):
        statistics = [float(simulation.epoch.statistics[part.name][0]) for part in detectors]
        assert [part.values[epoch] for part in game.statistics] == statistics
        assert game.alarm[epoch] == simulation.alarm[0]
        np.testing.assert_allclose(game.spoofed[epoch] - game.true[epoch], simulation.offset[0], atol=1e-9)
        simulation.resolve()
        np.testing.assert_allclose(game.error_vector[epoch], simulation.error[0], atol=1e-9)
        assert game.used[epoch] == simulation.used[0]
        assert game.backtracked[epoch] == simulation.navigator.backtracked[0]
        if epoch < 60:
            simulation.observe()


def test_events_tell_the_story_of_a_jump(game: GameTrace) -> None:
    onset, alarm, exclusion = (game.first(kind) for kind in (ONSET, ALARM, EXCLUSION))
    assert onset is not None
    assert alarm is not None
    assert exclusion is not None
    assert onset.epoch == np.flatnonzero(game.attacked)[0] == 1
    assert alarm.epoch == np.flatnonzero(game.alarm)[0]
    assert "snapshot" in alarm.detail
    assert exclusion.epoch == np.flatnonzero(~game.used)[0] >= onset.epoch
    assert not game.undetected
    backtracks = [event.epoch for event in game.events if event.kind == BACKTRACK]
    assert backtracks == np.flatnonzero(game.backtracked).tolist()


def test_a_stretch_of_exclusion_ends_with_reuse_and_an_attack_with_its_end(game: GameTrace) -> None:
    used, attacked = np.ones(61, dtype=bool), np.zeros(61, dtype=bool)
    used[[5, 6, 7, 20]], attacked[10:15] = False, True
    told = [(event.kind, event.epoch) for event in replace(game, used=used, attacked=attacked).events]
    for event in ((EXCLUSION, 5), (REUSE, 8), (EXCLUSION, 20), (REUSE, 21), (ONSET, 10), (END, 15)):
        assert event in told
    assert told == sorted(told, key=lambda each: each[1])


def test_json_brings_the_game_back(game: GameTrace) -> None:
    written = game.to_json()
    again = GameTrace.from_json(json.loads(json.dumps(written, allow_nan=False)))
    assert {**again.to_json(), "error_m": None} == {**written, "error_m": None}
    assert again.players == game.players
    assert again.events == game.events
    np.testing.assert_allclose(again.error, game.error, atol=1e-3)


def test_an_infinite_statistic_survives_json(game: GameTrace) -> None:
    first = game.statistics[0]
    certain = replace(first, values=np.where(np.arange(61) == 9, np.inf, first.values))
    again = GameTrace.from_json(json.loads(json.dumps(replace(game, statistics=(certain,)).to_json(), allow_nan=False)))
    assert again.alarm[9]
    assert np.isinf(again.statistics[0].values[9])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema_version": 2}, "this version reads schema_version 1, got 2"),
        ({"kind": "attackers"}, "not a game: its kind is 'attackers'"),
        ({"time_s": []}, "'time_s' must be a list of numbers"),
        ({"used": [1]}, "'used' must be a list of 61 numbers"),
        ({"error_m": None, "true_m": [1, 2]}, "'true_m' must be a JSON object"),
        ({"statistics": [{"name": "x", "threshold": "1", "arl0": None, "values": []}]}, "threshold"),
        ({"backtracked": [0.5] * 61}, "whole numbers"),
        ({"players": None}, "'players' must be a JSON object, got None"),
    ],
)
def test_a_stranger_is_refused_in_one_line(game: GameTrace, change: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words) as refusal:
        GameTrace.from_json(game.to_json() | change)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [None, [], "game", {"kind": "game"}])
def test_what_is_no_game_is_refused(content: object) -> None:
    with pytest.raises(ValueError, match="game"):
        GameTrace.from_json(content)


def test_csv_has_a_row_per_epoch(game: GameTrace) -> None:
    rows = list(csv.DictReader(io.StringIO(game.to_csv())))
    assert len(rows) == 61
    assert float(rows[10]["error_m"]) == pytest.approx(game.error[10], rel=1e-8)
    assert rows[1]["events"].startswith(ONSET)
    assert float(rows[3]["statistic of snapshot"]) == pytest.approx(game.statistics[0].values[3], rel=1e-8)


def test_a_filter_on_ranges_has_protection_levels() -> None:
    bank = "separation-bank:n=10"
    game = play_game("kujur-flight:horizon=20", "ramp:1", (bank,), "exclude-satellites", seed=0)
    assert [(level.name, level.direction) for level in game.levels] == [
        ("filter", "horizontal"),
        ("filter", "up"),
        (bank, "up"),
    ]
    assert game.levels[0].alert_limit > game.levels[1].alert_limit
    assert all((level.values > 0.0).all() for level in game.levels)
    assert GameTrace.from_json(json.loads(json.dumps(game.to_json()))).levels[2].name == bank


def test_a_learned_spoofer_and_a_pool_play() -> None:
    game = play_game("liu-flight:horizon=20", "policy:liu-flight-snapshot-spoofer")
    assert [part.name for part in game.statistics] == ["snapshot"]
    assert game.attacked[1:].all()
    drawn = [play_game("foi-drive:horizon=60", "training", seed=seed).players.drawn for seed in range(6)]
    assert len(set(drawn)) > 1


def test_nobody_plays() -> None:
    game = play_game("foi-drive:horizon=60")
    assert not game.attacked.any()
    assert game.used.all()
    assert game.players.response is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "unknown scenario 'nowhere'"),
        (("foi-drive", "rampp:1"), "unknown attack 'rampp'"),
        (("foi-drive", None, ("snapshott",)), "unknown detector 'snapshott'"),
        (("foi-drive", None, (), "snapshot"), "is a detector"),
        (("foi-drive", None, (), None, -1), "seed"),
        (("foi-drive", None, (), None, 0, "fast"), "no fidelity 'fast'"),
    ],
)
def test_what_does_not_exist_is_named(arguments: tuple, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        play_game(*arguments)
