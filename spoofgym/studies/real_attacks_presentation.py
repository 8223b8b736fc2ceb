"""The study of real attacks on the terminal: clean records, all detectors at a glance, and every attack in detail."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from spoofgym.calibration.thresholds import poisson_interval
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.scenarios.recorded_family import SETTLING
from spoofgym.studies.presentation import number

Rows = Sequence[Mapping[str, Any]]


def real_attacks_tables(report: Mapping[str, Any]) -> Group:
    """A ``"real-attacks"`` report for the terminal."""
    parts: list[Table | Text] = [records_table(report)]
    if report["rows"]:
        parts += [logs_table(report), glance_table(report), false_alarms_table(report)]
    parts += [real_table(report, log) for log in dict.fromkeys(row["log"] for row in real_rows(report))]
    parts += [injected_table(report, log) for log in dict.fromkeys(row["log"] for row in injected_rows(report))]
    parts.append(Text("\n".join(left_out_lines(report))))
    return Group(*parts)


def real_rows(report: Mapping[str, Any]) -> Rows:
    """Those of real attacks."""
    return [row for row in report["rows"] if row["real"]]


def injected_rows(report: Mapping[str, Any]) -> Rows:
    """Those of injected attacks."""
    return [row for row in report["rows"] if not row["real"]]


def detectors_of(rows: Rows) -> list[str]:
    """Names of the detectors, in the order in which they come."""
    return list(dict.fromkeys(row["detector"] for row in rows))


def attacks_of(rows: Rows) -> list[str]:
    """Words of the attacks, in the order in which they come."""
    return list(dict.fromkeys(row["attack"] for row in rows))


def is_quiet(row: Mapping[str, Any], probability: float) -> bool:
    """Whether alarms before the onset may have the rate that the threshold was set for, by their exact interval."""
    return not row["epochs_before"] or exact_interval(row["alarms_before"], row["epochs_before"])[0] <= probability


def _table(title: str, caption: str, first: str, columns: Sequence[str]) -> Table:
    table = Table(title=f"\n{title}", caption=caption, box=None, padding=(0, 1, 0, 0), title_justify="left")
    table.caption_justify = "left"
    table.add_column(first, no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def percent(share: float | None) -> str:
    """A share as percent, two digits that say something."""
    return "–" if share is None else f"{100.0 * share:.2g}" if share < 0.0995 else f"{100.0 * share:.0f}"


def _interval(ends: Sequence[float] | None) -> str:
    return "–" if ends is None else f"[{percent(ends[0])}, {percent(ends[1])}]"


def metres(value: float | None) -> str:
    """A distance or a time: one decimal where it is below 10."""
    return number(value, ".1f" if value is not None and value < 9.95 else ".0f")


def records_table(report: Mapping[str, Any]) -> Table:
    """What every clean record supports."""
    asked = report["false_alarm_probability"]
    table = _table(
        f"Clean records at {percent(asked)} % false alarms per epoch",
        "set: alarms that the thresholds leave in the record, and the interval of the share that they stand for if "
        "epochs are independent; held out: thresholds of one half tried on the other, median detector [least, most]; "
        "NIS: per degree of freedom, 1 where the filter is as good as it believes",
        "log\n", ("\nfilter", "\nepochs", "least\n%", "\nset", "95 %\n%", "held out\n%", "\nNIS"),
    )  # fmt: skip
    for log in report["logs"]:
        held = [
            row["share"] for row in report["false_alarms"] if row["log"] == log["log"] and row["share"] is not None
        ]
        tried = f"{percent(float(np.median(held)))} [{percent(min(held))}, {percent(max(held))}]" if held else "–"
        supported = (str(log["alarms_set"]), _interval(log["set_ci95"]), tried)
        table.add_row(
            log["log"], log["filter"], str(log["clean_epochs"]), percent(log["least_probability"]),
            *(supported if log["supported"] else ("not", "supported", "–")), f"{log['nis_per_degree']:.2f}",
        )  # fmt: skip
    return table


def logs_table(report: Mapping[str, Any]) -> Table:
    """A row for each log: what its injected attacks do, by the mean of all detectors."""
    rows = injected_rows(report)
    words = attacks_of(rows)
    table = _table(
        "Injected attacks by log",
        f"{report['games']} games of each attack: share of games that are found, mean of the detectors; largest error "
        "unnoticed, m, median game of the median detector",
        "log\n", [text for word in words for text in (f"{word}\n%", "\nm")],
    )  # fmt: skip
    for log in dict.fromkeys(row["log"] for row in rows):
        cells = []
        for word in words:
            of = [row for row in rows if row["log"] == log and row["attack"] == word]
            errors = [row["undetected_m"] for row in of if row["undetected_m"] is not None]
            cells.append(percent(float(np.mean([row["found"] / row["games"] for row in of]))) if of else "–")
            cells.append(metres(float(np.median(errors)) if errors else None))
        table.add_row(log, *cells)
    return table


def glance_table(report: Mapping[str, Any]) -> Table:
    """A row for each detector: delays in the real attacks, and games found of the injected ones."""
    real, rows = real_rows(report), injected_rows(report)
    words, logs = attacks_of(rows), list(dict.fromkeys(row["log"] for row in real))
    table = _table(
        "All detectors",
        "seconds from the onset of each real attack to the alarm: – = none; ! = more false alarms before the onset "
        "than asked for; a dot = it cannot watch the log; then games of the injected attacks that are found, % of all",
        "detector\n", [*(log.replace("-", "\n", 1) + " s" for log in logs), *(f"{word}\n%" for word in words)],
    )  # fmt: skip
    for name in detectors_of(report["rows"]):
        cells = []
        for log in logs:
            own = [row for row in real if (row["log"], row["detector"]) == (log, name)]
            mark = "" if not own or is_quiet(own[0], report["false_alarm_probability"]) else "!"
            cells.append(metres(own[0]["delay_s"]) + mark if own else ".")
        for word in words:
            of = [row for row in rows if (row["attack"], row["detector"]) == (word, name)]
            games = sum(row["games"] for row in of)
            cells.append(percent(sum(row["found"] for row in of) / games) if games else ".")
        table.add_row(name, *cells)
    return table


def false_alarms_table(report: Mapping[str, Any]) -> Table:
    """A row for each detector: false alarms by thresholds of the other half, of all records together."""
    table = _table(
        "False alarms held out: thresholds of one half of a record tried on the other",
        f"asked for: {percent(report['false_alarm_probability'])} % of the epochs. Intervals are exact, as if epochs, "
        "or alarms that begin, were independent; a dash: no record is long enough for halves",
        "detector\n", ["\nalarms", "\nof", "\n%", "95 %\n%", "begun\nper h", "95 %\nper h"],
    )  # fmt: skip
    for name in dict.fromkeys(row["detector"] for row in report["false_alarms"]):
        tried = [row for row in report["false_alarms"] if row["detector"] == name and row["share"] is not None]
        alarms, epochs = sum(row["alarms"] for row in tried), sum(row["epochs"] for row in tried)
        if not epochs:
            table.add_row(name, *6 * ["–"])
            continue
        begun, hours = sum(row["begun"] for row in tried), sum(row["hours"] for row in tried)
        low, high = (1.0 / end / hours for end in reversed(poisson_interval(begun, 1)))
        share = (percent(alarms / epochs), _interval(exact_interval(alarms, epochs)))
        table.add_row(name, str(alarms), str(epochs), *share, f"{begun / hours:.0f}", f"[{low:.0f}, {high:.0f}]")
    return table


def real_table(report: Mapping[str, Any], log: str) -> Table:
    """Every detector on one real attack."""
    rows = [row for row in real_rows(report) if row["log"] == log]
    head = rows[0]
    back = "it does not come back"
    if head["recovery_s"] is not None:
        back = f"it is back within 1 m {head['recovery_s']:.1f} s after its end"
    elif not head["ended"]:
        back = "it lasts to the end"
    pulls = any(row["after_pull_s"] is not None for row in rows)
    table = _table(
        f"{log}: the real attack",
        f"It lasts {head['lasts_s']:.1f} s; the filter errs by up to {metres(head['largest_error_m'])} m, every fix "
        f"used; {back}. Seconds to the alarm"
        + (", and from the beginning of the pull to an alarm" if pulls else "")
        + "; error then; largest error unnoticed; false alarms before the onset, of "
        f"{head['epochs_before']} epochs; alarms after the end",
        "detector\n",
        ["alarm\ns", *(["in pull\ns"] if pulls else []), "error\nm", "unno-\nticed m", "false\nbefore", "after\nend"],
    )  # fmt: skip
    for row in rows:
        table.add_row(
            row["detector"], metres(row["delay_s"]), *([metres(row["after_pull_s"])] if pulls else []),
            metres(row["error_at_alarm_m"]), metres(row["undetected_m"]), str(row["alarms_before"]),
            number(row["alarms_after_end"], ".0f"),
        )  # fmt: skip
    return table


def injected_table(report: Mapping[str, Any], log: str) -> Table:
    """Every detector on the injected attacks in one log."""
    rows = [row for row in injected_rows(report) if row["log"] == log]
    words = attacks_of(rows)
    heads = {row["attack"]: row for row in rows}
    games = heads[words[0]]["games"]
    low, high = exact_interval(games, games)
    told = "; ".join(f"{word}: {_attack(heads[word])}" for word in words)
    table = _table(
        f"{log}: injected attacks",
        f"games found, of {games} ({games} of {games} is [{percent(low)}, {percent(high)}] %); median seconds to the "
        f"alarm; median of the largest error unnoticed, m. {told}",
        "detector\n", [text for word in words for text in (f"{word}\nof {games}", "\ns", "\nm")],
    )  # fmt: skip
    cells = {(row["detector"], row["attack"]): row for row in rows}
    for name in detectors_of(rows):
        values: list[str] = []
        for word in words:
            row = cells[name, word]
            values += [str(row["found"]), metres(row["delay_s"]), metres(row["undetected_m"])]
        table.add_row(name, *values)
    return table


def _attack(row: Mapping[str, Any]) -> str:
    """An attack in words: what, how long, what it does to the filter, and when that is over."""
    text = f"{row['specification']}, {row['lasts_s']:.0f} s"
    if row["largest_error_m"] is not None:
        text += f", errors up to {metres(row['largest_error_m'])} m"
    if row["ended"]:
        text += f", back in {row['recovered']} of {row['ended']} games"
        text += "" if row["recovery_s"] is None else f", median {row['recovery_s']:.1f} s"
    return text


def rounded_up(value: float) -> float:
    """A number with two digits that is no smaller; value is above 0."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit


