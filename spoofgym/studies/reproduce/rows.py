"""A published figure beside ours, with its verdict and what it rests on.

The basis of a row says what it is evidence of:

- **printed**: the paper prints the number.
- **words**: the paper says it in words.
- **own formula**: the paper prints no number; its formula is evaluated with our parameters.
- **calibrated**: something of ours was chosen with this figure in sight, so that agreement is no evidence.
- **by construction**: it could not come out differently.
- **rejected reading**: another reading of the paper than the one that the other rows take.

Only printed figures and words are counted, each once: a row that *repeats* a figure, with another set-up than the one
that decides, is shown and not counted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.metrics import NORMAL_95
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import COMPLETE
from spoofgym.studies.reproduce.verdict import (
    NEVER,
    Published,
    Value,
    Verdict,
    event_verdict,
    number_verdict,
    statement_verdict,
)

Basis = Literal["printed", "words", "own formula", "calibrated", "by construction", "rejected reading"]
COUNTED: tuple[Basis, ...] = ("printed", "words")
Reasons = dict[Verdict, str]

REASONS: Reasons = {
    "reproduced": "The median is within 20 % of the published value, or within its rounding.",
    "compatible": "The published value lies in the range of our runs, but the median is farther than 20 % from it.",
    "partly": "Outside the range of our runs, but within a factor of two of their median.",
    "not reproduced": "Outside the range of our runs, and more than a factor of two from their median.",
}


@dataclass(frozen=True)
class Row:
    """One published figure.

    Attributes:
        item: what it is, with its unit.
        paper_value: as printed.
        value: ours: a median over runs, a share, or "never"; None where nothing is compared.
        interval: of ours, from the smallest to the largest run or the 95 % interval of a share; None = there is none.
        verdict: by `spoofgym.studies.reproduce.verdict`.
        reason: of the verdict, a sentence.
        basis: what the row is evidence of.
        repeats: whether another row has the same published figure, with the set-up that decides.
    """

    item: str
    paper_value: Value
    value: Value | None
    interval: tuple[Value, Value] | None
    verdict: Verdict
    reason: str
    basis: Basis = "printed"
    repeats: bool = False

    @property
    def counted(self) -> bool:
        """Whether the tally has it."""
        return self.basis in COUNTED and not self.repeats

    def as_json(self) -> dict[str, Any]:
        """The row with plain types."""
        interval = None if self.interval is None else list(self.interval)
        return {
            "item": self.item,
            "paper_value": self.paper_value,
            "value": self.value,
            "interval": interval,
            "verdict": self.verdict,
            "reason": self.reason,
            "basis": self.basis,
            "counted": self.counted,
        }


def number_row(item: str, published: Published, values: Floats, *, reasons: Reasons | None = None) -> Row:
    """A published number beside one of each run.

    Args:
        item: what it is.
        published: the number, with its rounding.
        values: ours, (N,).
        reasons: a sentence for a verdict, where there is a better one than the rule's.
    """
    low, median, high = float(np.min(values)), float(np.median(values)), float(np.max(values))
    verdict = number_verdict(published, low, median, high)
    reason = (reasons or {}).get(verdict) or REASONS[verdict]
    return Row(item, published.value, median, (low, high), verdict, reason)


def event_row(
    item: str, published: Published, times: Floats, *, origin: float = 0.0, reasons: Reasons | None = None
) -> Row:
    """A published time of an event, or "never", beside our times, (N,), infinite where a run never sees it.

    Args:
        item: what it is.
        published: the time, with its rounding, or "never".
        times: ours.
        origin: the onset, from which the verdict counts both.
        reasons: as for `number_row`.
    """
    verdict = event_verdict(_since(published, origin), times - origin)
    seen = np.isfinite(times)
    agreeing = int(np.sum(~seen if published.value == NEVER else seen))
    agree = f"{agreeing} of {len(times)} runs agree with the paper on whether it happens"
    median = float(np.sort(times)[(len(times) - 1) // 2])
    ends = (_or_never(float(np.min(times))), _or_never(float(np.max(times))))
    reason = (reasons or {}).get(verdict)
    told = f"{reason.removesuffix('.')} ({agree})." if reason else f"{agree}."
    return Row(item, published.value, _or_never(median), ends, verdict, told)


def _since(published: Published, origin: float) -> Published:
    """A published time, counted from the onset; "never" and limits in words keep their name."""
    value = published.value if isinstance(published.value, str) else published.value - origin
    return Published(value, published.low - origin, published.high - origin)


def _or_never(time: float) -> Value:
    return time if math.isfinite(time) else NEVER


def statement_row(item: str, statement: str, holds: Flags, values: Floats, reason: str) -> Row:
    """A statement in words beside the number of each run that decides it.

    Args:
        item: what it is about.
        statement: the paper's.
        holds: in each run, (N,).
        values: what ``item`` names, in each run, (N,).
        reason: how we decide, and what we see.
    """
    interval = (float(np.min(values)), float(np.max(values)))
    return Row(item, statement, float(np.median(values)), interval, statement_verdict(holds), reason, "words")


def on(basis: Basis, row: Row) -> Row:
    """The row on another basis."""
    return replace(row, basis=basis)


def again(row: Row) -> Row:
    """The row as one that repeats a published figure which another row decides."""
    return replace(row, repeats=True)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927, the score interval)."""
    z2 = NORMAL_95**2
    share = successes / trials
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = NORMAL_95 / (1 + z2 / trials) * math.sqrt(share * (1 - share) / trials + z2 / (4 * trials**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


@dataclass(frozen=True)
class Listing:
    """Rows one below the other, each with its reason.

    Attributes:
        title: of the group.
        rows: in order.
        note: below it.
    """

    title: str
    rows: tuple[Row, ...]
    note: str = ""


@dataclass(frozen=True)
class Grid:
    """Rows as the cells of a table like the paper's.

    Attributes:
        title: of the group.
        heads: of the columns, the first is that of the labels.
        lines: a label and a cell per further column; None = the paper has no figure there.
        note: below it.
    """

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, tuple[Row | None, ...]], ...]
    note: str = ""

    @property
    def rows(self) -> tuple[Row, ...]:
        """All cells, line by line."""
        return tuple(cell for _, cells in self.lines for cell in cells if cell is not None)


