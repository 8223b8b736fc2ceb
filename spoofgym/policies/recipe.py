"""The recipe of a published agent: the program and the options that train it again, as ``recipe.toml``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spoofgym import files

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RECIPE_FILE = "recipe.toml"
LARGEST_RECIPE = 2**16
"""Bytes; a real one has a few hundred."""
PROGRAMS = ("spoofgym.learning.spoofer", "spoofgym.learning.defender")
"""Programs that a recipe may name: nothing else is ever started."""


@dataclass(frozen=True)
class Recipe:
    """What trains an agent again.

    Attributes:
        program: one of `PROGRAMS`.
        options: of its command line by name, without the dashes; a list gives an option several times.
    """

    program: str
    options: Mapping[str, Any]

    @property
    def arguments(self) -> list[str]:
        """The options as a command line has them."""
        result = []
        for name, value in self.options.items():
            for item in value if isinstance(value, list | tuple) else [value]:
                text = json.dumps(item) if isinstance(item, bool) else str(item)
                result += [f"--{name.replace('_', '-')}", text]
        return result

    def write(self, folder: Path) -> None:
        """Write the recipe, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        lines = ["# The program and the options that train this agent again.", f"program = {json.dumps(self.program)}"]
        lines += ["", "[options]", *(f"{name} = {_written(value)}" for name, value in self.options.items())]
        files.write_text(folder / RECIPE_FILE, "\n".join(lines) + "\n")


def _written(value: Any) -> str:
    # strings, numbers, truth values and lists of them are written in TOML as in JSON
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def read_recipe(folder: Path) -> Recipe:
    """Read the recipe of an agent.

    Raises:
        FileNotFoundError: the folder has none.
        ValueError: it is damaged, or names a program that trains nothing.
    """
    path = folder / RECIPE_FILE
    if not path.is_file():
        raise FileNotFoundError(f"{folder} has no {RECIPE_FILE}: it cannot be trained again")
    with files.reading(path):
        if path.stat().st_size > LARGEST_RECIPE:
            raise ValueError(f"it has more than {LARGEST_RECIPE} bytes")
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        if set(content) != {"program", "options"} or not isinstance(content["options"], dict):
            raise ValueError("a recipe has a program and a table of options")
        if content["program"] not in PROGRAMS:
            raise ValueError(f"program must be one of {', '.join(PROGRAMS)}, got {content['program']!r}")
        return Recipe(content["program"], content["options"])
