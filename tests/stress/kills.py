"""Trainings that are killed (SIGKILL) at any moment and resumed: they end as if nothing had happened.

``fuzz(seed, tries, folder)`` kills short trainings of both programs in a scratch folder and gives the broken promises,
one text each.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import torch

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.learning import defender_ppo, ppo
from spoofgym.learning.run_folder import CHECKPOINT_FILE, Run, RunFolder
from spoofgym.policies.learned import CONFIG_FILE

RUNS = {
    "spoofgym.learning.spoofer": Run(
        SpooferConfig(scenario="liu-flight:horizon=12", detector="windowed:n=5,threshold=45"),
        ppo.Settings(lanes=4, trials=2, epochs=2, hidden=8),
        3,
        1200,
    ),
    "spoofgym.learning.defender": Run(
        DefenderConfig(scenario="foi-drive:horizon=40", detectors=("snapshot",)),
        defender_ppo.Settings(lanes=3, epochs=2, hidden=8, imitate=False, validation_episodes=6),
        4,
        720,
    ),
}
TYPES = {
    "spoofgym.learning.spoofer": ((SpooferConfig,), ppo.Settings),
    "spoofgym.learning.defender": ((DefenderConfig,), defender_ppo.Settings),
}
MOST_KILLS = 6
"""Of one training; then it may come to its end."""
LONGEST = 600.0
"""For one leg of a training, s."""


def fuzz(seed: int, tries: int, folder: Path) -> list[str]:
    """Kill and resume ``tries`` trainings in ``folder``; the broken promises."""
    rng = np.random.default_rng(seed)
    broken = []
    for _ in range(tries):
        program = str(rng.choice(list(RUNS)))
        expected, duration = _uninterrupted(program, folder)
        path, moments = folder / "killed", []
        shutil.rmtree(path, ignore_errors=True)
        _begin(program, path)
        for _ in range(MOST_KILLS):
            moments.append(round(float(duration * rng.uniform(0.0, 1.2)), 3))
            if _leg(program, path, moments[-1]) is not None:
                break
        words = f"{program} killed after {', '.join(map(str, moments))} s"
        done = subprocess.run(_command(program, path), capture_output=True, text=True, timeout=LONGEST)
        if done.returncode != 0 and "steps already" not in done.stderr:
            broken.append(f"{words}: the resumed run fails: {done.stderr.strip()[-300:]}")
        elif _result(path) != expected:
            broken.append(f"{words}: the resumed run ends elsewhere")
    return broken


def _begin(program: str, path: Path) -> None:
    RunFolder(path, program, *TYPES[program]).begin(RUNS[program])


def _command(program: str, path: Path) -> list[str]:
    return [sys.executable, "-m", "spoofgym", "train", program.rpartition(".")[2], "--resume", "--out", str(path)]


def _leg(program: str, path: Path, moment: float) -> int | None:
    """Train on, and kill the process after ``moment`` s; its exit status where it ended before, else None."""
    process = subprocess.Popen(_command(program, path), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        return process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        return None
    finally:  # after Ctrl-C, too, so that no training goes on alone
        process.kill()
        process.wait()


def _uninterrupted(program: str, folder: Path) -> tuple[dict[str, object], float]:
    """What the training leaves when nothing stops it, and how long it takes, s; made once in a folder."""
    path, clock = folder / program, folder / f"{program}.seconds"
    if not clock.exists():
        shutil.rmtree(path, ignore_errors=True)
        _begin(program, path)
        begun = time.monotonic()
        subprocess.run(_command(program, path), check=True, stderr=subprocess.DEVNULL, timeout=LONGEST)
        clock.write_text(repr(time.monotonic() - begun))
    return _result(path), float(clock.read_text())


def _result(path: Path) -> dict[str, object]:
    """All that a run leaves, by name; times are not part of it."""
    found: dict[str, object] = {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()}
    assert CONFIG_FILE in found
    found[CHECKPOINT_FILE] = repr(torch.load(path / CHECKPOINT_FILE, weights_only=True))
    return found
