"""The examples of the pages on ranges run, and print what the pages say."""

import contextlib
import io
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs" / "results"


def example(page: str, heading: str) -> str:
    """The Python lines of a section."""
    section = (DOCS / page).read_text().partition(f"## {heading}\n")[2]
    return section.partition("```python\n")[2].partition("```")[0]


def printed(code: str) -> list[str]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "example", "exec"), {"__name__": "example"})
    return out.getvalue().splitlines()


@pytest.mark.slow
def test_table_of_kappa_is_what_its_lines_print() -> None:
    section = (DOCS / "game.md").read_text().partition("## A spoofer of ranges\n")[2]
    table = [line for line in section.splitlines() if "-flight |" in line]
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table]
    lines = [line.split() for line in printed(example("game.md", "A spoofer of ranges"))]
    assert len(rows) == len(lines) == 5
    for row, (scenario, coupling, sigma, *kappa) in zip(rows, lines, strict=True):
        assert (row[0], row[1].partition(",")[0], float(row[2])) == (scenario, coupling, float(sigma))
        assert [float(value) for value in row[3:]] == [float(value) for value in kappa]


@pytest.mark.slow
def test_satellites_are_left_out_as_the_page_says() -> None:
    """On the same seed: the figures of the page, but for their rounding."""
    page = (DOCS / "defender.md").read_text()
    told = re.search(r"It prints ([\d.]+) m, ([\d.]+) m and ([\d.]+) m", page)
    assert told is not None
    errors = [float(line.split()[-2]) for line in printed(example("defender.md", "A defender on ranges"))]
    assert errors == pytest.approx([float(value) for value in told.groups()], abs=0.11)
    assert errors[2] < errors[1] < errors[0]
