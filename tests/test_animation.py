"""The animation of the README is small, and is what its program draws."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")

IMAGES = Path(__file__).parents[1] / "docs" / "images"
LARGEST = 500_000
"""Bytes, so that a page loads at once."""
DRAWN_ANEW = 2.0
"""Mean difference, of 255, that another matplotlib or another processor may make; the first picture differs from the
last by more."""


def picture(path: Path, place: int) -> np.ndarray:
    with Image.open(path) as animation:
        animation.seek(place % animation.n_frames)
        return np.asarray(animation.convert("RGB"), dtype=float)


def test_the_animation_is_what_its_program_draws(tmp_path: Path) -> None:
    kept, drawn = IMAGES / "game.gif", tmp_path / "drawn.gif"
    assert kept.stat().st_size < LARGEST
    command = [sys.executable, str(IMAGES / "make_animation.py"), "--every", "98", "--out", str(drawn)]
    subprocess.run(command, check=True, capture_output=True)
    for place in (0, -1):
        assert np.abs(picture(kept, place) - picture(drawn, place)).mean() < DRAWN_ANEW
    assert np.abs(picture(kept, 0) - picture(kept, -1)).mean() > 2 * DRAWN_ANEW
