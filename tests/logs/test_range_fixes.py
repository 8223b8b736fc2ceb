"""Ranges that give no fix: the error names codes or rates, not the mounting, which is given."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from spoofgym.scenarios.recorded import recorded
from tests.logs.range_drive import write_drive

KINDS = [{"coupling": "tight"}, {"fixes": "ranges"}]


def changed(folder: Path, column: str, change: Callable[[float], float]) -> Path:
    write_drive(folder, turns=3)
    with (folder / "ranges.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (folder / "ranges.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows({**row, column: change(float(row[column]))} for row in rows)
    return folder


@pytest.mark.parametrize("options", KINDS, ids=["tight", "loose"])
@pytest.mark.parametrize(
    ("change", "sign"),
    [(lambda rate: -rate, True), (lambda rate: rate / 0.19, False), (lambda rate: 0.0, False)],
    ids=["negated", "hertz", "zero"],
)
def test_range_rates_are_named(tmp_path: Path, options: dict[str, str], change: Callable, sign: bool) -> None:
    folder = changed(tmp_path / "log", "range_rate_mps", change)
    with pytest.raises(ValueError, match=r"range_rate_mps gives a velocity in 0 of \d+ epochs that have") as caught:
        recorded(str(folder), **options)  # type: ignore[arg-type]
    assert ("with all signs changed they fit" in str(caught.value)) == sign
    assert "mounting" not in str(caught.value)


@pytest.mark.parametrize("options", KINDS, ids=["tight", "loose"])
def test_pseudoranges_are_named(tmp_path: Path, options: dict[str, str]) -> None:
    folder = changed(tmp_path / "log", "pseudorange_m", lambda metres: metres / 1000.0)
    with pytest.raises(ValueError, match=r"pseudorange_m gives a position in 0 of \d+") as caught:
        recorded(str(folder), **options)  # type: ignore[arg-type]
    assert "mounting" not in str(caught.value)
