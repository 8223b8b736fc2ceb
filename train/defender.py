"""Train a PPO defender.

    python -m train.defender --scenario foi-drive --steps 3200000 --seed 0 --out runs/d

Writes into the run folder: the best policy (``policy.npz``, arrays only), what it was trained on (``config.json``),
the validation of every checkpoint (``validation.json``), TensorBoard logs, and a checkpoint from which ``--resume``
goes on. The best is the checkpoint with the least mean error on validation games against the training attacks. Ctrl-C
stops after the present step and leaves a usable policy.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from stable_baselines3 import PPO

from agents.learned import CONFIG_FILE, POLICY_FILE
from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, configure
from spoofgym.evaluation.defence import World, play_policy
from spoofgym.scenario import FIDELITIES
from spoofgym.scenarios import make_scenario
from train.arguments import count, seed_number
from train.defender_ppo import Settings, begin, environment_arguments, export, make_learner
from train.ppo import CHECKPOINT_FILE, load_checkpoint, read_config, save_checkpoint
from train.watch import Watch, mean_return

DEFAULT_STEPS = 3_200_000
DETECTORS = ("snapshot", "windowed:n=5", "windowed:n=20", "signed-mean:n=5", "signed-mean:n=10")
VALIDATION_FILE = "validation.json"
VALIDATION_SEED = 2_000_000_000
"""Of validation game 0: far from the seeds of training lanes and of evaluations."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = argparse.ArgumentParser(
        prog="python -m train.defender", description="Train a PPO defender against a population of spoofers."
    )
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--attacks", default="training", help="the population of opponents (default: %(default)s)")
    add("--detector", action="append", help=f"whose statistics the defender sees; repeatable ({', '.join(DETECTORS)})")
    add("--fidelity", default="linear", choices=FIDELITIES, help="of the simulation (default: %(default)s)")
    add("--steps", type=count, help=f"GNSS epochs to play (default: {DEFAULT_STEPS}; a resumed run's own)")
    add("--seed", type=seed_number, default=0, help="of the learner and lane 0 (default: %(default)s)")
    add("--out", type=Path, default=Path("runs/defender"), help="run folder (default: %(default)s)")
    add("--threads", type=count, default=1, help="of the learner and the simulation (default: %(default)s)")
    add("--resume", action="store_true", help="go on from the checkpoint in the run folder, with its settings")
    for name, value in asdict(Settings()).items():
        kind: Any = _switch if isinstance(value, bool) else type(value)
        add(f"--{name.replace('_', '-')}", type=kind, default=value, help=argparse.SUPPRESS)
    return result


def _switch(text: str) -> bool:
    if text not in ("true", "false"):
        raise argparse.ArgumentTypeError(f"expected true or false, got {text!r}")
    return text == "true"


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
            config = configure(DefenderConfig, content["environment"] | {"threads": options.threads})
            config = replace(config, detectors=tuple(config.detectors))  # type: ignore[arg-type]
            settings, seed = Settings(**content["learner"]), int(content["seed"])
            steps = options.steps or int(content["steps"])
            _refuse_changes(options, config, settings, seed)
        else:
            config = DefenderConfig(
                scenario=options.scenario,
                attacks=options.attacks,
                detectors=tuple(options.detector or DETECTORS),
                fidelity=options.fidelity,
                threads=options.threads,
            )
            settings = Settings(**{name: getattr(options, name) for name in asdict(Settings())})
            seed, steps = options.seed, options.steps or DEFAULT_STEPS
        folder.mkdir(parents=True, exist_ok=True)
        training = Training(config, settings, seed, steps, folder, console)
        if options.resume:
            training.resume()
    except (ValueError, TypeError, RuntimeError) as error:
        console.print(f"error: {error}", style="red", markup=False)
        return 2
    return training.run()


def _refuse_changes(options: argparse.Namespace, config: DefenderConfig, settings: Settings, seed: int) -> None:
    """A resumed run keeps its settings.

    Raises:
        ValueError: an option was given that says otherwise.
    """
    kept = {**vars(config), **asdict(settings), "seed": seed, "detector": list(config.detectors)}  # type: ignore[arg-type]
    for name, value in vars(options).items():
        given = value != parser().get_default(name) and name in kept and name != "threads"
        if given and value != kept[name]:
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"a resumed run keeps its settings: {option} {value} was given, the run has {kept[name]}")


