"""How near the optimum PPO comes, and in what time: trained with default settings on several seeds.

    python -m benchmarks.learning --seeds 0 1 2
    python -m benchmarks.learning --seeds 0 1 2 --detector windowed --knowledge full

Measure on an idle machine. Run folders stay under ``--out``: a seed whose run has come to its end is evaluated, not
trained again, and one that was interrupted goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.command_line import STDOUT, Parser, add_json, count, learner_seed, run_folder
from spoofgym.envs.config import ACTIONS, SpooferConfig
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.learning import spoofer
from spoofgym.learning.ppo import Settings
from spoofgym.learning.run_folder import DEFAULT_STEPS, RunFolder
from spoofgym.program import do_all, give_json, program
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Train and evaluate each seed, and print a table."""
    parser = Parser(prog="python -m benchmarks.learning", description=main.__doc__)
    parser.add_argument("--seeds", type=learner_seed, nargs="+", default=[0, 1, 2], help="(default: %(default)s)")
    parser.add_argument("--detector", default="snapshot", help="(default: %(default)s)")
    parser.add_argument("--knowledge", default="shadow", choices=KNOWLEDGE, help="(default: %(default)s)")
    parser.add_argument("--action", default="rate", choices=ACTIONS, help="(default: %(default)s)")
    parser.add_argument("--steps", type=count, default=DEFAULT_STEPS, help="(default: %(default)s)")
    parser.add_argument("--out", type=run_folder, default=Path("runs/learning"), help="(default: %(default)s)")
    add_json(parser)
    options = parser.parse_args(arguments)
    rows = [_row(options, seed) for seed in options.seeds]
    out = sys.stderr if options.json == STDOUT else sys.stdout
    report = {"schema_version": SCHEMA_VERSION, "kind": "learning", "rows": rows}
    do_all(lambda: print("\n".join(map(_line, rows)), file=out), lambda: give_json(report, options.json))
    return 0


def _line(row: dict[str, Any]) -> str:
    fraction = row["fraction_of_optimum"]
    return (
        f"seed {row['seed']}: undetected error {row['mean_undetected_error_m']:.2f} m"
        + (f", fraction of the optimum {fraction:.4f}" if fraction is not None else "")
        + f" (best ramp {row['best_ramp_m']:.2f} m)"
        + (f", trained in {row['training_seconds']:.0f} s" if row["training_seconds"] is not None else "")
    )


def _row(options: argparse.Namespace, seed: int) -> dict[str, Any]:
    path: Path = options.out / f"{options.detector.replace(':', '-')}-{options.knowledge}-{options.action}-{seed}"
    seconds = _train(options, seed, path)
    result = path / "evaluation.json"
    with contextlib.redirect_stdout(sys.stderr):  # the rows of this program have stdout for themselves
        given = ["--detector", options.detector, "--attacker", str(path), "--json", str(result)]
        _succeed(evaluate_spoofers.main(given))
    rows = {row["attacker"]: row for row in json.loads(result.read_text())["rows"]}
    return {
        "seed": seed,
        "training_seconds": seconds,
        "mean_undetected_error_m": rows[path.name]["mean_undetected_error_m"],
        "exact_undetected_error_m": rows[path.name]["exact_undetected_error_m"],
        "fraction_of_optimum": rows[path.name]["fraction_of_optimum"],
        "best_ramp_m": rows["best-ramp"]["mean_undetected_error_m"],
        "best_ramp_fraction": rows["best-ramp"]["fraction_of_optimum"],
    }


def _train(options: argparse.Namespace, seed: int, path: Path) -> float | None:
    """Train a seed, or what is left of it; the seconds of a whole training, else None."""
    game = {"detector": options.detector, "knowledge": options.knowledge, "action": options.action}
    settings = {**game, "steps": options.steps, "seed": seed}
    command = [part for name, value in settings.items() for part in (f"--{name}", str(value))] + ["--out", str(path)]
    folder = RunFolder(path, "spoofgym.learning.spoofer", (SpooferConfig,), Settings)
    if folder.holds_run:
        run, state = folder.run(), folder.state()
        folder.refuse_changes(run, {**settings, "detector": [options.detector]})
        if state is None or not folder.finished(run, state):
            _succeed(spoofer.main([*command, "--resume"]))
        return None
    begin = time.perf_counter()
    _succeed(spoofer.main(command))
    return time.perf_counter() - begin


def _succeed(status: int) -> None:
    if status:
        sys.exit(status)


if __name__ == "__main__":
    sys.exit(main())
