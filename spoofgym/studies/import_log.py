"""Makes a log folder of what another program or device has recorded, tells what was found, and checks it."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from spoofgym.command_line import Parser
from spoofgym.logs.checks.check import all_findings
from spoofgym.logs.importers.recording import AXES, Options
from spoofgym.logs.importers.registry import IMPORTERS, read_source
from spoofgym.logs.importers.summary import summary
from spoofgym.logs.importers.tidy import tidy
from spoofgym.logs.importers.writer import check_target, write_log
from spoofgym.program import moved, program

EXAMPLES = (
    "spoofgym import flight.ulg -o runs/flight",
    "spoofgym import drive.bag -o runs/drive --fix-topic /gps/fix --begin 1.7e9",
    "spoofgym import mapping.toml -o runs/mine",
)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    formats = "; ".join(f"{name}: {importer.told}" for name, importer in IMPORTERS.items())
    result = Parser(
        prog="spoofgym import",
        description="Make a log folder of what others have recorded, tell what was found, and check it.",
        examples=EXAMPLES,
    )
    result.add_argument("source", type=Path, metavar="SOURCE", help=f"file or folder. {formats}")
    result.add_argument("-o", "--out", type=Path, required=True, metavar="FOLDER", help="of the new log; new or empty")
    names = f"{', '.join(IMPORTERS)} (default: by the content of the source)"
    result.add_argument("--format", choices=IMPORTERS, metavar="FORMAT", help=names)
    result.add_argument("--name", help="of the log (default: the name of its folder)")
    axes = "of the inertial sensor: forward, right, down, left, up; unknown = found from the drive"
    result.add_argument("--axes", choices=AXES, help=f"{axes} (default: what the source says)")
    result.add_argument("--begin", type=moment, metavar="S", help="leave out what is earlier, on the source's clock")
    result.add_argument("--end", type=moment, metavar="S", help="leave out what is later")
    result.add_argument("--imu-topic", metavar="TOPIC", help="of a ROS bag with several")
    result.add_argument("--fix-topic", metavar="TOPIC", help="of a ROS bag with several")
    return result


def moment(text: str) -> float:
    """A time on the clock of a log, s."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number of seconds, got {text!r}")
    return value


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    check_target(options.out)
    recording = read_source(options.source, options.format, Options(options.imu_topic, options.fix_topic))
    if options.axes is not None:
        recording.axes = options.axes
    tidy(recording, options.begin, options.end)
    write_log(recording, options.out, options.name or options.out.resolve().name)
    print("\n".join([*summary(recording), f"written: {options.out}"]), flush=True)
    print("\n".join(f"{finding.severity}: {finding}" for finding in all_findings(options.out)) or "no fault found")
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym import"))
