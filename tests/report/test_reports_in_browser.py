"""Every kind of figure in a browser."""

from pathlib import Path

import pytest

from spoofgym.report.figures import (
    Bar,
    Bars,
    Curve,
    Curves,
    Layer,
    Line,
    Lines,
    Matrix,
    Section,
    Stanford,
    TableFigure,
)
from spoofgym.report.page import page, write_page
from tests.report.browser import DESK, PHONE, Browser
from tests.report.reports import REPORTS, matrix
from tests.report.test_reports import run

pytestmark = pytest.mark.xdist_group("browser")


@pytest.fixture(scope="module")
def all_kinds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports")
    runs = [run(folder / f"seed{seed}", seed, [1.0 + seed, 2.0, 3.0]) for seed in range(2)]
    write_page(folder / "all.html", [*(make() for make in REPORTS.values()), *runs], "Everything")
    return folder / "all.html"


@pytest.mark.parametrize(("size", "theme"), [(PHONE, "dark"), (DESK, "light")], ids=["phone-dark", "desk-light"])
def test_all_figures_draw(all_kinds: Path, browser: Browser, size: tuple, theme: str) -> None:
    browser.open(all_kinds, size, theme)
    assert browser.errors() == []
    assert browser.undrawn() == []
    assert browser.blank() == 0
    assert browser.too_wide() <= 0
    kinds = browser.run("return [...document.querySelectorAll('figure')].map((figure) => figure.classList[1])")
    assert sorted(set(kinds)) == ["bars", "curves", "lines", "matrix", "stanford", "table"]
    browser.find("#theme").send_keys("light" if theme == "dark" else "dark")
    browser.settle()
    assert browser.errors() == []
    assert browser.blank() == 0
    browser.find("#theme").send_keys("as the system")


def test_figures_without_any_number_draw(browser: Browser, tmp_path: Path) -> None:
    nothing = [[None, None], [None, None]]
    cells = {"corner": "row", "rows": ["a", "b"], "columns": ["c", "d"]}
    empty = [
        Bars(title="a", summary="", unit="m", bars=[Bar("x", None)]),
        Bars(title="b", summary="", unit="m", bars=[Bar("x", 0.0)], logarithmic=True),
        Matrix(title="c", summary="", layers=[Layer("m", nothing), Layer("n", nothing, logarithmic=True)], **cells),
        Lines(title="d", summary="", x_label="x", y_label="y", x=[0], lines=[Line("l", [None], [None], [None])]),
        Curves(title="e", summary="", curves=[Curve("d", "a", [], [], [], [])], chosen="a"),
        Stanford(title="f", summary="", alert_limit=1.0, edges=[0.0, 1.0, 1.5], cells=[], regions=[("nominal", 0)]),
        TableFigure(title="g", summary="", columns=["x"], rows=[]),
    ]
    (tmp_path / "empty.html").write_text(page([Section("empty", [], empty)], "empty"), encoding="utf-8")
    browser.open(tmp_path / "empty.html")
    assert browser.errors() == []
    assert browser.undrawn() == []
    browser.find("figure.matrix select").send_keys("n")
    assert browser.errors() == []


def column(browser: Browser) -> list[float]:
    """The second column of the first matrix, from the top."""
    return browser.run(
        "return [...document.querySelectorAll('table.heat')[0].querySelectorAll('tbody tr')]"
        ".map((row) => Number(row.querySelectorAll('td')[1].firstChild.textContent))"
    )


def test_a_matrix_is_sorted_by_a_click_and_by_the_keyboard(browser: Browser, tmp_path: Path) -> None:
    write_page(tmp_path / "matrix.html", [matrix(5, 4)])
    browser.open(tmp_path / "matrix.html")
    head = "table.heat thead th:nth-child(3)"
    before = column(browser)
    browser.find(f"{head} button").click()
    assert column(browser) == sorted(before, reverse=True)
    browser.find(f"{head} button").send_keys("\n")
    assert column(browser) == sorted(before)
    assert browser.find(head).get_attribute("aria-sort") == "ascending"
    intervals = browser.run("return document.querySelectorAll('table.heat small').length")
    assert intervals == 5 * 4
    browser.find("figure.matrix input[type=checkbox]").click()
    assert browser.run("return document.querySelectorAll('table.heat small').length") == 0


def test_the_round_of_a_league_can_be_chosen(browser: Browser, tmp_path: Path) -> None:
    write_page(tmp_path / "league.html", [REPORTS["league"]()])
    browser.open(tmp_path / "league.html")
    rows = "return document.querySelector('figure.matrix table').querySelectorAll('tbody tr').length"
    assert browser.run(rows) == 3
    browser.find("figure.matrix select").send_keys("round 0")
    assert browser.run(rows) == 2, "a player that is not there yet has no row"


def test_curves_can_be_left_out_and_the_attack_chosen(browser: Browser, tmp_path: Path) -> None:
    write_page(tmp_path / "matrix.html", [matrix(3, 4)])
    browser.open(tmp_path / "matrix.html")
    lines = "return document.querySelectorAll('figure.curves svg[role=img] path[stroke]').length"
    assert browser.run(lines) == 2 * 3
    browser.find("figure.curves .legend button").click()
    assert browser.run(lines) == 2 * 2
    label = "return document.querySelector('figure.curves svg[role=img]').getAttribute('aria-label')"
    browser.find("figure.curves select").send_keys("jump:0")
    assert browser.run(label).endswith("jump:0")
