"""Every kind of figure in a browser."""

from pathlib import Path

import pytest

from spoofgym.report.figures import (
    Bar,
    Bars,
    Curve,
    Curves,
    Diagram,
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
    edges = [0.0, 1.0, 1.5]
    diagram = Diagram(name="d", choice="c", alert_limit=1.0, edges=edges, cells=[], regions=[("nominal", 0)])
    empty = [
        Bars(title="a", summary="", unit="m", bars=[Bar("x", None)]),
        Bars(title="b", summary="", unit="m", bars=[Bar("x", 0.0)], logarithmic=True),
        Matrix(title="c", summary="", layers=[Layer("m", nothing), Layer("n", nothing, logarithmic=True)], **cells),
        Lines(title="d", summary="", x_label="x", y_label="y", x=[0], lines=[Line("l", [None], [None], [None])]),
        Curves(title="e", summary="", curves=[Curve("d", "a", [], [], [], [])], chosen="a"),
        Stanford(title="f", summary="", diagrams=[diagram], chosen="x"),
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


def test_stanford_diagrams_of_other_signals_are_chosen(browser: Browser, tmp_path: Path) -> None:
    def diagram(choice: str, name: str, count: int) -> Diagram:
        cells, regions = [(0, 1, count)], [("nominal", count)]
        return Diagram(name=name, choice=choice, alert_limit=1.0, edges=[0.0, 1.0, 1.5], cells=cells, regions=regions)

    diagrams = [diagram("clean", "a", 1), diagram("clean", "b", 2), diagram("slow", "a", 3), diagram("slow", "b", 4)]
    study = Stanford(title="t", summary="", diagrams=diagrams, chosen="slow")
    (tmp_path / "stanford.html").write_text(page([Section("s", [], [study])], "s"), encoding="utf-8")
    browser.open(tmp_path / "stanford.html")
    legends = "return [...document.querySelectorAll('figure.stanford .legend')].map((legend) => legend.textContent)"
    assert [text.split(" (")[0] for text in browser.run(legends)] == ["nominal: 3", "nominal: 4"]
    browser.find("figure.stanford select").send_keys("clean")
    assert [text.split(" (")[0] for text in browser.run(legends)] == ["nominal: 1", "nominal: 2"]
    browser.find("figure.stanford summary").click()
    browser.settle()
    assert browser.run("return document.querySelectorAll('figure.stanford tbody tr').length") == 4
    assert browser.errors() == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mean_error_m", "mean error, m"),
        ("ci95_m from", "95 % from, m"),
        ("arl0", "ARL₀"),
        ("arl0_ci95 to", "ARL₀ 95 % to"),
        ("median_time_to_detect_s", "median time to detect, s"),
        ("m", "m"),
        ("error from, m", "error from, m"),
        ("snapshot:arl0=100", "snapshot:arl0=100"),
    ],
)
def test_heads_of_tables_are_words(name: str, words: str, browser: Browser, tmp_path: Path) -> None:
    table = TableFigure(title="t", summary="", columns=[name], rows=[[1.0]])
    (tmp_path / "table.html").write_text(page([Section("s", [], [table])], "s"), encoding="utf-8")
    browser.open(tmp_path / "table.html")
    assert browser.run("return document.querySelector('figure.table th').textContent") == words


def test_the_first_column_of_a_wide_table_stays_on_a_phone(browser: Browser, tmp_path: Path) -> None:
    columns = ["response", *(f"figure_{place}_m" for place in range(9))]
    table = TableFigure(title="t", summary="", columns=columns, rows=[["exclude", *range(9)]])
    facts = [("Scenario", "liu-flight:horizon=150,imu=tactical")]
    (tmp_path / "wide.html").write_text(page([Section("s", facts, [table])], "s"), encoding="utf-8")
    browser.open(tmp_path / "wide.html", PHONE)
    place = "const box = document.querySelector('.scroll'); box.scrollLeft = 300; return [box.scrollLeft,"
    place += " document.querySelector('tbody td').getBoundingClientRect().left - box.getBoundingClientRect().left]"
    scrolled, left = browser.run(place)
    assert scrolled > 100
    assert abs(left) < 3
    assert browser.too_wide() <= 0
    assert "liu-flight:<wbr>horizon=150,<wbr>imu=tactical" in (tmp_path / "wide.html").read_text(encoding="utf-8")
