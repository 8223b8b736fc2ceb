"""The programs that evaluate and tune defenders, as a user runs them.

The detectors of an evaluation are replaced by some whose thresholds are given, so that nothing is calibrated.
"""

import json
import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.evaluation import defenders
from spoofgym.evaluation.defence import World, play_response
from spoofgym.evaluation.defender_rows import closed_gap
from spoofgym.policies import classical as listed
from spoofgym.policies.learned import LearnedDefender
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.studies import tune
from spoofgym.studies.evaluate import defenders as evaluate_defenders
from tests.learning.runs import DRIVE

pytestmark = pytest.mark.xdist_group("taught defender")  # one worker: the run folder is made once

ROW_KEYS = {
    "defender",
    "attack",
    "held_out",
    "episodes",
    "mean_error_m",
    "ci95_m",
    "rmse_m",
    "max_error_m",
    "detection_probability",
    "median_time_to_detect_s",
    "error_at_detection_m",
    "median_time_to_reuse_s",
    "never_reused_fraction",
    "clean_exclusion_fraction",
    "false_alarms_per_epoch",
}
WINDOWED, SIGNED = "windowed:n=5,threshold=35", "signed-mean:n=10,threshold=14"
PUBLISHED = (
    listed.ClassicalDefender("snapshot", "snapshot", "exclude"),
    listed.ClassicalDefender("foi-w5-b20", WINDOWED, "exclude-and-backtrack:20"),
    listed.ClassicalDefender("px4-auto", "snapshot", "px4-auto"),
)
TUNED = [
    listed.ClassicalDefender("tuned-depth", SIGNED, "exclude-and-backtrack:20,reuse=5", True),
    listed.ClassicalDefender("tuned-onset", SIGNED, "onset-depth:reuse=5", True),
]
GIVEN = "snapshot > exclude:reuse=3"
ATTACKS = {
    False: {"all-training", "none", "random-ramp", "random-jump", "random-growth"},
    True: {"all-held-out", "none", "two-stage-ramp", "sign-changing-ramp", "decaying-jump", "climbing-spiral"},
}
DEFENDERS = {
    "never": "yardstick",
    "always": "yardstick",
    "random": "yardstick",
    "oracle-onset": "yardstick",
    "oracle-depth": "yardstick",
    "snapshot": "published",
    "foi-w5-b20": "published",
    "px4-auto": "published",
    "tuned-depth": "tuned",
    "tuned-onset": "tuned",
}


@pytest.fixture
def world(monkeypatch):
    """What `spoofgym.evaluation.defenders` plays, without a detector that has to be calibrated."""
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ("snapshot", WINDOWED, SIGNED))
    monkeypatch.setattr(defenders, "PUBLISHED", PUBLISHED)
    monkeypatch.setattr(defenders, "tuned_for", lambda scenario: TUNED)


