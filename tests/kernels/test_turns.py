"""Of several processes that need a kernel at once one compiles. The lock of another process is one opened anew here."""

import threading
import time

import filelock
import pytest

from spoofgym.kernels import njit, storage, turns


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setattr(storage, "place", lambda: tmp_path)
    return tmp_path


def kernel():
    """As each new program finds it."""
    found = {"__name__": "somewhere"}
    exec("def twice(x):\n    return 2.0 * x\n", found)
    return njit(cache=True)(found["twice"])


def loaded(function):
    return sum(function.stats.cache_hits.values())


@pytest.fixture
def compiled(folder):
    """The file of a kernel that another process is about to write, and its lock, held there; not yet in its place."""
    kernel()(1.0)
    (file,) = folder.iterdir()
    content = file.read_bytes()
    file.unlink()
    with filelock.FileLock(file.with_suffix(turns.SUFFIX), thread_local=False) as lock:
        yield file, content, lock


def test_a_program_waits_for_what_another_compiles(compiled):
    file, content, lock = compiled

    def finish():
        time.sleep(0.2)
        file.write_bytes(content)
        lock.release()

    other = threading.Thread(target=finish)
    other.start()
    function = kernel()
    assert (function(1.0), loaded(function)) == (2.0, 1)
    other.join()
    assert not turns._held


def test_a_program_takes_over_from_one_that_ended(compiled):
    file, _, lock = compiled
    lock.release()
    function = kernel()
    assert (function(1.0), loaded(function)) == (2.0, 0)
    assert list(file.parent.iterdir()) == [file]


def test_nobody_waits_for_ever_for_one_that_is_stuck(compiled, monkeypatch):
    monkeypatch.setattr(turns, "LONGEST_WAIT", 0.05)
    file, _, lock = compiled
    function = kernel()
    assert (function(1.0), loaded(function)) == (2.0, 0)
    assert lock.is_locked
    assert file.exists()


@pytest.mark.parametrize("fault", [OSError, NotImplementedError])
def test_a_folder_without_locks_is_no_obstacle(folder, monkeypatch, fault):
    def refuse(*_, **__):
        raise fault("no locks here")

    monkeypatch.setattr(filelock.FileLock, "acquire", refuse)
    function = kernel()
    assert (function(1.0), loaded(function)) == (2.0, 0)
