"""The recipe of an agent asks for the very run that trained it."""

from pathlib import Path

import pytest

pytest.importorskip("torch")

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.learning import again, defender, defender_ppo, ppo, spoofer
from spoofgym.learning.run_folder import Run
from spoofgym.policies.recipe import Recipe
from spoofgym.studies.export import recipe_of


@pytest.mark.parametrize(
    ("module", "run"),
    [
        (
            spoofer,
            Run(SpooferConfig(scenario="foi-drive", knowledge="full", frames=3), ppo.Settings(), 4, 5000),
        ),
        (
            defender,
            Run(
                DefenderConfig(scenario="liu-flight", attacks="held-out", detectors=("snapshot", "windowed:n=5")),
                defender_ppo.Settings(lanes=64),
                7,
                9000,
            ),
        ),
        (
            defender,
            Run(
                DefenderConfig(detectors=("snapshot",), bank="multiple-hypothesis:hidden=0"),
                defender_ppo.Settings(),
                0,
                9000,
            ),
        ),
    ],
)
def test_the_options_of_a_recipe_are_the_run(module, run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = module.__name__.rpartition(".")[2]
    recipe_of(kind, run.content()).write(tmp_path)
    asked = []

    def main(arguments: list[str]) -> int:
        given = vars(module.parser().parse_args(arguments))
        assert (given.pop("out"), given.pop("resume")) == (tmp_path / "out", False)
        asked.append(module.asked_run(given))
        return 0

    monkeypatch.setattr(module, "main", main)
    assert again.main([str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    assert asked == [run]


def test_an_agent_without_a_recipe_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert again.main([str(tmp_path)]) == 2
    assert "has no recipe.toml: it cannot be trained again" in capsys.readouterr().err


def test_a_recipe_with_an_unknown_option_names_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Recipe("spoofgym.learning.spoofer", {"sed": 0}).write(tmp_path)
    assert again.main([str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert f"{tmp_path / 'recipe.toml'}: spoofgym.learning.spoofer has no option sed" in capsys.readouterr().err
