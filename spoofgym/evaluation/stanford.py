"""The Stanford diagram: how error, protection level and alert limit stand to each other, epoch by epoch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs

NOMINAL, MISLEADING, HAZARDOUS, UNAVAILABLE = range(4)
NAMES = ("nominal", "misleading", "hazardously misleading", "unavailable")
CELLS_TO_LIMIT = 40
"""Cells of the diagram from zero to the alert limit."""
REACH = 1.5
"""The diagram ends at so many alert limits; what lies beyond is counted in its last cells."""


@dataclass(frozen=True)
class StanfordDiagram:
    """Counts of epochs over error and protection level.

    Attributes:
        alert_limit: m.
        edges: of the cells, the same on both axes, (B + 1,), m; the alert limit is one of them.
        counts: by error and protection level, (B, B); the last row and the last column reach to infinity.
        regions: epochs in each region, in the order of `NAMES`, (4,); exact, while cells on the diagonal hold two.
        unavailable_misleading: epochs of the unavailable ones whose error is also beyond the protection level.
    """

    alert_limit: float
    edges: Floats
    counts: Runs
    regions: Runs
    unavailable_misleading: int

    def content(self) -> dict[str, Any]:
        """For a report: cells with epochs as (error, level, epochs), the others left out."""
        cells = zip(*np.nonzero(self.counts), strict=True)
        return {
            "alert_limit_m": self.alert_limit,
            "edges_m": self.edges.tolist(),
            "cells": [[int(error), int(level), int(self.counts[error, level])] for error, level in cells],
            "regions": dict(zip(NAMES, self.regions.tolist(), strict=True)),
            "unavailable_misleading": self.unavailable_misleading,
        }


def region(error: Floats, protection_level: Floats, alert_limit: float) -> Runs:
    """The region of each epoch, one of four, of the shape of ``error``.

    nominal: |e| <= PL <= AL; misleading: PL < |e| <= AL; hazardously misleading: PL <= AL < |e|; unavailable: AL < PL.
    """
    size = np.abs(error)
    available = np.where(size > alert_limit, HAZARDOUS, np.where(size > protection_level, MISLEADING, NOMINAL))
    return np.where(protection_level > alert_limit, UNAVAILABLE, available).astype(np.int64)


def stanford_diagram(
    error: Floats, protection_level: Floats, alert_limit: float, alarm: Flags | None = None
) -> StanfordDiagram:
    """Count epochs.

    Args:
        error: of the position, signed or not, any shape, m.
        protection_level: of the same shape, m; infinite where there is none.
        alert_limit: m.
        alarm: of the same shape; epochs with one are left out, for nobody is misled.

    Raises:
        ValueError: a shape or a value does not fit.
    """
    error, protection_level = checked("stanford", error, protection_level, alert_limit)
    alarmed = np.zeros(error.shape, dtype=np.bool_) if alarm is None else np.asarray(alarm, dtype=np.bool_)
    if alarmed.shape != error.shape:
        raise ValueError(f"stanford: alarm must have the shape {error.shape}, got {alarmed.shape}")
    used = ~alarmed
    size, level = np.abs(error[used]), protection_level[used]
    edges = float(alert_limit) / CELLS_TO_LIMIT * np.arange(round(REACH * CELLS_TO_LIMIT) + 1, dtype=np.float64)
    edges[CELLS_TO_LIMIT] = alert_limit
    counts = np.zeros((len(edges) - 1, len(edges) - 1), dtype=np.int64)
    np.add.at(counts, (_cell(size, edges), _cell(level, edges)), 1)
    regions = region(size, level, alert_limit)
    return StanfordDiagram(
        alert_limit=float(alert_limit),
        edges=edges,
        counts=counts,
        regions=np.bincount(regions, minlength=len(NAMES)).astype(np.int64),
        unavailable_misleading=int(np.count_nonzero((regions == UNAVAILABLE) & (size > level))),
    )


def checked(owner: str, error: Floats, protection_level: Floats, alert_limit: float) -> tuple[Floats, Floats]:
    """Error and protection level as arrays.

    Raises:
        ValueError: a shape or a value does not fit.
    """
    validation.above(owner, "alert_limit", alert_limit)
    error, level = np.asarray(error, dtype=np.float64), np.asarray(protection_level, dtype=np.float64)
    if error.shape != level.shape or error.size == 0:
        raise ValueError(
            f"{owner}: error and protection_level must have one shape and hold something, got {error.shape} and "
            f"{level.shape}"
        )
    if not np.all(np.isfinite(error)):
        raise ValueError(f"{owner}: error must be finite, got {error[~np.isfinite(error)][0]!r}")
    if not np.all(level >= 0.0):
        raise ValueError(f"{owner}: protection_level must be 0 or more, got {level[~(level >= 0.0)][0]!r}")
    return error, level


def _cell(values: Floats, edges: Floats) -> Runs:
    """The cell whose upper edge is the first that is not exceeded: a value on the alert limit is not beyond it."""
    return np.clip(np.searchsorted(edges, values, side="left") - 1, 0, len(edges) - 2)
