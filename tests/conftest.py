"""What tests keep from one run to the next lies in the test cache, or, where there is none, in a temporary folder."""

import gc
import os
import shutil
import signal
import stat
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest


def pytest_configure(config: pytest.Config) -> None:
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        # a shell that runs the suite in the background lets it ignore Ctrl-C, and all programs that it starts, too
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # the width of the terminal in which the tests run, which workers inherit, is not the width that a test means
    os.environ.pop("COLUMNS", None)
    # a worker of xdist inherits the folders of the process that started it, and these limits
    if not hasattr(config, "workerinput"):
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            # a worker for each core: more threads of one would only wait, busily, for those of the other
            os.environ.setdefault(name, "1")
        folder = _in_the_test_cache(config) or _temporary(config)
        # thresholds that tests calibrate, never among the user's
        os.environ["SPOOFGYM_CACHE"] = str(folder)
        # how long something takes on this machine is no part of what programs say
        os.environ["SPOOFGYM_QUIET"] = "1"
        # a window that a test opens is not on the screen of whoever runs the tests
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(folder / "hypothesis")


def pytest_collection_finish() -> None:
    """Let the garbage collector leave alone what was imported, which stays."""
    gc.freeze()


@pytest.hookimpl(optionalhook=True)  # without xdist there is no such hook
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Give a file, and the files of one `xdist_group`, to one worker: what their tests share is made once."""
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class ByFile(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            group = super()._split_scope(nodeid)
            return nodeid.partition("::")[0] if group == nodeid else group

    return ByFile(config, log)


@pytest.fixture
def package_copy(tmp_path: Path) -> Path:
    """A copy of the package that a test may change, even where the checkout cannot be written."""
    source = Path(__file__).parents[1] / "spoofgym"
    copy = shutil.copytree(source, tmp_path / "spoofgym", ignore=shutil.ignore_patterns("__pycache__"))
    for path in (copy, *copy.rglob("*")):
        path.chmod(path.stat().st_mode | stat.S_IWUSR)
    return copy


@pytest.fixture
def child() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Begins programs as `subprocess.Popen` does; none of them outlives its test."""
    begun: list[subprocess.Popen[str]] = []

    def begin(command: list[str], **options: Any) -> subprocess.Popen[str]:
        begun.append(subprocess.Popen(command, text=True, **options))
        return begun[-1]

    yield begin
    for process in begun:
        process.kill()
        process.communicate()


def _in_the_test_cache(config: pytest.Config) -> Path | None:
    """None where pytest has no cache (`-p no:cacheprovider`), or the checkout cannot be written."""
    cache = getattr(config, "cache", None)
    with suppress(OSError):
        if cache is not None:
            folder = cache.mkdir("spoofgym")
            tempfile.TemporaryFile(dir=folder).close()
            return folder
    return None


def _temporary(config: pytest.Config) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="spoofgym-tests-"))
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    return folder
