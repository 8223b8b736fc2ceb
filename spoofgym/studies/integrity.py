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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text
from scipy import special

from spoofgym.arrays import Flags, Floats
from spoofgym.command_line import STDOUT, Parser, add_figure, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.kujur_monitor import KujurMonitor
from spoofgym.detectors.separation_bank import DEFAULT_P_MD, SeparationBank
from spoofgym.evaluation.integrity import Integrity, integrity
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.program import last_of, moved, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.simulation import Simulation
from spoofgym.specification import spell
from spoofgym.studies.giving import Output, give
from spoofgym.studies.stanford import draw_side_by_side

EXAMPLES = (
    "spoofgym integrity --runs 50",
    "spoofgym integrity --figure stanford.png",
    "spoofgym integrity --scenario foi-drive --climb 0.5 --climb 2 --json -",
)

SCENARIO = "kujur-flight:horizon=2400"
"""20 minutes."""
RUNS = 200
UP = 2
BATCH = 100
"""Runs that are played at once."""
SNAPSHOT, BANK, MONITOR = "snapshot:p_fa=1e-5", "separation-bank", "kujur-monitor"
FROM_P, FROM_P_TESTED = "K σ from P, no test", "K σ from P, snapshot test"


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


def play(
    replica: Replica, runs: int, seed: int, scenario: Scenario, p_md: float = DEFAULT_P_MD, threads: int = 1
) -> Flight:
    """Play a replica; run i is seeded ``seed + i``, whatever the replica.

    Args:
        replica: what is replayed, from epoch 1 on.
        runs: N.
        seed: of run 0.
        scenario: whose K epochs are played, in its first fidelity.
        p_md: of every level, to one side.
        threads: of the simulation.
    """
    batches = [(min(BATCH, runs - first), seed + first) for first in range(0, runs, BATCH)]
    parts = [_play(replica, *batch, scenario, p_md, threads) for batch in batches]
    return Flight(
        np.concatenate([part.error for part in parts]),
        {user: np.concatenate([part.level[user] for part in parts]) for user in parts[0].level},
        {user: np.concatenate([part.alarm[user] for part in parts]) for user in parts[0].alarm},
        parts[0].alert_limit,
    )


def users_of(scenario: Scenario, p_md: float = DEFAULT_P_MD) -> dict[str, Detector | None]:
    """The users whose monitors a scenario offers what they need, each with its detector; None = it has no test."""
    monitors = {
        FROM_P_TESTED: make_detector(SNAPSHOT),
        BANK: make_detector(spell(BANK, p_md=p_md)),
        MONITOR: make_detector(spell(MONITOR, p_md_ss=p_md)),
    }
    fitting = {user: each for user, each in monitors.items() if set(each.needs) <= set(scenario.offers)}
    return {FROM_P: None, **fitting}


def _play(replica: Replica, runs: int, seed: int, scenario: Scenario, p_md: float, threads: int) -> Flight:
    users = users_of(scenario, p_md)
    detectors = {user: detector for user, detector in users.items() if detector is not None}
    fidelity = scenario.fidelities[0]
    simulation = Simulation(
        scenario, None, list(detectors.values()), None, runs, seed, fidelity=fidelity, threads=threads
    )
    simulation.reset()
    simulation.resolve()
    horizon = scenario.timeline.num_epochs
    offset, error = offsets(replica, simulation, horizon), np.empty((runs, horizon))
    level = {user: np.empty((runs, horizon)) for user in users}
    alarm = {user: np.zeros((runs, horizon), dtype=bool) for user in users}
    for k in range(horizon):
        epoch = simulation.observe(offset[k])
        for user, detector in detectors.items():
            assert detector.threshold is not None
            alarm[user][:, k] = epoch.statistics[detector.name] > detector.threshold
            if isinstance(detector, SeparationBank | KujurMonitor):
                level[user][:, k] = detector.protection_level
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
    """The filter's own σ of the height after the fix or the ranges of the present epoch, (N,), m.

    Of a fix with velocity the position alone is counted, which makes it a little larger.
    """
    navigator, innovation = simulation.navigator, simulation.epoch.innovation
    covariance = navigator.position_covariance
    prior = covariance[:, UP, UP]
    if isinstance(navigator, TightNavigator):
        return np.sqrt(prior - (navigator.position_gain[:, :, UP] ** 2).sum(axis=1))
    used = np.ones(len(prior)) if simulation.epoch.available is None else simulation.epoch.available.astype(float)
    of_height = covariance[:, :, UP]
    gained = np.linalg.solve(innovation.covariance[:, :3, :3], of_height[..., None])[..., 0]
    return np.sqrt(prior - used * (of_height * gained).sum(axis=1))


