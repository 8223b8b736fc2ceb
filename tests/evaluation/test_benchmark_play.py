"""Who may take part in a benchmark, what is kept of the games, and what a report tells."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spoofgym.envs.config import SpooferConfig
from spoofgym.evaluation import benchmark_play
from spoofgym.evaluation.agent_scores import play_games
from spoofgym.evaluation.benchmark import ATTACK, DEFEND
from spoofgym.evaluation.benchmark_play import Matches, check_player, watched_by
from spoofgym.evaluation.benchmark_report import OPTIMUM, measure, references
from spoofgym.evaluation.engine import Here
from spoofgym.optimum import bounded_optimum
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.published import policy_folder
from spoofgym.scenarios import make_scenario
from tests.evaluation.tiny_benchmark import LATCH, SCENARIO, TINY
from tests.run_folders import defender, spoofer

SPOOFER = {"scenario": SCENARIO, "detector": "snapshot", "knowledge": "shadow"}
SEES_WINDOWS = {"scenario": SCENARIO, "detector": "windowed:n=5", "knowledge": "full", "on_alarm": "respond"}
DEFENDER = {"scenario": SCENARIO, "attacks": "training", "detectors": ("snapshot", "windowed:n=20,threshold=90")}


def play(track: str, folder: Path, *policies: str, asked: tuple[str, ...] = ()) -> tuple[dict, list[str]]:
    told: list[str] = []
    return measure(Matches(TINY, folder), track, policies, asked, Here(), told.append), told


def test_games_that_are_kept_are_not_played_again(tmp_path: Path) -> None:
    report, told = play(DEFEND, tmp_path, "windowed:n=5 > exclude")
    assert len(told) == 4
    assert told[1] == "drive/error/worst: ramp:1 against windowed:n=5 > exclude"
    assert play(DEFEND, tmp_path, "windowed:n=5 > exclude") == (report, [])
    # as after a kill: some games are there
    cells = sorted(tmp_path.iterdir())
    assert len(cells) == 4
    cells[2].unlink()
    again, told = play(DEFEND, tmp_path, "windowed:n=5 > exclude")
    assert again == report
    assert len(told) == 1
    cells[1].write_bytes(cells[1].read_bytes()[:-40])
    with pytest.raises(ValueError, match=f"{cells[1].name} is damaged"):
        play(DEFEND, tmp_path, "windowed:n=5 > exclude")


def test_the_score_of_a_policy_is_that_of_its_environment(tmp_path: Path) -> None:
    """Against the snapshot test it is the mean undetected error of Spoofer-v0 on the same seeds."""
    name = spoofer(SPOOFER, tmp_path / "run")
    report, _ = play(ATTACK, tmp_path / "cells", name, asked=("drive/undetected",))
    act = LearnedSpoofer.load(policy_folder(name)).act
    expected = play_games(SpooferConfig(**SPOOFER), act, 6, 7).mean()
    (row,) = report["tasks"]
    assert row["score"]["value"] == pytest.approx(expected, rel=1e-12)
    assert row["normalised"]["value"] == pytest.approx(expected / 20.0, rel=1e-12)


def test_several_policies_are_the_seeds_of_one_method(tmp_path: Path) -> None:
    names = ["ramp:0.5", "ramp:1"]
    report, _ = play(ATTACK, tmp_path, *names)
    single = [play(ATTACK, tmp_path, name)[0] for name in names]
    for row, *alone in zip(report["tasks"], *(each["tasks"] for each in single), strict=True):
        assert row["score"]["value"] == pytest.approx(np.mean([each["score"]["value"] for each in alone]))
        assert row["matches"][0]["means"] == [each["matches"][0]["means"][0] for each in alone]
    with pytest.raises(ValueError, match="each policy can be given once only"):
        play(ATTACK, tmp_path, "ramp:1", "ramp:1")


def test_the_largest_harm_is_the_worst_case(tmp_path: Path) -> None:
    report, _ = play(DEFEND, tmp_path, "always-use", asked=("drive/error/worst",))
    (row,) = report["tasks"]
    means = {match["opponent"]: match["means"][0] for match in row["matches"]}
    assert row["score"]["value"] == max(means.values())
    assert means[row["worst"]] == max(means.values())
    assert row["normalised"]["value"] == pytest.approx((20.0 - max(means.values())) / 18.0)
    whole = report["summary"]["interquartile_mean"]
    assert whole == {**row["normalised"], "tasks": 1, "all_tasks": 3}


def test_a_policy_that_does_not_fit_some_tasks_is_refused_there_and_the_summary_says_so(tmp_path: Path) -> None:
    """It sees the statistics of a window: the duel's world runs one, games that a snapshot ends do not."""
    name = spoofer(SEES_WINDOWS, tmp_path / "run")
    report, told = play(ATTACK, tmp_path / "cells", name)
    assert [row["task"] for row in report["tasks"]] == ["drive/error/windowed:n=5"]
    assert [each["task"] for each in report["refused"]] == ["drive/undetected/snapshot", "flight/undetected/snapshot"]
    assert "trained to see the detectors windowed:n=5; the game runs snapshot" in report["refused"][0]["reason"]
    assert told[0].startswith("drive/undetected/snapshot is left out: ")
    whole = report["summary"]["interquartile_mean"]
    assert (whole["tasks"], whole["all_tasks"]) == (1, 3)
    with pytest.raises(ValueError, match=r"fits none of the 2 tasks: .*trained to see the detectors"):
        play(ATTACK, tmp_path / "cells", name, asked=("drive/undetected", "flight"))


