"""The papers, and their figures beside ours."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from spoofgym.evaluation.progress import Progress, silent
from spoofgym.studies.reproduce import foi_r_5687, kujur_2024, liu_2018, shadmehri_2025, song_2021
from spoofgym.studies.reproduce.rows import Group, Reproduction

PAPERS = {module.PAPER: module for module in (liu_2018, foi_r_5687, shadmehri_2025, song_2021, kujur_2024)}


def reproduce(paper: str, runs: int, seed: int, quick: bool) -> Reproduction:
    """All rows of a paper; arguments as `reproductions`."""
    *_, whole = reproductions(paper, runs, seed, quick)
    return whole


def reproductions(
    paper: str, runs: int, seed: int, quick: bool, progress: Progress = silent
) -> Iterator[Reproduction]:
    """The rows of a paper after each of their groups; the last one has all.

    Args:
        paper: its name on the command line.
        runs: of each game.
        seed: of run 0.
        quick: how the result is marked; a paper may have less to play then, too.
        progress: shows which group is being made.
    """
    module = PAPERS[paper]
    groups, found = module.groups(runs, seed, quick), list[Group]()
    for number in count(1):
        with progress(f"{paper}, part {number}"):
            group = next(groups, None)
        if group is None:
            return
        found.append(group)
        yield Reproduction(paper, module.TITLE, runs, seed, quick, module.READINGS, tuple(found))
