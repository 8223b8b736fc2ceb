"""Training runs: their learning curves, those that differ in the seed alone in one figure."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.learning_curve import (
    RETURNS,
    RETURNS_FILE,
    VALIDATION,
    VALIDATION_FILE,
    Rows,
    final_learner,
    read_rows,
)
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.policies.learned import CONFIG_FILE, kind_of, read_config
from spoofgym.report.figures import Figure, Line, Lines, Section
from spoofgym.report.tables import capital

MOST_POINTS = 400
"""Of a curve in a page."""


@dataclass(frozen=True)
class TrainingRun:
    """A run folder.

    Attributes:
        name: of the folder.
        config: environment, learner, seed and steps.
        returns: mean returns of the learner whose policy the run ends with.
        validation: mean errors in validation games, of a defender.
    """

    name: str
    config: dict[str, Any]
    returns: Rows
    validation: Rows

    @classmethod
    def read(cls, folder: Path) -> TrainingRun:
        """The run in a folder.

        Raises:
            ValueError: a file is damaged, or there is no curve.
        """
        returns, validation = read_rows(folder / RETURNS_FILE, RETURNS), read_rows(folder / VALIDATION_FILE, VALIDATION)
        if not returns and not validation:
            raise ValueError(f"{folder} has no learning curve: {RETURNS_FILE} is written from the first checkpoint on")
        return cls(folder.name, read_config(folder), final_learner(returns) if returns else [], validation)

    @property
    def setting(self) -> str:
        """What runs of different seeds have in common."""
        return json.dumps([self.config["environment"], self.config.get("learner")], sort_keys=True)

    @property
    def seed(self) -> object:
        """Of the run."""
        return self.config.get("seed")


def is_run(folder: Path) -> bool:
    """Whether a folder holds a training run."""
    return (folder / CONFIG_FILE).is_file()


def training_sections(runs: Sequence[TrainingRun]) -> list[Section]:
    """A section for each setting, with the runs of all its seeds."""
    groups: dict[str, list[TrainingRun]] = {}
    for run in runs:
        groups.setdefault(run.setting, []).append(run)
    return [_section(group) for group in groups.values()]


def _section(runs: Sequence[TrainingRun]) -> Section:
    environment = runs[0].config["environment"]
    figures: list[Figure] = []
    for title, y_label, rows, key in (
        ("Learning curve", "mean return of the last 100 games", [run.returns for run in runs], "mean_return"),
        ("Validation", "mean error in validation games, m", [run.validation for run in runs], "mean_error_m"),
    ):
        if any(rows):
            found = [(run, series) for run, series in zip(runs, rows, strict=True) if series]
            figures.append(_lines(title, y_label, found, key))
    seeds = ", ".join(str(run.seed) for run in runs)
    facts = [("Runs", ", ".join(run.name for run in runs)), ("Seeds", seeds)]
    told = {name: value for name, value in environment.items() if value is not None and name != "threads"}
    facts += [(capital(name), _told(value)) for name, value in told.items()]
    return Section(f"Training of a {kind_of(environment)} on {environment['scenario']}", facts, figures)


def _told(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _lines(title: str, y_label: str, runs: Sequence[tuple[TrainingRun, Rows]], key: str) -> Lines:
    """The curve of every seed, and their mean with its interval where there are several."""
    x = _axis([rows for _, rows in runs])
    curves = [_on_axis(rows, x, key) for _, rows in runs]
    several = len(runs) > 1
    lines = [
        Line(f"seed {run.seed}", _plain(curve), faint=several) for (run, _), curve in zip(runs, curves, strict=True)
    ]
    if several:
        lines.insert(0, _mean(np.array(curves)))
    ends = ", ".join(f"{rows[-1][key]:.4g}" for _, rows in runs)
    return Lines(
        title=title,
        summary=f"{len(runs)} {'seeds' if several else 'seed'}; at the end: {ends} ({y_label}).",
        x_label="steps of the learner",
        y_label=y_label,
        x=x.tolist(),
        lines=lines,
    )


def _axis(runs: Sequence[Rows]) -> Floats:
    """All steps at which any of the runs was measured, not more than a page needs."""
    x = np.unique(np.concatenate([[row["steps"] for row in rows] for rows in runs]).astype(np.float64))
    if len(x) <= MOST_POINTS:
        return x
    return x[np.unique(np.linspace(0, len(x) - 1, MOST_POINTS).round().astype(np.int64))]


def _on_axis(rows: Rows, x: Floats, key: str) -> Floats:
    """A curve at common steps, linear between its own; NaN beyond its ends."""
    steps = np.array([row["steps"] for row in rows], dtype=np.float64)
    return np.interp(x, steps, [row[key] for row in rows], left=np.nan, right=np.nan)


def _mean(curves: Floats) -> Line:
    """The mean of the seeds with its 95 % interval, where all of them have a value."""
    known = np.isfinite(curves).all(axis=0)
    mean, low, high = np.full((3, curves.shape[1]), np.nan)
    for place in np.flatnonzero(known):
        mean[place] = curves[:, place].mean()
        low[place], high[place] = mean_interval(curves[:, place])
    return Line(f"mean of {len(curves)} seeds", _plain(mean), _plain(low), _plain(high))


def _plain(values: Floats) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
