"""The program that plays a league, with real trainings."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("torch")

from spoofgym.learning import defender_ppo, league, ppo
from spoofgym.learning.best_response import BestResponse
from spoofgym.learning.double_oracle import ROUNDS_FILE
from spoofgym.policies.learned import load_policy

SHORT = ["--scenario", "foi-drive:horizon=60", "--games", "20", "--rounds", "1", "--detector", "snapshot"]
PLAYERS = ["--spoofer", "ramp:2", "--spoofer", "unseen:16", "--defender", "snapshot > exclude:reuse=5"]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trainings of a second."""
    settings = (ppo.Settings(lanes=4, trials=1), defender_ppo.Settings(lanes=4, imitate=False, validation_episodes=10))

    def trainer(*arguments: object) -> BestResponse:
        return BestResponse(*arguments[:2], 500, 500, *settings)  # type: ignore[arg-type]

    monkeypatch.setattr(league, "BestResponse", trainer)


@pytest.mark.usefixtures("quick")
def test_a_league_trains_compares_and_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = ["--json", str(tmp_path / "out.json"), "--figure", str(tmp_path / "out.png")]
    command = [*SHORT, *PLAYERS, "--resamples", "20", "--workers", "1", "--out", str(tmp_path / "league"), *files]
    assert league.main(command) == 0
    printed = capsys.readouterr()
    assert "worst case found" in printed.out
    assert "a spoofer is trained against" in printed.err
    report = json.loads((tmp_path / "out.json").read_text())
    first = (tmp_path / "league" / ROUNDS_FILE).read_text()
    assert report["results"] == json.loads(first)
    assert set(report["results"][0]["gains"]) == {"spoofer", "defender"}
    for name in ("spoofer-1", "defender-1"):
        assert load_policy(tmp_path / "league" / "policies" / name)
    assert league.main(command) == 0  # nothing is left to do
    assert (tmp_path / "league" / ROUNDS_FILE).read_text() == first
    assert " is trained against " in capsys.readouterr().err
    assert league.main([*command, "--seed", "1"]) == 2
    assert "holds another league: its seed is 0, not 1" in capsys.readouterr().err


def test_a_run_of_another_training_is_refused(tmp_path: Path) -> None:
    options = league.parser().parse_args([*SHORT, *PLAYERS])
    duel = league.settings_of(options).duel
    settings = (ppo.Settings(lanes=4, trials=1), defender_ppo.Settings(lanes=4, imitate=False, validation_episodes=10))
    train = BestResponse(duel, False, 200, 200, *settings)
    assert train("spoofer", "always-use", tmp_path / "x", 1) == f"policy:{tmp_path / 'x'}"
    another = "holds another training than what is asked for: its environment.defender is 'always-use', not 'alw"
    with pytest.raises(ValueError, match=another):
        train("spoofer", "always-exclude", tmp_path / "x", 1)
    with pytest.raises(ValueError, match="its steps is 200, not 300"):
        replace(train, spoofer_steps=300)("spoofer", "always-use", tmp_path / "x", 1)
    more_threads = replace(train, duel=replace(duel, threads=2))
    assert more_threads("spoofer", "always-use", tmp_path / "x", 1) == f"policy:{tmp_path / 'x'}"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--scenario", "moon"], "unknown scenario 'moon'"),
        (["--payoff", "most"], "unknown payoff 'most'"),
        (["--defender", "nobody"], "unknown response 'nobody'"),
        (["--spoofer", "nobody"], "unknown attack 'nobody'"),
        (["--meta", "best"], "--meta"),
        (["--clean", "2"], "--clean"),
        (["--engine", "ray", "--workers", "2"], "leave workers=2 out"),
        (["--address", "ray://there:1"], "is of the engine 'ray'"),
    ],
)
def test_bad_options_are_one_line(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [*SHORT, "--spoofer", "ramp:2", "--defender", "snapshot > exclude", "--out", str(tmp_path / "l"), *options]
    try:
        status = league.main(given)
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    printed = capsys.readouterr().err.strip().splitlines()
    assert message in printed[-1]


def test_the_default_players_fit_their_scenarios() -> None:
    for scenario in ("foi-drive", "liu-flight:horizon=250,imu=tactical"):
        settings = league.settings_of(league.parser().parse_args(["--scenario", scenario]))
        assert len(settings.spoofers) >= 6
        assert len(settings.defenders) >= 12
        assert {"always-exclude", "snapshot > px4-auto"} <= set(settings.defenders)
        assert "signed-mean:n=5" in settings.duel.detectors