class Training:
    """The training of one learner, and what is left of it whenever it ends."""

    def __init__(
        self, config: DefenderConfig, settings: Settings, seed: int, steps: int, folder: Path, console: Console
    ) -> None:
        """Build the learner."""
        self._config, self._settings, self._seed, self._steps = config, settings, seed, steps
        self._folder, self._console = folder, console
        self._learner = make_learner(config, settings, seed, folder)
        scenario = make_scenario(config.scenario)
        assert isinstance(config.detectors, tuple)
        detectors = calibrated_all([make_detector(part) for part in config.detectors], scenario)
        self._world = World(
            scenario, str(config.attacks), config.clean, tuple(detectors), fidelity=config.fidelity,
            threads=config.threads,
        )
        self._validation: list[dict[str, float]] = []
        self._watch = Watch(steps, console, self._result, self._keep)

    def resume(self) -> None:
        """Go on from the checkpoint in the run folder."""
        load_checkpoint(self._learner, self._folder)
        path = self._folder / VALIDATION_FILE
        self._validation = json.loads(path.read_text()) if path.is_file() else []
        if self._learner.num_timesteps >= self._steps:
            raise ValueError(
                f"the run has played {self._learner.num_timesteps:,} steps already: give more than that by --steps"
            )

    def run(self) -> int:
        """Train to the end; returns the exit status."""
        content = {
            "environment": environment_arguments(self._config),
            "learner": asdict(self._settings),
            "seed": self._seed,
            "steps": self._steps,
        }
        (self._folder / CONFIG_FILE).write_text(json.dumps(content, indent=2) + "\n")
        started, before, interrupted = time.perf_counter(), self._learner.num_timesteps, False
        if before == 0 and self._settings.imitate and not self._imitate():
            return 130
        self._watch.start()
        try:
            self._learner.learn(
                self._steps - before, callback=self._watch, reset_num_timesteps=before == 0, tb_log_name="ppo"
            )
        except KeyboardInterrupt:
            interrupted = True
        finally:
            self._watch.stop()
        save_checkpoint(self._learner, self._folder)
        validated = self._validation[-1]["steps"] if self._validation else -1
        if validated < self._learner.num_timesteps and not (interrupted and (self._folder / POLICY_FILE).is_file()):
            self._keep(self._learner)
        played, seconds = self._learner.num_timesteps - before, time.perf_counter() - started
        self._console.print(
            f"{'interrupted after' if interrupted else 'trained'} {played:,} steps in {seconds:.0f} s, validation "
            f"included ({played / max(seconds, 1e-9):,.0f} steps/s); {self._best()}; policy in {self._folder}",
            markup=False,
        )
        if interrupted:
            self._console.print(
                f"go on with: python -m train.defender --resume --out {self._folder} --steps {self._steps}",
                markup=False,
            )
        return 130 if interrupted else 0

    def _imitate(self) -> bool:
        """Begin with a classical defender; whether that came to its end."""
        try:
            with self._console.status("a classical defender is imitated, then the critic learns alone"):
                begin(self._learner, self._config, self._settings, self._seed)
                self._learner.num_timesteps = 0
                self._keep(self._learner)
        except KeyboardInterrupt:
            (self._folder / CONFIG_FILE).unlink()
            self._console.print("interrupted before the training began: there is nothing to go on from", markup=False)
            return False
        return True

    def _result(self, learner: PPO) -> str:
        return f"mean return {mean_return(learner):.1f}"

    def _keep(self, learner: PPO) -> None:
        """Validate a checkpoint; its policy is kept if it is the best so far."""
        policy = export(learner, self._config, self._folder)
        episodes = play_policy(
            self._world, replace(self._config), policy.act, self._settings.validation_episodes, VALIDATION_SEED
        )
        error = float(episodes.error.mean())
        if error < min((row["mean_error_m"] for row in self._validation), default=float("inf")):
            policy.save(self._folder)
        self._validation.append({"steps": learner.num_timesteps, "mean_error_m": error})
        (self._folder / VALIDATION_FILE).write_text(json.dumps(self._validation, indent=2) + "\n")
        save_checkpoint(learner, self._folder)

    def _best(self) -> str:
        best = min(self._validation, key=lambda row: row["mean_error_m"])
        return f"best checkpoint at {best['steps']:,} steps: {best['mean_error_m']:.3f} m in validation"


if __name__ == "__main__":
    sys.exit(main())
