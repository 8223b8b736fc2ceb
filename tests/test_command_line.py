"""Arguments of programs: what is valid is told in one line, and a destination is checked at once."""

import pytest

from spoofgym import command_line
from spoofgym.command_line import Parser, add_figure, add_json


@pytest.fixture
def parser():
    result = Parser(prog="x")
    add_json(result)
    add_figure(result)
    for name in ("count", "seed_number", "learner_seed", "threads", "above_one", "run_folder"):
        result.add_argument(f"--{name}", type=getattr(command_line, name))
    return result


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--count", "0", "expected a whole number, 1 or more, got '0'"),
        ("--count", "1.5", "expected a whole number, 1 or more, got '1.5'"),
        ("--count", "nan", "expected a whole number, 1 or more, got 'nan'"),
        ("--count", "inf", "expected a whole number, 1 or more, got 'inf'"),
        ("--count", "many", "expected a whole number, 1 or more, got 'many'"),
        ("--count", "1e30", "expected a whole number, 1,000,000,000,000 or less, got '1e30'"),
        ("--count", "1000000000001", "expected a whole number, 1,000,000,000,000 or less, got '1000000000001'"),
        ("--learner_seed", "-1", "expected a whole number, 0 or more, got '-1'"),
        ("--learner_seed", "4294967296", "--learner_seed: expected a whole number from 0 to 4294967295, got"),
        ("--seed_number", "-1", "expected a whole number, 0 or more, got '-1'"),
        ("--seed_number", "1.5", "expected a whole number, 0 or more, got '1.5'"),
        ("--threads", "1e9", "expected 1024 threads or fewer, got '1e9'"),
        ("--above_one", "inf", "expected a finite number greater than 1, got 'inf'"),
        ("--above_one", "1", "expected a finite number greater than 1, got '1'"),
        ("--figure", "out.gif", "a figure's name ends in .png, .svg, .pdf, got 'out.gif'"),
        ("--figure", "folder.png", "folder.png is a folder, a file is meant"),
        ("--json", "folder.png", "folder.png is a folder, a file is meant"),
        ("--json", "file/out.json", "file/out.json cannot be written: Not a directory"),
        ("--json", "out/", "expected the name of a file, got 'out/'"),
        ("--json", "a\nb/", "expected the name of a file"),
        ("--json", "", "expected the name of a file, got ''"),
        ("--run_folder", "file", "file is a file, a folder is meant"),
        ("--colour", "red", "unrecognized arguments: --colour red"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(parser, option, value, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as ended:
        parser.parse_args([option, value])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert words in line


def test_what_is_right_is_understood(parser, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = ["--count", "1e6", "--threads", "2", "--json", "-", "--figure", "a/b.PNG", "--run_folder", "x[/y]"]
    given += ["--seed_number", "4294967296", "--learner_seed", "4294967295"]
    options = parser.parse_args(given)
    assert (options.count, options.threads, options.json) == (1_000_000, 2, "-")
    assert (str(options.figure), str(options.run_folder)) == ("a/b.PNG", "x[/y]")
    assert (options.seed_number, options.learner_seed) == (2**32, 2**32 - 1)
    assert list(tmp_path.iterdir()) == []
