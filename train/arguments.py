"""Types of command-line arguments, with errors that say what is valid."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

PICTURES = (".png", ".svg", ".pdf")


def count(text: str) -> int:
    """A whole number of 1 or more; ``1e6`` and ``1_000_000`` are understood."""
    try:
        value = float(text.replace("_", ""))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}") from None
    if value != int(value) or value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of 1 or more, got {text!r}")
    return int(value)


def seed_number(text: str) -> int:
    """A whole number of 0 or more."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}") from None
    if value < 0:
        raise argparse.ArgumentTypeError(f"a seed is 0 or more, got {text!r}")
    return value


def above_one(text: str) -> float:
    """A finite number greater than 1."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None
    if not 1.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"expected a finite number greater than 1, got {text!r}")
    return value


def picture(text: str) -> Path:
    """A file whose ending names a picture format."""
    path = Path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f"a figure's name ends in {', '.join(PICTURES)}, got {text!r}")
    return path
