"""How programs end: one line and a status, whatever goes wrong and whoever reads the output."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from spoofgym.program import do_all, give_json, program


def ending(error):
    @program
    def main(arguments=None):
        raise error

    return main


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (ValueError("detector 'x': no\nsuch thing"), 2, "error: detector 'x': no such thing"),
        (FloatingPointError("diverged"), 2, "error: diverged"),
        (FileNotFoundError("runs/x is no run folder"), 2, "error: runs/x is no run folder"),
        (OSError(28, "No space left on device", "out.json"), 1, "error: out.json: No space left on device"),
        (OSError(28, "No space left on device"), 1, "error: No space left on device"),
        (RuntimeError("the thresholds are far too low"), 1, "error: the thresholds are far too low"),
        (ImportError("the figure needs matplotlib"), 1, "error: the figure needs matplotlib"),
        (MemoryError(), 1, "error: MemoryError"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_a_failure_is_one_line_and_a_status(error, status, line, capsys):
    assert ending(error)() == status
    assert capsys.readouterr().err == f"{line}\n"


def test_a_fault_of_the_program_keeps_its_traceback():
    with pytest.raises(AttributeError):
        ending(AttributeError("a slip"))()


def test_a_program_that_ends_well_has_status_0():
    @program
    def main(arguments=None):
        assert arguments == ["x"]

    assert main(["x"]) == 0


def test_what_can_be_given_is_given_though_something_fails(capsys):
    given = []

    def failing():
        raise OSError(28, "full")

    with pytest.raises(OSError, match="full"):
        do_all(failing, lambda: given.append(1), lambda: 1 / 0, lambda: given.append(2))
    assert given == [1, 2]


def test_json_goes_to_stdout_to_a_file_or_nowhere(tmp_path, capsys):
    give_json({"a": 1}, None)
    assert capsys.readouterr().out == ""
    give_json({"a": 1}, "-")
    assert json.loads(capsys.readouterr().out) == {"a": 1}
    give_json({"a": 1}, tmp_path / "x" / "out.json")
    assert json.loads((tmp_path / "x" / "out.json").read_text()) == {"a": 1}


WRITER = """
import sys, time
from spoofgym.program import program

@program
def main(arguments=None):
    print("√ " * 10, flush=True)
    for line in range(100_000):
        print(line)
    return 0

sys.exit(main())
"""


def run(code, **options):
    return subprocess.run(
        [sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, timeout=120, check=False, **options
    )


def test_a_reader_that_goes_away_is_no_error():
    reading, writing = os.pipe()
    os.close(reading)
    done = run(WRITER, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_an_output_that_is_full_is_one_line():
    with open("/dev/full", "w") as full:
        done = run(WRITER, stdout=full)
    assert (done.returncode, done.stderr) == (1, "error: No space left on device\n")


def test_a_terminal_without_a_character_gets_another():
    done = run(WRITER, stdout=subprocess.PIPE, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("? ? ")


def test_a_closed_output_is_no_error():
    done = run("import sys; sys.stdout = None\n" + WRITER, stdout=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, "")


def test_ctrl_c_is_one_line(child):
    code = WRITER.replace("for line in range(100_000):", "while True:").replace("print(line)", "time.sleep(0.01)")
    process = child([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "interrupted\n")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("a fault")])
def test_ctrl_c_while_a_program_is_imported_is_one_line(tmp_path, error):
    """A package of programs whose module is interrupted at its import; another exception keeps its traceback."""
    package = tmp_path / "programs"
    package.mkdir()
    (package / "__init__.py").write_text("from spoofgym.program import quiet_start\nquiet_start()\n")
    (package / "one.py").write_text(f"raise {error!r}\n")
    path = os.pathsep.join([str(tmp_path), os.getcwd(), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "programs.one"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if isinstance(error, KeyboardInterrupt):
        assert (done.returncode, done.stderr) == (130, "interrupted\n")
    else:
        assert done.returncode == 1
        assert done.stderr.startswith("Traceback")


def test_a_library_that_is_imported_changes_nothing():
    code = "import sys, spoofgym.evaluation; sys.exit(sys.excepthook is not sys.__excepthook__)"
    assert run(code).returncode == 0
