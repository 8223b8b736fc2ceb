"""What tests keep from one run to the next lies in the test cache, or, where there is none, in a temporary folder."""

import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest


def pytest_configure(config: pytest.Config) -> None:
    # the width of the terminal in which the tests run, which workers inherit, is not the width that a test means
    os.environ.pop("COLUMNS", None)
    # a worker of xdist inherits the folders of the process that started it
    if not hasattr(config, "workerinput"):
        folder = _in_the_test_cache(config) or _temporary(config)
        # thresholds that tests calibrate, never among the user's
        os.environ["SPOOFGYM_CACHE"] = str(folder)
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(folder / "hypothesis")


@pytest.fixture
def package_copy(tmp_path: Path) -> Path:
    """A copy of the package that a test may change, even where the checkout cannot be written."""
    source = Path(__file__).parents[1] / "spoofgym"
    copy = shutil.copytree(source, tmp_path / "spoofgym", ignore=shutil.ignore_patterns("__pycache__"))
    for path in (copy, *copy.rglob("*")):
        path.chmod(path.stat().st_mode | stat.S_IWUSR)
    return copy


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
