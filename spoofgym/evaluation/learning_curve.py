"""How a training went on: the files of a run folder that tell it, and what is read from them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from spoofgym import files

RETURNS_FILE = "returns.json"
"""A row for each rollout of a learner that has ended games."""
RETURNS = ("trial", "steps", "played", "mean_return")
"""Number of the learner, steps that it has played, steps that all learners have played, mean of its last games."""
VALIDATION_FILE = "validation.json"
VALIDATION = ("steps", "mean_error_m")

Rows = list[dict[str, float]]


def read_rows(path: Path, names: tuple[str, ...]) -> Rows:
    """The rows of a file; no rows where there is no file.

    Args:
        path: of the file.
        names: of the numbers of each row.

    Raises:
        ValueError: it is damaged.
    """
    if not path.exists():
        return []
    with files.reading(path):
        rows = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(rows, list):
            raise ValueError("it is no list of rows")
        return [_row(row, names) for row in rows]


def final_learner(rows: Rows) -> Rows:
    """The rows of the learner whose policy a run ends with: of the last trial that went on, from its beginning.

    Args:
        rows: of `RETURNS_FILE`.
    """
    return [row for row in rows if row["trial"] == rows[-1]["trial"]]


def _row(row: Any, names: tuple[str, ...]) -> dict[str, float]:
    if not isinstance(row, dict) or set(row) != set(names):
        raise ValueError(f"a row must have {', '.join(names)}")
    for value in row.values():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"a row must hold finite numbers, got {value!r}")
    return row
