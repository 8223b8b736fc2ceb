"""The matrix as a user asks for it: JSON alone, tables, figures, bad input."""

import itertools
import json

import numpy as np
import pytest

from spoofgym.studies import matrix_presentation
from spoofgym.studies.evaluate import matrix
from spoofgym.studies.matrix_presentation import drawn_curves, ensemble_notes, short_names, values

SHORT = ["--scenario", "liu-flight:horizon=20", "--arl0", "300", "--episodes", "200", "--threads", "1"]
PARTS = ["--detector", "snapshot", "--detector", "mewma", "--detector", "ensemble:snapshot+mewma", "--attack", "ramp:1"]
ROW_KEYS = {
    "detector",
    "attack",
    "detection_probability",
    "ci95",
    "median_time_to_detect_s",
    "error_at_detection_m",
    "mean_undetected_error_m",
}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("matrix") / "out.json"
    assert matrix.main([*SHORT, *PARTS, "--json", str(path)]) == 0
    return json.loads(path.read_text())


def test_every_detector_meets_every_attack_at_one_rate(report):
    assert (report["schema_version"], report["kind"], report["arl0"]) == (1, "matrix", 300.0)
    assert {row["attack"] for row in report["rows"]} == {"none", "ramp:1"}
    assert len(report["rows"]) == 6
    assert all(set(row) == ROW_KEYS for row in report["rows"])
    for detector in report["detectors"]:
        assert detector["arl0"] == pytest.approx(300.0, rel=0.1)
    assert report["detectors"][0]["arl0_ci95"] is None  # from theory
    assert report["detectors"][1]["arl0_ci95"][0] < 300.0 < report["detectors"][1]["arl0_ci95"][1]


def test_names_are_short_where_the_rate_is_common(report):
    assert list(short_names(report).values()) == ["snapshot", "mewma", "ensemble"]
    assert ensemble_notes(report) == ["ensemble: snapshot + mewma"]


def test_values_stand_at_their_detector_and_attack(report):
    detectors, attacks, table = values(report, "detection_probability")
    for row in report["rows"]:
        place = detectors.index(row["detector"]), attacks.index(row["attack"])
        assert table[place] == row["detection_probability"]
    assert np.isfinite(table).all()


def test_json_alone_on_stdout(capsys):
    assert matrix.main([*SHORT, *PARTS, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "matrix"


def test_figures_are_written_and_the_table_fits_a_terminal(tmp_path, capsys):
    figures = ["--figure", str(tmp_path / "heat.png"), "--roc", str(tmp_path / "roc.svg"), "--roc-attack", "ramp:1"]
    assert matrix.main([*SHORT, *PARTS, *figures]) == 0
    assert (tmp_path / "heat.png").stat().st_size > 10_000
    assert (tmp_path / "roc.svg").stat().st_size > 10_000
    printed = capsys.readouterr().out
    assert "games with an alarm" in printed
    assert "mean undetected error" in printed


@pytest.mark.parametrize(
    ("attacks", "drawn"), [(["ramp:1", "jump"], "ramp:1"), (["jump", "ramp:0.1"], "ramp:0.1"), (["jump"], "jump")]
)
def test_curves_of_the_usual_attack_or_else_of_the_first(attacks, drawn, tmp_path, monkeypatch):
    chosen = []
    monkeypatch.setattr(matrix, "curves_figure", lambda report, attack, path: chosen.append(attack))
    parts = [part for attack in attacks for part in ("--attack", attack)]
    assert matrix.main([*SHORT, "--detector", "snapshot", *parts, "--roc", str(tmp_path / "roc.png")]) == 0
    assert chosen == [drawn]


def test_points_with_few_clean_alarms_are_not_drawn(report):
    drawn = drawn_curves(report, "ramp:1")
    assert [curve["detector"] for curve in drawn] == [item["name"] for item in report["detectors"]]
    for curve, whole in zip(drawn, report["curves"], strict=True):
        alarms = [round(200 * point["false_alarm_probability"]) for point in whole["points"]]
        assert alarms[0] < 10
        assert curve["points"] == [point for point, n in zip(whole["points"], alarms, strict=True) if n >= 10]


def test_curves_need_false_alarms_and_the_rows_are_kept(tmp_path, capsys):
    few = [*SHORT, *PARTS, "--episodes", "15", "--json", str(tmp_path / "out.json"), "--roc", str(tmp_path / "roc.png")]
    assert matrix.main(few) == 2
    assert "raise --episodes" in " ".join(capsys.readouterr().err.split())
    assert json.loads((tmp_path / "out.json").read_text())["episodes"] == 15


def test_a_filter_that_breaks_down_is_told(capsys):
    scenario = "shadmehri-flight:filter=self-tuning,noise=markov,guard=none"
    parts = ["--detector", "snapshot:threshold=1e9", "--attack", "ramp:1", "--episodes", "20", "--threads", "1"]
    assert matrix.main(["--scenario", scenario, *parts]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert error.startswith("error: run ")
    assert "choose a guard" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*SHORT, *PARTS, "--roc", "x.png", "--roc-attack", "ramp:9"], "there are: ramp:1"),
        ([*SHORT, "--detector", "snapshot", "--detector", "snapshot", "--attack", "jump"], "once only"),
        ([*SHORT, "--detector", "snapshoot"], "valid names:"),
        (["--attack", "ramp:1", "--shadow", "foi-drive"], "it goes with --attacker"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, message, capsys):
    assert matrix.main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("arl0", ["1", "nan", "inf", "often"])
def test_an_impossible_rate_is_refused(arl0, capsys):
    with pytest.raises(SystemExit):
        matrix.main(["--arl0", arl0])
    assert "argument --arl0: expected a" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("detectors", "attacks"),
    [
        (["snapshot"], ["ramp:0.2"]),
        (["snapshot", "signed-mean:n=120"], ["none", "tracking-error:ramp:0.2,sigma=1,time=20"]),
        (["snapshot", "acna", "ensemble"], [f"ramp:{rate}" for rate in range(1, 19)]),
    ],
)
def test_titles_names_and_numbers_of_a_heat_map_are_whole_and_apart(detectors, attacks, tmp_path, monkeypatch):
    """Whatever the number of rows and columns: no text leaves the figure, and no number touches the next one."""
    drawn = []
    monkeypatch.setattr(matrix_presentation.files, "write_figure", lambda path, figure: drawn.append(figure))
    rows = [
        {"detector": one, "attack": other, "detection_probability": 1.0, "mean_undetected_error_m": 238.0}
        for one in detectors
        for other in attacks
    ]
    members = [{"name": name} for name in detectors]
    scenario = "liu-flight:horizon=250,imu=tactical"
    report = {"scenario": scenario, "arl0": 1e4, "episodes": 100, "detectors": members, "rows": rows}
    matrix_presentation.matrix_figure(report, tmp_path / "heat.png")
    (figure,) = drawn
    figure.canvas.draw()
    texts = [text for text in figure.findobj(lambda part: hasattr(part, "get_text")) if text.get_text()]
    for text in texts:
        box, whole = text.get_window_extent(), figure.bbox
        assert 0 <= box.x0 < box.x1 <= whole.x1, text.get_text()
        assert 0 <= box.y0 < box.y1 <= whole.y1, text.get_text()
    numbers = [text.get_window_extent() for text in texts if text.get_text() in ("100", "238")]
    assert len(numbers) == 2 * len(rows)
    assert not any(one.overlaps(other) for one, other in itertools.combinations(numbers, 2))
