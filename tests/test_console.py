"""What programs print: whole words and figures on any output, and names that are no markup."""

import io
import time

import pytest
from rich.console import Group
from rich.table import Table
from rich.text import Text

from spoofgym import patience
from spoofgym.console import PlainConsole, console, show

NAMES = ("none", "a-policy-with-a-rather-long-name", "x[/y][bold] :bomb:")


def table():
    title = "a title that says what the table is about, and in which game it was played"
    result = Table(title=title, box=None, padding=(0, 2, 0, 0))
    result.add_column("attacker", overflow="fold")
    for heading in ("error\nm", "exact\nm", "detected\n", "median\ns", "at alarm\nm", "of\noptimum"):
        result.add_column(heading, justify="right", no_wrap=True)
    for name in NAMES:
        result.add_row(name, *(f"{1234.5678 + place:.4f} ±0.28" for place in range(6)))
    return result


def printed(what, width=None):
    file = io.StringIO()
    terminal = PlainConsole(file=file, markup=False, highlight=False, emoji=False, width=width or 10_000)
    show(terminal, what)
    return file.getvalue().splitlines()


def test_nothing_is_wrapped_where_the_output_is_no_terminal(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    show(console(), Group(table(), Text("a legend " * 40)))
    lines = capsys.readouterr().out.splitlines()
    for name in NAMES:
        (line,) = [line for line in lines if line.startswith(f"{name} ")]
        assert [f"{1234.5678 + place:.4f} ±0.28" in line for place in range(6)] == [True] * 6
    assert ("a legend " * 40).strip() in [line.strip() for line in lines]


def test_a_title_and_a_caption_take_one_line_where_the_output_is_no_terminal(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    given = table()
    given.caption = "error: what is meant by it; [after]: a name in brackets; " * 6
    title, caption = given.title, given.caption
    for _ in range(2):  # the table itself is left as it is
        show(console(), given)
        lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
        assert lines[0] == title
        assert lines[-1] == caption.rstrip()
    assert (given.title, given.caption) == (title, caption)


def test_a_terminal_has_a_caption_as_wide_as_the_table():
    file, given = io.StringIO(), table()
    given.caption = "what is meant " * 20
    show(PlainConsole(file=file, force_terminal=True, color_system=None, markup=False, width=200), given)
    lines = file.getvalue().splitlines()
    assert sum("what is meant" in line for line in lines) > 1
    assert max(map(len, lines)) < 140


def test_an_output_has_the_width_that_is_asked_for(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "50")
    console().print(Text("some words " * 20))
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 50


@pytest.mark.parametrize("width", [20, 60, 100, 130])
def test_a_narrow_terminal_cuts_no_figure_and_no_name(width):
    lines = printed(table(), width)
    assert not any("…" in line for line in lines)
    assert sum(f"{1234.5678 + 5:.4f} ±0.28" in line for line in lines) == len(NAMES)
    # rows of folded names begin at the left, so that the pieces put together are the names
    start = next(place for place, line in enumerate(lines) if line.startswith("none"))
    pieces = "".join(line[:14].strip() for line in lines[start : start + 7])
    assert pieces.replace(" ", "").startswith("".join(NAMES).replace(" ", "")[:40])


def test_a_table_that_fits_is_printed_as_it_is():
    lines = printed(table(), 200)
    assert [line.split("  ")[0] for line in lines if "±" in line] == list(NAMES)


@pytest.fixture
def soon(monkeypatch):
    monkeypatch.setattr(patience, "EVERY", 0.02)
    monkeypatch.setattr(patience._Who, "ours", True)
    monkeypatch.setenv("SPOOFGYM_QUIET", "")


@pytest.mark.usefixtures("soon")
def test_what_goes_on_is_told_in_lines_where_stderr_is_no_terminal(capsys):
    terminal = console()
    with terminal.progress("first [/y]"):
        time.sleep(0.1)
    with terminal.progress("second"):
        time.sleep(0.1)
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert 2 < len(lines) < 12
    assert lines[0] == "spoofgym: 0 s so far, now: first [/y]"
    assert lines[-1] == "spoofgym: 0 s so far, now: second"


@pytest.mark.usefixtures("soon")
def test_short_parts_of_long_work_share_the_lines(monkeypatch, capsys):
    monkeypatch.setattr(patience, "EVERY", 3600.0)
    terminal = console()
    for part in range(100):
        with terminal.progress(str(part)):
            pass
    assert capsys.readouterr() == ("", "")


def test_a_terminal_has_a_spinner_on_stderr_beside_a_name_with_brackets(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with console().progress("x[/y]"):
        pass
    said = capsys.readouterr()
    assert said.out == ""
    assert "x[/y]" in said.err


def test_a_pipe_that_closes_is_left_to_the_program(monkeypatch):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        PlainConsole(file=Closed()).print("x")
