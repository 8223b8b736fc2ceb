"""Kujur, Khanafseh and Pervan (2024), "Optimal INS monitor for GNSS spoofer tracking error detection".

Rows for figures 1 to 6, 8, 10 and 11, the equations that they rest on, and appendices D and E. Missed detection comes
three ways: by the paper's formula, exactly, with the filter's feedback (`kujur_windows`), and by games (`kujur_games`).
Figure 7 shows realisations of the tracking error, of which there is nothing to compare.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import stats

from spoofgym.arrays import Floats
from spoofgym.detectors import cpi_theory
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.studies.reproduce import kujur_grids
from spoofgym.studies.reproduce.kujur_games import (
    HORIZON,
    INTERVAL,
    NAVIGATION,
    Game,
    Replica,
    correlation_time,
    flight,
    play,
)
from spoofgym.studies.reproduce.kujur_windows import P_FA, Windows, coasting, cumulative_exact, windows
from spoofgym.studies.reproduce.rows import (
    Group,
    Listing,
    Row,
    number_row,
    on,
    statement_row,
)
from spoofgym.studies.reproduce.verdict import Published, number_verdict, probability_verdict, rounded

PAPER = "kujur-2024"
TITLE = "Kujur et al. 2024, monitor of a spoofer's tracking error"
GAMES_PER_RUN = 25
"""Games for each run that is asked for: shares and their intervals need many."""
FREQUENT = 0.05
"""A false-alarm probability that so many games can show."""
CLEAN, WHITE_2 = Replica(0.0), Replica(0.02)
PLAYED = (WHITE_2, Replica(0.1, 10.0), Replica(0.1, 40.0))
WHITE_10 = Replica(0.1)
SECONDS = (30.0, 60.0, 180.0)

READINGS = (
    "The table of IMU grades (appendix F) is missing in the text that we have: the grades are assumed. Heading, "
    "settling time (15 minutes), elevation mask (5 degrees) and hour of the constellation's day (4 h) are ours.",
    "The text prints no P_MD, no N_min and no protection level; they are curves. Where a row says 'the formula', the "
    "paper's column is its equation evaluated with our filter's σ_s, which is not in the text either.",
    "The tracking error is vertical, as in the paper, and the monitor's window begins with the spoofing. P_FA is 1e-5.",
    f"A row of games has {GAMES_PER_RUN} for each run of --runs; its interval is the 95 % one of a share, a mean or a "
    "standard deviation.",
    "The CI's threshold has m N degrees of freedom, 16 for every epoch of eight satellites; the paper says N.",
    "Exact: the filter's errors and innovations are a linear map of the tracking error, its feedback included; a sum "
    "of squares then is a generalised chi-square.",
    "Equation 51 is a picture in the text: PL = Q⁻¹(P_FA / 2 N_min) σ_ss + Q⁻¹(P_MD) σ_coast, with P_FA divided by the "
    "open windows as the paper says, P_MD 1e-6.",
    "The time constants of appendix D are those of autocorrelations averaged over the eight satellites.",
    "The wording 'negligible' of the text is read as at most 1e-7, the requirement of its section 5.",
)


def groups(runs: int, seed: int, quick: bool) -> Iterator[Group]:
    """All rows, a group after the other.

    Args:
        runs: a 25th of the games of each kind.
        seed: of game 0.
        quick: whether there are fewer hours and tracking errors.
    """
    scenario, games = flight(), GAMES_PER_RUN * runs
    clean = play(scenario, CLEAN, games, seed)
    spoofed = {replica: play(scenario, replica, games, seed) for replica in PLAYED}
    exact = windows(NAVIGATION)
    yield false_alarms(clean)
    yield distributions(clean, spoofed[WHITE_2], exact)
    yield figure_1(spoofed[WHITE_2])
    yield three_ways(spoofed, exact)
    yield kujur_grids.missed_detection(exact)
    yield kujur_grids.grades()
    yield kujur_grids.statements(exact, quick)
    yield whiteness(runs, seed)
    yield separation(clean)
    yield from kujur_grids.shortest_windows(exact, quick)


def share_row(item: str, published: Published, events: int, trials: int, reason: str) -> Row:
    """A published number beside a share of games, with its exact 95 % interval."""
    share, (low, high) = events / trials, exact_interval(events, trials)
    return Row(item, published.value, share, (low, high), number_verdict(published, low, share, high), reason)


def _mean_row(item: str, published: float, values: Floats, reason: str) -> Row:
    """A published number beside the mean of one of each game, with its 95 % interval."""
    low, high = mean_interval(values)
    mean = float(np.mean(values))
    verdict = number_verdict(rounded(published, 0.0), low, mean, high)
    return Row(item, published, mean, (low, high), verdict, reason)


def false_alarms(clean: Game) -> Listing:
    """Thresholds of both monitors after 180 s without spoofing."""
    games, measured = len(clean.ci), 2 * flight().slots
    cumulative, projected = clean.ci[:, -1], clean.cpi[:, -1]
    literal = int(np.sum(cumulative > cpi_theory.cpi_threshold(P_FA, HORIZON)))
    correct = int(np.sum(cumulative > cpi_theory.ci_threshold(P_FA, HORIZON, measured)))
    seldom = int(np.sum(projected > cpi_theory.cpi_threshold(P_FA, HORIZON)))
    rows = [
        share_row(
            "CI, threshold of N degrees of freedom: share of clean games that alarm",
            rounded(P_FA, 0.0),
            literal,
            games,
            f"An epoch has {measured} measurements, so that there are {measured} N degrees; with these {correct} games "
            "alarm.",
        ),
        on(
            "own formula",
            share_row(
                f"CI, threshold of {measured} N degrees at P_FA {FREQUENT:g}: share of clean games that alarm",
                rounded(FREQUENT, 0.0),
                int(np.sum(cumulative > cpi_theory.ci_threshold(FREQUENT, HORIZON, measured))),
                games,
                "A P_FA that so many games can show.",
            ),
        ),
        on(
            "own formula",
            share_row(
                f"CPI, threshold of Gamma(N/2, 2) at P_FA {FREQUENT:g}: share of clean games that alarm (eq 35)",
                rounded(FREQUENT, 0.0),
                int(np.sum(projected > cpi_theory.cpi_threshold(FREQUENT, HORIZON))),
                games,
                f"At P_FA 1e-5 {seldom} of {games} games alarm.",
            ),
        ),
    ]
    return Listing("Section 2 and equation 35: false alarms after 180 s", tuple(rows))


def distributions(clean: Game, spoofed: Game, exact: Windows) -> Listing:
    """The CPI after 180 s without spoofing and with a white tracking error of 2 cm."""
    ratio = 1.0 + float(cpi_theory.kappa(WHITE_2.sigma, exact.information.mean()))
    variances, early = exact.variances(WHITE_2, HORIZON), exact.variances(WHITE_2, 60)
    fit = stats.kstest(clean.cpi[:, -1], stats.gamma(0.5 * HORIZON, scale=2.0).cdf)
    normal = (spoofed.cpi[:, -1] - HORIZON) / np.sqrt(2.0 * HORIZON)
    spread = float(np.std(normal, ddof=1))
    tails = np.quantile(_resampled_deviation(normal), (0.025, 0.975))
    low, high = float(tails[0]), float(tails[1])
    rows = (
        _mean_row(
            "clean: mean of q_N / N (eqs 19 and 34)",
            1.0,
            clean.cpi[:, -1] / HORIZON,
            f"Gamma(N/2, 2); the Kolmogorov-Smirnov test of all games against it has p = {fit.pvalue:.2g}.",
        ),
        _mean_row(
            "2 cm, white: mean of q_N / N; the formula has r = 1 + κ (eqs 24 and 37)",
            ratio,
            spoofed.cpi[:, -1] / HORIZON,
            f"Exact: {variances.mean():.3f}. An innovation holds the error and the one before, with the opposite sign.",
        ),
        _mean_row(
            "2 cm, white: mean of (q_N - N) / √(2N); the formula has √(N/2) κ (eqs 43 and 45)",
            float(np.sqrt(0.5 * HORIZON) * (ratio - 1.0)),
            normal,
            f"Exact: {(variances.sum() - HORIZON) / np.sqrt(2.0 * HORIZON):.2f}.",
        ),
        Row(
            "2 cm, white: standard deviation of (q_N - N) / √(2N); the formula has r (eq 45)",
            ratio,
            spread,
            (low, high),
            number_verdict(rounded(ratio, 0.0), low, spread, high),
            f"Exact: {np.sqrt((variances**2).mean()):.3f}, and {np.sqrt((early**2).mean()):.3f} after 30 s: it hardly "
            "depends on N, as the paper says.",
        ),
    )
    first, *others = rows
    listed = (first, *(on("own formula", row) for row in others))
    return Listing("Equations 19 to 45: distribution of the CPI after 180 s", listed)


def _resampled_deviation(values: Floats) -> Floats:
    """Standard deviations of 2000 resamples, drawn with a generator of its own."""
    drawn = np.random.default_rng(0).integers(0, len(values), (2000, len(values)))
    return np.std(values[drawn], axis=1, ddof=1)


def figure_1(spoofed: Game) -> Listing:
    """Figure 1, left: both monitors against a white tracking error of 2 cm."""
    games, measured = len(spoofed.ci), 2 * flight().slots
    projected = int(np.sum(spoofed.cpi[:, -1] > cpi_theory.cpi_threshold(P_FA, HORIZON)))
    cumulative = int(np.sum(spoofed.ci[:, -1] > cpi_theory.ci_threshold(P_FA, HORIZON, measured)))
    low, high = exact_interval(projected, games)
    missed = cumulative_exact(flight(), WHITE_2, HORIZON)
    row = Row(
        "2 cm, white: share of games that the CPI detects in 180 s",
        "far more than the CI",
        projected / games,
        (low, high),
        "reproduced" if low > exact_interval(cumulative, games)[1] else "not reproduced",
        f"The CI, with {measured} N degrees, detects {cumulative / games:.3f} (exact: {1.0 - missed:.3f}).",
        "words",
    )
    return Listing("Figure 1: CPI and CI", (row,))


def three_ways(spoofed: dict[Replica, Game], exact: Windows) -> Listing:
    """P_MD of the CPI by the formula, exactly, and in games."""
    rows = [
        _three_way_row(replica, game, exact, round(seconds / INTERVAL))
        for replica, game in spoofed.items()
        for seconds in SECONDS
    ]
    return Listing("P_MD three ways: the formula (paper), games (ours), exact (below)", tuple(rows))


def _three_way_row(replica: Replica, game: Game, exact: Windows, n: int) -> Row:
    """One replica after n epochs; where no game misses it, the exact value gives the verdict, for games cannot."""
    games, missed = len(game.cpi), int(np.sum(game.cpi[:, n - 1] <= cpi_theory.cpi_threshold(P_FA, n)))
    formula, value = float(f"{exact.formula(replica, n):.3g}"), exact.exact(replica, n)
    share, (low, high) = missed / games, exact_interval(missed, games)
    decided = (low, share, high) if missed else (value, value, value)
    return Row(
        f"{replica.words}, {INTERVAL * n:g} s: share of games that the CPI misses; the formula's P_MD",
        formula,
        share,
        (low, high),
        probability_verdict(formula, *decided),
        f"Exact P_MD: {value:.3g}." + ("" if missed else " No game missed it: the exact value decides."),
        "own formula",
    )


def whiteness(runs: int, seed: int) -> Listing:
    """Appendix D: the time constant of the innovations of the carriers under a white tracking error of 10 cm."""
    clean = correlation_time(play(flight(), CLEAN, runs, seed).carrier, INTERVAL)
    rows = []
    for imu, published in ((NAVIGATION, rounded(0.21, 0.01)), ("kujur-automotive", rounded(0.24, 0.01))):
        times = correlation_time(play(flight(imu), WHITE_10, runs, seed).carrier, INTERVAL)
        grade = imu.removeprefix("kujur-")
        rows.append(number_row(f"10 cm, white, {grade} IMU: time constant of the carrier's ACF, s", published, times))
    carrier = play(flight(), WHITE_10, runs, seed).carrier
    series = carrier - carrier.mean(axis=1, keepdims=True)
    first = ((series[:, 1:] * series[:, :-1]).sum(axis=1) / (series**2).sum(axis=1)).mean(axis=1)
    rows.append(
        statement_row(
            "10 cm, white, navigation IMU: autocorrelation of the innovations at one epoch",
            "white",
            np.abs(first) < 2.0 / np.sqrt(HORIZON),
            first,
            "White would be within 2/√K of zero. A time constant below the interval shows nothing: it is "
            f"{np.median(clean):.3f} s for clean innovations, which are white; the paper's 0.21 s is less, as a "
            "negative correlation makes it.",
        )
    )
    return Listing("Appendix D: whether spoofed innovations are white", tuple(rows))


def separation(clean: Game) -> Listing:
    """Appendix E: the variance of the separation after 180 s of coasting."""
    sigma = coasting(flight()).separation[HORIZON]
    square = (clean.separation / sigma) ** 2
    row = _mean_row(
        "mean square of the separation over u'(P_coast - P_KF) u after 180 s (eq 50)",
        1.0,
        square,
        f"σ_ss is {sigma:.2f} m.",
    )
    return Listing("Appendix E: solution separation", (on("own formula", row),))
