"""Shadmehri and Mahboobi Esfanjani (2025), spoofing detection by a self-tuning Kalman filter.

Rows for table 1, the false alarms that the paper does not give, the comparison at a matched false-alarm rate, and the
statements about the recursion. A ramp in north and in east each runs from 20 s to 25 s of a straight and level flight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.profiles import Ramp
from spoofgym.detectors.chi_square import SHADMEHRI_THRESHOLD
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.navigation.loose.adaptation import NegativeRatioError
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies.reproduce.rows import (
    Group,
    Listing,
    Row,
    again,
    event_row,
    on,
    wilson_interval,
)
from spoofgym.studies.reproduce.verdict import NEVER, Published, probability_verdict, rounded

PAPER = "shadmehri-2025"
TITLE = "Shadmehri and Mahboobi Esfanjani 2025, spoofing detection by a self-tuning Kalman filter"
ONSET, END, WARM = 20.0, 25.0, 10.0
WINDOW = 5.0
"""Length of the window of the self-tuning filter, s."""
SUMMED = (3, 4)
LONG_WINDOW = 15.0
"""Of the self-tuning filter where statistics are summed, s."""
NOMINAL = 1e-5
DECIDES = ("white", 10)
"""Noise and rate, Hz, of the set-up whose rows count."""
MATCHED = 0.01
"""Share of clean stretches as long as the attack in which there is an alarm."""
CLEAN_RUNS = 10
"""Clean runs for each spoofed one."""
DIAGONAL = 45.0
COMMON, SELF_TUNING = "common filter", "self-tuning filter"
TABLE_1: dict[str, dict[float, Published]] = {
    COMMON: {2.0: Published(NEVER), 3.0: rounded(3.41, 0.01), 5.0: rounded(1.91, 0.01)},
    SELF_TUNING: {2.0: rounded(0.35, 0.01), 3.0: rounded(0.22, 0.01), 5.0: rounded(0.11, 0.01)},
}

READINGS = (
    "The noise of the GNSS is not printed: white with the filter's own R (3.7, 3.7, 6 m), and beside it first-order "
    "Gauss-Markov of 1.6, 1.6, 3 m that keeps 0.999 from one 10 Hz fix to the next.",
    "Updates at 10 Hz, the rate of the receiver, and at 160 Hz, the rate of the IMU.",
    f"The window w and N are not printed: w holds {WINDOW:g} s of fixes, 50 at 10 Hz and 800 at 160 Hz; N = 1, the "
    "only one for which 25.9 is the quantile of chi-square with 3 degrees of freedom at 1e-5.",
    "The test uses S with the R of the epoch before; Q is kept where alpha is not positive, where the published "
    "recursion ends in a number that is none.",
    "Latency is the median of all runs, never where fewer than half of them detect between 20 and 25 s; a ramp of r "
    "m/s runs in north and in east each.",
    "Runs are of the linear fidelity; false alarms are counted in ten times as many clean runs, from 10 s on.",
    "At a matched rate each filter has the threshold at which 1 % of its own clean stretches of 5 s, the length of the "
    "attack, have an alarm: a rate in time, the same for 10 and 160 Hz.",
)


@dataclass(frozen=True)
class Setup:
    """A filter, the noise that it meets, and its rate.

    Attributes:
        filter: `COMMON` or `SELF_TUNING`.
        noise: "white" or "markov".
        rate: of updates and tests, Hz.
        span: length of the window of the self-tuning filter, s.
    """

    filter: str
    noise: str
    rate: int
    span: float = WINDOW

    @property
    def scenario(self) -> str:
        """Its specification."""
        text = f"shadmehri-flight:rate={self.rate},noise={self.noise}"
        return text if self.filter == COMMON else f"{text},filter=self-tuning,window={self.window},guard=hold"

    @property
    def window(self) -> int:
        """w, fixes."""
        return round(self.span * self.rate)

    @property
    def words(self) -> str:
        """What a row calls it."""
        return f"{self.filter}, {'white' if self.noise == 'white' else 'correlated'} noise, {self.rate} Hz"


SETUPS = tuple(
    Setup(kind, noise, rate) for noise in ("white", "markov") for rate in (10, 160) for kind in (COMMON, SELF_TUNING)
)


@dataclass(frozen=True)
class Flights:
    """The statistic of one set-up, along clean and spoofed runs.

    Attributes:
        clean: nis without an attack, from `WARM` on, (n, epochs).
        spoofed: by the ramp's rate, nis from the first spoofed epoch to `END`, (runs, epochs).
        since: times of these epochs since the onset, (epochs,), s.
    """

    clean: Floats
    spoofed: dict[float, Floats]
    since: Floats

    def latency(self, rate: float, threshold: float) -> Floats:
        """Time from the onset to the first alarm of each run, (runs,), s; infinite where there is none."""
        above = self.spoofed[rate] > threshold
        return np.where(above.any(axis=1), self.since[above.argmax(axis=1)], math.inf)

    def matched_threshold(self) -> float:
        """The threshold that the statistic exceeds in a share of `MATCHED` of clean stretches as long as the attack."""
        length = len(self.since)
        stretches = self.clean[:, self.clean.shape[1] % length :].reshape(-1, length)
        return float(np.quantile(stretches.max(axis=1), 1.0 - MATCHED))


def groups(runs: int, seed: int, quick: bool) -> Iterator[Group]:
    """All rows, a group after the other.

    Args:
        runs: of each game.
        seed: of run 0.
        quick: of no effect on the rows of this paper.
    """
    flights = {setup: fly(setup, runs, seed) for setup in SETUPS}
    yield from (table_1(flights, noise, rate) for noise in ("white", "markov") for rate in (160, 10))
    yield sums(runs, seed)
    yield false_alarms(flights)
    yield from (matched(flights, noise) for noise in ("white", "markov"))
    yield recursion(runs, seed)


def fly(setup: Setup, runs: int, seed: int) -> Flights:
    """Fly one set-up clean, and with each ramp of table 1."""
    times, clean = statistic(setup, 0.0, CLEAN_RUNS * runs, seed + runs)
    window = (times > ONSET + 1e-6) & (times <= END + 1e-6)
    spoofed = {rate: statistic(setup, rate, runs, seed)[1][:, window] for rate in TABLE_1[COMMON]}
    return Flights(clean[:, times >= WARM - 1e-6], spoofed, times[window] - ONSET)


def statistic(setup: Setup, rate: float, runs: int, seed: int) -> tuple[Floats, Floats]:
    """Times of the epochs, (K+1,), s, and their normalised innovation squared, (runs, K+1), under a ramp."""
    scenario = make_scenario(setup.scenario)
    attack = Ramp(math.sqrt(2.0) * rate, DIAGONAL, ONSET)
    simulation = Simulation(scenario, attack, (), None, runs, seed)
    times = scenario.timeline.times
    kept = np.empty((runs, len(times)))
    for k in range(len(times)):
        epoch = simulation.observe() if k else simulation.reset()
        kept[:, k] = epoch.innovation.nis
        simulation.resolve()
    return times, kept


def table_1(flights: dict[Setup, Flights], noise: str, rate: int) -> Listing:
    """Table 1 with one noise and one rate, at the published threshold."""
    rows = []
    for kind, published in TABLE_1.items():
        setup = Setup(kind, noise, rate)
        for ramp, value in published.items():
            latency = flights[setup].latency(ramp, SHADMEHRI_THRESHOLD)
            rows.append(event_row(f"{kind}, {ramp:g} m/s: detected after, s", value, latency))
    words = "white noise" if noise == "white" else "correlated noise"
    decides = (noise, rate) == DECIDES
    return Listing(
        f"Table 1, threshold 25.9: {words}, updates at {rate} Hz",
        tuple(rows if decides else map(again, rows)),
        "The set-up that counts: the noise that the filter believes, at the rate of the receiver." if decides else "",
    )


def sums(runs: int, seed: int) -> Listing:
    """Table 1 with a sum of M statistics against the published threshold: another reading of 3 (N + 1)."""
    rows = []
    for setup in (Setup(COMMON, "markov", 10), Setup(SELF_TUNING, "markov", 10, LONG_WINDOW)):
        times, clean = statistic(setup, 0.0, CLEAN_RUNS * runs, seed + runs)
        window = (times > ONSET + 1e-6) & (times <= END + 1e-6)
        before = (times > ONSET - (END - ONSET) + 1e-6) & (times <= ONSET + 1e-6)
        spoofed = {ramp: statistic(setup, ramp, runs, seed)[1] for ramp in TABLE_1[setup.filter]}
        for terms in SUMMED:
            name = f"sum of {terms}, {setup.filter}"
            for ramp, value in TABLE_1[setup.filter].items():
                latency = _latency(spoofed[ramp], terms, times, window)
                rows.append(event_row(f"{name}, {ramp:g} m/s: detected after, s", value, latency))
            alarmed = int((moving_sum(clean, terms)[:, before] > SHADMEHRI_THRESHOLD).any(axis=1).sum())
            title = f"{name}: share of clean runs that alarm within 5 s"
            rows.append(_cost(title, alarmed, CLEAN_RUNS * runs, int(before.sum())))
        mean = _latency(spoofed[5.0] / SUMMED[-1], SUMMED[-1], times, window)
        printed = event_row(
            f"mean of {SUMMED[-1]} as eq 14 prints it, {setup.filter}, 5 m/s: detected after, s",
            TABLE_1[setup.filter][5.0],
            mean,
        )
        rows.append(on("rejected reading", printed))
    return Listing(
        "Table 1, threshold 25.9, sum of M statistics: correlated noise, updates at 10 Hz",
        tuple(on("calibrated", row) if row.basis == "printed" else row for row in rows),
        f"M and a window of {LONG_WINDOW:g} s are chosen with the table in sight; 25.9 is then no quantile at 1e-5. "
        f"The detector is windowed:n={SUMMED[-1]},threshold={SHADMEHRI_THRESHOLD:g}.",
    )


def moving_sum(values: Floats, terms: int) -> Floats:
    """Sum of each value and the ``terms`` - 1 before it along the last axis, as many as there are at the beginning."""
    total = np.cumsum(values, axis=-1)
    before = np.concatenate([np.zeros_like(total[..., :terms]), total[..., :-terms]], axis=-1)
    return np.asarray(total - before)


def _latency(values: Floats, terms: int, times: Floats, window: Flags) -> Floats:
    """Time from the onset to the first alarm of a moving sum within a window, (runs,), s."""
    above = (moving_sum(values, terms) > SHADMEHRI_THRESHOLD)[:, window]
    return np.where(above.any(axis=1), (times[window] - ONSET)[above.argmax(axis=1)], math.inf)


def _cost(item: str, alarmed: int, runs: int, epochs: int) -> Row:
    """Runs with an alarm in some epochs beside the share that `NOMINAL` per independent epoch would give."""
    nominal = float(f"{1.0 - (1.0 - NOMINAL) ** epochs:.2g}")
    low, high = wilson_interval(alarmed, runs)
    share = alarmed / runs
    verdict = probability_verdict(nominal, low, share, high)
    reason = f"{NOMINAL:g} per epoch, were the {epochs} epochs independent, against {alarmed} of {runs} runs."
    return Row(item, nominal, share, (low, high), verdict, reason, "own formula")


def false_alarms(flights: dict[Setup, Flights]) -> Listing:
    """False alarms at the published threshold, which stands for 1e-5 per epoch."""
    rows = []
    for setup, flight in flights.items():
        alarms, epochs = int(np.count_nonzero(flight.clean > SHADMEHRI_THRESHOLD)), flight.clean.size
        share, (low, high) = alarms / epochs, exact_interval(alarms, epochs)
        runs = float(np.mean((flight.clean > SHADMEHRI_THRESHOLD).any(axis=1)))
        rows.append(
            Row(
                f"{setup.words}: false alarms per epoch",
                NOMINAL,
                share,
                (low, high),
                probability_verdict(NOMINAL, low, share, high),
                f"{alarms} in {epochs} epochs; {runs:.1%} of the clean runs alarm between 10 and 30 s. The interval "
                "takes epochs for independent.",
                "own formula",
            )
        )
    return Listing("False alarms at 25.9: nominal 1e-5 per epoch, measured nowhere in the paper", tuple(rows))


def matched(flights: dict[Setup, Flights], noise: str) -> Listing:
    """Both filters at the threshold at which 1 % of their own clean stretches of 5 s have an alarm."""
    rows = []
    for rate in (10, 160):
        common, tuned = (flights[Setup(kind, noise, rate)] for kind in (COMMON, SELF_TUNING))
        thresholds = [flight.matched_threshold() for flight in (common, tuned)]
        for ramp in TABLE_1[COMMON]:
            latencies = common.latency(ramp, thresholds[0]), tuned.latency(ramp, thresholds[1])
            row = _matched_row(rate, ramp, *latencies, thresholds)
            rows.append(row if (noise, rate) == DECIDES else again(row))
    words = "white noise" if noise == "white" else "correlated noise"
    return Listing(f"Matched, {MATCHED:.0%} of clean stretches of 5 s alarm: {words}", tuple(rows))


def _matched_row(rate: int, ramp: float, common: Floats, tuned: Floats, thresholds: list[float]) -> Row:
    shares = [float(np.mean(np.isfinite(latency))) for latency in (common, tuned)]
    medians = [float(np.sort(latency)[(len(latency) - 1) // 2]) for latency in (common, tuned)]
    more, sooner = shares[1] >= shares[0], medians[1] < medians[0]
    words = ["never" if math.isinf(median) else f"{median:.2f} s" for median in medians]
    return Row(
        f"{rate} Hz, {ramp:g} m/s: share that the self-tuning filter detects in 5 s",
        "more, sooner",
        shares[1],
        wilson_interval(round(shares[1] * len(tuned)), len(tuned)),
        "reproduced" if more and sooner else "partly" if more or sooner else "not reproduced",
        f"Median {words[1]} at a threshold of {thresholds[1]:.3g}; the common filter detects {shares[0]:.2f}, median "
        f"{words[0]} at {thresholds[0]:.3g}.",
        "words",
    )


def recursion(runs: int, seed: int) -> Listing:
    """Whether the published recursion, without any guard, lives through the flight."""
    rows = []
    for noise in ("white", "markov"):
        ended = np.array([_ends(noise, seed + run) for run in range(runs)])
        words = "white" if noise == "white" else "correlated"
        rows.append(
            Row(
                f"{words} noise: share of clean runs in which eq 11 takes the root of a negative number",
                "stable",
                float(ended.mean()),
                wilson_interval(int(ended.sum()), runs),
                "reproduced" if not ended.any() else "partly" if ended.mean() < 0.5 else "not reproduced",
                "Q sqrt(alpha) with alpha < 0; every other row keeps Q there.",
                "words",
                repeats=noise != DECIDES[0],
            )
        )
    return Listing("The recursion as published, equations 8 to 13, 10 Hz", tuple(rows))


def _ends(noise: str, seed: int) -> bool:
    window = Setup(SELF_TUNING, noise, 10).window
    scenario = f"shadmehri-flight:noise={noise},filter=self-tuning,window={window},guard=none"
    simulation = Simulation(make_scenario(scenario), None, (), None, 1, seed)
    try:
        simulation.reset()
        for _ in range(simulation.scenario.timeline.num_epochs):
            simulation.resolve()
            simulation.observe()
    except NegativeRatioError:
        return True
    return False
