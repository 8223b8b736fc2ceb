"""Train a PPO defender.

    spoofgym train defender --scenario foi-drive --steps 3200000 --seed 0 --out runs/d

Writes into the run folder: what the policy is trained on (``config.json``), the best policy (``policy.npz``, arrays
only), the validation of every tenth of the run (``validation.json``), TensorBoard logs, and checkpoints from which
``--resume`` goes on. The best is the policy with the least mean error on validation games against the training attacks.
Ctrl-C stops after the present step and leaves a usable policy.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import torch
from stable_baselines3 import PPO

from spoofgym import files
from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import Parser
from spoofgym.console import PlainConsole
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, configure
from spoofgym.envs.duel_config import DuelDefenderConfig
from spoofgym.envs.payoffs import PAYOFFS
from spoofgym.evaluation.agent_scores import play_games
from spoofgym.evaluation.defence import World, play_policy
from spoofgym.evaluation.learning_curve import VALIDATION_FILE
from spoofgym.learning import checkpoint
from spoofgym.learning.curve import LearningCurve
from spoofgym.learning.defender_ppo import AnyDefenderConfig, Settings, begin, export, make_learner
from spoofgym.learning.run_folder import CHECKPOINT_FILE, DEFAULT_STEPS, Run, RunFolder, add_options
from spoofgym.learning.session import train
from spoofgym.learning.settings_options import add_settings, given_settings
from spoofgym.learning.watch import CHECKPOINTS, Watch, mean_return
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.learned import POLICY_FILE, LearnedDefender
from spoofgym.program import moved, program
from spoofgym.scenarios import make_scenario

EXAMPLES = (
    "spoofgym train defender --scenario foi-drive --out runs/d",
    "spoofgym train defender --spoofer pool:ramp:0.2+jump:20 --out runs/e",
    "spoofgym train defender --resume --out runs/d",
)

DETECTORS = ("snapshot", "windowed:n=5", "windowed:n=20", "signed-mean:n=5", "signed-mean:n=10")
VALIDATION_SEED = 2_000_000_000
"""Of validation game 0: far from the seeds of training lanes and of evaluations."""


def parser() -> argparse.ArgumentParser:
    """The command line; what is not given has no entry."""
    result = Parser(
        prog="spoofgym train defender", examples=EXAMPLES,
        description="Train a PPO defender against a population of spoofers.",
        argument_default=argparse.SUPPRESS,
    )
    add = result.add_argument
    add("--scenario", help="what is driven or flown (default: foi-drive)")
    add("--attacks", help="the population of opponents (default: training)")
    add("--detector", action="append",
        help=f"whose statistics the defender sees; repeatable (default: {', '.join(DETECTORS)})")
    add("--bank", metavar="SPEC",
        help="bank of hypotheses that the defender sees, too: multiple-hypothesis, with options (default: none)")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear)")
    add("--spoofer", metavar="SPEC",
        help="train in the duel, against this spoofer: ramp:0.5, training, policy:FOLDER, pool:A+B, ...")
    add("--payoff", metavar="SPEC", help=f"of the duel: {PAYOFFS} (default: error)")
    add_options(result, "runs/defender")
    add_settings(result, Settings)
    return result


def asked_run(given: dict[str, Any]) -> Run:
    """The run that the options of the command line ask for.

    Raises:
        ValueError: an option of the duel without a spoofer, attacks or a bank beside a spoofer, or a part that is not
            valid.
    """
    arguments: dict[str, Any] = {"detectors": tuple(given.get("detector", DETECTORS))}
    names = ("scenario", "attacks", "bank", "fidelity", "threads", "spoofer", "payoff")
    arguments |= {name: given[name] for name in names if name in given}
    if "payoff" in given and "spoofer" not in given:
        raise ValueError("--payoff is of a duel: name the --spoofer, too")
    if "spoofer" in given and "attacks" in given:
        raise ValueError("--spoofer names who attacks in a duel: leave --attacks out")
    if "spoofer" in given and "bank" in given:
        raise ValueError("nobody sees a bank in a duel: leave --bank or --spoofer out")
    config: Any = configure(DuelDefenderConfig if "spoofer" in given else DefenderConfig, arguments)
    settings = Settings(**given_settings(given, Settings))
    return Run(config, settings, given.get("seed", 0), given.get("steps", DEFAULT_STEPS))


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    folder = RunFolder(options.out, "spoofgym.learning.defender", (DefenderConfig, DuelDefenderConfig), Settings)
    return train(options, folder, asked_run, Training)


Rows = list[dict[str, float]]
"""Steps played and mean error, m, of each validation."""


class Training:
    """The training of one learner, and what is left of it whenever it ends."""

    def __init__(self, run: Run, folder: RunFolder, terminal: PlainConsole) -> None:
        """Build the learner, and put it where the run stands.

        Raises:
            ValueError: the environment cannot be built, or the checkpoint is damaged.
        """
        self._run, self._folder, self._console = run, folder, terminal
        self._config: AnyDefenderConfig = run.environment
        with folder.naming_settings():
            self._learner = make_learner(self._config, run.learner, run.seed, folder.path)
            self._harm = _validated(self._config)
        self._validation: Rows = []
        self._best: LearnedDefender | None = None
        self._begun = False
        state = folder.state()
        if state is not None:
            self._read(state)
        curve = LearningCurve(folder.path, self.played)
        self._watch = Watch(
            run.steps, curve, terminal, lambda present: f"mean return {mean_return(present):.1f}", self._keep
        )

    def train(self) -> bool:
        """Train to the end; whether Ctrl-C came before it."""
        if self._best is not None:
            self._write()  # a kill may have come between these files and the checkpoint
        interrupted = False
        try:
            if not self._begun:
                self._begin()
            self._watch.start()
            self._watch.learn(self._learner, self._run.steps)
            if self._validation[-1]["steps"] < self._learner.num_timesteps:
                self._validate(self._learner)
            self._save(self._learner, self._run.steps)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            self._watch.stop()
        path = self._folder.path
        if interrupted and not (path / POLICY_FILE).is_file():
            export(self._learner, self._config, path).save(path)
        return interrupted

    @property
    def played(self) -> int:
        """Steps played."""
        return self._learner.num_timesteps

    def _begin(self) -> None:
        """Begin with a classical defender, or with nothing."""
        if self._run.learner.imitate:
            with self._console.progress("a classical defender is imitated, then the critic learns alone"):
                try:
                    begin(self._learner, self._config, self._run.learner, self._run.seed)
                finally:
                    self._learner.num_timesteps = 0  # of what counts, nothing has been played
        self._begun = True
        self._validate(self._learner)
        self._save(self._learner)

    def _keep(self, learner: PPO) -> None:
        if learner.num_timesteps >= self._validation[-1]["steps"] + self._run.steps // CHECKPOINTS:
            self._validate(learner)
        self._save(learner)

    def _validate(self, learner: PPO) -> None:
        """Play validation games; the policy is kept if it is the best so far."""
        policy = export(learner, self._config, self._folder.path)
        error = self._harm(policy, self._run.learner.validation_episodes)
        if error < min((row["mean_error_m"] for row in self._validation), default=math.inf):
            self._best = policy
        self._validation.append({"steps": learner.num_timesteps, "mean_error_m": error})
        self._write()

    def _write(self) -> None:
        """What the checkpoint holds, for those who read it."""
        assert self._best is not None
        self._best.save(self._folder.path)
        files.write_json(self._folder.path / VALIDATION_FILE, self._validation)

    def _save(self, learner: PPO, finished: int = 0) -> None:
        """Keep a checkpoint; ``finished`` is the length of a run that has come to its end."""
        assert self._best is not None
        layers = zip(self._best.weights, self._best.biases, strict=True)
        self._folder.save(
            {
                "learner": checkpoint.learner_state(learner),
                "validation": self._validation,
                "best": [[torch.tensor(weight), torch.tensor(bias)] for weight, bias in layers],
                "played": learner.num_timesteps,
                "finished": finished,
            }
        )

    def _read(self, state: checkpoint.State) -> None:
        """Go on from a checkpoint.

        Raises:
            ValueError: the checkpoint is damaged, or of another run.
        """
        with files.reading(self._folder.path / CHECKPOINT_FILE):
            checkpoint.check(self._learner, state["learner"])
            self._validation = [
                {"steps": checkpoint.whole(row["steps"]), "mean_error_m": float(row["mean_error_m"])}
                for row in state["validation"]
            ]
            if not self._validation or not all(math.isfinite(row["mean_error_m"]) for row in self._validation):
                raise ValueError("the validation has no rows, or an error that is not finite")
            present = export(self._learner, self._config, self._folder.path)
            self._best = replace(
                present,
                weights=tuple(weight.numpy() for weight, _ in state["best"]),
                biases=tuple(bias.numpy() for _, bias in state["best"]),
            )
            self._best.check_like(present)
            checkpoint.restore(self._learner, state["learner"])
            self._begun = True

    def summary(self) -> str:
        """Which policy was kept, and how it did in validation."""
        if not self._validation:
            return "no validation yet"
        best = min(self._validation, key=lambda row: row["mean_error_m"])
        return f"best policy at {best['steps']:,} steps: {best['mean_error_m']:.3f} m in validation"


def _validated(config: AnyDefenderConfig) -> Callable[[LearnedDefender, int], float]:
    """What measures a policy in so many validation games: its mean error, m, or in a duel its harm."""
    if isinstance(config, DuelDefenderConfig):
        return lambda policy, games: float(play_games(config, policy.act, games, VALIDATION_SEED).mean())
    world = _validation_world(config)
    return lambda policy, games: float(play_policy(world, config, policy.act, games, VALIDATION_SEED).error.mean())


def _validation_world(config: DefenderConfig) -> World:
    scenario = make_scenario(str(config.scenario))
    assert isinstance(config.detectors, tuple)
    detectors = calibrated_for_play([make_detector(part) for part in config.detectors], scenario, config.fidelity)
    return World(
        scenario, str(config.attacks), config.clean, tuple(detectors), fidelity=config.fidelity, threads=config.threads
    )


if __name__ == "__main__":
    sys.exit(moved("spoofgym train defender"))