def evaluated(capsys, *arguments):
    assert evaluate_defenders.main(["--scenario", DRIVE, "--threads", "1", *arguments, "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


def row_of(report, name, attack):
    (row,) = [row for row in report["rows"] if (row["defender"], row["attack"]) == (name, attack)]
    return row


@pytest.mark.usefixtures("world")
def test_json_alone_on_stdout(taught, capsys):
    report = evaluated(capsys, "--defender", str(taught), "--defender", GIVEN, "--episodes", "24")
    assert (report["schema_version"], report["kind"]) == (1, "defenders")
    assert (report["scenario"], report["fidelity"]) == (DRIVE, "linear")
    assert report["kinds"] == {**DEFENDERS, GIVEN: "given", "short": "learned"}
    assert all(set(row) == ROW_KEYS for row in report["rows"])
    for held_out, attacks in ATTACKS.items():
        for name in report["kinds"]:
            rows = [row for row in report["rows"] if (row["defender"], row["held_out"]) == (name, held_out)]
            assert {row["attack"] for row in rows} == attacks
            episodes = {row["attack"]: row["episodes"] for row in rows}
            pooled = episodes.pop("all-held-out" if held_out else "all-training")
            assert pooled == sum(episodes.values()) == 24
            means = [row["mean_error_m"] * row["episodes"] for row in rows if not row["attack"].startswith("all-")]
            assert rows[0]["mean_error_m"] == pytest.approx(sum(means) / 24)


@pytest.mark.usefixtures("world")
def test_what_the_yardsticks_show(capsys):
    report = evaluated(capsys, "--defender", GIVEN, "--episodes", "60", "--population", "held-out")
    assert report["kinds"] == {**DEFENDERS, GIVEN: "given"}
    assert {row["held_out"] for row in report["rows"]} == {True}
    never, always, onset = (row_of(report, name, "all-held-out") for name in ("never", "always", "oracle-onset"))
    assert (never["detection_probability"], never["clean_exclusion_fraction"]) == (0.0, 0.0)
    assert (never["median_time_to_detect_s"], never["median_time_to_reuse_s"]) == (None, 0.0)
    assert (always["clean_exclusion_fraction"], always["never_reused_fraction"]) == (1.0, 1.0)
    assert (onset["clean_exclusion_fraction"], onset["false_alarms_per_epoch"]) == (0.0, 0.0)
    assert onset["median_time_to_detect_s"] == 0.0
    clean = row_of(report, "never", "none")
    assert (clean["detection_probability"], clean["median_time_to_reuse_s"]) == (None, None)
    depth, tuned = (row_of(report, name, "all-held-out")["mean_error_m"] for name in ("oracle-depth", "tuned-depth"))
    assert depth < tuned
    assert report["comparisons"] == []


@pytest.mark.usefixtures("world")
def test_a_defender_on_the_command_line_is_the_one_of_the_list(capsys):
    """The published ones spelled out have the same games as under their names."""
    spelled = f"{WINDOWED} > exclude-and-backtrack:20"
    both = ["--defender", "snapshot > exclude", "--defender", spelled]
    report = evaluated(capsys, *both, "--episodes", "20", "--population", "training")
    for text, name in (("snapshot > exclude", "snapshot"), (spelled, "foi-w5-b20")):
        row = row_of(report, text, "all-training")
        assert row == {**row_of(report, name, "all-training"), "defender": text}
    gaps = {gap["defender"]: gap for gap in report["gaps"]}
    assert set(gaps) == {"snapshot > exclude", spelled, "tuned-onset"}
    means = {name: row_of(report, name, "all-training")["mean_error_m"] for name in report["kinds"]}
    for name, gap in gaps.items():
        assert (gap["from"], gap["to"], gap["held_out"]) == ("tuned-depth", "oracle-depth", False)
        expected = (means["tuned-depth"] - means[name]) / (means["tuned-depth"] - means["oracle-depth"])
        assert gap["closed"] == pytest.approx(expected)


@pytest.mark.usefixtures("world")
def test_what_does_not_fit_the_scenario_is_left_out(capsys, monkeypatch):
    """The robot has no inertial solution: what needs one is told on one line, unless somebody asked for it."""
    relative, robot = "relative-motion:k=20,threshold=30", "song-robot:horizon=40"
    unfit = (listed.ClassicalDefender("foi-relative-b20", relative, "exclude-and-backtrack:20"),)
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ("snapshot", WINDOWED, SIGNED, relative))
    monkeypatch.setattr(defenders, "PUBLISHED", PUBLISHED + unfit)
    few = ["--scenario", robot, "--threads", "1", "--episodes", "5", "--population", "training"]
    assert evaluate_defenders.main([*few, "--defender", "snapshot > exclude", "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["kinds"] == {**DEFENDERS, "snapshot > exclude": "given"}
    (line,) = [line for line in printed.err.splitlines() if line.startswith("left out")]
    assert line.endswith(f"{robot} does not give what they need: foi-relative-b20 ({relative})")
    assert evaluate_defenders.main([*few, "--defender", f"{relative} > exclude"]) == 2
    assert "needs inertial solution" in " ".join(capsys.readouterr().err.split())


@pytest.mark.usefixtures("world")
def test_comparisons_are_paired(taught, tmp_path, capsys):
    other = tmp_path / "other"
    shutil.copytree(taught, other)
    report = evaluated(
        capsys, "--defender", str(taught), "--defender", str(other), "--episodes", "30", "--population", "training"
    )
    by_pair = {(item["defender"], item["baseline"]): item for item in report["comparisons"]}
    assert set(by_pair) == {
        (name, baseline) for name in ("short", "other", "mean of the learned") for baseline in DEFENDERS
    }
    for (name, baseline), item in by_pair.items():
        assert (item["kind"], item["held_out"]) == (DEFENDERS[baseline], False)
        means = [row_of(report, one, "all-training")["mean_error_m"] for one in ("short", baseline)]
        assert item["difference_m"] == pytest.approx(means[0] - means[1], abs=1e-9), name
        assert item["ci95_m"][0] <= item["difference_m"] <= item["ci95_m"][1]


def test_oracle_depth_is_the_best_depth_of_each_game():
    scenario = make_scenario(DRIVE)
    world = World(scenario, "training", 0.5, tuple(calibrated_all([make_detector(SIGNED)], scenario)))
    oracle = defenders.Defenders(world, 25, 3).oracle_depth(TUNED[0])
    errors = []
    for response in (listed.with_depth(depth, "reuse=5") for depth in scenario.depth_table):
        errors.append(play_response(world, SIGNED, make_response(response), 25, 3).error.mean(axis=1))
    assert len(errors) == 11
    np.testing.assert_array_equal(oracle.error.mean(axis=1), np.min(errors, axis=0))
    assert len(set(np.argmin(errors, axis=0))) > 1


@pytest.mark.parametrize(("learned", "share"), [(1.0, 0.0), (0.8, 0.5), (0.6, 1.0), (1.2, -0.5)])
def test_closed_gap(learned, share):
    assert closed_gap(learned, 1.0, 0.6) == pytest.approx(share)
    assert closed_gap(learned, 0.6, 0.6) is None


@pytest.mark.usefixtures("world")
def test_tables_fit_a_terminal_and_a_figure_is_drawn(taught, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    figure, out = tmp_path / "sub" / "out.png", tmp_path / "out.json"
    arguments = ["--defender", str(taught), "--defender", GIVEN, "--episodes", "12", "--json", str(out)]
    assert evaluate_defenders.main(["--scenario", DRIVE, "--threads", "1", *arguments, "--figure", str(figure)]) == 0
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    lines = capsys.readouterr().out.replace(str(tmp_path), "").splitlines()
    assert max(map(len, lines)) <= 100
    text = "\n".join(lines)
    report = json.loads(out.read_text())
    names = {*report["kinds"], *(row["attack"] for row in report["rows"] if not row["attack"].startswith("all-"))}
    for name in names:  # whole: none is folded
        assert any(line.startswith(f"{name} ") for line in lines), name
    assert "…" not in text
    mean = row_of(report, "short", "all-held-out")["mean_error_m"]
    assert sum(line.startswith(f"short{' ' * 22}") and f"{mean:.2f} ±" in line for line in lines) >= 1


@pytest.mark.usefixtures("world")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--defender", "nowhere"], "--defender 'nowhere' is neither a run folder nor detector/response"),
        (["--defender", "> exclude"], "spelled detector/response, e.g. snapshot/exclude, got '> exclude'"),
        (["--defender", "oracle > exclude"], "unknown detector 'oracle'"),
        (["--defender", "snapshot > pray"], "unknown response 'pray'"),
        (["--scenario", "moon", "--defender", GIVEN], "unknown scenario 'moon'"),
    ],
)
def test_bad_input_of_an_evaluation_is_told(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert evaluate_defenders.main(["--scenario", DRIVE, "--episodes", "2", "--threads", "1", *arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.usefixtures("world")
def test_policies_that_cannot_be_told_apart_or_do_not_fit(taught, tmp_path, capsys):
    arguments = ["--scenario", DRIVE, "--episodes", "2", "--threads", "1", "--population", "training"]
    assert evaluate_defenders.main([*arguments, "--defender", str(taught), "--defender", str(taught)]) == 2
    assert "run folders of one name cannot be told apart: short, short" in " ".join(capsys.readouterr().err.split())

    policy = LearnedDefender.load(taught)
    folder = tmp_path / "odd"
    shutil.copytree(taught, folder)
    replace(policy, layout=("speed", *policy.layout[1:])).save(folder)
    assert evaluate_defenders.main([*arguments, "--defender", str(folder)]) == 2
    assert "policy 'odd' was trained for another observation: entry 0 was 'speed'" in " ".join(
        capsys.readouterr().err.split()
    )
    weights, biases = ((*parts[:-1], parts[-1][:-1]) for parts in (policy.weights, policy.biases))
    replace(policy, weights=weights, biases=biases).save(folder)
    assert evaluate_defenders.main([*arguments, "--defender", str(folder)]) == 2
    assert "policy 'odd' was trained on 10 depths, the game has 11" in " ".join(capsys.readouterr().err.split())


# --- tuning ---


@pytest.mark.usefixtures("world")
def test_tuning_ranks_the_grid(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(listed, "GRID_DETECTORS", (WINDOWED, SIGNED))
    monkeypatch.setattr(listed, "GRID_DEPTHS", (0, 20))
    monkeypatch.setenv("COLUMNS", "100")
    out = tmp_path / "sub" / "out.json"
    assert tune.main(["--scenario", DRIVE, "--episodes", "15", "--threads", "1", "--json", str(out)]) == 0
    report = json.loads(out.read_text())
    assert (report["schema_version"], report["kind"], report["scenario"]) == (1, "tuning", DRIVE)
    rows = report["rows"]
    assert {(row["detector"], row["response"]) for row in rows} == {
        (detector, response)
        for detector in (WINDOWED, SIGNED)
        for reuse in ("", "reuse=5", "reuse=12")
        for response in (
            f"exclude{':' if reuse else ''}{reuse}",
            f"exclude-and-backtrack:20{',' if reuse else ''}{reuse}",
            f"onset-depth{':' if reuse else ''}{reuse}",
        )
    }
    errors = [row["mean_error_m"] for row in rows]
    assert errors == sorted(errors)
    scenario = make_scenario(DRIVE)
    detectors = tuple(calibrated_all([make_detector(name) for name in ("snapshot", WINDOWED, SIGNED)], scenario))
    best = make_response(rows[0]["response"])
    games = play_response(World(scenario, "training", 0.5, detectors), rows[0]["detector"], best, 15, tune.SEED)
    assert math.isclose(games.error.mean(), errors[0])
    *lines, told = capsys.readouterr().out.splitlines()
    assert told == f"rows in {out}"
    assert f"{DRIVE}: best of 18 defenders, 15 games each" in lines[0]
    assert all(len(line) <= 100 for line in lines)
    assert len(lines) == 2 + 12
