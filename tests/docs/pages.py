"""The pages of the documentation, their blocks of code, and what a page says that a block prints.

A comment before a block tells the test what to do with it; a reader does not see it:

    <!-- test: replace 400_000 by 2_000 -->     a long training with small numbers; its printed numbers are not compared
    <!-- test: needs ray -->                    skipped where this package is not installed
    <!-- test: needs a RINEX file -->           always skipped: the repository has none
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = ("environments/spoofer.md", "environments/defender.md", "environments/duel")
BLOCK = re.compile(
    r"(?P<notes>(?:<!-- test: [^\n]* -->\n)*)```python\n(?P<code>.*?)```\n(?P<shown>(?:\n?    [^\n]*\n)*)", re.DOTALL
)
NOTE = re.compile(r"<!-- test: (.*) -->")
COMMAND = re.compile(r"^    ((?:spoofgym|python -m) (?:[^\n\\]|\\\n)*)$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A block of Python.

    Attributes:
        code: as it is run, with small numbers where the page has large ones.
        shown: the lines that the page says it prints; empty where it says nothing.
        exact: whether the numbers of these lines hold for the code that is run.
        needs: packages without which it is skipped.
    """

    code: str
    shown: tuple[str, ...]
    exact: bool
    needs: tuple[str, ...]


def pages() -> list[Path]:
    """README, CONTRIBUTING, the pages, and that of the agents."""
    written = [path for path in sorted((ROOT / "docs").rglob("*.md")) if not _generated(path)]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "agents" / "README.md", *written]


def _generated(path: Path) -> bool:
    place = path.relative_to(ROOT / "docs").as_posix()
    return place.startswith(("_build/", *GENERATED))


def name(path: Path) -> str:
    """The page's path in the repository."""
    return path.relative_to(ROOT).as_posix()


def blocks(path: Path) -> list[Block]:
    """The blocks of Python of a page, in order."""
    found = []
    for match in BLOCK.finditer(path.read_text(encoding="utf-8")):
        code, exact, needs = match["code"], True, []
        for note in NOTE.findall(match["notes"]):
            if note.startswith("replace "):
                before, after = note.removeprefix("replace ").split(" by ")
                assert before in code, f"{name(path)}: no {before!r} to replace"
                code, exact = code.replace(before, after), False
            elif note.startswith("needs "):
                needs.append(note.removeprefix("needs "))
            else:
                raise ValueError(f"{name(path)}: what is {note!r}?")
        shown = tuple(line.strip() for line in match["shown"].splitlines() if line.strip())
        found.append(Block(code, shown, exact, tuple(needs)))
    return found


def commands(path: Path) -> list[str]:
    """The command lines of a page that call a program of the project, a line each."""
    return [re.sub(r"\\\n\s*", "", line) for line in COMMAND.findall(path.read_text(encoding="utf-8"))]
