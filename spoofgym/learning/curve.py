"""The learning curve that a training writes into its run folder."""

from __future__ import annotations

from pathlib import Path

from spoofgym import files
from spoofgym.evaluation.learning_curve import RETURNS, RETURNS_FILE, Rows, read_rows


class LearningCurve:
    """Mean returns over the steps of a run; it is written with the checkpoints, and goes on with a resumed run."""

    def __init__(self, folder: Path, played: int) -> None:
        """Begin, or go on after so many steps: rows that a checkpoint has not reached are played again.

        Args:
            folder: of the run.
            played: steps of all learners up to its checkpoint.

        Raises:
            ValueError: the file in the folder is damaged.
        """
        self._path = folder / RETURNS_FILE
        kept = read_rows(self._path, RETURNS) if played else []
        self._rows: Rows = [row for row in kept if row["played"] <= played]

    def note(self, trial: int, steps: int, played: int, mean_return: float) -> None:
        """Note a rollout.

        Args:
            trial: number of the learner within the run.
            steps: that the learner has played.
            played: that all learners of the run have played.
            mean_return: of the learner's last games.
        """
        self._rows.append({"trial": trial, "steps": steps, "played": played, "mean_return": round(mean_return, 6)})

    def save(self) -> None:
        """Write the curve whole."""
        files.write_json(self._path, self._rows)
