"""The code blocks of the README run as they stand."""

import pydoc
import re
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_there_are_blocks():
    assert len(BLOCKS) >= 1


PAGES = ("spoofgym.envs.spoofer", "spoofgym.envs.defender", "spoofgym.envs.duel", "spoofgym.envs.duel_sides")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_that_help_shows_is_about_the_environment(page):
    """No page prints NumPy's own documentation of an array that the module happens to hold."""
    text = pydoc.render_doc(page, renderer=pydoc.plaintext)
    assert "## Observation Space" in text
    assert "ndarray(shape" not in text


def test_it_is_short_and_names_the_commands():
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 150
    for command in ("spoofgym train spoofer --scenario", "spoofgym evaluate spoofers --scenario", "make test"):
        assert command in text


@pytest.mark.parametrize("place", range(len(BLOCKS)))
def test_block_runs(place, capsys):
    exec("import gymnasium as gym, spoofgym\n" + BLOCKS[place], {})
    if "print(" in BLOCKS[place]:
        assert re.search(r"(error|harm) \d", capsys.readouterr().out)
