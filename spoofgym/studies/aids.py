"""What aids do to spoofers: a barometer to those that leave through the height, wheels to a drive.

``spoofgym study aids`` prints two tables. The first plays learned spoofers (``--spoofer FOLDER``, each trained by
``python -m train.spoofer``) on the flight of Liu et al. with and without a barometer. The second tells, for the drive
of FOI-R-5687, how far the position drifts without GNSS, and what the optimum and the best ramp are worth against the
snapshot test, with and without wheels.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, count, run_folder
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.detectors.chi_square import quantile
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.geodesy import horizontal
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.optimum import best_ramp, bounded_optimum
from spoofgym.program import last_of, moved, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym study aids --runs 100",
    "spoofgym study aids --spoofer runs/plain --spoofer runs/both --json rows.json",
)
FLIGHTS = ("liu-flight", "liu-flight:aids=barometer", "liu-flight:aids=barometer:walk=0.005")
"""The last is a barometer on a day of steady weather."""
ARL0 = "arl0=10000"
HORIZONTAL = f"signed-mean:n=30,{ARL0}"
AID = f"aid-innovation:n=30,{ARL0}"
IMUS = ("fog", "tactical", "automotive")
WHEELS = ("", "wheel-speed", "wheel-speed:rate=10", "wheel-speed+barometer")
MOMENTS = (60, 120, 230)
"""Epochs without GNSS after which the error is told; one lasts a second."""
ALARM_SHARE = 1e-5
"""False alarms of the snapshot test per epoch."""


@dataclass(frozen=True)
class FlightRow:
    """What one spoofer reaches on one flight.

    Attributes:
        scenario: the flight.
        spoofer: its name.
        error_m: mean horizontal error at the end.
        error_ci95_m: its interval.
        undetected_m: mean of it where `HORIZONTAL` has not alarmed, else 0.
        unseen_m: mean of it where neither that nor the test of the aids has; None = there are no aids.
        height_m: root-mean-square error of the height at the end.
        found: share of the games in which `HORIZONTAL` alarms.
        found_by_aids: share in which the test of the aids does.
    """

    scenario: str
    spoofer: str
    error_m: float
    error_ci95_m: tuple[float, float]
    undetected_m: float
    unseen_m: float | None
    height_m: float
    found: float
    found_by_aids: float | None


@dataclass(frozen=True)
class DriveRow:
    """What wheels do to the drive.

    Attributes:
        imu: grade of the IMU.
        aids: of the filter.
        coasting_m: root-mean-square horizontal error after `MOMENTS` without GNSS.
        optimum_m: undetected error of the optimum against the snapshot test.
        ramp_m: that of the best ramp.
        ramp_mps: its rate.
    """

    imu: str
    aids: str
    coasting_m: tuple[float, ...]
    optimum_m: float
    ramp_m: float
    ramp_mps: float


def fly(scenario: Scenario, spoofer: Attack, runs: int, seed: int) -> FlightRow:
    """Games of a spoofer in which every fix is used; game i is seeded ``seed + i``."""
    names = [HORIZONTAL, *([AID] if scenario.facts.aids else [])]
    detectors = calibrated_for_play([make_detector(name) for name in names], scenario, "linear")
    simulation = Simulation(scenario, spoofer, detectors, num_runs=runs, seed=seed)
    simulation.reset()
    alarmed: Flags = np.zeros((len(detectors), runs), dtype=bool)
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        epoch = simulation.observe()
        for place, detector in enumerate(detectors):
            assert detector.threshold is not None
            alarmed[place] |= epoch.statistics[detector.name] > detector.threshold
    simulation.resolve()
    error = horizontal(simulation.error)
    aided = len(detectors) > 1
    return FlightRow(
        scenario.name,
        spoofer.name,
        float(error.mean()),
        mean_interval(error),
        float((error * ~alarmed[0]).mean()),
        float((error * ~alarmed.any(axis=0)).mean()) if aided else None,
        float(np.sqrt(np.mean(simulation.error[:, 2] ** 2))),
        float(alarmed[0].mean()),
        float(alarmed[1].mean()) if aided else None,
    )


def coasting(scenario: Scenario, runs: int, seed: int) -> Floats:
    """Root-mean-square horizontal error at the end of each epoch of games whose fixes are all left out, (K,), m."""
    simulation = Simulation(scenario, num_runs=runs, seed=seed, demands=Demands(excludes=True))
    simulation.reset()
    out, errors = Decision(np.zeros(runs, dtype=bool)), []
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve(out)
        simulation.observe()
        errors.append(float(np.sqrt(np.mean(horizontal(simulation.error) ** 2))))
    return np.array(errors)


def drive(imu: str, aids: str, runs: int, seed: int) -> DriveRow:
    """The drive with one IMU and these aids."""
    scenario = make_scenario(f"foi-drive:imu={imu}" + (f",aids={aids}" if aids else ""))
    model, rates = scenario.linear_model(), np.array(scenario.drag_off_rate)
    threshold, drift = quantile(ALARM_SHARE, scenario.dimension), coasting(scenario, runs, seed)
    ramp = best_ramp(model, threshold, rates)
    return DriveRow(
        imu,
        aids or "none",
        tuple(float(drift[moment - 1]) for moment in MOMENTS),
        float(bounded_optimum(model, threshold, rates).score),
        float(ramp.outcome.score),
        ramp.rate,
    )


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study aids",
        description="What a barometer does to spoofers that leave through the height, and wheels to a drive.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--spoofer", action="append", type=run_folder, metavar="FOLDER", default=[],
        help="of a run of train.spoofer on liu-flight; repeatable")
    add("--runs", type=count, default=1000, help="of each row (default: %(default)s)")
    add_seed(result, "run 0", 77)
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = last_of(_reports(options, terminal.progress))
    give(report, "\n".join(_lines(report)), options.json, terminal)
    return 0


def _reports(options: argparse.Namespace, progress: Progress) -> Iterator[dict[str, Any]]:
    """The ``"aids"`` report after each row."""
    head = {"schema_version": SCHEMA_VERSION, "kind": "aids", "runs": options.runs, "seed": options.seed}
    flights: list[dict[str, Any]] = []
    drives: list[dict[str, Any]] = []
    for text in FLIGHTS:
        for folder in options.spoofer:
            with progress(f"{text}, {folder}"):
                row = fly(make_scenario(text), make_spoofer(f"policy:{folder}"), options.runs, options.seed)
            flights.append(asdict(row))
            yield {**head, "flights": list(flights), "drives": []}
    for imu in IMUS:
        for aids in WHEELS:
            with progress(f"{imu}, {aids or 'no aids'}"):
                drives.append(asdict(drive(imu, aids, options.runs, options.seed)))
            yield {**head, "flights": list(flights), "drives": list(drives)}


def _lines(report: dict[str, Any]) -> Iterator[str]:
    yield f"{report['runs']} games of each row from seed {report['seed']}\n"
    if report["flights"]:
        yield "| flight | spoofer | error, m | undetected, m | neither, m | height, m | found | by aids |"
        yield "|---|---|---|---|---|---|---|---|"
        for row in report["flights"]:
            yield _flight_line(row)
        yield ""
    seconds = " / ".join(map(str, MOMENTS))
    yield f"| IMU | aids | error after {seconds} s without GNSS, m | optimum, m | best ramp, m | its rate, m/s |"
    yield "|---|---|---|---|---|---|"
    for row in report["drives"]:
        drift = " / ".join(f"{error:.3g}" for error in row["coasting_m"])
        optimum, ramp, rate = (f"{row[key]:.3g}" for key in ("optimum_m", "ramp_m", "ramp_mps"))
        yield f"| {row['imu']} | {row['aids']} | {drift} | {optimum} | {ramp} | {rate} |"


def _flight_line(row: dict[str, Any]) -> str:
    low, high = row["error_ci95_m"]
    unseen = "-" if row["unseen_m"] is None else f"{row['unseen_m']:.1f}"
    by_aids = "-" if row["found_by_aids"] is None else f"{row['found_by_aids']:.1%}"
    return (
        f"| `{row['scenario']}` | {row['spoofer']} | {row['error_m']:.1f} ± {0.5 * (high - low):.2f} | "
        f"{row['undetected_m']:.1f} | {unseen} | {row['height_m']:.1f} | {row['found']:.1%} | {by_aids} |"
    )


if __name__ == "__main__":
    sys.exit(moved("spoofgym study aids"))
