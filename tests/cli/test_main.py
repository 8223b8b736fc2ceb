"""The command `spoofgym` as a newcomer meets it: help, wrong names, versions; it starts in no time."""

import os
import re
import shlex
import subprocess
import sys

import pytest

import spoofgym
from spoofgym.cli.commands import COMMANDS, groups
from spoofgym.cli.main import main

HEAVY = ("scipy", "numba", "matplotlib", "rich", "torch")


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-m", "spoofgym", *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_overview_needs_no_heavy_library():
    code = (
        "import sys; from spoofgym.cli.main import main; main(['--help']); main(['bound', '--help'])\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_module_is_the_command():
    done = run("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"spoofgym {spoofgym.__version__}\n", "")


@pytest.mark.parametrize("columns", ["80", "40"])
def test_the_overview_names_every_command_and_fits(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for command in COMMANDS:
        assert command.words.split()[0] in text
    before_examples = text.partition("examples:")[0]
    assert max(map(len, before_examples.splitlines())) <= int(columns)


@pytest.mark.parametrize("first", groups())
def test_a_group_lists_its_commands(first, capsys):
    assert main([first, "--help"]) == 0
    text = capsys.readouterr().out
    assert all(command.words in text for command in groups()[first])


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["evalute"], "error: spoofgym: no command 'evalute': did you mean 'evaluate'? there are: "),
        (["evaluate", "spofers"], "error: spoofgym evaluate: no command 'spofers': did you mean 'spoofers'? there are"),
        (["--verson"], "error: spoofgym: no command '--verson': did you mean '--version'? there are: "),
        (["list", "detecters"], "error: argument KIND: invalid choice: 'detecters': did you mean 'detectors'?"),
        (["list", "foi-drive"], "error: argument KIND: 'foi-drive' is a name, not a kind: spoofgym list scenarios foi"),
        (["study"], "error: spoofgym study needs one more word: acna, "),
        (["xyz"], "error: spoofgym: no command 'xyz'; there are: "),
        (["tune", "--scenari0", "x"], "error: unrecognized arguments: --scenari0 x: did you mean '--scenario'?"),
        (["tune", "--jsn=x"], "error: unrecognized arguments: --jsn=x: did you mean '--json'?"),
        (["benchmark", "atack", "x"], "error: argument COMMAND: invalid choice: 'atack': did you mean 'attack'?"),
        (["matrix", "--fidelity", "linaer"], "error: argument --fidelity: invalid choice: 'linaer': did you mean"),
        (["thresholds", "--detector", "snapshoot"], "error: unknown detector 'snapshoot': did you mean 'snapshot'?"),
        (["thresholds", "--scenario", "liu-fligth"], "error: unknown scenario 'liu-fligth': did you mean 'liu-flight'"),
        (["evaluate", "spoofers", "--attack", "rmap:1"], "error: unknown attack 'rmap': did you mean 'ramp'?"),
        (["evaluate", "spoofers", "--attack", "ramp:rat=1"], "error: attack 'ramp' has no option 'rat': did you mean"),
        (["evaluate", "defenders", "--defender", "snapshot/exclud"], "error: --defender 'snapshot/exclud' is neither"),
        (["evaluate", "defenders", "--defender", "snapshot > exclud"], "error: unknown response 'exclud': did you mea"),
    ],
)
def test_a_wrong_name_is_one_line_with_the_nearest_valid_one(arguments, line, capsys):
    try:
        status = main(arguments)
    except SystemExit as ended:
        status = ended.code
    said = capsys.readouterr()
    assert (status, said.out) == (2, "")
    (told,) = said.err.splitlines()
    assert told.startswith(line)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.words)
def test_every_help_has_examples_that_its_own_command_line_understands(command, tmp_path, monkeypatch):
    parser = command.parser()
    assert parser.prog.startswith("spoofgym ")
    assert parser.examples
    assert max(map(len, parser.examples)) <= 78
    monkeypatch.chdir(tmp_path)  # files that are named are looked for, not written
    for line in re.sub(r"\\\n\s+", "", "\n".join(parser.examples)).splitlines():
        words = shlex.split(line)
        assert " ".join(words).startswith(parser.prog)
        parser.parse_args(words[len(parser.prog.split()) :])
    assert not any(tmp_path.iterdir())
