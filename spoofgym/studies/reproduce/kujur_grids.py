"""Rows of Kujur 2024 that need no game: P_MD by formula and exactly, shortest windows, protection levels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spoofgym.studies.reproduce.kujur_games import GRADES, INTERVAL, NAVIGATION, Replica, flight
from spoofgym.studies.reproduce.kujur_windows import P_MD_CPI, Windows, coasting, windows
from spoofgym.studies.reproduce.rows import (
    Grid,
    Listing,
    Row,
    statement_row,
)
from spoofgym.studies.reproduce.verdict import NEVER, Published, Value, Verdict, number_verdict, probability_verdict

TIMES = (0.0, 10.0, 40.0)
SIGMAS, QUICK_SIGMAS = (0.05, 0.1, 0.2, 0.5, 1.0), (0.1, 0.5)
MINUTE = round(60.0 / INTERVAL)
LONGEST = 360
HOURS = range(24)
FEEDBACK = "Ours has the filter's feedback, the formula has not."
HOUR_WINDOW = round(30.0 / INTERVAL)


def compared(item: str, formula: float, exact: float) -> Row:
    """A probability by the paper's formula beside the exact one."""
    verdict = probability_verdict(formula, exact, exact, exact)
    return Row(item, float(f"{formula:.2g}"), exact, None, verdict, FEEDBACK, "own formula")


def missed_detection(exact: Windows) -> Grid:
    """Figures 2, 3 and 6: P_MD against run time, σ_t and τ."""
    seconds = (10.0, 30.0, 60.0, 120.0, 180.0)
    replicas = [Replica(0.02), *(Replica(sigma, time) for sigma in (0.05, 0.1) for time in TIMES)]
    lines = []
    for replica in replicas:
        lines.append((replica.words, tuple(_cell(exact, replica, time) for time in seconds)))
    heads = ("σ_t, τ", *(f"{time:g} s" for time in seconds))
    return Grid(
        "Figures 2, 3 and 6: P_MD of the CPI, navigation IMU",
        heads,
        tuple(lines),
        "Ours: exact. Paper: its formula with our σ_s (eqs 38 and 46 to 48).",
    )


def grades() -> Grid:
    """Figures 4 and 5: P_MD for the grades of the IMU."""
    cases = [(Replica(0.1), 10.0), (Replica(0.1), 30.0), (Replica(0.02), 60.0), (Replica(0.02), 180.0)]
    lines = []
    for imu in GRADES:
        grade = windows(imu)
        cells = tuple(_cell(grade, replica, time, f"{imu}, ") for replica, time in cases)
        lines.append((imu.removeprefix("kujur-"), cells))
    heads = ("IMU", *(f"{replica.words}, {time:g} s" for replica, time in cases))
    return Grid("Figures 4 and 5: P_MD of the CPI by the grade of the IMU", heads, tuple(lines), "As above.")


def _cell(monitor: Windows, replica: Replica, seconds: float, prefix: str = "") -> Row:
    n = round(seconds / INTERVAL)
    item = f"{prefix}{replica.words}, {seconds:g} s: P_MD, exact; the formula's"
    return compared(item, monitor.formula(replica, n), monitor.exact(replica, n))


def statements(exact: Windows, quick: bool) -> Listing:
    """What the text says about figures 2 to 8."""
    rows = (
        *_falling(exact),
        *_grade_statements(exact),
        *_colour(exact),
        _whole_day(range(0, 24, 8) if quick else HOURS),
    )
    return Listing("What the text says about figures 2 to 8: ours is exact", rows)


def _falling(exact: Windows) -> tuple[Row, ...]:
    """Figures 2 and 3: more run time and a greater error help."""
    run_times = np.array([exact.exact(Replica(0.02), n) for n in range(20, LONGEST + 1, 20)])
    sizes = np.array([exact.exact(Replica(sigma), 60) for sigma in (0.02, 0.05, 0.1)])
    decimetre = exact.exact(Replica(0.1), MINUTE)
    return (
        _statement(
            "2 cm, white: P_MD after 180 s",
            "falls with run time",
            run_times[-1],
            bool((np.diff(run_times) < 0.0).all()),
            f"From {run_times[0]:.2g} after 10 s on.",
        ),
        _statement(
            "30 s, white: P_MD of 10 cm",
            "falls with σ_t",
            sizes[-1],
            bool((np.diff(sizes) < 0.0).all()),
            f"Of 2 cm it is {sizes[0]:.2g}, of 5 cm {sizes[1]:.2g}.",
        ),
        _statement(
            "10 cm, white: P_MD after 60 s (section 6)",
            "low in < 1 min",
            decimetre,
            decimetre <= P_MD_CPI,
            f"1e-7 is reached after {_seconds(exact.shortest(Replica(0.1), exact.exact))} s.",
        ),
    )


