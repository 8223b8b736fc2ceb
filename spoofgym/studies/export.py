"""Export the policy of a run folder as an agent that others can use: policy, card and recipe.

    spoofgym export runs/x agents/my-spoofer
    spoofgym export runs/d my-defender --onnx

The agent is played in its own environment first, and the card tells what it is worth. Whoever gets the folder names it
as ``policy:FOLDER``. The folder holds arrays and text only; loading it runs nothing. ``--onnx`` adds ``policy.onnx``
for a computer without Python (extra ``spoofgym[onnx]``).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import spoofgym
from spoofgym import files
from spoofgym.command_line import Parser, add_import, add_seed, count
from spoofgym.console import console
from spoofgym.evaluation.agent_scores import GAMES, SEED, agent_scores
from spoofgym.policies.card import CARD_FILE, Card, layout_digest
from spoofgym.policies.learned import (
    CONFIG_FILE,
    SPOOFER,
    LearnedDefender,
    LearnedSpoofer,
    environment_of,
    load_policy,
    read_config,
)
from spoofgym.policies.published import policy_folder
from spoofgym.policies.recipe import Recipe
from spoofgym.program import moved, program

EXAMPLES = (
    "spoofgym export runs/x my-spoofer",
    "spoofgym export runs/d my-defender --onnx",
    "spoofgym export mine.zip runs/mine --scenario liu-flight --knowledge shadow",
    "spoofgym export mine.zip runs/d --environment DuelDefender-v0 --spoofer ramp:1",
)

OPTIONS = {
    SPOOFER: (
        *("scenario", "detector", "detectors", "knowledge", "action", "frames", "shadow", "fidelity", "objective"),
        *("defender", "payoff", "clean"),
    ),
    "defender": ("scenario", "attacks", "detectors", "bank", "fidelity", "spoofer", "payoff"),
}
"""Arguments of an environment that are options of the program that trains on it."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(prog="spoofgym export", examples=EXAMPLES, description="Export a trained policy as an agent.")
    add = result.add_argument
    add("run", metavar="RUN", help="run folder of a training, or a zip of Stable-Baselines3")
    add("out", metavar="OUT", type=Path, help="folder of the agent or the policy; its name is the agent's")
    add("--games", type=count, default=GAMES, help="for the scores of the card (default: %(default)s)")
    add_seed(result, "game 0", SEED)
    add("--onnx", action="store_true", help="write policy.onnx, too (extra onnx)")
    add_import(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    return make_agent(parser().parse_args(arguments))


def make_agent(options: argparse.Namespace) -> int:
    """Make an agent of a run folder, as the options of `parser` say; returns the exit status."""
    out: Path = options.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"{out} exists already: choose another folder")
    folder = policy_folder(options.run)
    if (folder / CARD_FILE).is_file() and not (folder / CONFIG_FILE).is_file():
        raise ValueError(f"{folder} is an agent already: name the run folder of its training")
    policy, run = load_policy(folder), read_config(folder)
    terminal = console()
    with terminal.progress(f"playing {options.games} games"):
        scores = agent_scores(policy, options.games, options.seed)
    card = Card(
        name=out.resolve().name,
        role=policy.kind,
        environment=environment_of(policy.configuration),
        arguments=policy.configuration,
        layout_digest=layout_digest(policy.layout),
        weights_digest=policy.weights_digest,
        training=training_of(policy.kind, run),
        scores=scores,
    )
    write_agent(out, policy, card, recipe_of(policy.kind, run), options.onnx)
    for score in scores:
        low, high = score.interval
        half = 0.5 * (high - low)
        terminal.print(f"{score.metric} against {score.opponent}: {score.value:.3g} ±{half:.2g} {score.unit}")
    terminal.print(f"agent in {out}; use it as policy:{out}", soft_wrap=True)
    return 0


def training_of(kind: str, run: dict[str, Any]) -> dict[str, Any]:
    """How a policy was trained, as its card tells it.

    Args:
        kind: who was trained.
        run: content of the run's ``config.json``.
    """
    return {
        "program": f"spoofgym.learning.{kind}",
        "settings": run.get("learner", {}),
        "seed": run.get("seed"),
        "steps": run.get("steps"),
        "version": spoofgym.__version__,
        "commit": _commit(),
        "exported": datetime.now(timezone.utc).date().isoformat(),
    }


def recipe_of(kind: str, run: dict[str, Any]) -> Recipe:
    """What trains a policy again.

    Args:
        kind: who was trained.
        run: content of the run's ``config.json``.
    """
    environment = run["environment"]
    options = {name: environment[name] for name in OPTIONS[kind] if environment.get(name) is not None}
    if "detectors" in options:
        options["detector"] = options.pop("detectors")
    learner = run.get("learner", {})
    return Recipe(f"spoofgym.learning.{kind}", {**options, **learner, "seed": run["seed"], "steps": run["steps"]})


def write_agent(
    out: Path, policy: LearnedSpoofer | LearnedDefender, card: Card, recipe: Recipe, onnx: bool = False
) -> None:
    """Write the folder of an agent, whole or not at all.

    Raises:
        OSError: it cannot be written.
        ImportError: ONNX is asked for and missing.
    """
    files.check_folder(out)
    draft = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.resolve().parent))
    try:
        policy.save(draft)
        card.write(draft)
        recipe.write(draft)
        if onnx:
            from spoofgym.policies.onnx_model import write_onnx

            write_onnx(policy, draft)
        draft.chmod(0o755)
        if out.is_dir():
            out.rmdir()
        draft.replace(out)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _commit() -> str | None:
    """The commit of the checkout that this program runs in; None where there is none."""
    try:
        command, place = ["git", "rev-parse", "HEAD"], Path(__file__).parent
        told = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


if __name__ == "__main__":
    sys.exit(moved("spoofgym export"))
