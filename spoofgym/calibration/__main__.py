"""``python -m spoofgym.calibration`` prints the thresholds that `spoofgym.detectors.chi_square` ships."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.calibration.thresholds import calibrate
from spoofgym.command_line import Parser, above_one, add_seed, count
from spoofgym.detectors.chi_square import DEFAULT_ARL0, DEFAULT_WINDOW, Windowed
from spoofgym.program import program


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the threshold of a windowed test on white innovations."""
    parser = Parser(prog="python -m spoofgym.calibration", description=main.__doc__)
    parser.add_argument("--dimension", type=int, default=3, choices=(3, 6), help="of the fix (default: %(default)s)")
    parser.add_argument("--window", type=count, default=DEFAULT_WINDOW, help="n, epochs (default: %(default)s)")
    parser.add_argument("--arl0", type=above_one, default=DEFAULT_ARL0, help="epochs (default: %(default)s)")
    parser.add_argument("--epochs", type=count, default=1000, help="of a run (default: %(default)s)")
    parser.add_argument("--alarms", type=count, default=5000, help="first alarms that decide (default: %(default)s)")
    add_seed(parser, "the noise")
    options = parser.parse_args(arguments)
    clean = white_statistics(np.eye(options.dimension), options.epochs)
    detector = Windowed(options.window)
    result = calibrate(detector, clean, options.arl0, first_alarms=options.alarms, seed=options.seed)
    low, high = result.interval
    print(
        f"windowed n={options.window} m={options.dimension}: threshold {result.threshold:.3f} "
        f"at ARL0 {result.arl0:.4g} epochs, 95 % [{low:.4g}, {high:.4g}], "
        f"{result.first_alarms} first alarms in {result.epochs_at_risk:.3g} epochs"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
