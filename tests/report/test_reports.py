"""What a page makes of every kind of report and of run folders."""

import json
from pathlib import Path

import numpy as np
import pytest

from spoofgym.evaluation.learning_curve import RETURNS_FILE, VALIDATION_FILE
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.policies.learned import CONFIG_FILE
from spoofgym.report import sources
from spoofgym.report.figures import Bars, Curves, Lines, Matrix, Stanford, TableFigure
from spoofgym.report.page import write_page
from spoofgym.report.program import main
from spoofgym.report.sources import VIEWS, sections_of
from tests.report import reports


def figure(report, kind, title=""):
    """The first figure of a kind, with a title that begins so."""
    found = [each for section in sections_of([report]) for each in section.figures]
    return next(each for each in found if isinstance(each, kind) and each.title.startswith(title))


@pytest.mark.parametrize("kind", reports.REPORTS)
def test_every_kind_becomes_a_page_and_is_read_from_json(kind, tmp_path):
    report = json.loads(json.dumps(reports.REPORTS[kind](), allow_nan=False))
    assert report["kind"] == kind
    assert kind in VIEWS
    (tmp_path / "given.json").write_text(json.dumps(report))
    assert main([str(tmp_path / "given.json"), "-o", str(tmp_path / "page.html")]) == 0
    assert "figure-0" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_spoofers_stand_beside_optimum_and_bound():
    bars = figure(reports.attackers(), Bars)
    assert [(mark.label, mark.value) for mark in bars.marks] == [("optimum", 57.25), ("upper bound", 57.37)]
    assert [(bar.value, bar.low, bar.high) for bar in bars.bars][-1] == (42.0, 40.0, 44.0)
    assert {bar.group for bar in bars.bars} == {"baseline", "player"}


def test_a_bayesian_bound_beside_an_evaluation_is_a_line_in_its_figure():
    alone = figure(reports.defenders(), Bars)
    assert alone.marks == []
    both = sections_of([reports.defenders(), reports.bayesian("held-out")])
    drawn = {each.title: each for each in both[0].figures if isinstance(each, Bars)}
    assert drawn["Mean error, training attacks"].marks == []
    assert [mark.value for mark in drawn["Mean error, held-out attacks"].marks] == [0.6]


def test_defenders_are_sorted_and_their_differences_shown():
    bars = figure(reports.defenders(), Bars)
    assert [bar.label for bar in bars.bars] == ["runs/d", "tuned-onset", "never"]
    pairs = figure(reports.defenders(), Bars, "runs/d minus")
    assert "better than 4 of 4" in pairs.summary


def test_a_defender_alone_is_not_compared():
    report = reports.defenders()
    alone = {**report, "rows": report["rows"][:1], "comparisons": [], "gaps": []}
    assert "has the least mean error" in figure(report, Bars).summary
    assert figure(alone, Bars).summary.startswith(f"The mean error of {report['rows'][0]['defender']} is ")


def test_the_matrix_has_its_shares_intervals_and_curves():
    report = reports.matrix()
    matrix, row = figure(report, Matrix), report["rows"][1]
    assert matrix.rows == ["windowed:n=1", "windowed:n=2", "windowed:n=3"]
    layer = matrix.layers[0]
    assert layer.values[0][1] == pytest.approx(100 * row["detection_probability"])
    assert [layer.low[0][1], layer.high[0][1]] == pytest.approx([100 * end for end in row["ci95"]])
    curves = figure(report, Curves)
    assert curves.chosen == "ramp:0.1"
    assert curves.curves[0].x == [point["false_alarm_probability"] for point in report["curves"][0]["points"]]


def test_curves_of_an_attack_are_shown_before_those_of_clean_games():
    report = reports.matrix()
    for item in report["curves"]:
        item["attack"] = {"ramp:0.1": "none"}.get(item["attack"], item["attack"])
    chosen = figure(report, Curves).chosen
    assert chosen != "none"
    assert chosen in {item["attack"] for item in report["curves"]}


