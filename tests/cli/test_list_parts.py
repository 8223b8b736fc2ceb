"""`spoofgym list` tells of every part what its own documentation says, with a spelling and a command that work."""

import json
import shlex
from functools import partial

import pytest

from spoofgym import own_parts
from spoofgym.attacks import ATTACKS
from spoofgym.cli import play
from spoofgym.cli.list_parts import KINDS, main, table
from spoofgym.cli.parts import REGISTRIES, parts
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.navigation.aids import make_aids
from spoofgym.policies import published
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.studies.evaluate import recorded
from tests.run_folders import spoofer

MAKE = {"scenarios": make_scenario, "detectors": make_detector, "attacks": make_spoofer, "responses": make_response}
MAKE["aids"] = partial(make_aids, "test")

ON_A_LOG = ("recorded", "position-only", "velocity-only")
"""Attacks that need what only a log has: an attack of its own, or fixes with velocity."""


@pytest.mark.parametrize("kind", REGISTRIES)
def test_every_part_tells_what_it_is_and_can_be_built_as_spelled(kind):
    for part in parts(kind):
        assert len(part.told) > 10, part.name
        assert not part.told.endswith("al")
        if part.name != "recorded":
            MAKE[kind](part.example)
        words = shlex.split(part.command)
        if kind == "attacks" and part.name in ON_A_LOG:
            assert words[:4] == ["spoofgym", "evaluate", "recorded", "FOLDER"]
            assert recorded.parser().parse_args(words[3:]).attack == [part.example]
            continue
        assert words[:2] == ["spoofgym", "play"]
        play.seats(play.parser().parse_args(words[2:]))


def test_options_have_defaults_units_and_words():
    (ramp,) = [part for part in parts("attacks") if part.name == "ramp"]
    rate, direction, onset = ramp.options
    assert (rate.name, rate.default, rate.unit) == ("rate", "", "m/s")
    assert (direction.default, onset.default, onset.unit) == ("90", "none", "s")
    assert ramp.source == "Liu 2018, eq 14"
    told = {option.name: option.told for part in parts("responses") for option in part.options}
    assert all(told[name] for name in ("reuse", "reuse_threshold", "position_gate"))  # those of base classes, too


@pytest.mark.parametrize("columns", ["80", "40"])
@pytest.mark.parametrize("arguments", [[], ["detectors", "relative-motion"], ["scenarios", "liu-flight"]])
def test_text_fits_the_terminal(arguments, columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    assert main(arguments) == 0
    lines = capsys.readouterr().out.partition("example:")[0].splitlines()
    assert max(map(len, lines)) <= int(columns)


def test_a_line_that_a_terminal_cuts_ends_after_a_word(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    rows = [("ramp", "An offset that grows without a jump, for ever and ever"), ("a-much-longer", "Short")]
    assert list(table(rows, terminal=True)) == [
        "ramp           An offset that grows without a jump, for ...",
        "a-much-longer  Short",
    ]
    assert next(table(rows, terminal=False)).endswith("and ever")


def test_a_narrow_terminal_shows_it_whole_below_the_name(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    rows = [("ramp", "An offset that grows without a jump"), ("jump", "Short")]
    below = ["    An offset that grows", "    without a jump"]
    assert list(table(rows, terminal=True)) == ["ramp", *below, "jump", "    Short"]


def test_a_specification_tells_of_its_part(capsys):
    assert main(["detectors", "cusum:k=2,arl0=1e4"]) == 0
    assert capsys.readouterr().out.startswith("cusum (detector)")
    assert main(["detectors", "cusm"]) == 2
    assert "did you mean 'cusum'?" in capsys.readouterr().err


@pytest.mark.parametrize("kind", KINDS)
def test_json_alone_on_stdout(kind, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "agents"
    folder.mkdir()
    monkeypatch.setattr(published, "agents_folder", lambda: folder)
    assert main([kind, "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == list(REGISTRIES.get(kind, ()))


def test_a_run_folder_without_a_card_is_no_published_policy(tmp_path, capsys):
    spoofer({"scenario": "liu-flight:horizon=5", "knowledge": "blind"}, tmp_path / "x")
    assert main(["policies", str(tmp_path / "x")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_parts_of_ones_own_are_listed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(own_parts, "_TAKEN", [])
    (tmp_path / "parts_of_a_test.py").write_text(
        "from spoofgym.detectors import DETECTORS\n"
        "from spoofgym.detectors.chi_square import Snapshot\n"
        "class Mine(Snapshot):\n"
        "    '''A test of my own. It is like the other.'''\n"
        "DETECTORS['mine'] = Mine\n"
        "class Untold(Snapshot): pass\n"
        "DETECTORS['untold'] = Untold\n"
        "from spoofgym.attacks import ATTACKS\n"
        "ATTACKS['my-ramp'] = ATTACKS['ramp']\n"
    )
    try:
        assert main(["detectors", "mine", "--import", "parts_of_a_test"]) == 0
        text = capsys.readouterr().out
        assert "A test of my own." in text
        assert text.endswith("--detector mine --import parts_of_a_test\n")
        assert main(["detectors", "untold"]) == 0
        assert "\n\nIt has no docstring that would tell what it is.\n\n" in capsys.readouterr().out
        assert main(["attacks"]) == 0
        assert "my-ramp" in capsys.readouterr().out
    finally:
        for name in ("mine", "untold"):
            REGISTRIES["detectors"].pop(name, None)
        ATTACKS.pop("my-ramp", None)
    with pytest.raises(SystemExit) as ended:
        main(["detectors", "--import", "no_such_module"])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "argument --import: 'no_such_module' cannot be imported: ModuleNotFoundError" in line