def test_a_defender_brings_its_detectors(tmp_path: Path) -> None:
    name = defender(DEFENDER, tmp_path / "run")
    assert watched_by(name) == ("snapshot", "windowed:n=20,threshold=90")
    assert watched_by(f"windowed:n=6 > {name}") == ("windowed:n=6", "snapshot", "windowed:n=20,threshold=90")
    assert watched_by("always-use") == ()
    report, _ = play(DEFEND, tmp_path / "cells", name, "windowed:n=6,threshold=55 > exclude")
    assert [row["task"] for row in report["tasks"]] == ["drive/error/held-out", "drive/error/worst"]
    # other scenarios have other depths
    (refused,) = report["refused"]
    assert refused["task"] == "flight/beyond:2/held-out"
    assert "was trained on 11 depths and 0 slots of satellites, the game has 5 and 0" in refused["reason"]
    assert report["summary"]["groups"]["drive"]["tasks"] == report["summary"]["groups"]["drive"]["all_tasks"] == 2
    held_out = report["summary"]["groups"]["held-out"]
    assert (held_out["tasks"], held_out["all_tasks"]) == (1, 2)


def test_a_detector_that_is_not_pinned_keeps_its_own_threshold() -> None:
    place = TINY.places[0]
    found = benchmark_play._with_thresholds(place, ("windowed:n=5", "windowed", "windowed:n=20", "snapshot"))
    assert found == (("windowed:n=5", 50.0), ("windowed", None), ("snapshot", 25.9))


@pytest.mark.parametrize(
    ("track", "player", "message"),
    [
        (ATTACK, "nobody", "unknown attack 'nobody'"),
        (ATTACK, "policy:nobody", "'nobody' is no run folder and no published agent"),
        (ATTACK, "snapshot > exclude", "defends: it plays the track 'defend'"),
        (ATTACK, "px4-auto", "defends: it plays the track 'defend'"),
        (DEFEND, "ramp:1", "spoofs: it plays the track 'attack'"),
        (DEFEND, "lp-gate", "spoofs: it plays the track 'attack'"),
        (DEFEND, "nobody", "fits none of the 3 tasks: duel: defender: unknown response 'nobody'"),
        (DEFEND, "nobody > exclude", "fits none of the 3 tasks: unknown detector 'nobody'"),
        (DEFEND, "snapshot", "is a detector: name the response to its alarm, too"),
    ],
)
def test_players_that_cannot_take_part_are_refused(track: str, player: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        play(track, tmp_path, player)
    with pytest.raises(ValueError, match="track must be"):
        check_player("dance", player)


def test_policies_of_the_other_side_and_damaged_ones_are_refused(tmp_path: Path) -> None:
    name = spoofer(SPOOFER, tmp_path / "run")
    with pytest.raises(ValueError, match="run folder of a spoofer, not of a defender"):
        play(DEFEND, tmp_path, name)
    (tmp_path / "run" / "policy.npz").write_bytes(b"PK")
    with pytest.raises(ValueError, match=r"policy\.npz is damaged"):
        play(ATTACK, tmp_path, name)


def test_a_task_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no task 'driv' in the track 'attack'; there are: drive/undetected/snapshot"):
        play(ATTACK, tmp_path, "ramp:1", asked=("driv",))
    assert [task.name for task in TINY.chosen(ATTACK, ("drive/error/", "flight"))] == [
        "flight/undetected/snapshot",
        "drive/error/windowed:n=5",
    ]


def test_another_agent_of_a_pinned_name_is_refused(tmp_path: Path) -> None:
    pinned = replace(TINY, agents=(("liu-flight-snapshot-spoofer", "0" * 64),))
    with pytest.raises(ValueError, match="whose weights have the digest 000000000000; here they have e5467c429c73"):
        measure(Matches(pinned, tmp_path), ATTACK, ["ramp:1"], (), Here(), lambda _: None)


def test_references_are_the_scores_of_the_pinned_players(tmp_path: Path) -> None:
    matches = Matches(TINY, tmp_path)
    found = {}
    for track in (ATTACK, DEFEND):
        found |= {each.task: each for each in references(matches, TINY.chosen(track), Here(), lambda _: None)}
    scenario = make_scenario(SCENARIO)
    optimum = bounded_optimum(scenario.linear_model(), 25.9, np.array(scenario.drag_off_rate)).score
    exact = found["drive/undetected/snapshot"]
    assert (exact.zero, exact.one, exact.best) == (0.0, optimum, OPTIMUM)
    duel, worst = "drive/error/windowed:n=5", "drive/error/worst"
    for name, zero, track in ((duel, "none", ATTACK), (worst, "always-use", DEFEND)):
        scores = {
            player: play(track, tmp_path, player, asked=(name,))[0]["tasks"][0]["score"]["value"]
            for player in TINY.baselines(track)
        }
        best = max(scores, key=scores.__getitem__) if track == ATTACK else min(scores, key=scores.__getitem__)
        assert (found[name].zero, found[name].one, found[name].best) == (scores[zero], scores[best], best)


def test_the_digest_names_all_of_the_definition() -> None:
    task = TINY.tasks[0]
    others = [
        replace(TINY, outage=0.2),
        replace(TINY, tasks=(replace(task, one=21.0), *TINY.tasks[1:])),
        replace(TINY, tasks=(replace(task, matches=(replace(task.matches[0], seed=8),)), *TINY.tasks[1:])),
        replace(TINY, defenders=(LATCH,)),
    ]
    assert len({TINY.digest, *(other.digest for other in others)}) == 5