def test_a_league_shows_rounds_mixtures_and_values():
    report = reports.league()
    values, matrix = figure(report, Lines), figure(report, Matrix)
    assert (list(values.x), list(values.lines[0].y), list(values.lines[0].low)) == ([0, 1], [3.0, 4.0], [2.5, 3.5])
    assert matrix.rows[2] == "spoofer/0"
    assert [layer.values[2][0] for layer in matrix.layers] == [None, 4.0]
    assert matrix.row_weights == [[1.0, 0.0, None], [1.0, 0.0, 0.0]]
    assert matrix.layers[1].low[2][0] == pytest.approx(3.6)


def test_a_league_that_is_still_played_is_read_from_its_folder(tmp_path):
    report = reports.league()
    (tmp_path / sources.LEAGUE_FILE).write_text(json.dumps({k: v for k, v in report.items() if k != "results"}))
    (tmp_path / sources.ROUNDS_FILE).write_text(json.dumps(report["results"][:1]))
    assert list(figure(tmp_path, Lines).x) == [0]


def test_files_of_a_league_have_the_names_that_the_league_gives_them():
    from spoofgym.learning import double_oracle

    assert (sources.LEAGUE_FILE, sources.ROUNDS_FILE) == (double_oracle.SETTINGS_FILE, double_oracle.ROUNDS_FILE)
    assert sources.SCHEMA_VERSION == SCHEMA_VERSION == double_oracle.SCHEMA_VERSION


def first_of(rows):
    return rows[0]["signals"], rows[0]["user"]


def test_a_stanford_diagram_has_all_epochs_without_an_alarm():
    report = reports.integrity_study()
    stanford = figure(report, Stanford)
    [diagram] = [each for each in stanford.diagrams if (each.choice, each.name) == first_of(report["rows"])]
    assert stanford.chosen in {each.choice for each in stanford.diagrams}
    assert len(stanford.diagrams) == len(report["rows"])
    assert sum(count for *_, count in diagram.cells) == sum(count for _, count in diagram.regions)
    assert sum(count for _, count in diagram.regions) == 1000 - report["rows"][0]["epochs_in_alarm"]


# --- run folders ------------------------------------------------------------------------------------------------------


def run(folder: Path, seed: int, values, steps=(100, 200, 300), **environment) -> Path:
    folder.mkdir()
    game = {"scenario": "liu-flight", "detector": "snapshot", "knowledge": "shadow"} | environment
    config = {"environment": game, "learner": {"lanes": 4}, "seed": seed, "steps": 300}
    (folder / CONFIG_FILE).write_text(json.dumps(config))
    rows = [{"trial": 0, "steps": 50, "played": 50, "mean_return": -9.0}]
    rows += [
        {"trial": 1, "steps": each, "played": 50 + each, "mean_return": value}
        for each, value in zip(steps, values, strict=True)
    ]
    (folder / RETURNS_FILE).write_text(json.dumps(rows))
    return folder


def test_seeds_of_one_setting_share_a_learning_curve(tmp_path):
    folders = [run(tmp_path / f"seed{seed}", seed, [1.0 + seed, 2.0 + seed, 3.0]) for seed in range(3)]
    [section] = sections_of(folders)
    [lines] = section.figures
    mean, *seeds = lines.lines
    assert [line.name for line in seeds] == ["seed 0", "seed 1", "seed 2"]
    assert list(lines.x) == [100, 200, 300]
    assert mean.y == pytest.approx([2.0, 3.0, 3.0])
    assert (mean.low[0], mean.high[0]) == pytest.approx(mean_interval(np.array([1.0, 2.0, 3.0])))


def test_curves_with_other_steps_are_interpolated_where_all_are_known(tmp_path):
    one = run(tmp_path / "a", 0, [0.0, 2.0], (100, 300))
    other = run(tmp_path / "b", 1, [1.0, 3.0], (200, 400))
    [section] = sections_of([one, other])
    mean = section.figures[0].lines[0]
    assert list(section.figures[0].x) == [100, 200, 300, 400]
    assert mean.y == [None, 1.0, 2.0, None]