def _grade_statements(exact: Windows) -> tuple[Row, ...]:
    """Figures 4 and 5: what the IMU does."""
    automotive, lousy = windows("kujur-automotive"), windows("kujur-lousy")
    needed = {NAVIGATION: exact, "kujur-automotive": automotive}
    shortest = {imu: grade.shortest(Replica(0.1), grade.exact) for imu, grade in needed.items()}
    best, worst = shortest[NAVIGATION], shortest["kujur-automotive"]
    longer = np.inf if best is None or worst is None else 100.0 * (worst / best - 1.0)
    low = {name: grade.exact(Replica(0.02), LONGEST) for name, grade in (("n", exact), ("a", automotive), ("l", lousy))}
    return (
        _statement(
            "10 cm, white, automotive IMU: time to P_MD 1e-7 over that of the navigation IMU, % more",
            "negligible",
            longer,
            longer < 10.0,
            "The errors of satellites and clock decide σ_s, not the IMU.",
        ),
        _statement(
            "2 cm, white, lousy IMU: P_MD after 180 s over that of the automotive IMU",
            "worse",
            low["l"] / low["a"],
            low["l"] > 2.0 * low["a"] and low["a"] < 1.1 * low["n"],
            f"{low['l']:.2g} against {low['a']:.2g}, and {low['n']:.2g} with the navigation IMU.",
        ),
    )


def _colour(exact: Windows) -> tuple[Row, ...]:
    """Figure 6: correlated tracking error."""
    minute = [exact.exact(Replica(0.1, time), MINUTE) for time in TIMES]
    coloured, formula = Replica(0.1, 40.0), exact.formula(Replica(0.1, 40.0), MINUTE)
    longest = exact.exact(coloured, LONGEST)
    return (
        _statement(
            "10 cm, 60 s: P_MD for τ = 40 s",
            "greater for larger τ",
            minute[-1],
            bool((np.diff(minute) > 0.0).all()),
            f"White {minute[0]:.2g}, τ = 10 s {minute[1]:.2g}.",
        ),
        _statement(
            "10 cm, τ = 40 s: P_MD after 60 s (section 4)",
            "negligible in < 1 min",
            minute[-1],
            minute[-1] <= P_MD_CPI,
            f"Nor after 180 s: {longest:.2g}. The filter takes the error over within an epoch, and what the next "
            f"innovation sees is its change. The formula, which leaves that out, has {formula:.2g} here.",
        ),
    )


def _whole_day(hours: Sequence[int]) -> Row:
    """Figure 8: white tracking error of 10 cm at every hour of the day."""
    replica = Replica(0.1)
    by_hour = [windows(NAVIGATION, float(hour), 60) for hour in hours]
    missed = np.array([hour.exact(replica, HOUR_WINDOW) for hour in by_hour])
    formula = np.array([hour.formula(replica, HOUR_WINDOW) for hour in by_hour])
    sigma = np.array([1.0 / np.sqrt(hour.information[0]) for hour in by_hour])
    return statement_row(
        "10 cm, white: P_MD after 30 s, over the hours of the day",
        "effective all day",
        missed <= P_MD_CPI,
        missed,
        f"1/σ_s goes from {100.0 * sigma.min():.1f} to {100.0 * sigma.max():.1f} cm; by the formula the worst hour has "
        f"{formula.max():.2g}.",
    )


def _statement(item: str, statement: str, value: float, holds: bool, reason: str) -> Row:
    return statement_row(item, statement, np.array([holds]), np.array([value]), reason)


def _seconds(epochs: int | None) -> Value:
    return NEVER if epochs is None else INTERVAL * epochs