def left_out_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """What was left out and why, each reason once."""
    logs = {log["log"] for log in report["logs"]}
    places: dict[tuple[str, str], list[str]] = {}
    for entry in report["left_out"]:
        places.setdefault((entry["part"], entry["reason"]), []).append(entry["log"])
    reasons: dict[tuple[str, str], list[str]] = {}
    for (part, reason), where in places.items():
        told = "every log" if set(where) == logs and len(logs) > 1 else ", ".join(where)
        reasons.setdefault((reason, told), []).append(part)
    for (reason, told), parts in reasons.items():
        yield f"left out of {told}: {', '.join(parts)}: {reason}"
    for log in report["logs"]:
        if not log["supported"]:
            least = rounded_up(log["least_probability"])
            yield f"{log['log']}: not supported: {log['clean_epochs']} clean epochs need --p-fa {least:g} or more"
        if log["settling_s"] < SETTLING - 1.0:
            told = f"the filter had {log['settling_s']:.1f} s to settle, half of the log; {SETTLING:g} s are usual"
            yield f"{log['log']}: {told}"
        options = log["scenario"].partition(",")[2]
        if options:
            told = f"; IMU simulated: {log['simulated_imu']}" if log["simulated_imu"] else ""
            yield f"{log['log']}: {options}{told}"
