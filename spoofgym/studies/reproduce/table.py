"""A reproduction on the terminal, 100 columns wide at most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import get_args

from rich.console import Group as RenderableGroup
from rich.console import RenderableType
from rich.constrain import Constrain
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from spoofgym.studies.reproduce.rows import COUNTED, Basis, Grid, Listing, Reproduction, Row
from spoofgym.studies.reproduce.verdict import Value, Verdict

WIDTH = 100
MARKS: dict[Verdict, tuple[str, str]] = {
    "reproduced": ("✓", "green"),
    "compatible": ("≈", "cyan"),
    "partly": ("~", "yellow"),
    "not reproduced": ("✗", "red"),
}


def reproduction_parts(report: Reproduction, columns: int) -> RenderableGroup:
    """All groups, the readings, and how many rows came out.

    Args:
        report: the rows.
        columns: of the terminal.
    """
    width = min(WIDTH, columns)
    return RenderableGroup(*(Constrain(part, width) for part in _parts(report)))


def _parts(report: Reproduction) -> Iterator[RenderableType]:
    runs = f"{report.runs} runs, seed {report.seed}"
    head = Text(f"{report.title}: {runs}", style="bold")
    if report.quick:
        head.append("  quick: too few runs for a verdict that counts", style="bold red")
    yield head
    marks = "   ".join(f"{mark} {verdict}" for verdict, (mark, _) in MARKS.items())
    yield Text(f"Ours: median [smallest–largest run].  {marks}")
    yield Text("In brackets: not counted, because it was calibrated, follows from a formula, or repeats another row.")
    for group in report.groups:
        yield ""
        yield Text(group.title, style="bold")
        yield _listing(group) if isinstance(group, Listing) else _grid(group)
        if group.note:
            yield Padding(Text(group.note, style="dim"), (0, 0, 0, 2))
    yield ""
    yield Text("Readings", style="bold")
    for reading in report.readings:
        yield _bullet(reading)
    yield ""
    yield Text("Published figures, each once", style="bold")
    yield tally(report)


def _bullet(text: str) -> Table:
    """A paragraph whose lines hang behind the dash."""
    table = Table.grid(padding=(0, 1, 0, 0))
    table.add_row(" -", Text(text))
    return table


def tally(report: Reproduction) -> Table:
    """How many published figures of each basis have each verdict; the first two lines count."""
    table = _frame()
    table.add_column("basis")
    for verdict, (mark, style) in MARKS.items():
        table.add_column(f"{mark} {verdict}", justify="right", style=style)
    for basis in get_args(Basis):
        found = report.tally(basis)
        if any(found.values()):
            table.add_row(basis, *(str(found[verdict]) for verdict in MARKS))
    return table


def summary(reports: Sequence[Reproduction]) -> Table:
    """A line per paper and counted basis: how many published figures have each verdict."""
    table = _frame()
    table.add_column("paper")
    table.add_column("basis")
    for verdict, (mark, style) in MARKS.items():
        table.add_column(f"{mark} {verdict}", justify="right", style=style)
    table.add_column("not counted", justify="right")
    for report in reports:
        for basis in COUNTED:
            found = report.tally(basis)
            rest = str(sum(not row.counted for row in report.rows)) if basis == COUNTED[0] else ""
            table.add_row(
                report.paper if basis == COUNTED[0] else "", basis, *(str(found[verdict]) for verdict in MARKS), rest
            )
    return table


def _mark(row: Row) -> Text:
    """The mark of the verdict, in brackets where it does not count."""
    mark, style = MARKS[row.verdict]
    return Text(mark if row.counted else f"({mark})", style=style)


def number(value: Value | None, digits: int = 3) -> str:
    """So many significant digits, and those before the point."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if value == 0:
        return "0"
    size = abs(value)
    if size >= 1e6 or size < 1e-3:
        return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+0", "e")
    return f"{value:.0f}" if round(size) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def _ours(row: Row) -> str:
    """The value, and its interval more roughly, where there is more to it than the value."""
    if row.interval is None or len({number(value) for value in (row.value, *row.interval)}) == 1:
        return number(row.value)
    low, high = (number(value, 2) for value in row.interval)
    return number(row.value) if low == high else f"{number(row.value)} [{low}–{high}]"


def _frame() -> Table:
    return Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)


def _listing(group: Listing) -> Table:
    table = _frame()
    table.add_column("", no_wrap=True)
    table.add_column("item, and why", ratio=1)
    table.add_column("paper", justify="right", max_width=20)
    table.add_column("ours", justify="right", overflow="fold")
    for row in group.rows:
        item = Text(row.item)
        why = "" if row.basis in COUNTED else f" [{row.basis}]"
        item.append(f"\n{row.reason}{why}", style="dim")
        table.add_row(_mark(row), item, number(row.paper_value), _ours(row))
    return table


def _grid(group: Grid) -> Table:
    table = _frame()
    table.add_column(group.heads[0], overflow="fold")
    for head in group.heads[1:]:
        table.add_column(head, justify="right", overflow="fold")
    for label, cells in group.lines:
        table.add_row(Text(label), *(_cell(cell) for cell in cells))
    return table


def _cell(row: Row | None) -> Text:
    if row is None:
        return Text("")
    cell = Text(f"{_ours(row)}\npaper {number(row.paper_value)} ", justify="right")
    cell.append_text(_mark(row))
    return cell
