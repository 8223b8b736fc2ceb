"""The matrix of detectors and attacks, and its ROC and DET curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spoofgym.report.figures import Curve, Curves, Figure, Layer, Matrix, Section
from spoofgym.report.tables import Report, facts_of, interval_of, percent, table_of
from spoofgym.studies.matrix_presentation import ensemble_notes, short_names

FIRST_ATTACK = "ramp:0.1"


def matrix_sections(report: Report) -> list[Section]:
    """A ``"matrix"`` report."""
    names = short_names(dict(report))
    figures: list[Figure] = [_matrix(report, names)]
    if report["curves"]:
        figures.append(_curves(report, names))
    figures.append(table_of("Thresholds", "Every detector with its threshold.", report["detectors"]))
    if report.get("learned"):
        figures.append(table_of("Learned spoofers", "By the detector they were trained against.", report["learned"]))
    notes = [("Ensemble", note) for note in ensemble_notes(dict(report))]
    title = f"Detectors against attacks on {report['scenario']}"
    return [Section(title, [*facts_of(report), *notes], figures)]


def _matrix(report: Report, names: Mapping[str, str]) -> Matrix:
    detectors = [item["name"] for item in report["detectors"]]
    attacks = list(dict.fromkeys(row["attack"] for row in report["rows"]))
    cells = {(row["detector"], row["attack"]): row for row in report["rows"]}

    def table(value: Any) -> list[list[float | None]]:
        return [[value(cells[detector, attack]) for attack in attacks] for detector in detectors]

    layers = [
        Layer(
            "games with an alarm, %",
            table(lambda row: percent(row["detection_probability"])),
            table(lambda row: percent(interval_of(row)[0])),
            table(lambda row: percent(interval_of(row)[1])),
            most=100.0,
        ),
        Layer("mean undetected error, m", table(lambda row: row["mean_undetected_error_m"]), logarithmic=True),
        Layer("median time to detect, s", table(lambda row: row["median_time_to_detect_s"])),
        Layer("error at the alarm, m", table(lambda row: row["error_at_detection_m"]), logarithmic=True),
    ]
    return Matrix(
        title="Every detector against every attack",
        summary=f"{len(detectors)} detectors, {len(attacks)} attacks, {report['episodes']} games each, at an average "
        f"of {report['arl0']:g} epochs between false alarms; in the column “none” an alarm is a false one. A click on "
        "a name sorts by it.",
        corner="detector",
        rows=[names[name] for name in detectors],
        columns=attacks,
        layers=layers,
    )


def _curves(report: Report, names: Mapping[str, str]) -> Curves:
    curves = [_curve(item, names) for item in report["curves"]]
    attacks = list(dict.fromkeys(curve.choice for curve in curves))
    told = [attack for attack in attacks if attack != "none"] or attacks  # clean games have the curve of chance
    chosen = FIRST_ATTACK if FIRST_ATTACK in told else told[0]
    return Curves(
        title="ROC and DET curves",
        summary="Detection probability of a game over its false-alarm probability, as the threshold changes. The "
        "legend switches curves on and off; the one that is pointed at shows its 95 % interval.",
        curves=curves,
        chosen=chosen,
    )


def _curve(item: Mapping[str, Any], names: Mapping[str, str]) -> Curve:
    points = item["points"]
    return Curve(
        name=names[item["detector"]],
        choice=item["attack"],
        x=[point["false_alarm_probability"] for point in points],
        y=[point["detection_probability"] for point in points],
        low=[point["detection_ci95"][0] for point in points],
        high=[point["detection_ci95"][1] for point in points],
    )