def test_other_settings_have_a_section_of_their_own(tmp_path):
    one, other = run(tmp_path / "a", 0, [1.0, 2.0, 3.0]), run(tmp_path / "b", 0, [1.0, 2.0, 3.0], knowledge="full")
    assert len(sections_of([one, other])) == 2


def test_a_defender_has_its_validation(tmp_path):
    folder = run(tmp_path / "d", 0, [1.0, 2.0, 3.0])
    (folder / VALIDATION_FILE).write_text(json.dumps([{"steps": 0, "mean_error_m": 4.0}]))
    assert figure(folder, Lines, "Validation").lines[0].y == [4.0]


def test_reports_in_a_run_folder_are_shown_and_other_files_are_not(tmp_path):
    folder = run(tmp_path / "x", 0, [1.0, 2.0, 3.0])
    (folder / "evaluation.json").write_text(json.dumps(reports.attackers()))
    (folder / "notes.json").write_text('{"mine": 1}')
    assert len(sections_of([folder])) == 2


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        (RETURNS_FILE, '[{"steps": 1}]', "a row must have trial, steps, played, mean_return"),
        (RETURNS_FILE, '{"a": 1}', "it is no list of rows"),
        (CONFIG_FILE, "[]", "it does not say what the environment is"),
        (RETURNS_FILE, "[]", "has no learning curve"),
    ],
)
def test_a_damaged_run_is_named(tmp_path, name, content, words):
    folder = run(tmp_path / "x", 0, [1.0, 2.0, 3.0])
    (folder / name).write_text(content)
    with pytest.raises(ValueError, match=words):
        sections_of([folder])


def test_a_folder_without_anything_is_named(tmp_path):
    with pytest.raises(ValueError, match="holds no training, no league and no report"):
        sections_of([tmp_path])


@pytest.mark.parametrize("kind", reports.REPORTS)
def test_a_damaged_report_is_refused_in_one_line(kind, tmp_path):
    for damage in ({"rows": None, "results": 3, "tasks": None}, {"rows": [3], "results": [3], "tasks": [3]}):
        with pytest.raises(ValueError, match="a damaged report of kind") as refusal:
            write_page(tmp_path / "page.html", [{**reports.REPORTS[kind](), **damage, "summary": None}])
        assert "\n" not in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


def test_tables_have_a_column_for_each_value_of_an_object_and_write_lists_as_text():
    report = reports.tuning()
    report["rows"][0]["extra"] = {"a": [1, 2, 3], "b": {"c": 5.0}, "ci95": [1.0, 2.0]}
    table = figure(report, TableFigure)
    row = dict(zip(table.columns, table.rows[0], strict=True))
    assert (row["ci95_m from"], row["ci95_m to"], row["extra a"], row["extra b c"]) == (2.0, 4.0, "[1, 2, 3]", 5.0)
    assert (row["extra ci95 from"], row["extra ci95 to"]) == (1.0, 2.0)


def test_runs_of_one_setting_are_drawn_together():
    row = {"runs": ["runs/a", "runs/b"], "games": 10, "mean_m": 50.0, "ci95_m": [48.0, 52.0], "iqm_m": 51.0}
    report = {**reports.attackers(), "aggregates": [{**row, "iqm_ci95_m": [49.0, 53.0]}]}
    bars = figure(report, Bars, "Runs of one setting")
    assert [(bar.value, bar.low, bar.high) for bar in bars.bars] == [(50.0, 48.0, 52.0), (51.0, 49.0, 53.0)]


def test_defenders_against_one_attack_are_named_by_it():
    assert figure({**reports.defenders(), "attack": "ramp:0.5"}, Bars).title == "Mean error, ramp:0.5"
