"""Train an agent again, from its recipe.

    spoofgym train again NAME --out runs/again

NAME is a published agent or the folder of one. What trains is the program that the recipe names, with its options.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from spoofgym.command_line import Parser, run_folder, threads
from spoofgym.policies.published import policy_folder
from spoofgym.policies.recipe import RECIPE_FILE, read_recipe
from spoofgym.program import moved, program

EXAMPLES = (
    "spoofgym train again liu-flight-snapshot-spoofer --out runs/again",
)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym train again", description="Train an agent again, from its recipe.", examples=EXAMPLES
    )
    add = result.add_argument
    add("agent", metavar="NAME", help="published agent, or the folder of one")
    add("--out", type=run_folder, default=Path("runs/again"), help="run folder (default: %(default)s)")
    add("--threads", type=threads, default=1, help="of the learner and the simulation (default: %(default)s)")
    add("--resume", action="store_true", help="go on from the last checkpoint in the run folder")
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    folder = policy_folder(options.agent)
    recipe = read_recipe(folder)
    given = [*recipe.arguments, "--out", str(options.out), "--threads", str(options.threads)]
    if options.resume:
        given.append("--resume")
    learner = importlib.import_module(recipe.program)
    known = {action.dest for action in learner.parser()._actions}
    unknown = sorted(set(recipe.options) - known)
    if unknown:
        raise ValueError(f"{folder / RECIPE_FILE}: {recipe.program} has no option {', '.join(unknown)}")
    return int(learner.main(given))


if __name__ == "__main__":
    sys.exit(moved("spoofgym train again"))
