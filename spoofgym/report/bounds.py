"""Bounds: what no defender is below, in a population of attacks and in the duel."""

from __future__ import annotations

from spoofgym.report.figures import Bar, Bars, Figure, Mark, Section
from spoofgym.report.tables import Report, facts_of, interval_of, table_of

BOUND, DEFENDER = "bound", "defender"


def bayesian_sections(report: Report) -> list[Section]:
    """A ``"bayesian-bound"`` report."""
    figures: list[Figure] = [_population(row) for row in report["rows"]]
    return [Section(f"Bayesian bound on {report['scenario']}", facts_of(report), figures)]


def _population(row: Report) -> Bars:
    bayesian, trusting = row["bayesian"], row["trusting"]
    defenders = sorted(row["defenders"], key=lambda each: float(each["harm"]))
    bars = [Bar("Bayesian, median of the posterior", bayesian["harm"], *interval_of(bayesian, "harm_ci95"), BOUND)]
    bars += [Bar(each["defender"], each["harm"], *interval_of(each, "harm_ci95"), DEFENDER) for each in defenders]
    bars.append(Bar("best filter that uses every fix", trusting["harm"], *interval_of(trusting, "harm_ci95"), DEFENDER))
    best = f" The best defender has {defenders[0]['harm']:.2f} m ({defenders[0]['defender']})." if defenders else ""
    return Bars(
        title=f"Defenders above the Bayesian bound, {row['population']} attacks",
        summary=f"No defender is below {bayesian['harm']:.2f} m on average in these games.{best}",
        unit="mean error, m (95 % interval)",
        bars=bars,
        marks=[Mark("Bayesian bound", bayesian["harm"])],
    )


def duel_sections(report: Report) -> list[Section]:
    """A ``"duel-bound"`` report."""
    figures: list[Figure] = [
        Bars(
            title="No defender keeps the mean payoff below",
            summary=" ".join(f"Payoff {row['payoff']}: {row['value']:.3g} at least." for row in report["rows"]),
            unit="mean payoff (95 % interval)",
            bars=[Bar(row["payoff"], row["value"], *interval_of(row)) for row in report["rows"]],
        ),
        table_of("All numbers", "A row for each payoff.", report["rows"]),
    ]
    return [Section(f"Bound of the duel on {report['scenario']}", facts_of(report), figures)]
