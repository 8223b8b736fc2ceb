"""Thresholds that tests calibrate are kept beside the test cache, never in the user's."""

import os

import pytest


def pytest_configure(config: pytest.Config) -> None:
    os.environ["SPOOFGYM_CACHE"] = str(config.cache.mkdir("calibration"))  # type: ignore[union-attr]
