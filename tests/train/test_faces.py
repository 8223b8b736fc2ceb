"""Training programs of a checkout are those of the package, and commands that have moved say where."""

import importlib
import re
import runpy
import sys
from pathlib import Path

import pytest

from spoofgym.cli.commands import COMMANDS, find, groups
from spoofgym.studies.evaluate.__main__ import new_name

ROOT = Path(__file__).parents[2]
MOVED = {
    "train.evaluate": "evaluate",
    "train.tune": "tune",
    "train.wrong_shadow": "study wrong-shadow",
    "spoofgym.evaluation.acna_study": "study acna",
    "spoofgym.evaluation.recorded_ranges": "study recorded-ranges",
    "spoofgym.studies.evaluate": "evaluate spoofers",
    "spoofgym.studies.duel_bound": "bound duel",
    "spoofgym.learning.exploit": "exploit",
}


@pytest.mark.parametrize("name", ["spoofer", "defender", "league"])
def test_a_face_is_the_program_of_the_package(name):
    face = importlib.import_module(f"train.{name}")
    assert face.main is importlib.import_module(f"spoofgym.learning.{name}").main


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_a_moved_command_says_where_it_is(old, new, monkeypatch, capsys):
    """As ``python -m`` runs it."""
    monkeypatch.setattr(sys, "argv", [old, "--scenario", "liu-flight"])
    for module in (old, f"{old}.__main__"):
        if not hasattr(sys.modules.get(module), "__path__"):
            monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(SystemExit) as end:
        runpy.run_module(old, run_name="__main__", alter_sys=True)
    assert (end.value.code, *capsys.readouterr()) == (2, "", f"error: this command has moved: spoofgym {new}\n")
    assert find(new.split()) is not None or new in groups()


def test_every_program_of_the_package_says_its_new_name():
    """Their own modules hold the names, so that no old spelling runs or ends without a word."""
    for command in COMMANDS:
        path = ROOT / f"{command.module.replace('.', '/')}.py"
        if re.match(r"spoofgym\.(studies|learning)\.(?!evaluate)", command.module):
            assert re.search(r'sys\.exit\(moved\("spoofgym (.+)"\)\)', path.read_text())[1] in command.parser().prog


@pytest.mark.parametrize(
    ("arguments", "new"),
    [
        (["--matrix", "--arl0", "300"], "matrix"),
        (["--defender=runs/d"], "evaluate defenders"),
        (["--scenario", "recorded:x", "--attack", "ramp:1"], "evaluate recorded FOLDER"),
        (["--attacker", "runs/x"], "evaluate spoofers"),
    ],
)
def test_the_program_that_did_four_things_names_the_one_that_is_meant(arguments, new):
    assert new_name(arguments) == f"spoofgym {new}"
