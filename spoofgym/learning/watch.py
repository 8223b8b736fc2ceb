"""What is seen of a training while it runs, and the legs that it consists of."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from spoofgym.learning.curve import LearningCurve

CHECKPOINTS = 10
LONGEST_LEG = 250_000
LINE_EVERY = 30.0
"""Seconds between two lines where no bar is shown."""


def leg_of(steps: int) -> int:
    """Steps between two checkpoints of a run: a tenth of it, no more than `LONGEST_LEG`."""
    return max(1, min(steps // CHECKPOINTS, LONGEST_LEG))


class Watch(BaseCallback):
    """Progress bar over a whole run, and a checkpoint after every leg.

    A leg begins with new games in all lanes and random numbers of its own, which the seed of the run, the learner and
    the steps that it has played decide. So what comes after a checkpoint depends on what was before it only
    through the learner, and a run that is resumed there goes on as if nothing had stopped it.

    Attributes:
        steps_before: steps of the learners before the present one, which the bar counts as well.
        stream: numbers that tell the present learner's random numbers from those of others: the seed of the run, and
            which learner of the run it is.
    """

    def __init__(
        self,
        steps: int,
        curve: LearningCurve,
        console: Console,
        result: Callable[[PPO], str],
        keep: Callable[[PPO], None],
    ) -> None:
        """Watch a run of ``steps``.

        Args:
            steps: of all learners.
            curve: of the run; written before every checkpoint.
            console: where the bar is shown, if it is a terminal.
            result: what the bar says of a learner.
            keep: called after every leg, between two rollouts.
        """
        super().__init__()
        self._steps, self._curve, self._result, self._keep = steps, curve, result, keep
        self.steps_before = 0
        self.stream: tuple[int, ...] = (0, 0)
        self._progress = Progress(
            TextColumn("training"),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[result]}"),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task("training", total=steps, result="")
        self._console, self._begun, self._told = console, time.monotonic(), time.monotonic()
        self._end_of_leg: int | None = None

    def start(self) -> None:
        """Show the bar."""
        self._progress.start()

    def stop(self) -> None:
        """Leave the terminal as it was."""
        self._progress.stop()

    def learn(self, learner: PPO, steps: int, name: str = "ppo") -> None:
        """Let a learner play up to ``steps`` in all, in legs."""
        done = learner.num_timesteps
        if steps > done:
            self._end_of_leg = None
            learner.learn(steps - done, callback=self, reset_num_timesteps=done == 0, tb_log_name=name)

    def _on_training_end(self) -> None:
        self._curve.save()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        played = self.steps_before + self.num_timesteps
        if self.model.ep_info_buffer:
            self._curve.note(self.stream[1], self.num_timesteps, played, mean_return(self.model))
        result = self._result(self.model)  # type: ignore[arg-type]
        self._progress.update(self._task, completed=min(played, self._steps), result=result)
        self._tell(played, result)

    def _tell(self, played: int, result: str) -> None:
        """A line every so often where there is no bar: an output that is no terminal, a file say."""
        now = time.monotonic()
        if self._console.is_terminal or now - self._told < LINE_EVERY:
            return
        self._told = now
        spent, share = now - self._begun, min(played / self._steps, 1.0)
        self._console.print(f"training: {played:,} of {self._steps:,} steps, {share:.0%}, {spent:.0f} s; {result}")

    def _on_rollout_start(self) -> None:
        if self._end_of_leg is not None and self.num_timesteps < self._end_of_leg:
            return
        if self._end_of_leg is not None:
            self._curve.save()
            self._keep(self.model)  # type: ignore[arg-type]
        begin_leg(self.model, self.stream)
        self._end_of_leg = self.num_timesteps + leg_of(self._steps)


def begin_leg(learner: BaseAlgorithm, stream: tuple[int, ...]) -> None:
    """New games in all lanes, and random numbers that nothing decides but the stream and the steps played."""
    numbers = np.random.SeedSequence((*stream, learner.num_timesteps)).generate_state(2, np.uint64)
    learner.set_random_seed(int(numbers[0] >> 32))
    environment = learner.env
    assert environment is not None
    environment.seed(int(numbers[1] >> 1))
    learner._last_obs = environment.reset()  # type: ignore[assignment]
    learner._last_episode_starts = np.ones(environment.num_envs, dtype=bool)


def mean_return(learner: BaseAlgorithm) -> float:
    """Mean return of the last hundred games, or 0 before any has ended."""
    episodes: Any = learner.ep_info_buffer or []
    return float(np.mean([episode["r"] for episode in episodes])) if episodes else 0.0
