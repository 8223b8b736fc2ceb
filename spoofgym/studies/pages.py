"""Tables in pages of documentation, which programs write between two marks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from spoofgym import files


def put_table(page: Path, begin: str, end: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Put a table into a page, between two marks, in place of what stood there.

    Args:
        page: a Markdown file.
        begin: line before the table.
        end: line after it.
        columns: names.
        rows: cells of each row.

    Raises:
        ValueError: the page lacks the marks.
        OSError: it cannot be read or written.
    """
    before, after = around(page, begin, end)
    escaped = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = [f"| {' | '.join(row)} |" for row in (columns, ["---"] * len(columns), *escaped)]
    files.write_text(page, f"{before}{begin}\n\n" + "\n".join(lines) + f"\n\n{end}{after}")


def around(page: Path, begin: str, end: str) -> tuple[str, str]:
    """What stands in a page before and after two marks.

    Raises:
        ValueError: the page lacks the marks.
        OSError: it cannot be read.
    """
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, found_too, after = rest.partition(end)
    if not found or not found_too:
        raise ValueError(f"{page} has no place for the table: it needs the lines {begin!r} and {end!r}")
    return before, after
