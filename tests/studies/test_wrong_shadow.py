"""Spoofers whose shadow filter is not the victim's: what they are worth, and the programs that tell."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.envs.observation import spoofer_fields
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation import wrong_shadow as library
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.wrong_shadow import RIGHT, Shadow, optimum_player, policy_player, ratio_of_means, wrong_shadows
from spoofgym.learning import spoofer
from spoofgym.optimum import bounded_optimum
from spoofgym.policies.learned import CONFIG_FILE, LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import GRADES
from spoofgym.studies import wrong_shadow
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers

SCENARIO = "liu-flight:horizon=20"
WIDE, TACTICAL = f"{SCENARIO},sigma=7.4", f"{SCENARIO},imu=tactical"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run folder whose policy moves north-east at a rate that the shadow's innovation of the coming fix brakes."""
    folder = tmp_path_factory.mktemp("runs") / "braking"
    folder.mkdir()
    layout = tuple(field.name for field in spoofer_fields("shadow", 3, ("snapshot",)))
    weight = np.zeros((3, len(layout)), dtype=np.float32)
    weight[[0, 1], [11, 12]] = 0.6
    bias = np.array([0.4, 0.3, 0.0], dtype=np.float32)
    LearnedSpoofer(folder, {"knowledge": "shadow"}, layout, (weight,), (bias,)).save(folder)
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": {"knowledge": "shadow", "scenario": SCENARIO}}))
    return folder


@pytest.fixture(scope="module")
def evaluation():
    scenario = make_scenario(SCENARIO)
    detectors = [calibrated(make_detector("snapshot"), scenario)]
    return Evaluation(scenario, ("snapshot",), detectors, "linear", 3000, 0, 1, detectors[0].threshold)


def test_shadows_of_a_table_are_specifications_of_the_same_game():
    shadows = wrong_shadows(make_scenario(SCENARIO))
    assert [shadow.label for shadow in shadows] == [
        *(f"imu {name}" for name in GRADES if name != "navigation"),
        *(f"sigma x {factor}" for factor in ("0.5", "0.7", "1.4", "2")),
    ]
    built = [make_scenario(shadow.scenario) for shadow in shadows]
    assert [scenario.name for scenario in built] == [shadow.scenario for shadow in shadows]
    assert {scenario.timeline for scenario in built} == {make_scenario(SCENARIO).timeline}
    factors = [scenario.family.receiver.white_sigma[0] / 3.7 for scenario in built[-4:]]
    assert factors == pytest.approx([0.5, 0.7, 1.4, 2.0])
    again = wrong_shadows(make_scenario(f"{SCENARIO},imu=tactical,sigma=7.4"))
    assert again[0].scenario == WIDE
    assert again[-1].scenario == f"{SCENARIO},imu=tactical,sigma=14.8"


@pytest.mark.parametrize("shadow", [None, WIDE, TACTICAL])
def test_exact_value_of_a_policy_is_the_victims(folder, evaluation, shadow):
    """6 sigma of 3000 games: false failure below 1e-8; the filter's noise in the norm adds up to its own size."""
    play = policy_player(evaluation, LearnedSpoofer.load(folder))(Shadow("s", shadow))
    errors = np.where(play.episodes.detected, 0.0, play.episodes.final_error)
    assert abs(errors.mean() - play.exact) < 6 * errors.std() / np.sqrt(len(errors)) + 1.0
    assert play.exact > 2.0


def test_a_policy_with_another_shadow_plays_otherwise(folder, evaluation):
    policy = LearnedSpoofer.load(folder)
    values = [evaluation.exact(policy.with_shadow(shadow)) for shadow in (None, SCENARIO, WIDE, TACTICAL)]
    assert values[0] == values[1]
    assert len(set(values[1:])) == 3


def test_optimum_of_the_right_filter_is_the_best(evaluation):
    """By definition, and what is computed on a wrong filter is worth what its games give (6 sigma, below 1e-8)."""
    play = optimum_player(evaluation, 25.9)
    right, wrong = play(RIGHT), play(Shadow("wide", WIDE))
    scenario = make_scenario(SCENARIO)
    best = bounded_optimum(scenario.linear_model(), 25.9, np.array(scenario.drag_off_rate))
    assert right.exact == pytest.approx(best.score, rel=1e-9)
    assert wrong.exact < 0.9 * right.exact
    errors = np.where(wrong.episodes.detected, 0.0, wrong.episodes.final_error)
    assert abs(errors.mean() - wrong.exact) < 6 * errors.std() / np.sqrt(len(errors)) + 1.0


