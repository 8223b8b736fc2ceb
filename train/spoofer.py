"""Train a PPO spoofer.

    python -m train.spoofer --scenario liu-flight --detector snapshot --knowledge shadow --steps 3200000 --seed 0 --out
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
from stable_baselines3 import PPO

from agents.learned import CONFIG_FILE
from spoofgym.envs.config import ACTIONS, KNOWLEDGE, SpooferConfig, configure
from spoofgym.scenario import FIDELITIES
from train.arguments import count, seed_number
from train.ppo import (
    CHECKPOINT_FILE,
    Settings,
    export,
    load_checkpoint,
    make_learner,
    read_config,
    save_checkpoint,
    write_config,
)
from train.watch import Watch, mean_return

DEFAULT_STEPS = 3_200_000


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = argparse.ArgumentParser(
        prog="python -m train.spoofer", description="Train a PPO spoofer against a detector on a real INS/GNSS filter."
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="what is flown: liu-flight, kujur-flight, ... (default: %(default)s)")
    add("--detector", default="snapshot", help="snapshot, windowed:n=20, ... (default: %(default)s)")
    add("--knowledge", default="shadow", choices=KNOWLEDGE, help="of the victim (default: %(default)s)")
    add("--action", default="rate", choices=ACTIONS, help="what the policy controls (default: %(default)s)")
    add("--frames", type=count, default=1, help="epochs that the policy sees at once (default: %(default)s)")
    add("--shadow", metavar="SPEC", help="scenario whose filter the spoofer takes for the victim's (default: its own)")
    add("--fidelity", default="linear", choices=FIDELITIES, help="of the simulation (default: %(default)s)")
    add("--steps", type=count, default=DEFAULT_STEPS,
        help="GNSS epochs to play, rounded up to whole rollouts (default: %(default)s)")
    add("--seed", type=seed_number, default=0, help="of the learner and lane 0 (default: %(default)s)")
    add("--out", type=Path, default=Path("runs/spoofer"), help="run folder (default: %(default)s)")
    add("--threads", type=count, default=1, help="of the learner and the simulation (default: %(default)s)")
    add("--resume", action="store_true", help="go on from the checkpoint in the run folder, with its settings")
    return result


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
        if options.resume:
            content = read_config(folder)
            config = configure(SpooferConfig, content["environment"] | {"threads": options.threads})
            settings, seed = Settings(**content["learner"]), int(content["seed"])
        else:
            config = SpooferConfig(
                scenario=options.scenario,
                detector=options.detector,
                knowledge=options.knowledge,
                action=options.action,
                fidelity=options.fidelity,
                frames=options.frames,
                shadow=options.shadow,
                threads=options.threads,
            )
            settings, seed = Settings(), options.seed
        folder.mkdir(parents=True, exist_ok=True)
        learner = make_learner(config, settings, seed, folder)
        if options.resume:
            load_checkpoint(learner, folder)
    except (ValueError, TypeError, RuntimeError) as error:
        console.print(f"error: {error}", style="red", markup=False)
        return 2
    write_config(folder, config, settings, seed, options.steps)
    training = Training(config, settings, seed, options.steps, folder, console, learner)
    return training.run(options.resume)


class Training:
    """Trials, the training of the best, and what is left of it whenever it ends."""

    def __init__(
        self,
        config: SpooferConfig,
        settings: Settings,
        seed: int,
        steps: int,
        folder: Path,
        console: Console,
        learner: PPO,
    ) -> None:
        self._config, self._settings, self._seed, self._steps = config, settings, seed, steps
        self._folder, self._console = folder, console
        self._learner = learner
        scale = float(learner.get_env().unwrapped.vector_env.game.scenario.error_scale)  # type: ignore[union-attr]
        self._watch = Watch(
            steps, console, lambda present: f"mean gain {mean_return(present) * scale:.1f} m", self._keep
        )

    def run(self, resume: bool) -> int:
        """Train to the end, after trials where this is no resumed run; returns the exit status."""
        begin = time.perf_counter()
        before = self._learner.num_timesteps
        interrupted = False
        self._watch.start()
        try:
            if not resume:
                self._try_beginnings()
            self._learn(self._learner, self._steps - self._watch.steps_before)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            self._watch.stop()
        self._keep(self._learner)
        played = self._watch.steps_before + self._learner.num_timesteps - before
        seconds = time.perf_counter() - begin
        self._console.print(
            f"{'interrupted after' if interrupted else 'trained'} {played:,} steps in {seconds:.0f} s "
            f"({played / max(seconds, 1e-9):,.0f} steps/s); policy in {self._folder}",
            markup=False,
        )
        if interrupted:
            self._console.print(
                f"go on with: python -m train.spoofer --resume --out {self._folder} --steps {self._steps}", markup=False
            )
        return 130 if interrupted else 0

    def _keep(self, learner: PPO) -> None:
        export(learner, self._config, self._folder)
        save_checkpoint(learner, self._folder)

    def _try_beginnings(self) -> None:
        """Short trainings from different beginnings: which direction an attack takes is decided early, by chance."""
        share = self._steps // (2 * self._settings.trials + 2)
        first, played = self._learner, 0
        for trial in range(self._settings.trials):
            candidate = first
            if trial:
                seed = int(np.random.SeedSequence((self._seed, trial)).generate_state(1)[0])
                candidate = make_learner(self._config, self._settings, seed, self._folder)
            best, self._learner = self._learner, candidate
            self._learn(candidate, share)
            if mean_return(best) > mean_return(candidate):
                self._learner = best
            played += candidate.num_timesteps
            self._watch.steps_before = played
        self._watch.steps_before = played - self._learner.num_timesteps

    def _learn(self, learner: PPO, steps: int) -> None:
        """Up to ``steps`` of this learner in all."""
        done = learner.num_timesteps
        if steps > done:
            learner.learn(steps - done, callback=self._watch, reset_num_timesteps=done == 0, tb_log_name="ppo")


if __name__ == "__main__":
    sys.exit(main())