Group = Listing | Grid


def each(change: Callable[[Row], Row], group: Group) -> Group:
    """The group with every row changed."""
    if isinstance(group, Listing):
        return replace(group, rows=tuple(change(row) for row in group.rows))
    lines = ((label, tuple(None if cell is None else change(cell) for cell in cells)) for label, cells in group.lines)
    return replace(group, lines=tuple(lines))


@dataclass(frozen=True)
class Reproduction:
    """All rows of one paper.

    Attributes:
        paper: its name on the command line.
        title: author, year and what it is.
        runs: of each row.
        seed: of run 0.
        quick: whether it has too few runs to stand for anything.
        readings: how we read what the paper leaves open, a sentence each.
        groups: the rows.
        complete: whether all groups are there.
    """

    paper: str
    title: str
    runs: int
    seed: int
    quick: bool
    readings: tuple[str, ...]
    groups: tuple[Group, ...]
    complete: bool = True

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all groups."""
        return tuple(row for group in self.groups for row in group.rows)

    def tally(self, basis: Basis) -> dict[Verdict, int]:
        """How many published figures of a basis have each verdict, each figure once."""
        verdicts = [row.verdict for row in self.rows if row.basis == basis and not row.repeats]
        return {verdict: verdicts.count(verdict) for verdict in REASONS}

    def as_json(self) -> dict[str, Any]:
        """The rows with plain types, and what made them."""
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": "reproduction",
            "paper": self.paper,
            "runs": self.runs,
            "seed": self.seed,
            "quick": self.quick,
            "rows": [{"group": group.title, **row.as_json()} for group in self.groups for row in group.rows],
            **({} if self.complete else {COMPLETE: False}),
        }
