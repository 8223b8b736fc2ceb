"""What the pages say is so: blocks run and print what stands below them, commands exist, links lead somewhere."""

from __future__ import annotations

import importlib
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from spoofgym.attacks import ATTACKS
from spoofgym.cli.commands import find
from spoofgym.detectors import DETECTORS
from spoofgym.responses import RESPONSES
from spoofgym.scenarios import SCENARIOS
from tests.docs.pages import ROOT, Block, blocks, commands, name, pages

NUMBER = r"\d+(?:\.\d+)?"
ELSEWHERE = {"docs/how-to/detector.md", "docs/how-to/cluster.md"}
"""Pages whose blocks another test runs: tests/test_tutorial.py, and tests/optional/test_rllib.py with Ray."""
SLOW = {"docs/how-to/train-sb3.md", "docs/how-to/train-own-ppo.md", "docs/how-to/duel.md"}
WITH_BLOCKS = [path for path in pages() if blocks(path) and name(path) not in ELSEWHERE]
LOGS = ROOT.parent / "shared" / "data"
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#{1,6} (.*)$", re.MULTILINE)


def params() -> list[object]:
    slow = [pytest.mark.slow]
    return [pytest.param(path, id=name(path), marks=slow if name(path) in SLOW else []) for path in WITH_BLOCKS]


def lacking(block: Block) -> str | None:
    """What a block needs and this machine has not."""
    for what in block.needs:
        if what == "the logs":
            if not LOGS.is_dir():
                return f"sample logs in {LOGS}"
        else:
            try:
                importlib.import_module(what)
            except ImportError:
                return what
    return None


@pytest.mark.parametrize("path", params())
def test_blocks_run_and_print_what_the_page_shows(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another version of NumPy may draw other noise: numbers within a fifth, or 6 of 100 games."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    skipped = []
    for block in blocks(path):
        if missing := lacking(block):
            skipped.append(missing)
            continue
        lines: list[str] = []
        names["print"] = lambda *parts, lines=lines: lines.append(" ".join(map(str, parts)))
        exec(compile(block.code, name(path), "exec"), names)
        if block.shown:
            check_printed([line for text in lines for line in text.splitlines()], block)
    if skipped:
        pytest.skip(f"blocks that need {', '.join(dict.fromkeys(skipped))}")


def check_printed(lines: list[str], block: Block) -> None:
    """The lines are those that the page shows, but for their numbers; these are near where they hold for the code."""
    got, shown = ([" ".join(line.split()) for line in part] for part in (lines, block.shown))
    assert [re.sub(NUMBER, "#", line) for line in got] == [re.sub(NUMBER, "#", line) for line in shown]
    for line, wanted in zip(got, shown, strict=True):
        if block.exact:
            found, said = ([float(x) for x in re.findall(NUMBER, text)] for text in (line, wanted))
            assert found == pytest.approx(said, rel=0.2, abs=6.0 if "%" in line else 0.0), line


@pytest.fixture(autouse=True)
def registries() -> Iterator[None]:
    """Parts that a page registers are gone after its test."""
    before = [(registry, dict(registry)) for registry in (ATTACKS, DETECTORS, RESPONSES, SCENARIOS)]
    yield
    for registry, content in before:
        registry.clear()
        registry.update(content)


@pytest.mark.parametrize("path", [path for path in pages() if commands(path)], ids=name)
def test_commands_are_those_that_there_are(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is read by the parser of its program: a command or an option that was renamed is found here."""
    monkeypatch.chdir(tmp_path)
    for line in commands(path):
        words = shlex.split(line, comments=True)
        if words[0] == "spoofgym":
            check_command(words[1:], line)
        elif words[2].startswith("train."):
            check_command([words[2].replace(".", " ").split()[0], words[2].partition(".")[2], *words[3:]], line)
        elif words[2] not in ("pytest", "pip", "venv", "build", "sphinx"):
            assert importlib.util.find_spec(words[2]) is not None, line


def check_command(words: list[str], line: str) -> None:
    if words[0] in ("--help", "--version") or words[-1] == "--help":
        return
    found = find(words)
    assert found is not None, f"no such command: {line}"
    command, length = found
    parser, rest = command.parser(), words[length:]
    if "--import" in rest:  # the module is the reader's
        assert "--import" in parser.format_help(), line
        place = rest.index("--import")
        rest = rest[:place] + rest[place + 2 :]
    try:
        parser.parse_args(rest)
    except SystemExit as error:
        pytest.fail(f"{line}: {error}")


def anchors(path: Path) -> set[str]:
    """The anchors of the headings of a page, as GitHub and MyST make them."""
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in HEADING.findall(text)}


@pytest.mark.parametrize("path", pages(), ids=name)
def test_links_lead_to_files_and_headings_that_there_are(path: Path) -> None:
    """Those within the repository; the rest needs a network."""
    text = re.sub(r"```.*?```|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    broken = []
    for link, image in LINK.findall(text):
        target, _, anchor = (link or image).partition("#")
        if target.startswith(("http:", "https:", "mailto:")):
            continue
        place = Path(os.path.normpath(path.parent / target)) if target else path
        generated = place.parent.name == "environments" and place.suffix == ".md"
        if not (place.exists() or generated) or (anchor and anchor not in anchors(place)):
            broken.append(link or image)
    assert broken == []
