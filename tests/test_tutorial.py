"""The tutorial on detectors: a class of ten lines, and blocks that run in turn and print what the page says."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from spoofgym.detectors.base import Detector

PAGE = (Path(__file__).parents[1] / "docs" / "how-to" / "detector.md").read_text(encoding="utf-8")
BLOCK = r"```python\n(.*?)```\n((?:\n?    [^\n]*\n)*)"
"""A block of code, and what it prints: the indented lines that follow."""
BLOCKS, SHOWN = zip(*re.findall(BLOCK, PAGE, flags=re.DOTALL), strict=True)
NUMBER = r"\d+(?:\.\d+)?"


def numbers(line):
    return [float(x) for x in re.findall(NUMBER, line)]


def test_the_class_has_at_most_ten_lines_of_code():
    (detector,) = [node for node in ast.parse(BLOCKS[0]).body if isinstance(node, ast.ClassDef)]
    assert [base.id for base in detector.bases] == ["Detector"]
    lines = BLOCKS[0].splitlines()[detector.lineno - 1 : detector.end_lineno]
    assert len([line for line in lines if line.strip()]) <= 10
    assert ";" not in BLOCKS[0]


def test_there_is_a_block_for_every_step():
    assert len(BLOCKS) == 5
    for block, word in zip(BLOCKS[1:], ("calibrated(", "watch_attack(", "gym.make(", "Ensemble("), strict=True):
        assert word in block


def test_the_blocks_run_and_print_what_the_page_shows():
    """Another version of NumPy may draw other noise: numbers within a fifth, or 6 of 100 games."""
    names, printed = {}, []
    for block, shown in zip(BLOCKS, SHOWN, strict=True):
        lines = []
        names["print"] = lambda *parts, lines=lines: lines.append(" ".join(map(str, parts)))
        exec(block, names)
        expected = [line.strip() for line in shown.splitlines() if line.strip()]
        assert [re.sub(NUMBER, "#", line) for line in lines] == [re.sub(NUMBER, "#", line) for line in expected]
        for line, wanted in zip(lines, expected, strict=True):
            assert numbers(line) == pytest.approx(numbers(wanted), rel=0.2, abs=6.0 if "%" in line else 0.0)
        printed.append(lines)
    detector = names["detector"]
    assert type(detector).__bases__ == (Detector,)
    assert detector.arl0_interval[0] < 5e3 < detector.arl0_interval[1]
    # per axis the variance is 0.1 / 1.9; epochs that were independent would have exp(-t² / 2 s²) = 1 / 5000
    independent = (2.0 * (0.1 / 1.9) * np.log(5000.0)) ** 0.5
    assert 0.85 * independent < detector.threshold < independent
    (leaning,), (snapshot,) = (numbers(line) for line in printed[2])
    assert leaning > snapshot + 70
    assert 1.0 < names["ensemble"].threshold < 1.4
