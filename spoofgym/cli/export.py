"""Make an agent of a run folder, or a policy folder of a zip that Stable-Baselines3 has saved.

spoofgym export runs/x my-spoofer
spoofgym export mine.zip runs/mine --scenario liu-flight --knowledge shadow
spoofgym export mine.zip runs/mine --environment DuelDefender-v0 --spoofer ramp:0.5
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.command_line import count, share
from spoofgym.console import console
from spoofgym.envs.config import ACTIONS, configure
from spoofgym.envs.trained import ENVIRONMENTS
from spoofgym.navigation.family import COUPLINGS, FIDELITIES
from spoofgym.program import program
from spoofgym.studies import export

ZIP = ".zip"
NAMESPACE = "spoofgym/"
NAMES = tuple(name.removeprefix(NAMESPACE) for name in ENVIRONMENTS)
SPOOFER = NAMES[0]
ALONE = ("detector", "detectors")
"""What the detectors are called in `Spoofer-v0`, and in the others."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = export.parser()
    of_zip = result.add_argument_group(
        "of a zip of Stable-Baselines3",
        "A policy of PPO or A2C with tanh layers, whose observations were not normalised (no VecNormalize). Nothing "
        "that is pickled in the zip is read. Name the environment of its training, and the arguments that it had.",
    )
    add = of_zip.add_argument
    add("--environment", choices=NAMES, help=f"on which it was trained (default: {SPOOFER})")
    add("--scenario", help="what was driven or flown")
    add("--detector", action="append", metavar="SPEC", help="repeatable, in order")
    add("--knowledge", choices=KNOWLEDGE, help="of the victim: what a spoofer sees")
    add("--action", choices=ACTIONS, help="what a spoofer controls")
    add("--frames", type=count, help="epochs that a spoofer sees at once")
    add("--shadow", metavar="SPEC", help="scenario whose filter a spoofer takes for the victim's")
    add("--attacks", metavar="SPEC", help="opponents of Defender-v0")
    add("--spoofer", metavar="SPEC", help="opponent of DuelDefender-v0")
    add("--defender", metavar="SPEC", help="opponent of DuelSpoofer-v0")
    add("--payoff", metavar="SPEC", help="of the duel")
    add("--objective", metavar="SPEC", help="of Spoofer-v0: what the spoofer was paid for")
    add("--clean", type=share, help="share of games without an attack")
    add("--bank", metavar="SPEC", help="bank of hypotheses that a defender saw")
    add("--fidelity", choices=FIDELITIES, help="of the simulation")
    add("--coupling", choices=COUPLINGS, help="of the filter")
    return result


OF_ZIP = (
    *("scenario", "detector", "knowledge", "action", "frames", "shadow", "attacks", "spoofer", "defender", "payoff"),
    *("objective", "clean", "bank", "fidelity", "coupling"),
)
"""Arguments of environments among the options, as they are called there, but for the detectors."""


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    given = {name: value for name in OF_ZIP if (value := getattr(options, name)) is not None}
    if not options.run.lower().endswith(ZIP):
        asked = next(iter(given), "environment" if options.environment else None)
        if asked is not None:
            raise ValueError(f"--{asked} is of a zip of Stable-Baselines3; a run folder tells it itself")
        return export.make_agent(options)
    source, out = Path(options.run), Path(options.out)
    if not source.is_file():
        raise FileNotFoundError(f"{source} is no file")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"{out} exists already: choose another folder")
    config = _environment(options.environment or SPOOFER, given)
    from spoofgym.learning.from_zip import policy_of_zip

    policy_of_zip(source, config, out)
    terminal = console()
    if options.scenario is None:  # a zip does not say what it was trained on
        terminal.print(
            f"taken as trained on {options.environment or SPOOFER} with scenario={config.scenario}: "
            "name the --scenario if it was another",
            soft_wrap=True,
        )
    terminal.print(f"policy in {out}, arrays and text only; use it as policy:{out}", soft_wrap=True)
    return 0


def _environment(name: str, given: dict[str, Any]) -> Any:
    """The configuration of an environment.

    Raises:
        ValueError: an argument that it does not have.
    """
    detectors = given.pop("detector", None)
    if detectors is not None:
        given[ALONE[name != SPOOFER]] = detectors[0] if len(detectors) == 1 else tuple(detectors)
    try:
        return configure(ENVIRONMENTS[f"{NAMESPACE}{name}"], given)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from error
