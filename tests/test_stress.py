"""The stress program tells how far it has come, and ends in one line."""

import io
import signal
import subprocess
import sys
import time

import pytest

from tests.stress import __main__ as stress
from tests.stress.kills import _leg
from tests.stress.progress import BETWEEN, Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def told(out, moments):
    """What is printed where tries end at these moments, s."""
    clock = iter([0.0, *moments, moments[-1]])
    progress = Progress("tries", 10, out, lambda: next(clock))
    for made in range(1, len(moments) + 1):
        progress.tell(made)
    progress.end("10 tried, every promise held")
    return out.getvalue()


def test_a_pipe_has_a_line_now_and_then():
    lines = told(io.StringIO(), [1.0, BETWEEN - 1.0, BETWEEN, BETWEEN + 1.0, 2.5 * BETWEEN]).splitlines()
    assert lines == [
        "tries: 0 of 10 tried",
        "tries: 3 of 10 tried (30 s)",
        "tries: 5 of 10 tried (75 s)",
        "tries: 10 tried, every promise held (75 s)",
    ]


def test_a_terminal_has_one_line():
    text = told(Terminal(), [1.0, 2.0])
    assert text.count("\n") == 1
    assert "2 of 10 tried" in text
    assert text.endswith("every promise held (2 s)\x1b[K\n")


def test_the_help_fits_a_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        stress.main(["--help"])
    text = capsys.readouterr().out
    assert "``" not in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("option", [["--steps", "-1"], ["--kills", "many"], ["--seed", "-1"]])
def test_a_wrong_option_is_one_line(option, capsys):
    with pytest.raises(SystemExit) as ended:
        stress.main(option)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert option[0] in line


@pytest.mark.slow
@pytest.mark.parametrize("delay", [None, 0.1])
def test_ctrl_c_is_one_line(delay, child):
    """At the start of the imports, and in the middle of a game."""
    command = [sys.executable, "-m", "tests.stress", "--steps", "1e9"]
    process = child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    if delay is None:
        time.sleep(1.0)  # the interpreter has begun, torch is not there yet
    else:
        assert process.stdout.readline() == "steps of lanes: 0 of 1,000,000,000 tried\n"
        time.sleep(delay)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "interrupted\n")


def test_a_training_does_not_outlive_an_interrupted_program(tmp_path, monkeypatch):
    begun = []

    class Interrupted(subprocess.Popen):
        def wait(self, timeout=None):
            begun.append(self)
            if timeout is not None:
                raise KeyboardInterrupt
            return super().wait()

    monkeypatch.setattr(subprocess, "Popen", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        _leg("spoofgym.learning.spoofer", tmp_path, 60.0)
    assert begun[0].poll() == -signal.SIGKILL
