"""spoofgym-bench v1 does not change: its definition, its opponents, and what some of its games are worth."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.evaluation.benchmark import TRACKS
from spoofgym.evaluation.benchmark_play import Matches, check_player, watched_by
from spoofgym.evaluation.benchmark_v1 import V1
from spoofgym.scenarios import make_scenario

DIGEST = "6b4a40cc9f4a542d"
V2 = (
    "spoofgym-bench v1 must not change. If this change is meant, it makes a v2: a definition of its own "
    "(spoofgym/evaluation/benchmark_v2.py), whose results are never compared with those of v1."
)
PINNED = [
    ("liu-flight/undetected/snapshot", "snapshot", "ramp:0.2", [25.384801579, 23.943164378, 24.592991429]),
    (
        "foi-drive/error/worst",
        "unseen:16",
        "signed-mean:n=5 > onset-depth:reuse=12",
        [0.611791664, 0.281577517, 0.707445945, 47.600964145],
    ),
    (
        "foi-drive/error/worst",
        "policy:drive-tuned-onset-spoofer",
        "windowed:n=20 > exclude-and-backtrack:20",
        [36.086766573, 0.378825161, 0.448976435, 0.409566693],
    ),
    (
        "tactical-flight/beyond:150/held-out",
        "held-out",
        "snapshot > px4-dead-reckoning",
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.376, 0.0, 0.432],
    ),
]
"""A task, the opponent of one of its matches, a player, and what its first games are worth."""


def test_the_definition_is_the_pinned_one() -> None:
    assert V1.digest == DIGEST, V2


@pytest.mark.parametrize(("name", "opponent", "player", "worth"), PINNED)
def test_the_pinned_games_are_worth_what_they_were(
    name: str, opponent: str, player: str, worth: list[float], tmp_path: Path
) -> None:
    """Other arithmetic moves an error by less than 1e-5 of it: a policy computes in single precision."""
    task = next(task for task in V1.tasks if task.name == name)
    (match,) = (match for match in task.matches if match.opponent == opponent)
    few = replace(task, matches=(replace(match, games=len(worth)),))
    (found,) = Matches(V1, tmp_path).worth(few, [player])
    np.testing.assert_allclose(found[0], worth, rtol=1e-5, atol=1e-8, err_msg=V2)


def test_no_game_belongs_to_two_matches_and_every_task_has_references() -> None:
    matches = sorted((match for task in V1.tasks for match in task.matches), key=lambda match: match.seed)
    for one, other in itertools.pairwise(matches):
        assert one.seed + one.games <= other.seed
    assert len({(task.track, task.name) for task in V1.tasks}) == len(V1.tasks)
    for task in V1.tasks:
        assert task.best
        assert (task.one > task.zero) == (task.track == "attack")


def test_opponents_and_players_of_the_table_are_there(tmp_path: Path) -> None:
    for track in TRACKS:
        for player in V1.baselines(track):
            check_player(track, player)
    for player in V1.defenders:
        assert set(watched_by(player)) <= set(V1.places[0].world), "its threshold would not be pinned"
    Matches(V1, tmp_path).check_agents()


def test_thresholds_are_those_of_calibration() -> None:
    """Of the two detectors whose thresholds are shipped; calibration takes too long for the others."""
    for place in V1.places[:2]:
        detectors = [make_detector(name) for name in ("snapshot", "windowed:n=20")]
        ready = calibrated_for_play(detectors, make_scenario(place.scenario), V1.fidelity)
        pinned = dict(place.thresholds)
        assert [pinned["snapshot"], pinned["windowed:n=20"]] == [25.9, 114.41]
        for detector in ready:
            detector.bind(1, 3)
        assert [detector.threshold for detector in ready] == [25.9, 114.41]
