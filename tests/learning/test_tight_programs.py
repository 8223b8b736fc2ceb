"""The training programs on ranges: four rates for the spoofer, satellites for the defender, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.evaluation import defenders
from spoofgym.learning import defender, defender_ppo, imitation, spoofer
from spoofgym.learning.defender_ppo import DefenderPolicy
from spoofgym.learning.imitation import Teacher
from spoofgym.policies import baselines
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.studies import wrong_shadow
from spoofgym.studies.evaluate import defenders as evaluate_defenders
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers

SCENARIO = "kujur-flight:horizon=44,onset=60"
WINDOWED = "windowed:n=5,p_fa=1e-4"


def told(capsys: Any) -> str:
    return " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_a_spoofer_is_trained_and_evaluated(tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """On real alarms: their probability is not known. Random rates are caught, and no optimum is told."""
    monkeypatch.setattr(baselines, "SEARCH_EPISODES", 20)
    monkeypatch.setattr(baselines, "SEARCH_ROUNDS", 1)
    folder = tmp_path / "run"
    assert spoofer.main(["--scenario", SCENARIO, "--steps", "2000", "--out", str(folder)]) == 0
    policy = LearnedSpoofer.load(folder)
    assert policy.act(np.zeros((2, len(policy.layout)), dtype=np.float32)).shape == (2, 4)
    assert "mean clock error" in policy.layout
    arguments = ["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "20", "--threads", "1"]
    capsys.readouterr()
    assert evaluate_spoofers.main([*arguments, "--json", "-"]) == 0
    rows = {row["attacker"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert rows["random"]["detection_probability"] == 1.0
    assert rows["run"]["episodes"] == 20
    assert all(row["fraction_of_optimum"] is None for row in rows.values())
    assert rows["closed-form"]["mean_undetected_error_m"] is None


@pytest.mark.slow
def test_a_defender_is_taught_trained_and_evaluated(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(defender_ppo, "TEACHING_LANES", 4)
    monkeypatch.setattr(imitation, "FEW", 1)
    monkeypatch.setattr(imitation, "MANY", 1)
    folder = tmp_path / "run"
    short = ["--detector", "snapshot", "--detector", "separation-bank:n=20", "--lanes", "4", "--critic-games", "1"]
    given = ["--scenario", SCENARIO, *short, "--validation-episodes", "5", "--steps", "176", "--out", str(folder)]
    assert defender.main(given) == 0
    policy = LearnedDefender.load(folder)
    assert (policy.slots, policy.depths) == (8, 5)
    actions = policy.act(np.random.default_rng(0).uniform(-1, 1, (50, len(policy.layout))).astype(np.float32))
    assert actions.shape == (50, 10)
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ("snapshot", WINDOWED))
    monkeypatch.setattr(defenders, "PUBLISHED", ())
    monkeypatch.setattr(defenders, "tuned_for", lambda scenario: [])
    capsys.readouterr()
    arguments = ["--scenario", SCENARIO, "--defender", str(folder), "--episodes", "8", "--threads", "1"]
    assert evaluate_defenders.main([*arguments, "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {"run", "never", "always"} <= {row["defender"] for row in rows}
    # a policy that sees ranges has nothing to see in fixes
    assert evaluate_defenders.main(["--scenario", SCENARIO + ",coupling=loose", *arguments[2:]]) == 2
    assert "'separation-bank:n=20' needs ranges to satellites" in told(capsys)


def test_a_classical_teacher_leaves_no_satellite_out() -> None:
    game = DefenderGame(DefenderConfig(scenario=SCENARIO, detectors="snapshot"), 3)
    game.reset(np.arange(3))
    action = Teacher(2, 5).act(game)
    assert action.tolist() == [[0, 2, *[0] * 8]] * 3
    assert game.step(action).left_out.tolist() == [0, 0, 0]


def test_a_choice_that_is_not_read_has_no_probability() -> None:
    """Of use or exclude always; of the depth where exclusion begins; of a satellite in view where the epoch is used."""
    space = spaces.MultiDiscrete([2, 5, 2, 2])
    policy = DefenderPolicy(
        spaces.Box(-1.0, 1.0, (6,), np.float32), space, lambda _: 1e-3, width=6, hidden=8, excluding=3, slots=(4, 5)
    )
    rng = np.random.default_rng(0)
    seen = rng.uniform(-1, 1, (64, 6)).astype(np.float32)
    seen[:, 3:] = rng.integers(2, size=(64, 3))
    actions = rng.integers(space.nvec, size=(64, 4))
    _, log_probability, entropy = policy.evaluate_actions(torch.as_tensor(seen), torch.as_tensor(actions))
    logits = policy.action_net(policy.mlp_extractor.forward_actor(torch.as_tensor(seen)))
    parts = [part.log_softmax(dim=1).detach().numpy() for part in logits.split([2, 5, 2, 2], dim=1)]
    for row in range(64):
        excludes = actions[row, 0] == 1
        read = [True, excludes and not seen[row, 3], *(not excludes and seen[row, slot] > 0 for slot in (4, 5))]
        logs = [part[row, actions[row, place]] for place, part in enumerate(parts)]
        spread = [-float(np.sum(np.exp(part[row]) * part[row])) for part in parts]
        assert log_probability[row].item() == pytest.approx(sum(v for v, r in zip(logs, read, strict=True) if r), 1e-5)
        assert entropy[row].item() == pytest.approx(sum(v for v, r in zip(spread, read, strict=True) if r), 1e-5)


def test_what_ranges_do_not_offer_is_refused(tmp_path: Path, capsys: Any) -> None:
    out = ["--out", str(tmp_path / "run")]
    assert spoofer.main(["--scenario", SCENARIO, "--action", "innovation", *out]) == 2
    assert "action 'innovation' is for filters on fixes" in told(capsys)
    assert spoofer.main(["--scenario", SCENARIO, "--shadow", "kujur-flight:horizon=50", *out]) == 2
    assert "does not fit the game" in told(capsys)
    assert wrong_shadow.main(["--scenario", SCENARIO]) == 2
    assert "is none with simulated fixes (coupling=loose)" in told(capsys)
    assert defender.main(["--scenario", "kujur-flight:horizon=20,onset=60", "--detector", "snapshot", *out]) == 2
    assert "needs a game of more than 20 s" in told(capsys)
