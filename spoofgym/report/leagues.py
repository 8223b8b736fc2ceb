"""Leagues: values per round, the payoff matrix with its mixtures, and how far every defender can be exploited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spoofgym.policies.published import shown_player
from spoofgym.report.figures import Bar, Bars, Figure, Layer, Line, Lines, Matrix, Section
from spoofgym.report.tables import Report, counted, facts_of, interval_of, table_of

SIDES = ("spoofer", "defender")


def league_sections(report: Report) -> list[Section]:
    """A ``"league"`` report."""
    rounds = report["results"]
    if not rounds:
        raise ValueError("the league has played no round yet")
    payoff = _payoff(report["duel"]["payoff"])
    figures: list[Figure] = [_values(rounds, payoff), _matrix(rounds, payoff)]
    figures += [_mixtures(rounds, side) for side in SIDES]
    figures += [*_gains(rounds, payoff), _worst(rounds[-1], payoff)]
    facts = [("Scenario", str(report["duel"]["scenario"])), ("Payoff", str(report["duel"]["payoff"]))]
    facts += [(name.capitalize(), str(report[name])) for name in ("meta", "games", "seed") if name in report]
    return [Section(f"League on {report['duel']['scenario']}", facts, figures)]


def _payoff(specification: object) -> str:
    return "share of epochs" if str(specification).startswith("beyond") else "harm, m"


def _values(rounds: Sequence[Report], payoff: str) -> Lines:
    intervals = [interval_of(found, "value_ci95") for found in rounds]
    last, (low, high) = rounds[-1], intervals[-1]
    return Lines(
        title="Value of the game by round",
        summary=f"After {counted(len(rounds), 'round')} the value is {last['value']:.3g} [{low:.3g}, {high:.3g}] "
        f"({payoff}).",
        x_label="round",
        y_label=payoff,
        x=[found["number"] for found in rounds],
        lines=[_line("value", [found["value"] for found in rounds], intervals)],
        whole=True,
    )


def _line(
    name: str, values: Sequence[float | None], ends: Sequence[tuple[float | None, float | None]]
) -> Line:
    return Line(name, values, [low for low, _ in ends], [high for _, high in ends])


def _names(rounds: Sequence[Report], side: str) -> list[str]:
    return list(dict.fromkeys(name for found in rounds for name in found[f"{side}s"]))


def _matrix(rounds: Sequence[Report], payoff: str) -> Matrix:
    spoofers, defenders = _names(rounds, "spoofer"), _names(rounds, "defender")
    return Matrix(
        title="Payoff matrix",
        summary=f"Mean payoff ({payoff}) of every spoofer (rows) against every defender (columns), with the share of "
        "each in the mixture of its side. The round can be chosen.",
        corner="spoofer",
        rows=[shown_player(name) for name in spoofers],
        columns=[shown_player(name) for name in defenders],
        layers=[_layer(found, spoofers, defenders) for found in rounds],
        row_weights=[_weights(found, "spoofer", spoofers) for found in rounds],
        column_weights=[_weights(found, "defender", defenders) for found in rounds],
        weighted="share",
        frames=True,
    )


def _layer(found: Report, spoofers: Sequence[str], defenders: Sequence[str]) -> Layer:
    def table(sign: float) -> list[list[float | None]]:
        cells = {
            (spoofer, defender): found["mean"][i][j] + sign * found["half_width"][i][j]
            for i, spoofer in enumerate(found["spoofers"])
            for j, defender in enumerate(found["defenders"])
        }
        return [[cells.get((spoofer, defender)) for defender in defenders] for spoofer in spoofers]

    return Layer(f"round {found['number']}", table(0.0), table(-1.0), table(1.0))


def _weights(found: Report, side: str, names: Sequence[str]) -> list[float | None]:
    shares = dict(zip(found[f"{side}s"], found[f"{side}_mixture"], strict=True))
    return [shares.get(name) for name in names]


def _mixtures(rounds: Sequence[Report], side: str) -> Matrix:
    names = _names(rounds, side)
    weights = [_weights(found, side, names) for found in rounds]
    last = sorted(zip(names, weights[-1], strict=True), key=lambda pair: -(pair[1] or 0.0))
    mixed = ", ".join(f"{shown_player(name)} {share:.2f}" for name, share in last if share and share >= 0.005)
    return Matrix(
        title=f"Mixture of the {side}s by round",
        summary=f"In the last round: {mixed}.",
        corner=side,
        rows=[shown_player(name) for name in names],
        columns=[f"round {found['number']}" for found in rounds],
        layers=[Layer("share in the mixture", [list(row) for row in zip(*weights, strict=True)], most=1.0)],
    )


def _gains(rounds: Sequence[Report], payoff: str) -> list[Lines]:
    """What each side's best response gained against the mixture, where there were trainings."""
    trained = [found for found in rounds if found["gains"]]
    if not trained:
        return []
    lines = []
    for side in SIDES:
        gains: list[Mapping[str, Any]] = [found["gains"].get(side) or {} for found in trained]
        ends = [interval_of(gain, "gain_ci95") for gain in gains]
        lines.append(_line(f"{side}'s", [gain.get("gain") for gain in gains], ends))
    return [
        Lines(
            title="Gain of the best responses by round",
            summary="What a newly trained player of each side gains against the mixture of the other: zero where the "
            "mixtures cannot be exploited.",
            x_label="round",
            y_label=payoff,
            x=[found["number"] for found in trained],
            lines=lines,
            whole=True,
        )
    ]


def _worst(last: Report, payoff: str) -> Bars:
    """Every defender of the last round, the least exploited first."""
    bars = []
    for place, name in enumerate(last["defenders"]):
        column = [row[place] for row in last["mean"]]
        worst = max(range(len(column)), key=column.__getitem__)
        half = last["half_width"][worst][place]
        by = f"by {shown_player(last['spoofers'][worst])}"
        bars.append(Bar(shown_player(name), column[worst], column[worst] - half, column[worst] + half, note=by))
    bars.sort(key=lambda bar: bar.value or 0.0)
    return Bars(
        title="Worst case of every defender",
        summary=f"{bars[0].label} has the least worst case, {bars[0].value:.3g} ({payoff}).",
        unit=f"worst case in the last round: {payoff} (95 % interval)",
        bars=bars,
    )


def exploit_sections(report: Report) -> list[Section]:
    """An ``"exploit"`` report: the worst case of every defender, and every spoofer against it."""
    payoff = _payoff(report["payoff"])
    rows = sorted(report["rows"], key=lambda row: float(row["worst"]["harm"]))
    worst = Bars(
        title="Worst case found for every defender",
        summary=f"{rows[0]['defender']} is exploited least: {rows[0]['worst']['harm']:.3g} ({payoff}).",
        unit=f"mean {payoff} (95 % interval)",
        bars=[_exploited(row) for row in rows],
    )
    cells = [(row["defender"], cell) for row in rows for cell in (*row["fixed"], *row["learned"])]
    flat = [{"defender": defender, **cell, "spoofer": shown_player(cell["spoofer"])} for defender, cell in cells]
    summary = "A row for each spoofer that was played against a defender."
    title = f"Exploitability on {report['scenario']}"
    return [Section(title, facts_of(report), [worst, table_of("All spoofers", summary, flat)])]


def _exploited(row: Report) -> Bar:
    worst = row["worst"]
    low, high = interval_of(worst)
    return Bar(row["defender"], worst["harm"], low, high, note=f"by {shown_player(worst['spoofer'])}")
