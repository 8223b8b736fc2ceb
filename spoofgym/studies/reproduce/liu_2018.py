"""Liu et al. (2018), "Impact assessment of GNSS spoofing attacks on INS/GNSS integrated navigation system".

Rows for table 2, figures 4 to 6 and the statements of section 4 that they illustrate. All games are flown on one
scenario, from 740 to 1100 s, with a synchronised ramp in longitude from 800 s on; game i of every ramp meets the same
noise, so that differences between ramps are paired. The noise of the fixes is white first, then made from ranges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.profiles import Ramp
from spoofgym.detectors.chi_square import quantile
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.optimum.play import expected_play
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import DEGREE_PER_HOUR
from spoofgym.simulation import Simulation
from spoofgym.studies.reproduce import liu_ranges, liu_table_2
from spoofgym.studies.reproduce.rows import (
    Group,
    Listing,
    Row,
    again,
    number_row,
    on,
    statement_row,
    wilson_interval,
)
from spoofgym.studies.reproduce.tracks import Tracks, play
from spoofgym.studies.reproduce.verdict import Published, rounded

PAPER = "liu-2018"
TITLE = "Liu et al. 2018, impact assessment of GNSS spoofing"
SCENARIO = "liu-flight:onset=740,horizon=360"
RANGES_SCENARIO = SCENARIO + ",noise=ranges"
ONSET, DETECTION, END = 800.0, 825.0, 1100.0
RATES = (0.0, 0.3, 0.5, 1.0, 12.4)
DEPTH = 50
P_FA = 1e-3
EAST = 0
FORWARD = 1
RATES_ON_RANGES = (12.4,)
"""Whose bound a row on ranges shows, too."""
NORMAL_OUTSIDE_3_SIGMA = 100.0 * math.erfc(3.0 / math.sqrt(2.0))  # %
GYRO_SPECIFICATION = 0.01  # deg/h, table 1

READINGS = (
    "The rate of the GNSS fixes is not printed: 1 Hz, which gives the square roots of P that table 2 implies.",
    "The flight is not printed but for its end state (appendix C): speed, height, turns and manoeuvres are ours.",
    "GNSS noise is white with the filter's own R (3.7, 3.7, 6 m), except in the rows that name ranges: there a fix is "
    "made from the ranges to the 24-slot constellation with the errors of table 1. Those of satellite, ionosphere and "
    "troposphere are constants of each satellite, tracking noise and multipath are white; the paper gives no times.",
    "A value that the paper calls 'about' may be half a unit of its last non-zero digit off.",
    "The test of the innovations is the snapshot chi-square test with 1e-3 false alarms per epoch over 300 epochs.",
    "Backtracking: at 825 s the fixes of the last 50 epochs are taken back, and no fix is used from there on.",
    "P, bounds, innovations and biases come from the strapdown fidelity, backtracking from the linear one.",
)


@dataclass(frozen=True)
class Flights:
    """What is simulated, once, for all rows.

    Attributes:
        scenario: of all games.
        tracks: of each ramp by its rate in m/s, every fix used, strapdown.
        deviation: sqrt of the diagonal of P at the end of each, (N, 15).
    """

    scenario: Scenario
    tracks: dict[float, Tracks]
    deviation: dict[float, Floats]


def groups(runs: int, seed: int, quick: bool) -> Iterator[Group]:
    """All rows, a group after the other.

    Args:
        runs: games of each ramp.
        seed: of game 0.
        quick: of no effect on the rows of this paper.
    """
    flights = fly_ramps(runs, seed)
    yield from liu_table_2.grids(flights.deviation[12.4], flights.deviation[0.0])
    yield bounds(flights)
    yield innovations(flights)
    yield detection(flights)
    yield biases(flights)
    yield backtracking(runs, seed)
    yield from_ranges(runs, seed)


def fly_ramps(runs: int, seed: int) -> Flights:
    """Fly every ramp of `RATES` in the strapdown fidelity, every fix used."""
    scenario = make_scenario(SCENARIO)
    tracks, deviation = {}, {}
    for rate in RATES:
        simulation = _ramp(scenario, rate, runs, seed)
        tracks[rate] = play(simulation)
        assert isinstance(simulation.navigator, StrapdownNavigator)
        deviation[rate] = np.sqrt(np.diagonal(simulation.navigator.covariance, axis1=1, axis2=2))
    return Flights(scenario, tracks, deviation)


def _ramp(scenario: Scenario, rate: float, runs: int, seed: int) -> Simulation:
    return Simulation(scenario, Ramp(rate, onset=ONSET), (), None, runs, seed, fidelity="strapdown")


def from_ranges(runs: int, seed: int) -> Listing:
    """The second noise model: fixes made from ranges."""
    scenario = make_scenario(RANGES_SCENARIO)
    tracks = {rate: play(_ramp(scenario, rate, runs, seed)) for rate in liu_ranges.RATES}
    without, taken_back = (coasting_error(runs, seed, 1.0, depth, RANGES_SCENARIO) for depth in (0, DEPTH))
    return liu_ranges.listing(tracks, ONSET, quantile(P_FA, 3), without, taken_back)


def bounds(flights: Flights) -> Listing:
    """Figure 4: errors in longitude and the bounds that the filter computes for them."""
    clean, onset = flights.tracks[0.0], flights.tracks[0.0].at(ONSET)
    outside = 100.0 * np.mean(
        np.abs(clean.error[:, onset:, EAST]) > 3.0 * clean.position_sigma[:, onset:, EAST], axis=1
    )
    low, high = mean_interval(outside)
    rows = [
        again(
            Row(
                "not spoofed: epochs outside the 3 σ bound, % (mean of the runs, 95 % interval)",
                "inside",
                float(np.mean(outside)),
                (max(low, 0.0), high),
                "reproduced" if low <= NORMAL_OUTSIDE_3_SIGMA else "not reproduced",
                f"A normal error leaves it in {NORMAL_OUTSIDE_3_SIGMA:.2f} % of the epochs.",
                "words",
            )
        )
    ]
    for rate, final, note in (
        (0.3, rounded(90.0, 10.0), ""),
        (12.4, rounded(2 * 1852.0, 1852.0), " (2 nautical miles)"),
    ):
        track = flights.tracks[rate]
        beyond = np.abs(track.error[:, onset:, EAST]) > 3.0 * track.position_sigma[:, onset:, EAST]
        left = track.time[onset:][_last_inside(beyond)] - ONSET
        change = 100.0 * np.abs(track.position_sigma[:, -1] / clean.position_sigma[:, -1] - 1.0).max(axis=1)
        unchanged = statement_row(
            f"{rate:g} m/s: the 3 σ bound changes at 1100 s by, %",
            "unchanged",
            change < 0.5,
            change,
            "Gains and P depend on the trajectory alone, and the spoofed one is not far from the true one.",
        )
        rows += [
            again(unchanged) if rate in RATES_ON_RANGES else unchanged,
            statement_row(
                f"{rate:g} m/s: error outside 3 σ for good after, s",
                "grows out",
                beyond[:, -1],
                left,
                "The filter's bound stays at 2 m while its error follows the spoofer.",
            ),
            on(
                "by construction",
                number_row(
                    f"{rate:g} m/s: error in longitude at 1100 s, m{note}",
                    final,
                    track.error[:, -1, EAST],
                    reasons={"reproduced": "The filter follows the ramp, and is 2 % ahead of it at the end."},
                ),
            ),
        ]
    return Listing("Figure 4: bounds from P, and errors", tuple(rows))


def _last_inside(beyond: Flags) -> Runs:
    """The epoch from which on a run is outside for good, (N,); the last epoch where it ends inside."""
    inside = ~beyond
    after = beyond.shape[1] - inside[:, ::-1].argmax(axis=1)
    return np.where(inside.any(axis=1), np.minimum(after, beyond.shape[1] - 1), 0)


def innovations(flights: Flights) -> Listing:
    """Equation 34 and figure 5: the mean of the innovations."""
    rows = [_equation_34(flights, rate) for rate in RATES[1:]]
    onset = flights.tracks[0.0].at(ONSET)
    shift = flights.tracks[0.5].residual[:, onset:] - flights.tracks[0.0].residual[:, onset:]
    noise = np.sqrt(np.diagonal(flights.scenario.linear_model().innovation_covariance, axis1=1, axis2=2))[onset:]
    in_sigma = np.abs(shift) / noise
    others = in_sigma[:, :, 1:].max(axis=(1, 2))
    rows.append(
        statement_row(
            "0.5 m/s: largest mean in north or up, in σ of the innovation",
            "longitude only",
            (others < 0.5) & (in_sigma[:, :, EAST].max(axis=1) > 2.0),
            others,
            "It couples into the other axes, but stays below half a σ there, where longitude exceeds 2 σ.",
        )
    )
    rows += _window(shift[:, :, EAST])
    return Listing("Equation 34 and figure 5: mean of the innovations", tuple(rows))


def _equation_34(flights: Flights, rate: float) -> Row:
    """Paired change of the innovations of the nonlinear filter against their expectation, in % of its peak."""
    onset, model = flights.tracks[0.0].at(ONSET), flights.scenario.linear_model()
    offsets = np.zeros((model.num_epochs, 3))
    offsets[:, EAST] = rate * np.maximum(model.time[1:] - ONSET, 0.0)
    whitened = expected_play(model, offsets, quantile(P_FA, 3)).whitened
    expected = np.einsum("kij,kj->ki", model.innovation_factor[1:], whitened)
    shift = flights.tracks[rate].residual[:, 1:] - flights.tracks[0.0].residual[:, 1:]
    difference = 100.0 * np.abs(shift - expected).max(axis=(1, 2)) / np.abs(expected[onset:]).max()
    return statement_row(
        f"{rate:g} m/s: eq 34 against the nonlinear filter, largest difference in % of the peak",
        "equal",
        difference < 1.0,
        difference,
        "Paired runs of the strapdown filter; we ask for 1 % of the largest innovation at every epoch.",
    )


def _window(shift: Floats) -> list[Row]:
    """Rows on how long the mean of the longitude innovation stays large; shift (N, epochs after the onset), m."""
    size = np.abs(shift)
    peak, last = size.max(axis=1), size[:, -1]
    at_peak = size.argmax(axis=1).astype(float)
    late = np.arange(size.shape[1]) > at_peak[:, None]
    half = np.argmax(late & (size < 0.5 * peak[:, None]), axis=1).astype(float)
    swing = np.where(late, -np.sign(shift[:, 10:11]) * shift, 0.0)
    opposite, zero = swing.max(axis=1), (swing > 0.0).argmax(axis=1)
    return [
        statement_row(
            "0.5 m/s: mean of the longitude innovation falls below half of its peak after, s",
            "limited window",
            half > 0,
            half,
            f"It peaks at {np.median(peak):.1f} m, {np.median(at_peak):.0f} s after the onset.",
        ),
        statement_row(
            "0.5 m/s: mean of the longitude innovation 300 s after the onset, % of the peak",
            "approaches zero",
            (last < 0.1 * peak) & (opposite < 0.1 * peak),
            100.0 * last / peak,
            f"A damped oscillation: it passes zero {np.median(zero):.0f} s after the onset and swings to "
            f"{np.median(100 * opposite / peak):.0f} % of the peak with the opposite sign. It has at most "
            f"{100 * np.max(last / peak):.0f} % of the peak left.",
        ),
    ]


def detection(flights: Flights) -> Listing:
    """Figure 5b: larger ramps are easier to detect."""
    threshold, onset = quantile(P_FA, 3), flights.tracks[0.0].at(ONSET)
    alarms = {
        rate: np.asarray((track.nis[:, onset + 1 :] > threshold).any(axis=1)) for rate, track in flights.tracks.items()
    }
    expected = 1.0 - (1.0 - P_FA) ** round(END - ONSET)
    rows = []
    for rate, smaller in ((0.3, 0.0), (0.5, 0.3), (1.0, 0.5)):
        share = float(alarms[rate].mean())
        more = share > alarms[smaller].mean() or share == 1.0
        rows.append(
            Row(
                f"{rate:g} m/s: share of runs that the snapshot test detects",
                "more at larger rates",
                share,
                wilson_interval(int(alarms[rate].sum()), len(alarms[rate])),
                "reproduced" if more else "not reproduced",
                f"At {smaller:g} m/s it is {alarms[smaller].mean():.2f}; false alarms alone make {expected:.2f}.",
                "words",
                repeats=True,
            )
        )
    return Listing("Figure 5b: detection by the innovations", tuple(rows))


def biases(flights: Flights) -> Listing:
    """Figure 6a: the estimated bias of the y gyro, and what a monitor of it would do."""
    onset = flights.tracks[0.0].at(ONSET)
    size = np.abs(flights.tracks[1.0].bias[:, onset:, FORWARD]) / DEGREE_PER_HOUR
    clean = np.abs(flights.tracks[0.0].bias[:, onset:, FORWARD]) / DEGREE_PER_HOUR
    limit = 5.0 * GYRO_SPECIFICATION
    peak = size.max(axis=1)
    delay = np.where((size > limit).any(axis=1), (size > limit).argmax(axis=1), size.shape[1]).astype(float)
    at_detection = np.median(size[:, round(DETECTION - ONSET)])
    return Listing(
        "Figure 6a: estimated gyro bias under 1 m/s",
        (
            number_row(
                "largest estimated bias of the y gyro, °/h",
                Published("> 0.3", 0.3, math.inf),
                peak,
                reasons={
                    "partly": "More than five times the data sheet in every run, but the manoeuvres before the attack "
                    "decide how much."
                },
            ),
            statement_row(
                "five times the data-sheet value is exceeded after, s",
                "obvious sign",
                (peak > limit) & (clean.max(axis=1) <= limit),
                delay,
                f"A sign, but a late one: 25 s after the onset the estimate is {at_detection:.3f} °/h; no alarm in the "
                "clean run is asked for, too.",
            ),
        ),
    )


def backtracking(runs: int, seed: int) -> Listing:
    """Figure 6b: from 825 s on the INS alone, its fixes of the last 50 s taken back or not."""
    without, taken_back = (coasting_error(runs, seed, 1.0, depth) for depth in (0, DEPTH))
    unspoofed = coasting_error(runs, seed, 0.0, DEPTH)
    rows = (
        number_row(
            "no backtracking: horizontal error at 1100 s, m",
            rounded(150.0, 10.0),
            without,
            reasons={"partly": "Within a factor of two; the trajectory and the GNSS rate decide the spoofer's part."},
        ),
        number_row(
            "50 s of backtracking: horizontal error at 1100 s, m",
            rounded(90.0, 10.0),
            taken_back,
            reasons={"not reproduced": "Nothing spoofed is left in it: this is the drift of a clean INS after 325 s."},
        ),
        again(
            statement_row(
                "gain by backtracking: error without it minus error with it, m",
                "better with",
                without > taken_back,
                without - taken_back,
                f"Of paired runs; backtracking removes the attack exactly (difference to an unspoofed run "
                f"{np.abs(taken_back - unspoofed).max():.1g} m).",
            )
        ),
    )
    return Listing("Figure 6b: pure INS after detection at 825 s, ramp of 1 m/s", rows)


def coasting_error(runs: int, seed: int, rate: float, depth: int, scenario: str = SCENARIO) -> Floats:
    """Horizontal error at the end if no fix is used from the detection on, (N,), m."""
    simulation = Simulation(
        make_scenario(scenario),
        Ramp(rate, onset=ONSET),
        (),
        None,
        runs,
        seed,
        demands=Demands(excludes=True, history=60),
    )

    def decide(time: float, count: int) -> Decision:
        use = np.full(count, time < DETECTION)
        return Decision(use, np.full(count, depth if time == DETECTION else 0))

    return play(simulation, decide).horizontal_error[:, -1]