def test_a_blind_policy_keeps_its_configuration(folder):
    policy = LearnedSpoofer.load(folder)
    blind = replace(policy, configuration={"knowledge": "blind"})
    assert blind.with_shadow(WIDE) is blind
    assert spoofer_config(policy.with_shadow(WIDE).with_shadow(None)) == spoofer_config(policy)


def test_paired_ratio_covers_the_truth():
    """x = 0.8 r + noise: the interval's half is 1.96 deviations of the noise's mean over that of r, within 10 %."""
    rng = np.random.default_rng(0)
    reference = rng.gamma(4.0, 10.0, 4000)
    values = 0.8 * reference + rng.normal(0.0, 3.0, 4000)
    ratio, (low, high) = ratio_of_means(values, reference)
    deviation = 3.0 / np.sqrt(4000) / 40.0
    assert abs(ratio - 0.8) < 6 * deviation  # false failure below 1e-8
    assert 0.5 * (high - low) == pytest.approx(1.96 * deviation, rel=0.1)
    assert ratio_of_means(reference, reference) == (1.0, (1.0, 1.0))
    assert ratio_of_means(values, np.zeros(4000)) is None


def test_program(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(library, "SIGMA_FACTORS", (2.0,))
    monkeypatch.setattr(library, "GRADES", {"tactical": GRADES["tactical"]})
    out = tmp_path / "sub" / "out.json"
    arguments = ["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "200", "--threads", "1"]
    assert wrong_shadow.main([*arguments, "--json", str(out)]) == 0
    report = json.loads(out.read_text())
    assert (report["schema_version"], report["kind"]) == (1, "wrong-shadow")
    assert report["detector"]["threshold"] == 25.9
    assert [(row["attacker"], row["shadow_scenario"]) for row in report["rows"]] == [
        (name, shadow) for name in ("braking", "optimum") for shadow in (None, TACTICAL, WIDE)
    ]
    for row in report["rows"]:
        assert row["episodes"] == 200
        if row["shadow_scenario"] is None:
            assert (row["fraction_of_right"], row["fraction_ci95"]) == (1.0, [1.0, 1.0])
    table = capsys.readouterr().out
    assert all(text in table for text in ("braking", "optimum", "imu tactical", "sigma x 2"))


@pytest.mark.parametrize(
    ("detector", "told"),
    [
        ("cusum", "cusum; "),
        ("ensemble", "ensemble:snapshot"),
        (["snapshot", "windowed:n=5"], "snapshot, windowed:n=5; "),
    ],
)
def test_a_policy_that_another_detector_has_taught_is_refused(folder, tmp_path, capsys, detector, told):
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    environment = {"knowledge": "shadow", "scenario": SCENARIO, "detector": detector}
    (other / CONFIG_FILE).write_text(json.dumps({"environment": environment}))
    assert wrong_shadow.main(["--scenario", SCENARIO, "--attacker", str(other)]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert f"policy 'other' was trained against {told}" in message


def test_evaluation_replaces_the_shadow(folder, evaluation, capsys):
    arguments = ["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "50", "--threads", "1", "--json", "-"]
    assert evaluate_spoofers.main([*arguments, "--shadow", WIDE]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][-1]
    expected = evaluation.exact(LearnedSpoofer.load(folder).with_shadow(WIDE))
    assert row["exact_undetected_error_m"] == pytest.approx(expected, rel=1e-12)


def test_training_with_a_wrong_shadow_keeps_it(tmp_path):
    out = tmp_path / "run"
    arguments = ["--scenario", SCENARIO, "--shadow", WIDE, "--steps", "300", "--threads", "1", "--out", str(out)]
    assert spoofer.main(arguments) == 0
    assert json.loads((out / CONFIG_FILE).read_text())["environment"]["shadow"] == WIDE
    assert LearnedSpoofer.load(out).configuration["shadow"] == WIDE


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        (spoofer, ["--shadow", "liu-flight:horizon=20"], "epochs: 20 instead of 120"),
        (spoofer, ["--shadow", "liu-flight", "--knowledge", "blind"], "a 'blind' spoofer has no shadow filter"),
        (evaluate_spoofers, ["--shadow", "liu-flight"], "--shadow replaces the shadow filter of learned spoofers"),
        (wrong_shadow, ["--detector", "windowed:n=5,threshold=45"], "for a snapshot test on a matched filter only"),
        (wrong_shadow, ["--scenario", "liu-flight:imu=tactical"], "for a snapshot test on a matched filter only"),
        (wrong_shadow, ["--scenario", "foi-drive"], "scenario 'foi-drive' has no option 'sigma'"),
        (wrong_shadow, ["--attacker", "nowhere"], "is no run folder"),
    ],
)
def test_bad_input_is_told(program, arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert program.main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())
