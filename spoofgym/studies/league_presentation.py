"""Tables and the figure of a league: who can be exploited by how much, who is mixed in, and how the value moved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from spoofgym import files
from spoofgym.figures import new_figure

MIXED = 0.005
"""Share from which a player is named in a mixture."""


def league_tables(report: dict[str, Any]) -> list[Table]:
    """The tables of a ``"league"`` report: values per round, mixtures of the last, and every defender.

    Args:
        report: of `spoofgym.learning.league`.
    """
    return [_rounds(report), _mixture(report, "spoofer"), _mixture(report, "defender"), _defenders(report)]


def _unit(report: dict[str, Any]) -> str:
    return "" if str(report["duel"]["payoff"]).startswith("beyond") else ", m"


def _rounds(report: dict[str, Any]) -> Table:
    title = f"{report['duel']['scenario']}, payoff {report['duel']['payoff']}: value of the game"
    value = f"value{_unit(report)}"
    columns = ("round", "spoofers", "defenders", "games a cell", value, "spoofer gains", "defender gains")
    table = _table(title, columns)
    for found in report["results"]:
        low, high = found["value_ci95"]
        gains = [_gain(found["gains"].get(side)) for side in ("spoofer", "defender")]
        players = [str(len(found[side])) for side in ("spoofers", "defenders")]
        games = _range(np.unique(found["games"]))
        table.add_row(str(found["number"]), *players, games, f"{found['value']:.3g} [{low:.3g}, {high:.3g}]", *gains)
    return table


def _range(numbers: NDArray[np.int64]) -> str:
    """The smallest and the largest of some numbers; one where they are equal."""
    return f"{numbers[0]:,}" if len(numbers) == 1 else f"{numbers[0]:,} to {numbers[-1]:,}"


def _gain(gain: dict[str, Any] | None) -> str:
    if gain is None:
        return ""
    low, high = gain["gain_ci95"]
    return f"{gain['gain']:.3g} ±{0.5 * (high - low):.2g}{'' if gain['joins'] else ', left out'}"


def _mixture(report: dict[str, Any], side: str) -> Table:
    last = report["results"][-1]
    table = _table(f"{side}s that are mixed", (side, "share"))
    pairs = zip(last[f"{side}s"], last[f"{side}_mixture"], strict=True)
    for name, share in sorted(pairs, key=lambda pair: -pair[1]):
        if share >= MIXED:
            table.add_row(name, f"{share:.2f}")
    return table


def _defenders(report: dict[str, Any]) -> Table:
    """Every defender, the least exploited first; the mixture of defenders is one of them."""
    last = report["results"][-1]
    mean, half = np.array(last["mean"]), np.array(last["half_width"])
    unit = _unit(report)
    table = _table("worst case found", ("defender", f"harm{unit}", "by", "against the mixture"))
    spoofers, shares = last["spoofers"], np.array(last["spoofer_mixture"])
    rows = []
    for place, name in enumerate(last["defenders"]):
        worst = int(mean[:, place].argmax())
        found = mean[worst, place]
        rows.append((found, name, f"{found:.3g} ±{half[worst, place]:.2g}", spoofers[worst], shares @ mean[:, place]))
    mixed = mean @ np.array(last["defender_mixture"])
    worst = int(mixed.argmax())
    rows.append((mixed[worst], "the mixture", f"{mixed[worst]:.3g}", spoofers[worst], shares @ mixed))
    for _, name, harm, by, against in sorted(rows, key=lambda row: row[0]):
        table.add_row(name, harm, by, f"{against:.3g}")
    return table


def _table(title: str, columns: tuple[str, ...]) -> Table:
    table = Table(title=title, box=None)
    for place, name in enumerate(columns):
        table.add_column(name, justify="left" if place == 0 or name == "by" else "right")
    return table


def league_figure(report: dict[str, Any], path: Path) -> None:
    """The payoff matrix of the last round, its mixtures at the margins, and the value per round if there are several.

    Args:
        report: of `spoofgym.learning.league`.
        path: of the picture.
    """
    results = report["results"]
    rows, columns = np.array(results[-1]["mean"]).shape
    several = len(results) > 1
    figure = new_figure(4.5 + 0.62 * columns, (4.2 if several else 2.6) + 0.34 * rows, dpi=110, layout="constrained")
    if several:
        upper, lower = figure.subplots(2, 1, gridspec_kw={"height_ratios": (rows + 2, 7)})
        _draw_values(lower, results, _unit(report))
    else:
        upper = figure.subplots()
    _draw_matrix(upper, report)
    figure.suptitle(_title(report), x=0.01, ha="left", fontsize=11)
    files.write_figure(path, figure)


def _title(report: dict[str, Any]) -> str:
    """Two lines, which fit beside a matrix of one column."""
    last = report["results"][-1]
    low, high = last["value_ci95"]
    value = f"value {last['value']:.3g} [{low:.3g}, {high:.3g}]"
    return f"{report['duel']['scenario']}: mean harm{_unit(report)}\nshare in the mixture in brackets; {value}"


def _draw_matrix(axes: Any, report: dict[str, Any]) -> None:
    last = report["results"][-1]
    mean = np.array(last["mean"])
    axes.imshow(mean, cmap="YlOrRd", aspect="auto", vmin=0.0)
    middle = 0.6 * float(mean.max())
    for (row, column), value in np.ndenumerate(mean):
        text = f"{value:.3g}\n±{last['half_width'][row][column]:.1g}"
        colour = "white" if value > middle else "black"
        axes.text(column, row, text, ha="center", va="center", fontsize=6.5, color=colour)
    named = [(last["defenders"], last["defender_mixture"]), (last["spoofers"], last["spoofer_mixture"])]
    labels = [[_label(name, share) for name, share in zip(*pair, strict=True)] for pair in named]
    axes.set_xticks(range(mean.shape[1]), labels[0], rotation=45, ha="right", rotation_mode="anchor", fontsize=8)
    axes.set_yticks(range(mean.shape[0]), labels[1], fontsize=8)


def _draw_values(axes: Any, results: list[dict[str, Any]], unit: str) -> None:
    numbers = [found["number"] for found in results]
    low, high = np.array([found["value_ci95"] for found in results]).T
    axes.fill_between(numbers, low, high, color="#0072b2", alpha=0.2, linewidth=0)
    axes.plot(numbers, [found["value"] for found in results], color="#0072b2", marker="o")
    axes.set_xticks(numbers)
    axes.set(xlabel="round", ylabel=f"value{unit}", ylim=(0, 1.1 * max(high)))
    axes.grid(color="#e6e6e6", linewidth=0.6)


def _label(name: str, share: float) -> str:
    short = name if not name.startswith("policy:") else name.rpartition("/")[2]
    return f"{short}  ({share:.2f})" if share >= MIXED else short
