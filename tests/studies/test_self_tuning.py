"""The table of the guards: what its columns say of filters that are known."""

import re

import numpy as np
import pytest

from spoofgym.studies import self_tuning


def cells(text, guard):
    """The row of a guard in each table."""
    rows = [line for line in text.splitlines() if line.startswith(f"| `{guard}` |")]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in rows]


def test_the_table_has_a_row_of_each_guard_and_noise(capsys):
    """Under correlated noise the published recursion has ended in all runs; a constant filter has a factor of 1."""
    self_tuning.main(["--runs", "20", "--guards", "none", "all"])
    text = capsys.readouterr().out
    assert [row[2] for row in cells(text, self_tuning.COMMON)] == ["1 [1, 1]", "1 [1, 1]"]
    assert [row[5] for row in cells(text, self_tuning.COMMON)] == ["3.70", "3.70"]
    assert cells(text, "none")[1][1] == "100 %"
    assert set(cells(text, "none")[1][2:]) == {"-"}
    assert len(cells(text, "all")) == 2


def test_error_and_detection_of_the_common_filter_are_those_of_its_covariance():
    """The mean square of 300 runs in two axes has a relative deviation of 5.8 % at most: a third is six of them.

    The filter's P still over-states its errors by a tenth: its initial one is nine times the truth.
    """
    clean = self_tuning.play(self_tuning.COMMON, "white", 0.0, 50, 300, 0)
    late = clean.time > 15.0
    ratio = np.square(clean.error[late]).mean() / np.square(clean.sigma[late]).mean()
    assert ratio == pytest.approx(1.0, abs=0.33)
    strong = self_tuning.play(self_tuning.COMMON, "white", 20.0, 50, 300, 0)
    row = self_tuning.row(self_tuning.COMMON, "white", clean, strong)
    assert re.match(r"100 %, \d\.\d s", self_tuning.line(row).split("|")[9].strip())


def test_wrong_arguments_end_the_program(capsys):
    with pytest.raises(SystemExit):
        self_tuning.main(["--runs", "0"])
    assert "expected a whole number, 1 or more" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        self_tuning.main(["--runs", "2", "--guards", "some"])
    assert "invalid choice: 'some'" in capsys.readouterr().err
