"""What tests keep from one run to the next lies in the test cache, or, where there is none, in a temporary folder."""

import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest


def pytest_configure(config: pytest.Config) -> None:
    # a worker of xdist inherits the folders of the process that started it
    if not hasattr(config, "workerinput"):
        folder = _in_the_test_cache(config) or _temporary(config)
        # thresholds that tests calibrate, never among the user's
        os.environ["SPOOFGYM_CACHE"] = str(folder)
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(folder / "hypothesis")


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