def shortest_windows(exact: Windows, quick: bool) -> tuple[Grid, Grid, Listing]:
    """Figures 10 and 11: N_min of the CPI, and the greatest protection level of windows as long."""
    sigmas = QUICK_SIGMAS if quick else SIGMAS
    coasted = coasting(flight())
    epochs = {
        Replica(sigma, time): (
            exact.shortest(Replica(sigma, time), exact.formula),
            exact.shortest(Replica(sigma, time), exact.exact),
        )
        for time in TIMES
        for sigma in sigmas
    }
    levels = {replica: tuple(None if n is None else coasted.level(n) for n in pair) for replica, pair in epochs.items()}
    heads = ("τ", *(f"{100.0 * sigma:g} cm" for sigma in sigmas))
    windows_grid, levels_grid = [], []
    for time in TIMES:
        label = f"{time:g} s" if time else "white"
        replicas = [Replica(sigma, time) for sigma in sigmas]
        windows_grid.append((label, tuple(_window_cell(replica, epochs[replica]) for replica in replicas)))
        levels_grid.append((label, tuple(_level_cell(replica, levels[replica]) for replica in replicas)))
    return (
        Grid(
            "Figure 10: shortest window for P_MD 1e-7, s",
            heads,
            tuple(windows_grid),
            "Ours: exact. Paper: its formula with our σ_s. never: not within 180 s, the longest run time of the paper.",
        ),
        Grid(
            "Figure 11: protection level of windows as long, up, m",
            heads,
            tuple(levels_grid),
            f"P_FA 1e-5 divided by the open windows, P_MD 1e-6. never: there is no such window. The coasting's σ is "
            f"{coasted.sigma[0]:.2f} m after an epoch and {coasted.sigma[LONGEST - 1]:.2f} m after 180 s.",
        ),
        _about_windows(sigmas, epochs, levels),
    )


def _window_cell(replica: Replica, epochs: tuple[int | None, int | None]) -> Row:
    formula, exact = (_seconds(n) for n in epochs)
    return _either(f"{replica.words}: N_min for P_MD 1e-7, s; the formula's", formula, exact, 0.5 * INTERVAL)


def _level_cell(replica: Replica, levels: tuple[float | None, ...]) -> Row:
    formula, exact = (NEVER if level is None else level for level in levels)
    return _either(f"{replica.words}: protection level, m; with the formula's N_min", formula, exact, 0.05)


def _either(item: str, formula: Value, exact: Value, half: float) -> Row:
    """A number or "never" of the formula beside the exact one."""
    if isinstance(formula, str) or isinstance(exact, str):
        return Row(item, formula, exact, None, _same(formula, exact), FEEDBACK, "own formula")
    published = Published(formula, formula - half, formula + half)
    return Row(item, formula, exact, None, number_verdict(published, exact, exact, exact), FEEDBACK, "own formula")


def _same(formula: Value, exact: Value) -> Verdict:
    return "reproduced" if formula == exact else "not reproduced"


def _about_windows(
    sigmas: Sequence[float],
    epochs: dict[Replica, tuple[int | None, int | None]],
    levels: dict[Replica, tuple[float | None, ...]],
) -> Listing:
    """What the text says about both figures."""
    needed = np.array([[epochs[Replica(sigma, time)][1] or np.inf for sigma in sigmas] for time in TIMES])
    ordered = bool((needed[1:] >= needed[:-1]).all() and (needed[:, 1:] <= needed[:, :-1]).all())
    rows = [
        _statement(
            "50 cm, τ = 40 s: N_min, s",
            "longer for colour",
            INTERVAL * needed[-1, sigmas.index(0.5)],
            ordered,
            "Ordered by τ and by σ_t at all values of the grid.",
        )
    ]
    for sigma in sorted({0.1, 0.5}):
        by_time = [levels[Replica(sigma, time)][1] for time in TIMES]
        rows.append(_convergence(sigma, by_time))
    return Listing("What the text says about figures 10 and 11: ours is exact", tuple(rows))


def _convergence(sigma: float, by_time: Sequence[float | None]) -> Row:
    white, coloured = by_time[0], by_time[-1]
    item = f"{100.0 * sigma:g} cm: protection level for τ = 40 s over that for white error"
    paper = "converges at decimetres"
    if white is None or coloured is None:
        reason = "There is no window for τ = 40 s within 180 s, and so no protection level of both monitors."
        return Row(item, paper, NEVER, None, "not reproduced", reason, "words")
    words = f"{white:.1f} and {coloured:.1f} m; we ask for 10 %."
    return _statement(item, paper, coloured / white, abs(coloured / white - 1.0) < 0.1, words)
