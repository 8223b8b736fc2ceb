"""The programs of the defender as a user runs them: a short training, its evaluation, the tuning, bad input.

The detectors of an evaluation are replaced by some whose thresholds are given, so that nothing is calibrated.
"""

import json
import math
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.envs.trained import defender_config
from spoofgym.evaluation import defenders
from spoofgym.evaluation.defence import World, play_policy, play_response
from spoofgym.learning import defender, defender_ppo, imitation
from spoofgym.learning.defender import VALIDATION_FILE, VALIDATION_SEED
from spoofgym.learning.run_folder import CHECKPOINT_FILE
from spoofgym.policies import classical as listed
from spoofgym.policies.learned import CONFIG_FILE, POLICY_FILE, LearnedDefender
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.studies import evaluate, tune

pytestmark = pytest.mark.xdist_group("defender programs")  # one worker: the run folder is made once

SCENARIO = "foi-drive:horizon=60"
SHORT = ["--scenario", SCENARIO, "--detector", "snapshot", "--lanes", "4", "--validation-episodes", "20"]
SHORT += ["--critic-games", "1"]
STEPS = 1200
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


@pytest.fixture(autouse=True, scope="module")
def _few_lessons():
    """Imitation goes through all of its steps, in few games: no test here asks what is learned in it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(defender_ppo, "TEACHING_LANES", 8)
        for name, value in (("FEW", 1), ("MANY", 2), ("PASSES", 5)):
            patch.setattr(imitation, name, value)
        yield


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "short"
    assert defender.main([*SHORT, "--steps", str(STEPS), "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def world(monkeypatch):
    """What `spoofgym.evaluation.defenders` plays, without a detector that has to be calibrated."""
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ("snapshot", WINDOWED, SIGNED))
    monkeypatch.setattr(defenders, "PUBLISHED", PUBLISHED)
    monkeypatch.setattr(defenders, "tuned_for", lambda scenario: TUNED)


def evaluated(capsys, *arguments):
    assert evaluate.main(["--scenario", SCENARIO, "--threads", "1", *arguments, "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


def row_of(report, name, attack):
    (row,) = [row for row in report["rows"] if (row["defender"], row["attack"]) == (name, attack)]
    return row


# --- training ---------------------------------------------------------------------------------------------------------


def test_training_leaves_a_policy_and_says_how(run):
    config = json.loads((run / CONFIG_FILE).read_text())
    assert config["environment"]["scenario"] == SCENARIO
    assert config["environment"]["attacks"] == "training"
    assert config["environment"]["detectors"] == ["snapshot"]
    assert (config["learner"]["lanes"], config["learner"]["validation_episodes"]) == (4, 20)
    assert (config["seed"], config["steps"]) == (0, STEPS)
    policy = LearnedDefender.load(run)
    actions = policy.act(np.zeros((2, len(policy.layout)), dtype=np.float32))
    assert actions.shape == (2, 2)
    assert (run / CHECKPOINT_FILE).is_file()
    assert list((run / "tensorboard").rglob("events.*"))


def test_the_policy_that_is_kept_is_the_best_in_validation(run):
    """Played again on the validation games it has the least of the errors that stand in the run folder, exactly."""
    validation = json.loads((run / VALIDATION_FILE).read_text())
    assert validation[-1]["steps"] >= STEPS
    assert len(validation) > 2
    scenario = make_scenario(SCENARIO)
    world = World(scenario, "training", 0.5, tuple(calibrated_all([make_detector("snapshot")], scenario)))
    policy = LearnedDefender.load(run)
    games = play_policy(world, defender_config(policy), policy.act, 20, VALIDATION_SEED)
    assert games.error.mean() == min(row["mean_error_m"] for row in validation)


def test_a_run_folder_is_not_overwritten(run, capsys):
    before = (run / POLICY_FILE).read_bytes()
    assert defender.main([*SHORT, "--out", str(run)]) == 2
    assert "already holds a run" in " ".join(capsys.readouterr().err.split())
    assert (run / POLICY_FILE).read_bytes() == before


def test_a_run_can_be_resumed(run, tmp_path, capsys):
    folder = tmp_path / "resumed"
    shutil.copytree(run, folder)
    before = json.loads((folder / VALIDATION_FILE).read_text())
    checkpoint = (folder / CHECKPOINT_FILE).read_bytes()
    assert defender.main([*SHORT, "--steps", str(2 * STEPS), "--out", str(folder), "--resume"]) == 0
    after = json.loads((folder / VALIDATION_FILE).read_text())
    assert after[: len(before)] == before
    assert before[-1]["steps"] < after[-1]["steps"] < 2 * STEPS + 4 * 60
    assert (folder / CHECKPOINT_FILE).read_bytes() != checkpoint
    assert f"trained {after[-1]['steps'] - before[-1]['steps']:,} steps" in " ".join(capsys.readouterr().err.split())
    LearnedDefender.load(folder)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--steps", "9999", "--seed", "7"], "a resumed run keeps its settings: --seed 7 was given, the run has 0"),
        (["--steps", "9999", "--attacks", "held-out"], "--attacks held-out was given, the run has training"),
        (["--steps", "9999", "--gamma", "0.5"], "--gamma 0.5 was given, the run has 0.99"),
        ([], "steps already: give more than that by --steps"),
    ],
)
def test_a_resumed_run_refuses_other_settings_and_stays_as_it_is(run, tmp_path, capsys, arguments, message):
    folder = tmp_path / "resumed"
    shutil.copytree(run, folder)
    kept = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert defender.main([*arguments, "--out", str(folder), "--resume"]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == kept


def test_a_run_that_was_interrupted_at_its_beginning_starts_again(run, tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    folder = tmp_path / "short"
    with monkeypatch.context() as patch:
        patch.setattr(defender, "begin", interrupted)
        assert defender.main([*SHORT, "--steps", str(STEPS), "--out", str(folder)]) == 130
    assert "go on with: python -m spoofgym.learning.defender --resume" in capsys.readouterr().err
    LearnedDefender.load(folder)
    assert defender.main(["--resume", "--out", str(folder)]) == 0
    assert (folder / VALIDATION_FILE).read_bytes() == (run / VALIDATION_FILE).read_bytes()


def test_equal_seeds_train_equal_policies(run, tmp_path):
    folder = tmp_path / "again"
    assert defender.main([*SHORT, "--steps", str(STEPS), "--out", str(folder)]) == 0
    assert json.loads((folder / VALIDATION_FILE).read_text()) == json.loads((run / VALIDATION_FILE).read_text())


@pytest.mark.slow
def test_interruption_leaves_a_usable_policy(tmp_path, child):
    folder = tmp_path / "interrupted"
    begun = ["--imitate", "false", "--steps", "100000000", "--out", str(folder)]  # what interrupts imitation is above
    command = [sys.executable, "-m", "spoofgym.learning.defender", *SHORT, *begun]
    process = child(command, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 600
    while not (folder / CHECKPOINT_FILE).exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.2)
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "--resume" in errors
    assert (folder / CHECKPOINT_FILE).is_file()
    assert json.loads((folder / VALIDATION_FILE).read_text())
    LearnedDefender.load(folder)


# --- evaluation -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("world")
def test_json_alone_on_stdout(run, capsys):
    report = evaluated(capsys, "--defender", str(run), "--defender", GIVEN, "--episodes", "40")
    assert (report["schema_version"], report["kind"]) == (1, "defenders")
    assert (report["scenario"], report["fidelity"]) == (SCENARIO, "linear")
    assert report["kinds"] == {**DEFENDERS, GIVEN: "given", "short": "learned"}
    assert all(set(row) == ROW_KEYS for row in report["rows"])
    for held_out, attacks in ATTACKS.items():
        for name in report["kinds"]:
            rows = [row for row in report["rows"] if (row["defender"], row["held_out"]) == (name, held_out)]
            assert {row["attack"] for row in rows} == attacks
            episodes = {row["attack"]: row["episodes"] for row in rows}
            pooled = episodes.pop("all-held-out" if held_out else "all-training")
            assert pooled == sum(episodes.values()) == 40
            means = [row["mean_error_m"] * row["episodes"] for row in rows if not row["attack"].startswith("all-")]
            assert rows[0]["mean_error_m"] == pytest.approx(sum(means) / 40)


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
    assert evaluate.main([*few, "--defender", "snapshot > exclude", "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["kinds"] == {**DEFENDERS, "snapshot > exclude": "given"}
    (line,) = [line for line in printed.err.splitlines() if line.startswith("left out")]
    assert line.endswith(f"{robot} does not give what they need: foi-relative-b20 ({relative})")
    assert evaluate.main([*few, "--defender", f"{relative} > exclude"]) == 2
    assert "needs inertial solution" in " ".join(capsys.readouterr().err.split())


@pytest.mark.usefixtures("world")
def test_comparisons_are_paired(run, tmp_path, capsys):
    other = tmp_path / "other"
    shutil.copytree(run, other)
    report = evaluated(
        capsys, "--defender", str(run), "--defender", str(other), "--episodes", "30", "--population", "training"
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
    scenario = make_scenario(SCENARIO)
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
    assert defenders.closed_gap(learned, 1.0, 0.6) == pytest.approx(share)
    assert defenders.closed_gap(learned, 0.6, 0.6) is None


@pytest.mark.usefixtures("world")
def test_tables_fit_a_terminal_and_a_figure_is_drawn(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    figure, out = tmp_path / "sub" / "out.png", tmp_path / "out.json"
    arguments = ["--defender", str(run), "--defender", GIVEN, "--episodes", "12", "--json", str(out)]
    assert evaluate.main(["--scenario", SCENARIO, "--threads", "1", *arguments, "--figure", str(figure)]) == 0
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
        (["--defender", "nowhere"], "--defender 'nowhere' is neither a run folder nor 'detector > response'"),
        (["--defender", "> exclude"], "spelled 'detector > response', e.g. 'snapshot > exclude', got '> exclude'"),
        (["--defender", "oracle > exclude"], "unknown detector 'oracle'"),
        (["--defender", "snapshot > pray"], "unknown response 'pray'"),
        (["--defender", GIVEN, "--attack", "ramp:0.5"], "it goes without --attacker, --attack and --detector"),
        (["--defender", GIVEN, "--detector", "snapshot"], "it goes without --attacker, --attack and --detector"),
        (["--scenario", "moon", "--defender", GIVEN], "unknown scenario 'moon'"),
    ],
)
def test_bad_input_of_an_evaluation_is_told(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert evaluate.main(["--scenario", SCENARIO, "--episodes", "2", "--threads", "1", *arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.usefixtures("world")
def test_policies_that_cannot_be_told_apart_or_do_not_fit(run, tmp_path, capsys):
    arguments = ["--scenario", SCENARIO, "--episodes", "2", "--threads", "1", "--population", "training"]
    assert evaluate.main([*arguments, "--defender", str(run), "--defender", str(run)]) == 2
    assert "run folders of one name cannot be told apart: short, short" in " ".join(capsys.readouterr().err.split())

    policy = LearnedDefender.load(run)
    folder = tmp_path / "odd"
    shutil.copytree(run, folder)
    replace(policy, layout=("speed", *policy.layout[1:])).save(folder)
    assert evaluate.main([*arguments, "--defender", str(folder)]) == 2
    assert "policy 'odd' was trained for another observation: entry 0 was 'speed'" in " ".join(
        capsys.readouterr().err.split()
    )
    weights, biases = ((*parts[:-1], parts[-1][:-1]) for parts in (policy.weights, policy.biases))
    replace(policy, weights=weights, biases=biases).save(folder)
    assert evaluate.main([*arguments, "--defender", str(folder)]) == 2
    assert "policy 'odd' was trained on 10 depths, the game has 11" in " ".join(capsys.readouterr().err.split())


# --- tuning and arguments ---------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("world")
def test_tuning_ranks_the_grid(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(listed, "GRID_DETECTORS", (WINDOWED, SIGNED))
    monkeypatch.setattr(listed, "GRID_DEPTHS", (0, 20))
    monkeypatch.setenv("COLUMNS", "100")
    out = tmp_path / "sub" / "out.json"
    assert tune.main(["--scenario", SCENARIO, "--episodes", "15", "--threads", "1", "--json", str(out)]) == 0
    report = json.loads(out.read_text())
    assert (report["schema_version"], report["kind"], report["scenario"]) == (1, "tuning", SCENARIO)
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
    scenario = make_scenario(SCENARIO)
    detectors = tuple(calibrated_all([make_detector(name) for name in ("snapshot", WINDOWED, SIGNED)], scenario))
    best = make_response(rows[0]["response"])
    games = play_response(World(scenario, "training", 0.5, detectors), rows[0]["detector"], best, 15, tune.SEED)
    assert math.isclose(games.error.mean(), errors[0])
    lines = capsys.readouterr().out.splitlines()
    assert f"{SCENARIO}: best of 18 defenders, 15 games each" in lines[0]
    assert all(len(line) <= 100 for line in lines)
    assert len(lines) == 2 + 12


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        (defender, ["--scenario", "moon"], "unknown scenario 'moon'; valid names: "),
        (defender, ["--detector", "oracle"], "unknown detector 'oracle'; valid names: "),
        (defender, ["--detector", "snapshot", "--attacks", "rain"], "unknown attack 'rain'; valid names: "),
        (defender, ["--detector", "snapshot", "--detector", "snapshot"], "each detector can be given once only"),
        (defender, ["--scenario", "foi-drive:horizon=0"], "horizon must be a whole number, 1 or more, got 0"),
        (defender, ["--resume", "--out", "nowhere"], "nowhere holds no run to resume: it has no config.json"),
        (tune, ["--scenario", "moon"], "unknown scenario 'moon'; valid names: "),
    ],
)
def test_bad_input_is_told_and_nothing_is_written(program, arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert program.main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.rglob("*.npz")) == []
    assert list(tmp_path.rglob("*.json")) == []


@pytest.mark.parametrize(
    ("program", "option", "value"),
    [
        (defender, "--steps", "0"),
        (defender, "--seed", "-1"),
        (defender, "--privileged", "perhaps"),
        (defender, "--fidelity", "cubic"),
        (evaluate, "--population", "everyone"),
        (tune, "--episodes", "none"),
    ],
)
def test_arguments_are_checked_at_once(program, option, value, capsys):
    with pytest.raises(SystemExit):
        program.main([option, value])
    assert value in capsys.readouterr().err
