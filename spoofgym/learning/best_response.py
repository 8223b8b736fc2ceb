"""Best responses by PPO: a policy of one side, trained against the other side's mixture."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from spoofgym.console import PlainConsole, console
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import SPOOFER
from spoofgym.learning import defender, defender_ppo, ppo, spoofer
from spoofgym.learning.run_folder import Run, RunFolder
from spoofgym.policies.published import POLICY


@dataclass(frozen=True)
class BestResponse:
    """Trains best responses in a duel.

    Attributes:
        duel: its arguments.
        shows: whether progress is shown on a terminal.
        spoofer_steps: epochs that a spoofer plays in its training.
        defender_steps: epochs that a defender plays in its training.
        spoofer_settings: of the spoofers' learner.
        defender_settings: of the defenders' learner.
    """

    duel: DuelConfig
    shows: bool
    spoofer_steps: int
    defender_steps: int
    spoofer_settings: ppo.Settings = field(default_factory=lambda: ppo.Settings(**ppo.SCRIPTED_START))
    defender_settings: defender_ppo.Settings = field(default_factory=defender_ppo.Settings)

    def __call__(self, side: str, opponent: str, folder: Path, seed: int) -> str:
        """Train a best response to a mixture, or go on with it; returns its specification.

        Args:
            side: that learns.
            opponent: the mixture of the other side, as a pool.
            folder: of the run, which may hold one that was interrupted.
            seed: of the training.

        Raises:
            KeyboardInterrupt: Ctrl-C; the run can go on.
            ValueError: the folder holds another run, naming the first setting that differs.
        """
        run, kept, train = self._spoofer(opponent, folder, seed) if side == SPOOFER else self._defender(
            opponent, folder, seed
        )
        torch.set_num_threads(self.duel.threads)
        if not kept.holds_run:
            kept.begin(run)
        else:
            _check_same(folder, kept.run(), run)
        state = kept.state()
        if (state is None or not kept.finished(run, state)) and train(run, kept, self._terminal()).train():
            raise KeyboardInterrupt
        return f"{POLICY}{folder}"

    def _terminal(self) -> PlainConsole:
        return console(stderr=True) if self.shows else PlainConsole(quiet=True)

    def _spoofer(self, opponent: str, folder: Path, seed: int) -> tuple[Run, RunFolder, Any]:
        # a clean game teaches a spoofer nothing
        config = DuelSpooferConfig(**vars(replace(self.duel, clean=0.0)), defender=opponent)
        kept = RunFolder(folder, "spoofgym.learning.spoofer", (DuelSpooferConfig,), ppo.Settings)
        return Run(config, self.spoofer_settings, seed, self.spoofer_steps), kept, spoofer.Training

    def _defender(self, opponent: str, folder: Path, seed: int) -> tuple[Run, RunFolder, Any]:
        config = DuelDefenderConfig(**vars(self.duel), spoofer=opponent)
        kept = RunFolder(folder, "spoofgym.learning.defender", (DuelDefenderConfig,), defender_ppo.Settings)
        return Run(config, self.defender_settings, seed, self.defender_steps), kept, defender.Training


def _check_same(folder: Path, found: Run, asked: Run) -> None:
    """Refuse to go on with another training; how many threads compute it does not matter.

    Raises:
        ValueError: naming the first setting that differs.
    """
    wanted = _flat(asked)
    for name, value in _flat(found).items():
        if name != "environment.threads" and value != wanted.get(name):
            told = f"its {name} is {value!r}, not {wanted.get(name)!r}"
            raise ValueError(f"{folder} holds another training than what is asked for: {told}")


def _flat(run: Run) -> dict[str, Any]:
    result: dict[str, Any] = {"steps": run.steps, "seed": run.seed}
    for section in ("environment", "learner"):
        result |= {f"{section}.{name}": value for name, value in run.content()[section].items()}
    return result
