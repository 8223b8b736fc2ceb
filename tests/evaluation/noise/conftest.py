"""One drive of known noises, its scenario, and the estimate on it."""

from __future__ import annotations

from pathlib import Path

import pytest

from spoofgym.evaluation.noise.estimate import Estimate, estimate_noise
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from tests.logs.known_noise import write

SEED = 0


@pytest.fixture(scope="session")
def known_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("noise") / "known", SEED)


@pytest.fixture(scope="session")
def known(known_log: Path) -> Scenario:
    return make_scenario(f"recorded:{known_log}")


@pytest.fixture(scope="session")
def estimate(known: Scenario) -> Estimate:
    return estimate_noise(known)
