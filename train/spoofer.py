"""Train a PPO spoofer.

    python -m train.spoofer --scenario liu-flight --detector snapshot --knowledge shadow --steps 2000000 --seed 0 --out
    runs/x

Writes into the run folder: the policy (``policy.npz``, arrays only), what it was trained on (``config.json``),
TensorBoard logs, and checkpoints from which ``--resume`` goes on. Ctrl-C stops after the present step and leaves a
usable policy.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.learned import CONFIG_FILE
from spoofgym.envs.config import ACTIONS, KNOWLEDGE, SpooferConfig
from spoofgym.scenario import FIDELITIES
from train.arguments import count, seed_number
from train.ppo import CHECKPOINT_FILE, Settings, export, load_checkpoint, make_learner, save_checkpoint, write_config

DEFAULT_STEPS = 2_000_000


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = argparse.ArgumentParser(
        prog="python -m train.spoofer", description="Train a PPO spoofer against a detector on a real INS/GNSS filter."
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="what is flown (default: %(default)s)")
    add("--detector", default="snapshot", help="snapshot, windowed:n=20, ... (default: %(default)s)")
    add("--knowledge", default="shadow", choices=KNOWLEDGE, help="of the victim (default: %(default)s)")
    add("--action", default="rate", choices=ACTIONS, help="what the policy controls (default: %(default)s)")
    add("--fidelity", default="linear", choices=FIDELITIES, help="of the simulation (default: %(default)s)")
    add("--steps", type=count, default=DEFAULT_STEPS, help="GNSS epochs to play (default: %(default)s)")
    add("--seed", type=seed_number, default=0, help="of the learner and lane 0 (default: %(default)s)")
    add("--out", type=Path, default=Path("runs/spoofer"), help="run folder (default: %(default)s)")
    add("--threads", type=count, default=2, help="of the learner and the simulation (default: %(default)s)")
    add("--resume", action="store_true", help="go on from the checkpoint in the run folder")
    return result


class Watch(BaseCallback):
    """Progress bar, checkpoints after every tenth of the run, and the policy's mean return."""

    def __init__(self, config: SpooferConfig, folder: Path, steps: int, console: Console) -> None:
        super().__init__()
        self._config, self._folder, self._steps = config, folder, steps
        self._progress = Progress(
            TextColumn("training"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("steps"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[result]}"),
            console=console,
        )
        self._next_checkpoint = 0

    def _on_training_start(self) -> None:
        self._task = self._progress.add_task("training", total=self._steps, completed=self.num_timesteps, result="")
        self._progress.start()
        self._next_checkpoint = self.num_timesteps + self._steps // 10

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        episodes = self.model.ep_info_buffer
        result = ""
        if episodes:
            mean = np.mean([episode["r"] for episode in episodes]) * self._scale()
            result = f"mean undetected error gained {mean:.1f} m"
        self._progress.update(self._task, completed=min(self.num_timesteps, self._steps), result=result)

    def _scale(self) -> float:
        return float(self.training_env.unwrapped.vector_env.game.scenario.error_scale)  # type: ignore[attr-defined]

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next_checkpoint:
            self._next_checkpoint += self._steps // 10
            self.keep()

    def _on_training_end(self) -> None:
        self.stop()

    def stop(self) -> None:
        """Leave the terminal as it was."""
        self._progress.stop()

    def keep(self) -> None:
        """Write policy and checkpoint."""
        assert isinstance(self.model, PPO)
        export(self.model, self._config, self._folder)
        save_checkpoint(self.model, self._folder)


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    console = Console(stderr=True)
    options = parser().parse_args(arguments)
    folder: Path = options.out
    if (folder / CONFIG_FILE).exists() and not options.resume:
        console.print(f"error: {folder} already holds a run; choose another --out, or --resume to go on", style="red")
        return 2
    if options.resume and not (folder / CHECKPOINT_FILE).is_file():
        console.print(f"error: {folder} has no {CHECKPOINT_FILE} to resume from", style="red")
        return 2
    torch.set_num_threads(options.threads)
    try:
        config = SpooferConfig(
            scenario=options.scenario,
            detector=options.detector,
            knowledge=options.knowledge,
            action=options.action,
            fidelity=options.fidelity,
            threads=options.threads,
        )
        folder.mkdir(parents=True, exist_ok=True)
        learner = make_learner(config, Settings(), options.seed, folder)
    except (ValueError, TypeError) as error:
        console.print(f"error: {error}", style="red", markup=False)
        return 2
    if options.resume:
        load_checkpoint(learner, folder)
    write_config(folder, config, Settings(), options.seed, options.steps)
    return _learn(learner, config, options.steps, folder, console)


def _learn(learner: PPO, config: SpooferConfig, steps: int, folder: Path, console: Console) -> int:
    watch = Watch(config, folder, steps, console)
    begin, before = time.perf_counter(), learner.num_timesteps
    interrupted = False
    try:
        learner.learn(max(0, steps - before), callback=watch, reset_num_timesteps=before == 0, tb_log_name="ppo")
    except KeyboardInterrupt:
        interrupted = True
        watch.stop()
    export(learner, config, folder)
    save_checkpoint(learner, folder)
    seconds = time.perf_counter() - begin
    played = learner.num_timesteps - before
    console.print(
        f"{'interrupted after' if interrupted else 'trained'} {played:,} steps in {seconds:.0f} s "
        f"({played / max(seconds, 1e-9):,.0f} steps/s); policy in {folder}",
        markup=False,
    )
    if interrupted:
        console.print(f"go on with: python -m train.spoofer --resume --out {folder} --steps {steps}", markup=False)
    return 130 if interrupted else 0


if __name__ == "__main__":
    sys.exit(main())
