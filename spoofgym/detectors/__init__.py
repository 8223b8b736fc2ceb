"""Tests for spoofing, one file per family."""

from __future__ import annotations

from collections.abc import Callable

from spoofgym.detectors.acna import Acna
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Snapshot, Windowed
from spoofgym.specification import build

DETECTORS: dict[str, Callable[..., Detector]] = {"snapshot": Snapshot, "windowed": Windowed, "acna": Acna}


def make_detector(detector: str | Detector) -> Detector:
    """The detector that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    return detector if isinstance(detector, Detector) else build(detector, DETECTORS, "detector")
