"""Make an agent of a run folder, or a policy folder of a zip that Stable-Baselines3 has saved.

spoofgym export runs/x my-spoofer
spoofgym export mine.zip runs/mine --scenario liu-flight --knowledge shadow
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.command_line import count
from spoofgym.console import console
from spoofgym.envs.config import ACTIONS, SpooferConfig, configure
from spoofgym.program import program
from spoofgym.studies import export

ZIP = ".zip"
OF_ZIP = ("scenario", "detector", "knowledge", "action", "frames")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = export.parser()
    of_zip = result.add_argument_group(
        "of a zip of Stable-Baselines3",
        "A PPO spoofer that you have trained yourself. Loading a zip runs what is in it: never take somebody else's.",
    )
    add = of_zip.add_argument
    add("--scenario", help="of its training (default: liu-flight)")
    add("--detector", help="of its training (default: snapshot)")
    add("--knowledge", choices=KNOWLEDGE, help="of the victim (default: shadow)")
    add("--action", choices=ACTIONS, help="what it controls (default: rate)")
    add("--frames", type=count, help="epochs that it sees at once (default: 1)")
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    given = {name: value for name in OF_ZIP if (value := getattr(options, name)) is not None}
    if not options.run.lower().endswith(ZIP):
        if given:
            raise ValueError(f"--{next(iter(given))} is of a zip of Stable-Baselines3; a run folder tells it itself")
        return export.make_agent(options)
    source, out = Path(options.run), Path(options.out)
    if not source.is_file():
        raise FileNotFoundError(f"{source} is no file")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"{out} exists already: choose another folder")
    config = configure(SpooferConfig, given)
    from spoofgym.learning.from_zip import spoofer_of_zip

    spoofer_of_zip(source, config, out)
    console().print(f"policy in {out}, arrays and text only; use it as policy:{out}", soft_wrap=True)
    return 0
