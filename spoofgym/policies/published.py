"""Finds published agents by name: a folder of the package each, with policy, configuration, card and recipe.

An installed package holds them in ``spoofgym/agents``, a checkout in ``agents`` beside the package.
"""

from __future__ import annotations

import os
from pathlib import Path

import spoofgym
from spoofgym.policies.learned import POLICY_FILE
from spoofgym.validation import nearest

AGENTS = "agents"
POLICY = "policy:"
"""Begins the specification of a learned policy."""


def agents_folder() -> Path:
    """The folder of the published agents."""
    package = Path(spoofgym.__file__).parent
    installed = package / AGENTS
    return installed if installed.is_dir() else package.parent / AGENTS


def published_names() -> list[str]:
    """The names of the published agents, sorted."""
    return sorted(path.parent.name for path in agents_folder().glob(f"*/{POLICY_FILE}"))


def shown_player(specification: str) -> str:
    """A player's specification as tables and figures show it: a policy in a folder of its own by the end of its path.

    ``policy:/runs/exploit/spoofers/0b29/seed-3``, one of several seeds, becomes ``learned, seed 3``.
    """
    if not specification.startswith(POLICY):
        return specification
    parts = Path(specification.removeprefix(POLICY)).as_posix().split("/")
    if parts[-1].startswith("seed-"):
        return f"learned, {parts[-1].replace('-', ' ')}"
    return "/".join(parts[-2:])


def published_folder(name: str) -> Path:
    """The folder of a published agent.

    Raises:
        ValueError: there is none of this name; the message lists the valid ones.
    """
    names = published_names()
    if name not in names:
        raise ValueError(f"no published agent is named {name!r}{nearest(name, names) or ';'} {_listed(names)}")
    return agents_folder() / name


def policy_folder(text: str) -> Path:
    """The folder of a policy that is given by the name of a published agent or by the path of a run folder.

    ``policy:`` may stand before it. The name of a published agent stands for this agent, even where a folder of this
    name lies in the working directory.

    Raises:
        ValueError: neither; the message lists the valid names.
    """
    names, given = published_names(), text.strip().removeprefix(POLICY).strip()
    if not given:
        raise ValueError(f"{text!r} names no policy: write policy:NAME or policy:FOLDER")
    if given in names:
        return agents_folder() / given
    if not Path(given).is_dir():
        kind = "run folder" if os.sep in given else "run folder and no published agent"
        raise ValueError(f"{given!r} is no {kind}{nearest(given, names) or ';'} {_listed(names)}")
    return Path(given)


def _listed(names: list[str]) -> str:
    return f"published agents: {', '.join(names)}" if names else "this version publishes no agents"
