"""What a protection level from the filter's own covariance is worth under spoofing, beside one from separation.

The covariance P depends on the trajectory and not on the signals (Liu 2018): a spoofer drags the position out of K σ
while σ stays what it was. A level by solution separation rests on a coasting that no signal of the last n epochs has
touched (Kujur 2024). ``spoofgym integrity`` plays the flight of the latter clean and with
replicas of the true signals that climb slowly, all satellites alike, and prints a table; ``--figure FILE`` draws
Stanford diagrams of both levels.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from spoofgym.arrays import Flags, Floats
from spoofgym.command_line import STDOUT, Parser, add_figure, add_json, add_seed, count
from spoofgym.detectors import make_detector
from spoofgym.detectors.kujur_monitor import KujurMonitor
from spoofgym.detectors.separation_bank import DEFAULT_P_MD, SeparationBank
from spoofgym.evaluation.integrity import Integrity, integrity
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.program import give_json, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.simulation import Simulation
from spoofgym.specification import spell
from spoofgym.studies.stanford import draw_side_by_side

EXAMPLES = (
    "spoofgym integrity --runs 50",
    "spoofgym integrity --figure stanford.png",
)

HORIZON = 2400
"""Epochs of half a second: 20 minutes."""
UP = 2
BATCH = 100
"""Runs that are played at once."""
SNAPSHOT, BANK, MONITOR = "snapshot:p_fa=1e-5", "separation-bank", "kujur-monitor"
FROM_P, FROM_P_TESTED = "K σ from P, no test", "K σ from P, snapshot test"
USERS = (FROM_P, FROM_P_TESTED, BANK, MONITOR)


@dataclass(frozen=True)
class Replica:
    """A spoofer that replays the true signals of a place above the vehicle.

    Attributes:
        rate: at which the place climbs from the vehicle's on, m/s.
        sigma: of the tracking error in the vertical, m.
        time: its correlation time, s; 0 = white.
    """

    rate: float
    sigma: float = 0.0
    time: float = 0.0

    @property
    def words(self) -> str:
        """What the table calls it."""
        if self == CLEAN:
            return "clean"
        colour = f"τ {self.time:g} s" if self.time else "white"
        return f"{self.rate:g} m/s" + (f", tracking error {100.0 * self.sigma:g} cm, {colour}" if self.sigma else "")


CLEAN, SLOW, SLOWER = Replica(0.0), Replica(0.2), Replica(0.04)
REPLICAS = (CLEAN, SLOW, SLOWER, Replica(0.04, 0.1), Replica(0.04, 0.1, 40.0))


@dataclass(frozen=True)
class Flight:
    """N runs of K epochs, every range used.

    Attributes:
        error: of the position, up, (N, K), m.
        level: the protection level of each user, (N, K), m.
        alarm: of each user, from its first one on, (N, K).
        alert_limit: vertical, m.
    """

    error: Floats
    level: dict[str, Floats]
    alarm: dict[str, Flags]
    alert_limit: float

    def result(self, user: str) -> Integrity:
        """What the level and the alarm of a user were worth."""
        return integrity(self.error, self.level[user], self.alert_limit, self.alarm[user])


def multiplier(p_md: float) -> float:
    """K of a level K σ that a normal error exceeds with probability ``p_md`` to one side."""
    return float(-special.ndtri(p_md))


def play(replica: Replica, runs: int, seed: int, horizon: int = HORIZON, p_md: float = DEFAULT_P_MD) -> Flight:
    """Play a replica; run i is seeded ``seed + i``, whatever the replica.

    Args:
        replica: what is replayed, from epoch 1 on.
        runs: N.
        seed: of run 0.
        horizon: K, epochs of half a second.
        p_md: of every level, to one side.
    """
    parts = [_play(replica, min(BATCH, runs - first), seed + first, horizon, p_md) for first in range(0, runs, BATCH)]
    return Flight(
        np.concatenate([part.error for part in parts]),
        {user: np.concatenate([part.level[user] for part in parts]) for user in USERS},
        {user: np.concatenate([part.alarm[user] for part in parts]) for user in USERS},
        parts[0].alert_limit,
    )


def _play(replica: Replica, runs: int, seed: int, horizon: int, p_md: float) -> Flight:
    scenario = make_scenario(f"kujur-flight:horizon={horizon}")
    assert scenario.alert_limits is not None
    bank, monitor = make_detector(spell(BANK, p_md=p_md)), make_detector(spell(MONITOR, p_md_ss=p_md))
    assert isinstance(bank, SeparationBank)
    assert isinstance(monitor, KujurMonitor)
    detectors = {FROM_P_TESTED: make_detector(SNAPSHOT), BANK: bank, MONITOR: monitor}
    simulation = Simulation(scenario, None, list(detectors.values()), None, runs, seed)
    simulation.reset()
    simulation.resolve()
    offset, error = offsets(replica, simulation, horizon), np.empty((runs, horizon))
    level = {user: np.empty((runs, horizon)) for user in USERS}
    alarm = {user: np.zeros((runs, horizon), dtype=bool) for user in USERS}
    for k in range(horizon):
        epoch = simulation.observe(offset[k])
        for user, detector in detectors.items():
            assert detector.threshold is not None
            alarm[user][:, k] = epoch.statistics[detector.name] > detector.threshold
        level[BANK][:, k], level[MONITOR][:, k] = bank.protection_level, monitor.protection_level
        level[FROM_P][:, k] = multiplier(p_md) * filtered_sigma(simulation)
        simulation.resolve()
        error[:, k] = simulation.error[:, UP]
    level[FROM_P_TESTED] = level[FROM_P]
    held = {user: np.logical_or.accumulate(flags, axis=1) for user, flags in alarm.items()}
    return Flight(error, level, held, scenario.alert_limits[1])


def offsets(replica: Replica, simulation: Simulation, horizon: int) -> Floats:
    """What the spoofer adds at the epochs 1 to K, (K, N, 3), m ENU."""
    intervals = simulation.scenario.timeline.intervals
    offset = np.zeros((horizon, simulation.num_runs, 3))
    for run in range(simulation.num_runs):
        stream = simulation.streams(run, "tracking")
        offset[:, run, UP] = draw_tracking_error(stream, (horizon,), replica.sigma, replica.time, intervals[1:])
    offset[:, :, UP] += replica.rate * np.cumsum(intervals)[:, None]
    return offset


def filtered_sigma(simulation: Simulation) -> Floats:
    """The filter's own σ of the height after the ranges of the present epoch, (N,), m."""
    navigator = simulation.navigator
    assert isinstance(navigator, TightNavigator)
    prior, gain = navigator.position_covariance[:, UP, UP], navigator.position_gain[:, :, UP]
    return np.sqrt(prior - (gain**2).sum(axis=1))


