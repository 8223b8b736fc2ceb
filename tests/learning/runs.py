"""Short runs of both training programs, for what may happen to a run folder, and of a defender that imitates first."""

from contextlib import contextmanager
from dataclasses import replace

import pytest
import torch

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.learning import defender, defender_ppo, imitation, ppo, spoofer
from spoofgym.learning.run_folder import CHECKPOINT_FILE, Run, RunFolder

SPOOFER = Run(
    SpooferConfig(scenario="liu-flight:horizon=12", detector="windowed:n=5,threshold=45"),
    ppo.Settings(lanes=4, trials=2, epochs=2, hidden=8),
    3,
    240,
)
"""Games that an alarm ends, so that lanes are in mid-game where a rollout ends."""
EXPECTED = replace(SPOOFER, environment=SpooferConfig(scenario="liu-flight:horizon=12"))
DEFENDER = Run(
    DefenderConfig(scenario="foi-drive:horizon=40", detectors=("snapshot",)),
    defender_ppo.Settings(lanes=3, epochs=2, hidden=8, imitate=False, validation_episodes=6),
    4,
    240,
)
PROGRAMS = {"spoofer": (spoofer, SPOOFER), "expected": (spoofer, EXPECTED), "defender": (defender, DEFENDER)}
TYPES = {spoofer: ((SpooferConfig,), ppo.Settings), defender: ((DefenderConfig,), defender_ppo.Settings)}

DRIVE, STEPS = "foi-drive:horizon=60", 480
SHORT = ["--scenario", DRIVE, "--detector", "snapshot", "--lanes", "4", "--validation-episodes", "20"]
SHORT += ["--critic-games", "1"]
"""Options of the defender's training that imitates first."""


@contextmanager
def few_lessons():
    """Imitation goes through all of its steps, in few games: no test here asks what is learned in it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(defender_ppo, "TEACHING_LANES", 8)
        for name, value in (("FEW", 1), ("MANY", 2), ("PASSES", 5)):
            patch.setattr(imitation, name, value)
        yield


def begun(path, name):
    """A run folder just after its start."""
    program, run = PROGRAMS[name]
    RunFolder(path, "train.x", *TYPES[program]).begin(run)
    return program


def resume(program, path, *options):
    return program.main(["--resume", "--out", str(path), *options])


def result(path):
    """All that a run leaves, but for logs: by name."""
    found = {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()}
    found[CHECKPOINT_FILE] = repr(torch.load(path / CHECKPOINT_FILE, weights_only=True))
    return found
