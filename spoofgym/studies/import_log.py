"""Makes a log folder of what another program or device has recorded.

spoofgym import flight.ulg -o runs/flight
spoofgym import drive.bag -o runs/drive --fix-topic /gps/fix
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from spoofgym.command_line import Parser
from spoofgym.logs.importers.recording import AXES, Options
from spoofgym.logs.importers.registry import IMPORTERS, read_source
from spoofgym.logs.importers.summary import summary
from spoofgym.logs.importers.tidy import tidy
from spoofgym.logs.importers.writer import check_target, write_log
from spoofgym.program import program


def parser() -> Parser:
    """The command line."""
    formats = "; ".join(f"{name}: {importer.told}" for name, importer in IMPORTERS.items())
    made = Parser(prog="spoofgym import", description=main.__doc__)
    made.add_argument("source", type=Path, metavar="SOURCE", help=f"file or folder. {formats}")
    made.add_argument("-o", "--out", type=Path, required=True, metavar="FOLDER", help="of the new log; new or empty")
    made.add_argument("--format", choices=IMPORTERS, help="of the source (default: by its content)")
    made.add_argument("--name", help="of the log (default: the folder's)")
    axes = "of the inertial sensor: forward, right, down, left, up; unknown = found from the drive"
    made.add_argument("--axes", choices=AXES, help=axes)
    made.add_argument("--begin", type=float, metavar="S", help="leave out what is earlier, on the clock of the source")
    made.add_argument("--end", type=float, metavar="S", help="leave out what is later")
    return made


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Make a log folder of what another program or device has recorded, and tell what was found."""
    options = parser().parse_args(arguments)
    check_target(options.out)
    recording = read_source(options.source, options.format, Options())
    if options.axes is not None:
        recording.axes = options.axes
    tidy(recording, options.begin, options.end)
    write_log(recording, options.out, options.name or options.out.name)
    print("\n".join([*summary(recording), f"written: {options.out}"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