def table_of(report: dict[str, Any]) -> Table:
    """An ``"integrity"`` report for the terminal."""
    games = f"{report['epochs']} epochs, {report['runs']} runs from seed {report['seed']}"
    title = f"{report['scenario']}, {games}, vertical"
    table = Table(
        title=title,
        caption="misled: share of runs with |error| > level at an epoch without an alarm; failed: with |error| > alert "
        "limit; 95 % intervals; available, alarm: shares of epochs",
        box=None,
        padding=(0, 1, 0, 0),
    )
    table.add_column("level and alarm", overflow="fold")
    for name in ("level, m", "misled", "failed", "available", "alarm"):
        table.add_column(name, justify="right", no_wrap=True)
    signals = ""
    for row in report["rows"]:
        if row["signals"] != signals:
            signals = row["signals"]
            table.add_row(Text(signals, style="bold"))
        shares = (row["misleading_information"], row["integrity_failure"])
        table.add_row(
            f"  {row['user']}",
            f"{row['level_m']:.1f}",
            *(f"{part['share']:.3g} [{part['ci95'][0]:.2g}, {part['ci95'][1]:.2g}]" for part in shares),
            f"{row['availability']:.3g}",
            f"{row['epochs_in_alarm'] / (report['epochs'] * report['runs']):.3g}",
        )
    return table


def draw(flight: Flight, replica: Replica, path: Path) -> None:
    """The Stanford diagrams of the level from P and of that from separation, side by side.

    Raises:
        ImportError: matplotlib is missing.
    """
    titles = {FROM_P: "K σ from P, no test", BANK: "separation-bank, until its alarm"}
    titles |= {} if BANK in flight.level else {FROM_P_TESTED: "K σ from P, until an alarm of the snapshot test"}
    diagrams = {title: flight.result(user).diagram for user, title in titles.items() if user in flight.level}
    draw_side_by_side(diagrams, path, f"Replica of the true signals that climbs at {replica.words}: vertical error")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym integrity",
        description="Compare protection levels from P and from solution separation, clean and spoofed.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--scenario", default=SCENARIO, help="what is driven or flown; a recorded log, too (default: %(default)s)")
    add("--climb", action="append", type=rate, metavar="M/S",
        help="of the replayed place; repeatable (default: 0.2, and 0.04 with and without a tracking error)")
    add("--runs", type=count, help="of each replica (default: 200; a recorded log has one)")
    add_seed(result, "run 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


def rate(text: str) -> float:
    """A rate of 0 or more, m/s."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < np.inf:
        raise argparse.ArgumentTypeError(f"expected a rate of 0 m/s or more, got {text!r}")
    return value


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    scenario = make_scenario(options.scenario)
    if not scenario.random and options.runs not in (None, 1):
        raise ValueError(f"{scenario.name} is a recorded log, which has one run: leave --runs out")
    runs = options.runs or (RUNS if scenario.random else 1)
    replicas = REPLICAS if options.climb is None else (CLEAN, *map(Replica, options.climb))
    drawn = SLOW if options.climb is None else replicas[-1]
    terminal = console(stderr=options.json == STDOUT)
    kept: list[Flight] = []
    games = (runs, options.seed, options.threads)
    found = last_of(_reports(scenario, replicas, *games, terminal.progress, drawn, kept))
    outputs: list[Output] = [("figure", options.figure, lambda path: draw(kept[0], drawn, path))]
    give(found, table_of(found), options.json, terminal, outputs)
    return 0


def _reports(
    scenario: Scenario,
    replicas: Sequence[Replica],
    runs: int,
    seed: int,
    threads: int,
    progress: Progress,
    drawn: Replica,
    kept: list[Flight],
) -> Iterator[dict[str, Any]]:
    """The report after every replica; the flight of the one that is drawn is kept."""
    rows: list[dict[str, Any]] = []
    for replica in replicas:
        with progress(replica.words):
            flight = play(replica, runs, seed, scenario, threads=threads)
        kept += [flight] if replica == drawn else []
        for user, level in flight.level.items():
            named = {"signals": replica.words, "user": user, "level_m": float(np.median(level))}
            rows.append({**named, **flight.result(user).content()})
        yield report(scenario, list(rows), runs, seed)


def report(scenario: Scenario, rows: list[dict[str, Any]], runs: int, seed: int) -> dict[str, Any]:
    """An ``"integrity"`` report.

    Args:
        scenario: that was played.
        rows: of all signals and users.
        runs: of each replica.
        seed: of run 0.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "integrity",
        "scenario": scenario.name,
        "direction": "vertical",
        "epochs": scenario.timeline.num_epochs,
        "runs": runs,
        "seed": seed,
        "rows": rows,
    }


if __name__ == "__main__":
    sys.exit(moved("spoofgym integrity"))
