"""What is seen of a training while it runs, and what is kept of it on the way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

CHECKPOINTS = 10


class Watch(BaseCallback):
    """Progress bar over a whole run, and a call after every tenth of it.

    Attributes:
        steps_before: steps of the learners before the present one, which the bar counts, too.
    """

    def __init__(
        self, steps: int, console: Console, result: Callable[[PPO], str], keep: Callable[[PPO], None]
    ) -> None:
        """Watch a run of ``steps``.

        Args:
            steps: of all learners.
            console: where the bar is shown.
            result: what the bar says of a learner.
            keep: called after every tenth of the run, between two rollouts.
        """
        super().__init__()
        self._steps, self._result, self._keep = steps, result, keep
        self.steps_before = 0
        self._progress = Progress(
            TextColumn("training"),
            BarColumn(bar_width=20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[result]}"),
            console=console,
        )
        self._task = self._progress.add_task("training", total=steps, result="")
        self._next_checkpoint = steps // CHECKPOINTS

    def start(self) -> None:
        """Show the bar."""
        self._progress.start()

    def stop(self) -> None:
        """Leave the terminal as it was."""
        self._progress.stop()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        played = self.steps_before + self.num_timesteps
        self._progress.update(
            self._task, completed=min(played, self._steps), result=self._result(self.model)  # type: ignore[arg-type]
        )

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next_checkpoint:
            self._next_checkpoint = self.num_timesteps + self._steps // CHECKPOINTS
            self._keep(self.model)  # type: ignore[arg-type]


def mean_return(learner: BaseAlgorithm) -> float:
    """Mean return of the last hundred games, or 0 before any has ended."""
    episodes: Any = learner.ep_info_buffer or []
    return float(np.mean([episode["r"] for episode in episodes])) if episodes else 0.0
