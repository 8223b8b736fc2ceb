"""Training on one side of the duel, against any player on the other: what is left can play, be exported and resumed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("torch")

from spoofgym.envs.duel_config import DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.trained import trained_on
from spoofgym.evaluation.duels import DuelConfig, play_cell
from spoofgym.learning import defender, spoofer
from spoofgym.learning.run_folder import RunFolder, given_options
from spoofgym.learning.spoofer import Settings
from spoofgym.policies.learned import load_policy
from spoofgym.studies import export

DRIVE = "foi-drive:horizon=60"
DETECTORS = ("--detector", "snapshot", "--detector", "windowed:n=5,threshold=60")
QUICK = ("--lanes", "8", "--imitate", "false", "--validation-episodes", "20")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A spoofer that was trained against a classical defender, and a defender that was trained against it."""
    folder = tmp_path_factory.mktemp("duel")
    arguments = ["--scenario", DRIVE, "--knowledge", "full", "--defender", "windowed:n=5,threshold=60 > exclude"]
    asked = spoofer.asked_run(given_options(spoofer.parser().parse_args([*arguments, "--steps", "2000"])))
    run = replace(asked, learner=Settings(lanes=8, trials=1))
    RunFolder(folder / "x", "spoofgym.learning.spoofer", (DuelSpooferConfig,), Settings).begin(run)
    assert spoofer.main(["--resume", "--out", str(folder / "x")]) == 0
    pool = f"pool:ramp:1+policy:{folder / 'x'},weights=1+2"
    given = ["--scenario", DRIVE, "--spoofer", pool, "--payoff", "beyond:5", *DETECTORS, *QUICK, "--steps", "1000"]
    assert defender.main([*given, "--out", str(folder / "d")]) == 0
    return folder


def test_both_play_each_other(trained: Path) -> None:
    one, two = (trained_on(load_policy(trained / name)) for name in "xd")
    assert isinstance(one, DuelSpooferConfig)
    assert isinstance(two, DuelDefenderConfig)
    # what the defender follows is watched, and clean games teach a spoofer nothing
    assert one.detectors == ("snapshot", "windowed:n=5,threshold=60")
    assert (one.clean, one.sees_decisions, two.payoff) == (0.0, True, "beyond:5")
    config = DuelConfig(scenario=DRIVE, detectors=one.detectors, clean=0.0)
    cell = play_cell(config, f"policy:{trained / 'x'}", f"policy:{trained / 'd'}", 5, 1)
    assert (cell.harm > 0.0).all()


def test_validation_is_in_the_payoff_of_the_duel(trained: Path) -> None:
    rows = json.loads((trained / "d" / "validation.json").read_text())
    assert all(0.0 <= row["mean_error_m"] <= 1.0 for row in rows)


def test_it_is_exported_with_the_harm_and_a_recipe(trained: Path, tmp_path: Path) -> None:
    assert export.main([str(trained / "x"), str(tmp_path / "agent"), "--games", "10"]) == 0
    card = json.loads((tmp_path / "agent" / "card.json").read_text())
    assert card["environment"] == "spoofgym/DuelSpoofer-v0"
    assert [score["metric"] for score in card["scores"]] == ["harm"]
    recipe = export.recipe_of("spoofer", json.loads((trained / "x" / "config.json").read_text()))
    given = given_options(spoofer.parser().parse_args(recipe.arguments))
    run = RunFolder(trained / "x", "spoofgym.learning.spoofer", (DuelSpooferConfig,), Settings).run()
    assert spoofer.asked_run(given) == run


def test_a_run_can_be_lengthened(trained: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert spoofer.main(["--resume", "--out", str(trained / "x"), "--defender", "latch"]) == 2
    assert "a resumed run keeps its settings: --defender latch was given" in capsys.readouterr().err
    assert spoofer.main(["--resume", "--out", str(trained / "x"), "--steps", "4000"]) == 0


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        (spoofer, ["--payoff", "error"], "--payoff is of a duel: name the --defender, too"),
        (spoofer, ["--clean", "0.5"], "--clean is of a duel: name the --defender, too"),
        (spoofer, ["--scripted"], "--scripted is of a duel: name the --defender, too"),
        (spoofer, ["--defender", "exclude", "--clean", "1"], "--clean 1 makes every game a clean one"),
        (spoofer, ["--defender", "nobody"], "duel: defender: unknown response 'nobody'"),
        (defender, ["--payoff", "error"], "--payoff is of a duel: name the --spoofer, too"),
        (defender, ["--spoofer", "ramp:1", "--attacks", "training"], "leave --attacks out"),
    ],
)
def test_options_that_do_not_fit_are_told(program, arguments, message, tmp_path: Path, capsys) -> None:
    assert program.main([*arguments, "--out", str(tmp_path / "run")]) == 2
    assert message in capsys.readouterr().err
