"""Kujur 2024: the rows of the report, and the verdicts that no draw decides."""

import bisect
import json

import pytest

from spoofgym.detectors import cpi_theory
from spoofgym.studies.reproduce import kujur_2024
from spoofgym.studies.reproduce.kujur_grids import compared
from spoofgym.studies.reproduce.papers import PAPERS, reproduce

pytestmark = pytest.mark.slow


def test_a_cell_is_judged_by_decades():
    verdicts = [compared("x", formula, exact).verdict for formula, exact in ((0.1, 0.19), (0.1, 0.3), (1e-9, 0.1))]
    assert verdicts == ["reproduced", "partly", "not reproduced"]


def bisected(required, missed, most):
    """The window that `minimum_epochs` finds one epoch after the other: P_MD falls with the window in these rows."""
    if missed(most) > required:
        return None
    return 1 + bisect.bisect_left(range(1, most + 1), True, key=lambda window: missed(window) <= required)


@pytest.fixture(scope="module")
def report():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cpi_theory, "minimum_epochs", bisected)
        return reproduce(kujur_2024.PAPER, 2, 0, True)


def test_rows(report):
    assert PAPERS["kujur-2024"] is kujur_2024
    parsed = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert parsed["paper"] == "kujur-2024"
    items = {row.item: row for row in report.rows}
    assert len(items) == len(report.rows), "items must be unique"
    assert all(row.reason.endswith(".") for row in report.rows)
    titles = " ".join(group.title for group in report.groups)
    for figure in ("Figure 1:", "Figures 2, 3 and 6", "Figures 4 and 5", "figures 2 to 8", "Figure 10", "Figure 11"):
        assert figure in titles
    assert sum("share of games that the CPI misses" in item for item in items) == 9


def test_verdicts_that_no_draw_decides(report):
    items = {row.item: row for row in report.rows}
    expected = {
        "10 cm, white: P_MD after 60 s (section 6)": "reproduced",
        "10 cm, τ = 40 s: P_MD after 60 s (section 4)": "not reproduced",
        "10 cm, 60 s: P_MD for τ = 40 s": "reproduced",
        "10 cm, white: P_MD after 30 s, over the hours of the day": "reproduced",
        "2 cm, white, lousy IMU: P_MD after 180 s over that of the automotive IMU": "reproduced",
        "10 cm, white, automotive IMU: time to P_MD 1e-7 over that of the navigation IMU, % more": "reproduced",
        "CI, threshold of N degrees of freedom: share of clean games that alarm": "not reproduced",
        "10 cm, white, navigation IMU: autocorrelation of the innovations at one epoch": "not reproduced",
        "10 cm: protection level for τ = 40 s over that for white error": "not reproduced",
    }
    assert {item: items[item].verdict for item in expected} == expected
    assert "far more than the CI" in {row.paper_value for row in report.rows}


def test_where_no_game_misses_the_exact_value_decides(report):
    """10 cm, tau 10 s after 180 s: some 2e-4 exactly, 1e-20 by the formula; 50 games tell neither from zero."""
    row = next(row for row in report.rows if row.item.startswith("10 cm, τ 10 s, 180 s: share"))
    assert row.paper_value < 1e-15
    assert row.verdict == "not reproduced"
