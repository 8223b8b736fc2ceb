"""Tests for spoofing, one file per family."""

from __future__ import annotations

from collections.abc import Callable

from spoofgym.detectors.acna import Acna
from spoofgym.detectors.base import Detector
from spoofgym.detectors.bias_range import BiasRange
from spoofgym.detectors.chi_square import Snapshot, Windowed
from spoofgym.detectors.growing_window import GrowingWindow
from spoofgym.detectors.mean_innovation import MeanInnovation
from spoofgym.detectors.relative_motion import RelativeMotion
from spoofgym.detectors.signed_mean import SignedMean
from spoofgym.specification import build

DETECTORS: dict[str, Callable[..., Detector]] = {
    "snapshot": Snapshot,
    "windowed": Windowed,
    "acna": Acna,
    "signed-mean": SignedMean,
    "mean-innovation": MeanInnovation,
    "relative-motion": RelativeMotion,
    "growing-window": GrowingWindow,
    "bias-range": BiasRange,
}


def make_detector(detector: str | Detector) -> Detector:
    """The detector that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    return detector if isinstance(detector, Detector) else build(detector, DETECTORS, "detector")
