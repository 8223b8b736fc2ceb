"""Train a PPO spoofer.

    spoofgym train spoofer --scenario liu-flight --detector snapshot --knowledge shadow --out runs/x
    spoofgym train spoofer --scenario foi-drive --defender snapshot/px4-auto --out runs/y

Writes into the run folder: what the policy is trained on (``config.json``), the policy (``policy.npz``, arrays only),
TensorBoard logs, and checkpoints from which ``--resume`` goes on. Ctrl-C stops after the present step and leaves a
usable policy.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from stable_baselines3 import PPO

from spoofgym import files
from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.command_line import Parser, count, share
from spoofgym.console import PlainConsole
from spoofgym.envs.config import ACTIONS, SpooferConfig, configure
from spoofgym.envs.duel_config import DuelSpooferConfig
from spoofgym.envs.objectives import SPELLINGS
from spoofgym.envs.payoffs import PAYOFFS
from spoofgym.evaluation.duels import with_detectors_of
from spoofgym.learning import checkpoint, scripted_start
from spoofgym.learning.curve import LearningCurve
from spoofgym.learning.ppo import SCRIPTED_START, Settings, export, make_learner
from spoofgym.learning.run_folder import CHECKPOINT_FILE, DEFAULT_STEPS, Run, RunFolder, add_options
from spoofgym.learning.session import train
from spoofgym.learning.settings_options import add_settings, given_settings
from spoofgym.learning.watch import Watch, mean_return
from spoofgym.navigation.family import FIDELITIES
from spoofgym.program import moved, program

EXAMPLES = (
    "spoofgym train spoofer --scenario liu-flight --knowledge shadow --out runs/x",
    "spoofgym train spoofer --scenario foi-drive --defender snapshot/px4-auto \\",
    "  --out runs/y",
    "spoofgym train spoofer --resume --out runs/x",
)


def parser() -> argparse.ArgumentParser:
    """The command line; what is not given has no entry."""
    result = Parser(
        prog="spoofgym train spoofer", examples=EXAMPLES,
        description="Train a PPO spoofer against a detector on a real INS/GNSS filter.",
        argument_default=argparse.SUPPRESS,
    )
    add = result.add_argument
    add("--scenario", help="what is flown: liu-flight, kujur-flight, ... (default: liu-flight)")
    add("--detector", action="append", help="snapshot, windowed:n=20, ...; repeatable (default: snapshot)")
    add("--knowledge", choices=KNOWLEDGE, help="of the victim (default: shadow)")
    add("--action", choices=ACTIONS, help="what the policy controls (default: rate)")
    add("--frames", type=count, help="epochs that the policy sees at once (default: 1)")
    add("--shadow", metavar="SPEC", help="scenario whose filter the spoofer takes for the victim's (default: its own)")
    add("--objective", metavar="SPEC", help=f"of a single game: {SPELLINGS} (default: error)")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear)")
    add("--defender", metavar="SPEC",
        help="train in the duel, against this defender: snapshot/exclude, px4-auto, policy:FOLDER, pool:A+B, ...")
    add("--payoff", metavar="SPEC", help=f"of the duel: {PAYOFFS} (default: error)")
    add("--clean", type=share, help="share of clean games in the duel, which teach a spoofer nothing (default: 0)")
    add_settings(result, Settings, {
        "scripted": "begin, in the duel, with the scripted or optimal attack that harms the defender most"
    })
    add_options(result, "runs/spoofer")
    return result


def asked_run(given: dict[str, Any]) -> Run:
    """The run that the options of the command line ask for.

    Raises:
        ValueError: an option of the duel without a defender, no game with an attack, or a part that is not valid.
    """
    settings = given_settings(given, Settings)
    others = ("seed", "steps", "detector", *settings)
    arguments = {name: value for name, value in given.items() if name not in others}
    detectors = tuple(given.get("detector", ()))
    config: Any
    if "defender" in arguments:
        if "objective" in arguments:
            raise ValueError("--objective is of a game without a --defender; what a duel is played for is its --payoff")
        duel = configure(DuelSpooferConfig, {"clean": 0.0, "detectors": detectors or "snapshot", **arguments})
        if duel.clean == 1.0:
            raise ValueError("--clean 1 makes every game a clean one, which teaches a spoofer nothing: give less")
        config = with_detectors_of(duel, (duel.defender,))
    else:
        told = ("payoff", "clean", *(["scripted"] if settings.get("scripted") else []))
        for name in told:
            if name in given:
                raise ValueError(f"--{name} is of a duel: name the --defender, too")
        if detectors:
            arguments["detector"] = detectors[0] if len(detectors) == 1 else detectors
        config = configure(SpooferConfig, arguments)
    if settings.get("scripted"):
        settings = {**SCRIPTED_START, **settings}
    return Run(config, Settings(**settings), given.get("seed", 0), given.get("steps", DEFAULT_STEPS))


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    folder = RunFolder(options.out, "spoofgym.learning.spoofer", (SpooferConfig, DuelSpooferConfig), Settings)
    return train(options, folder, asked_run, Training)


@dataclass(frozen=True)
class Place:
    """Where a run stands: first some trials, then the training of the best of them.

    Attributes:
        trial: which one goes on; as many as there are trials = the training of the best.
        before: steps of trials that have ended, without those of the learner that goes on.
        best: the best of the trials that have ended; None before any has.
        best_trial: which one that was.
        learner: the state of the learner that goes on; None = it begins.
    """

    trial: int = 0
    before: int = 0
    best: checkpoint.State | None = None
    best_trial: int = 0
    learner: checkpoint.State | None = None


class Training:
    """Trials, the training of the best, and what is left of it whenever it ends."""

    def __init__(self, run: Run, folder: RunFolder, terminal: PlainConsole) -> None:
        """Build the learner that goes on, or the first.

        Raises:
            ValueError: the environment cannot be built, or the checkpoint is damaged.
        """
        if run.learner.scripted and not isinstance(run.environment, DuelSpooferConfig):
            raise ValueError(f"{folder.path}: only a spoofer in a duel can begin with a scripted attack")
        self._run, self._folder = run, folder
        self._trials = run.learner.trials
        self._place = Place()
        with folder.naming_settings():
            self._learner = self._made(0)
        state = folder.state()
        if state is not None:
            self._place = self._read(state)
            self._learner = self._present()
        self._watch = Watch(run.steps, LearningCurve(folder.path, self.played), terminal, self._told, self._keep)

    def _told(self, learner: PPO) -> str:
        """What the bar says of a learner."""
        game: Any = learner.get_env().unwrapped.vector_env.game  # type: ignore[union-attr]
        if isinstance(self._run.environment, DuelSpooferConfig):
            return f"mean harm {mean_return(learner):.3g} {'' if game.harm.payoff.unit != 'm' else 'm'}".rstrip()
        return f"mean gain {mean_return(learner) * game.scenario.error_scale:.1f} m"

    def train(self) -> bool:
        """Train to the end; whether Ctrl-C came before it."""
        interrupted = False
        self._watch.start()
        try:
            while self._place.trial < self._trials:
                self._try()
            self._learn(self._run.steps - self._place.before)
            self._save_policy(self._learner)
            self._folder.save(self._content(self._learner, self._run.steps))
        except KeyboardInterrupt:
            interrupted = True
        finally:
            self._watch.stop()
        if interrupted and self._shown:
            self._save_policy(self._learner)
        return interrupted

    def summary(self) -> str:
        """Nothing: no validation chose the policy."""
        return ""

    @property
    def played(self) -> int:
        """Steps played, of all learners together."""
        return self._place.before + self._learner.num_timesteps

    @property
    def _present_trial(self) -> int:
        """The trial with which the learner that goes on began."""
        return self._place.trial if self._place.trial < self._trials else self._place.best_trial

    @property
    def _shown(self) -> bool:
        """Whether the present learner's policy is the one to use: no trial before it was better."""
        return self._place.best is None

    def _made(self, trial: int) -> PPO:
        """The learner of a trial, as it begins."""
        seed = self._run.seed
        if trial:
            seed = int(np.random.SeedSequence((seed, trial)).generate_state(1)[0])
        return make_learner(self._run.environment, self._run.learner, seed, self._folder.path)

    def _present(self) -> PPO:
        """The learner that goes on, as the run left it."""
        learner = self._made(self._present_trial)
        if self._place.learner is not None:
            checkpoint.restore(learner, self._place.learner)
        return learner

    def _learn(self, steps: int) -> None:
        settings, config = self._run.learner, self._run.environment
        if settings.scripted and self._learner.num_timesteps == 0:
            scripted_start.begin(self._learner, config, settings.critic_games, self._learner.seed or 0)
        self._watch.stream = (self._run.seed, self._present_trial)
        self._watch.steps_before = self._place.before
        self._watch.learn(self._learner, steps)

    def _try(self) -> None:
        """A short training: which direction an attack takes is decided early, by chance."""
        self._learn(self._run.steps // (2 * self._trials + 2))
        place, state = self._place, checkpoint.learner_state(self._learner)
        best, best_trial = state, place.trial
        if place.best is not None and checkpoint.mean_gain(place.best) > checkpoint.mean_gain(state):
            best, best_trial = place.best, place.best_trial
        if best_trial == place.trial:
            self._save_policy(self._learner)
        following, before = place.trial + 1, place.before + state["steps"]
        if following < self._trials:
            self._place = Place(following, before, best, best_trial)
        else:
            self._place = Place(following, before - best["steps"], None, best_trial, best)
        self._learner = self._present()
        self._folder.save(self._content(self._learner))

    def _keep(self, learner: PPO) -> None:
        if self._shown:
            self._save_policy(learner)
        self._folder.save(self._content(learner))

    def _save_policy(self, learner: PPO) -> None:
        export(learner, self._run.environment, self._folder.path).save(self._folder.path)

    def _content(self, learner: PPO, finished: int = 0) -> checkpoint.State:
        """A checkpoint; ``finished`` is the length of a run that has come to its end."""
        place = self._place
        return {
            "trial": place.trial,
            "before": place.before,
            "best": place.best,
            "best_trial": place.best_trial,
            "learner": checkpoint.learner_state(learner) if learner.num_timesteps else None,
            "played": place.before + learner.num_timesteps,
            "finished": finished,
        }

    def _read(self, state: checkpoint.State) -> Place:
        """The place that a checkpoint tells.

        Raises:
            ValueError: the checkpoint is damaged, or of another run.
        """
        with files.reading(self._folder.path / CHECKPOINT_FILE):
            trial, best_trial = checkpoint.whole(state["trial"]), checkpoint.whole(state["best_trial"])
            if not best_trial < self._trials or not trial <= self._trials:
                raise ValueError(f"trial {trial}, the best {best_trial}, of {self._trials}")
            for present in (state["best"], state["learner"]):
                if present is not None:
                    checkpoint.check(self._learner, present)
            if (state["learner"] is None and trial == self._trials) or (state["best"] is None) != (
                trial in (0, self._trials)
            ):
                raise ValueError("the learner that goes on is missing")
            before = checkpoint.whole(state["before"])
            return Place(trial, before, state["best"], best_trial, state["learner"])


if __name__ == "__main__":
    sys.exit(moved("spoofgym train spoofer"))
