"""The code blocks of the README run as they stand."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_there_are_blocks():
    assert len(BLOCKS) >= 3


@pytest.mark.parametrize("place", range(len(BLOCKS)))
def test_block_runs(place, capsys):
    exec("import gymnasium as gym, spoofgym\n" + BLOCKS[place], {})
    if "print(" in BLOCKS[place]:
        assert re.search(r"(error|harm) \d", capsys.readouterr().out)
