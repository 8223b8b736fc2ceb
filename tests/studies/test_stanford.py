"""Stanford diagrams are drawn."""

import numpy as np
import pytest

from spoofgym.evaluation.stanford import stanford_diagram
from spoofgym.studies.stanford import draw


def test_the_picture(tmp_path):
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(0)
    diagram = stanford_diagram(8.0 * rng.random(500), 12.0 * rng.random(500), 10.0)
    path = tmp_path / "deep" / "stanford.png"
    draw(diagram, path, "a title")
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    nobody = np.zeros(1)
    draw(stanford_diagram(nobody, nobody, 10.0, np.array([True])), path)
