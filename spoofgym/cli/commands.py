"""The commands of ``spoofgym``: what each is called, what it does, and which module does it.

A module is imported when its command is called, so that the list of commands costs no time.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType

from spoofgym.program import Program


@dataclass(frozen=True)
class Command:
    """One command.

    Attributes:
        words: its name, in one or two words: ``tune``, ``evaluate spoofers``.
        told: what it does, in a line.
        module: that holds its ``parser()`` and its ``main(arguments)``.
    """

    words: str
    told: str
    module: str

    @property
    def main(self) -> Program:
        """The program; its module is imported."""
        found: Program = self._module().main
        return found

    @property
    def parser(self) -> Callable[[], argparse.ArgumentParser]:
        """What makes its command line; its module is imported."""
        found: Callable[[], argparse.ArgumentParser] = self._module().parser
        return found

    def _module(self) -> ModuleType:
        return importlib.import_module(self.module)


STUDIES, LEARNING = "spoofgym.studies", "spoofgym.learning"
SECTIONS: dict[str, tuple[Command, ...]] = {
    "look": (
        Command("list", "what there is to play with", "spoofgym.cli.list_parts"),
        Command("play", "play one game and tell its story", "spoofgym.cli.play"),
        Command("report", "a page to look at, of games and results", "spoofgym.report.program"),
        Command("check", "whether it works here, for a bug report", "spoofgym.cli.check"),
    ),
    "measure": (
        Command("evaluate spoofers", "spoofers beside baselines and the optimum", f"{STUDIES}.evaluate.spoofers"),
        Command("evaluate defenders", "defenders on populations of attacks", f"{STUDIES}.evaluate.defenders"),
        Command("evaluate recorded", "detectors and attacks on a recorded log", f"{STUDIES}.evaluate.recorded"),
        Command("matrix", "every detector against every attack", f"{STUDIES}.evaluate.matrix"),
        Command("benchmark", "spoofgym-bench: scores that others can compare", f"{STUDIES}.benchmark"),
        Command("integrity", "protection levels, Stanford diagrams", f"{STUDIES}.integrity"),
    ),
    "set up": (
        Command("thresholds", "thresholds at an equal false-alarm rate", f"{STUDIES}.thresholds"),
        Command("tune", "the best classical defenders of a scenario", f"{STUDIES}.tune"),
    ),
    "recorded logs": (
        Command("import", "make a log folder of what others have recorded", f"{STUDIES}.import_log"),
        Command("check-log", "units, axes, clocks, holes and signs of a log", f"{STUDIES}.check_log"),
        Command("estimate-noise", "process and measurement noise of a log", f"{STUDIES}.estimate_noise"),
    ),
    "learn": (
        Command("train spoofer", "train a PPO spoofer", f"{LEARNING}.spoofer"),
        Command("train defender", "train a PPO defender", f"{LEARNING}.defender"),
        Command("train league", "both sides learn against each other", f"{LEARNING}.league"),
        Command("train again", "train a published agent again", f"{LEARNING}.again"),
        Command("exploit", "how exploitable a defender is", f"{LEARNING}.exploit"),
        Command("export", "make an agent of your own policy", "spoofgym.cli.export"),
        Command("agents", "what the published agents are worth", f"{STUDIES}.agents"),
    ),
    "bounds and papers": (
        Command("bound duel", "what no defender of the duel can do better", f"{STUDIES}.duel_bound"),
        Command("bound bayes", "the Bayesian who knows the attacks", f"{STUDIES}.bayesian_bound"),
        Command("reproduce", "published figures beside ours", f"{STUDIES}.reproduce.__main__"),
        Command("study acna", "windows and thresholds of ACNA", f"{STUDIES}.acna"),
        Command("study self-tuning", "a filter that learns its own noises", f"{STUDIES}.self_tuning"),
        Command("study patient-spoofer", "a spoofer that waits for a reset", f"{STUDIES}.patient_spoofer"),
        Command("study wrong-shadow", "a spoofer with another filter in mind", f"{STUDIES}.wrong_shadow"),
        Command("study fidelity-of-thresholds", "thresholds in both fidelities", f"{STUDIES}.fidelity_of_thresholds"),
        Command("study noise", "filters before and after their noises are estimated", f"{STUDIES}.blind_noise"),
        Command("study aids", "what barometer and wheels do to spoofers", f"{STUDIES}.aids"),
        Command("study real-attacks", "every detector on real attacks and logs", f"{STUDIES}.real_attacks"),
        Command("study recorded-ranges", "loose and tight filters on a log", f"{STUDIES}.recorded_ranges"),
        Command("study fusion-ripper", "FusionRipper on a drive, published and ours", f"{STUDIES}.fusion_ripper"),
        Command("study delay", "what a defender's delay costs on the road", f"{STUDIES}.delay"),
    ),
}
"""In the order in which a newcomer meets them."""
COMMANDS = tuple(command for section in SECTIONS.values() for command in section)


def groups() -> dict[str, tuple[Command, ...]]:
    """The commands of two words, by their first."""
    firsts = dict.fromkeys(command.words.split()[0] for command in COMMANDS if " " in command.words)
    return {first: tuple(each for each in COMMANDS if each.words.split()[0] == first) for first in firsts}


def find(words: Sequence[str]) -> tuple[Command, int] | None:
    """The command with which a command line begins, and how many words name it; None where none does."""
    for length in (2, 1):
        for command in COMMANDS:
            if command.words.split() == list(words[:length]):
                return command, length
    return None
