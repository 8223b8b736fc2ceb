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
    ("change", "told"),
    [
        (lambda rate: -rate, r"range_rate_mps has the opposite sign .* multiply them by -1"),
        (lambda rate: rate / 0.19, r"they are in Hz: multiply them by 0\.19"),
        (lambda rate: 0.0, r"range_rate_mps gives a velocity in 0 of \d+ epochs that have"),
    ],
    ids=["negated", "hertz", "zero"],
)
def test_range_rates_are_named(tmp_path: Path, options: dict[str, str], change: Callable, told: str) -> None:
    folder = changed(tmp_path / "log", "range_rate_mps", change)
    with pytest.raises(ValueError, match=told) as caught:
        recorded(str(folder), **options)  # type: ignore[arg-type]
    assert "mounting" not in str(caught.value)


@pytest.mark.parametrize("options", KINDS, ids=["tight", "loose"])
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda metres: metres / 1000.0, "pseudorange_m is in kilometres; multiply it by 1000"),
        (lambda metres: 2.2e7, r"pseudorange_m gives a position in 0 of \d+"),
    ],
    ids=["kilometres", "constant"],
)
def test_pseudoranges_are_named(tmp_path: Path, options: dict[str, str], change: Callable, told: str) -> None:
    folder = changed(tmp_path / "log", "pseudorange_m", change)
    with pytest.raises(ValueError, match=told) as caught:
        recorded(str(folder), **options)  # type: ignore[arg-type]
    assert "mounting" not in str(caught.value)
