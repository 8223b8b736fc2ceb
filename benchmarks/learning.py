"""How near the optimum PPO comes, and in what time: trained with default settings on several seeds.

    python -m benchmarks.learning --seeds 0 1 2
    python -m benchmarks.learning --seeds 0 1 2 --detector windowed --knowledge full

Measure on an idle machine. Run folders stay under ``--out``; a seed whose folder already holds a policy is evaluated,
not trained again.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from agents.learned import POLICY_FILE
from spoofgym.envs.config import ACTIONS, KNOWLEDGE
from train import evaluate, spoofer
from train.arguments import count, seed_number


def main() -> int:
    """Train and evaluate each seed, and print a table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learning", description=main.__doc__)
    parser.add_argument("--seeds", type=seed_number, nargs="+", default=[0, 1, 2], help="(default: %(default)s)")
    parser.add_argument("--detector", default="snapshot", help="(default: %(default)s)")
    parser.add_argument("--knowledge", default="shadow", choices=KNOWLEDGE, help="(default: %(default)s)")
    parser.add_argument("--action", default="rate", choices=ACTIONS, help="(default: %(default)s)")
    parser.add_argument("--steps", type=count, default=spoofer.DEFAULT_STEPS, help="(default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("runs/learning"), help="(default: %(default)s)")
    parser.add_argument("--json", type=Path, help="write the rows")
    options = parser.parse_args()
    rows = [_row(options, seed) for seed in options.seeds]
    for row in rows:
        fraction = row["fraction_of_optimum"]
        print(
            f"seed {row['seed']}: undetected error {row['mean_undetected_error_m']:.2f} m"
            + (f", fraction of the optimum {fraction:.4f}" if fraction is not None else "")
            + f" (best ramp {row['best_ramp_m']:.2f} m)"
            + (f", trained in {row['training_seconds']:.0f} s" if row["training_seconds"] is not None else "")
        )
    if options.json is not None:
        options.json.write_text(json.dumps({"schema_version": 1, "kind": "learning", "rows": rows}, indent=2) + "\n")
    return 0


def _row(options: argparse.Namespace, seed: int) -> dict[str, Any]:
    folder: Path = options.out / f"{options.detector.replace(':', '-')}-{options.knowledge}-{options.action}-{seed}"
    game = ["--detector", options.detector]
    seconds = None
    if not (folder / POLICY_FILE).exists():
        learner = ["--knowledge", options.knowledge, "--action", options.action, "--steps", str(options.steps)]
        begin = time.perf_counter()
        status = spoofer.main([*game, *learner, "--seed", str(seed), "--out", str(folder)])
        if status:
            sys.exit(status)
        seconds = time.perf_counter() - begin
    result = folder / "evaluation.json"
    if evaluate.main([*game, "--attacker", str(folder), "--json", str(result)]):
        sys.exit(2)
    rows = {row["attacker"]: row for row in json.loads(result.read_text())["rows"]}
    return {
        "seed": seed,
        "training_seconds": seconds,
        "mean_undetected_error_m": rows[folder.name]["mean_undetected_error_m"],
        "exact_undetected_error_m": rows[folder.name]["exact_undetected_error_m"],
        "fraction_of_optimum": rows[folder.name]["fraction_of_optimum"],
        "best_ramp_m": rows["best-ramp"]["mean_undetected_error_m"],
        "best_ramp_fraction": rows["best-ramp"]["fraction_of_optimum"],
    }


if __name__ == "__main__":
    sys.exit(main())
