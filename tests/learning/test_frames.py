"""Spoofers with a memory are trained, kept and evaluated like those without; run folders without one still load."""

import json

import numpy as np
import pytest

from spoofgym.envs.trained import spoofer_config
from spoofgym.learning import spoofer
from spoofgym.policies.learned import CONFIG_FILE, LearnedSpoofer
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers

SHORT = ["--scenario", "liu-flight:horizon=20", "--threads", "1"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "memory"
    assert spoofer.main([*SHORT, "--frames", "3", "--steps", "6000", "--out", str(folder)]) == 0
    return folder


def test_the_run_folder_keeps_the_memory(run):
    assert json.loads((run / CONFIG_FILE).read_text())["environment"]["frames"] == 3
    policy = LearnedSpoofer.load(run)
    assert spoofer_config(policy).frames == 3
    assert policy.layout[20] == "offset east, 1 epoch ago"
    assert policy.act(np.zeros((2, 60), dtype=np.float32)).shape == (2, 3)


def test_it_is_evaluated_in_a_game_with_its_memory(run, capsys):
    """6 sigma of 1000 games: false failure below 1e-8; the filter's noise in the norm adds up to its own size."""
    assert evaluate_spoofers.main([*SHORT, "--attacker", str(run), "--episodes", "1000", "--json", "-"]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][-1]
    assert row["attacker"] == "memory"
    standard_error = (row["ci95_m"][1] - row["ci95_m"][0]) / (2 * 1.96)
    assert abs(row["mean_undetected_error_m"] - row["exact_undetected_error_m"]) < 6 * standard_error + 1.0


def test_it_can_be_resumed(run):
    assert spoofer.main(["--steps", "20000", "--out", str(run), "--resume"]) == 0
    assert LearnedSpoofer.load(run).configuration["frames"] == 3


def test_a_run_folder_without_memory_and_shadow_still_loads(run, tmp_path):
    content = json.loads((run / CONFIG_FILE).read_text())
    for key in ("frames", "shadow"):
        del content["environment"][key]
    (tmp_path / CONFIG_FILE).write_text(json.dumps(content))
    (tmp_path / "policy.npz").write_bytes((run / "policy.npz").read_bytes())
    config = spoofer_config(LearnedSpoofer.load(tmp_path))
    assert (config.frames, config.shadow) == (1, None)