def row(replica: Replica, user: str, result: Integrity, level: Floats) -> str:
    """One line of the table."""
    misled, failed = (
        f"{part.share:.3g} [{part.interval[0]:.2g}, {part.interval[1]:.2g}]" for part in (result.misled, result.failed)
    )
    alarmed = result.alarmed / level.size
    return (
        f"| {replica.words} | {user} | {np.median(level):.1f} | {misled} | {failed} | {result.availability:.3g} "
        f"| {alarmed:.3g} |"
    )


def draw(flight: Flight, replica: Replica, path: Path) -> None:
    """The Stanford diagrams of the level from P and of that from separation, side by side.

    Raises:
        ImportError: matplotlib is missing.
    """
    titles = {FROM_P: "K σ from P, no test", BANK: "separation-bank, until its alarm"}
    diagrams = {title: flight.result(user).diagram for user, title in titles.items()}
    draw_side_by_side(diagrams, path, f"Replica of the true signals that climbs at {replica.words}: vertical error")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym integrity",
        description="Compare protection levels from P and from solution separation, clean and spoofed.",
        examples=EXAMPLES,
    )
    result.add_argument("--runs", type=count, default=200, help="of each replica (default: %(default)s)")
    add_seed(result, "run 0")
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    tell = partial(print, file=sys.stderr if options.json == STDOUT else sys.stdout, flush=True)
    tell(f"kujur-flight, {HORIZON} epochs, {options.runs} runs from seed {options.seed}, vertical\n")
    tell("| signals | level and alarm | level, m | misleading information | integrity failure | available | in alarm |")
    tell("|---|---|---|---|---|---|---|")
    rows = []
    for replica in REPLICAS:
        flight = play(replica, options.runs, options.seed, HORIZON)
        for user in USERS:
            result, level = flight.result(user), flight.level[user]
            tell(row(replica, user, result, level))
            named = {"signals": replica.words, "user": user, "level_m": float(np.median(level))}
            rows.append({**named, **result.content()})
        if replica == SLOW and options.figure is not None:
            draw(flight, replica, options.figure)
    give_json(report(rows, options.runs, options.seed), options.json)
    return 0


def report(rows: list[dict[str, Any]], runs: int, seed: int) -> dict[str, Any]:
    """An ``"integrity"`` report.

    Args:
        rows: of all signals and users.
        runs: of each replica.
        seed: of run 0.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "integrity",
        "scenario": "kujur-flight",
        "direction": "vertical",
        "epochs": HORIZON,
        "runs": runs,
        "seed": seed,
        "rows": rows,
    }


if __name__ == "__main__":
    sys.exit(moved("spoofgym integrity"))
