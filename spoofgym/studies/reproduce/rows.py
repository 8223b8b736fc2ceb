"""A published figure beside ours, and the rule that gives the verdict.

- **reproduced**: the published value, as it is rounded in print, meets the interval of ours: from the smallest to the
  largest of our runs, or the 95 % interval of a share of them. A further run like ours would fall outside the range of
  n of them with probability 2 / (n + 1).
- **partly**: it does not, but it is within a factor of two of our median, or the tendency that the row names holds.
- **not reproduced**: neither.

A statement in words is reproduced where it holds in every run, partly where it holds in more than half of them or the
tendency that the row names holds in all. An
event that some runs never see ("never") is reproduced where at least half of our runs agree with the paper on whether
it happens, and a published time then meets the range of those that see it; partly where some runs agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.metrics import NORMAL_95
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import COMPLETE

Verdict = Literal["reproduced", "partly", "not reproduced"]
Reasons = dict[Verdict, str]
Value = float | str
NEVER = "never"

INSIDE = "The published value meets the range of our runs."
NEAR = "Outside the range of our runs, but within a factor of two of their median."
FAR = "Outside the range of our runs, and more than a factor of two from their median."


@dataclass(frozen=True)
class Published:
    """A value as a paper prints it.

    Attributes:
        value: the number, a statement in words, or "never".
        low: smallest number that is printed so.
        high: largest; infinite for a value that is a lower limit.
    """

    value: Value
    low: float = math.nan
    high: float = math.nan


def rounded(value: float, place: float = 1.0) -> Published:
    """A number whose last significant digit has the place ``place``: rounding moved it by half of that at most."""
    return Published(value, value - 0.5 * place, value + 0.5 * place)


@dataclass(frozen=True)
class Row:
    """One published figure.

    Attributes:
        item: what it is, with its unit.
        paper_value: as printed.
        value: ours: a median over runs, a share, or "never"; None where nothing is compared.
        interval: of ours, from the smallest to the largest run or the 95 % interval of a share; None = there is none.
        verdict: by the rule of this module.
        reason: of the verdict, a sentence.
    """

    item: str
    paper_value: Value
    value: Value | None
    interval: tuple[Value, Value] | None
    verdict: Verdict
    reason: str

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
        }


def number_row(
    item: str, published: Published, values: Floats, *, tendency: bool = False, reasons: Reasons | None = None
) -> Row:
    """A published number beside one of each run.

    Args:
        item: what it is.
        published: the number, with its rounding.
        values: ours, (N,).
        tendency: whether what the number stands for holds in our runs although the number may not.
        reasons: a sentence for a verdict, where there is a better one than the rule's.
    """
    low, median, high = float(np.min(values)), float(np.median(values)), float(np.max(values))
    verdict = number_verdict(published, low, median, high, tendency)
    reason = (reasons or {}).get(verdict) or {"reproduced": INSIDE, "partly": NEAR, "not reproduced": FAR}[verdict]
    return Row(item, published.value, median, (low, high), verdict, reason)


def number_verdict(published: Published, low: float, median: float, high: float, tendency: bool = False) -> Verdict:
    """The rule for a number."""
    if published.low <= high and published.high >= low:
        return "reproduced"
    nearest = min(max(median, published.low), published.high)
    near = 0.5 * nearest <= median <= 2.0 * nearest if nearest > 0 else median == nearest
    return "partly" if near or tendency else "not reproduced"


def event_row(
    item: str, published: Published, times: Floats, *, origin: float = 0.0, reasons: Reasons | None = None
) -> Row:
    """A published time of an event, or "never", beside our times, (N,), infinite where a run never sees it.

    Args:
        item: what it is.
        published: the time, with its rounding, or "never".
        times: ours.
        origin: from which a factor of two counts.
        reasons: as for `number_row`.
    """
    seen = np.isfinite(times)
    median = float(np.sort(times)[(len(times) - 1) // 2])
    low, high = float(np.min(times)), float(np.max(times))
    share = float(np.mean(~seen)) if published.value == NEVER else float(np.mean(seen))
    if published.value == NEVER:
        verdict: Verdict = "reproduced" if share >= 0.5 else "partly" if share > 0 else "not reproduced"
    elif share == 0:
        verdict = "not reproduced"
    else:
        since = Published(published.value, published.low - origin, published.high - origin)
        found = times[seen] - origin
        verdict = number_verdict(since, float(np.min(found)), float(np.median(found)), float(np.max(found)))
        if share < 0.5 and verdict == "reproduced":
            verdict = "partly"
    agree = f"{round(share * len(times))} of {len(times)} runs agree with the paper on whether it happens"
    reason = (reasons or {}).get(verdict)
    return Row(
        item,
        published.value,
        _or_never(median),
        (_or_never(low), _or_never(high)),
        verdict,
        f"{reason.removesuffix('.')} ({agree})." if reason else f"{agree}.",
    )


def _or_never(time: float) -> Value:
    return time if math.isfinite(time) else NEVER


def statement_row(
    item: str, statement: str, holds: Flags, values: Floats, reason: str, *, tendency: Flags | None = None
) -> Row:
    """A statement in words beside the number of each run that decides it.

    Args:
        item: what it is about.
        statement: the paper's.
        holds: in each run, (N,).
        values: what ``item`` names, in each run, (N,).
        reason: how we decide, and what we see.
        tendency: whether what the statement stands for holds in each run, although the statement may not, (N,).
    """
    share, near = float(np.mean(holds)), tendency is not None and bool(np.all(tendency))
    verdict: Verdict = "reproduced" if share == 1.0 else "partly" if share > 0.5 or near else "not reproduced"
    interval = (float(np.min(values)), float(np.max(values)))
    return Row(item, statement, float(np.median(values)), interval, verdict, reason)


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
