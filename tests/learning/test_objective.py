"""A spoofer that is paid for the vehicle learns to lead it off its path; programs take objective and payoffs."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from spoofgym.envs.trained import trained_on
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.learning import defender_ppo, exploit, league, ppo, spoofer
from spoofgym.learning.best_response import BestResponse
from spoofgym.policies.learned import LearnedSpoofer

DRIVE = "foi-drive:horizon=12,guidance=first-order:1"
GAMES = 400
SHORT = ["--scenario", DRIVE.replace("12", "30"), "--games", "20", "--detector", "snapshot"]


def deviations(act, objective: str) -> np.ndarray:
    """What each of many games has paid at its end, m."""
    lanes = SpooferVectorEnv(GAMES, scenario=DRIVE, detector="snapshot:threshold=60", objective=objective)
    observation, _ = lanes.reset(seed=100)
    paid, over = np.zeros(GAMES), np.zeros(GAMES, dtype=bool)
    for _ in range(12):
        observation, reward, terminated, *_ = lanes.step(act(observation))
        paid += np.where(over, 0.0, reward)
        over |= terminated
    return paid * lanes.game.scenario.error_scale


@pytest.mark.parametrize("objective", ["deviation", "target:0/-30"])
def test_a_short_training_beats_chance(objective: str, tmp_path: Path) -> None:
    """By ten standard errors of the difference, so that chance in the games does not decide."""
    folder = tmp_path / "run"
    options = ["--scenario", DRIVE, "--detector", "snapshot:threshold=60", "--objective", objective, "--steps", "8000"]
    assert spoofer.main([*options, "--lanes", "64", "--trials", "1", "--out", str(folder)]) == 0
    assert json.loads((folder / "config.json").read_text())["environment"]["objective"] == objective
    policy, rng = LearnedSpoofer.load(folder), np.random.default_rng(0)
    assert trained_on(policy).objective == objective
    learned = deviations(policy.act, objective)
    chance = deviations(lambda _: rng.uniform(-1.0, 1.0, (GAMES, 3)).astype(np.float32), objective)
    assert learned.mean() - chance.mean() > 10.0 * (learned - chance).std() / np.sqrt(GAMES)


def test_an_objective_is_refused_where_it_does_not_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "run")]
    assert spoofer.main(["--objective", "deviation", *out]) == 2
    assert "add guidance=first-order:2 to the scenario" in " ".join(capsys.readouterr().err.split())
    assert spoofer.main(["--scenario", DRIVE, "--objective", "target:4", *out]) == 2
    assert "needs EAST/NORTH in m" in " ".join(capsys.readouterr().err.split())
    assert spoofer.main(["--scenario", DRIVE, "--objective", "deviation", "--defender", "exclude", *out]) == 2
    assert "what a duel is played for is its --payoff" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()


def test_a_league_is_played_for_the_deviation(tmp_path: Path) -> None:
    command = [*SHORT, "--payoff", "deviation", "--rounds", "0", "--workers", "1", "--out", str(tmp_path / "league")]
    players = ["--spoofer", "ramp:2,direction=0", "--spoofer", "none", "--defender", "always-use"]
    players += ["--defender", "always-exclude"]
    assert league.main([*command, *players, "--resamples", "20", "--json", str(tmp_path / "out.json")]) == 0
    (found,) = json.loads((tmp_path / "out.json").read_text())["results"]
    ramp, nobody = found["mean"]
    assert ramp[0] > 2.0 * nobody[0]


def test_exploitability_is_found_for_a_target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = (ppo.Settings(lanes=4, trials=1), defender_ppo.Settings(lanes=4))
    monkeypatch.setattr(exploit, "BestResponse", lambda *given: BestResponse(*given[:2], 300, 300, *settings))
    files = ["--out", str(tmp_path / "run"), "--json", str(tmp_path / "out.json"), "--workers", "1", "--seeds", "1"]
    assert exploit.main([*SHORT, "--payoff", "target:0/-30", "--defender", "snapshot > exclude", *files]) == 0
    report = json.loads((tmp_path / "out.json").read_text())
    assert report["payoff"] == "target:0/-30"
    assert report["rows"][0]["worst"]["harm"] > 0.0
