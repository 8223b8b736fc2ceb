"""Whether detectors let a game begin: it starts after a clean burn-in without an alarm."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from spoofgym.detectors.base import Detector
from spoofgym.validation import written

FIRST_TRIED, TRIED = 8, 200
"""Clean runs that are tried. Where an eighth of them passes, all of 200 fail once in 4e11 times."""


def require_clean_starts(
    scenario: str, detectors: Sequence[Detector], passes: Callable[[Sequence[Detector], int], bool]
) -> None:
    """Refuse detectors that let no clean run begin.

    Detectors that are known to be quiet are not tried, so that this costs nothing where thresholds come from an ARL0.

    Args:
        scenario: its name, for the message.
        detectors: with their thresholds.
        passes: whether any of so many clean runs, which are no runs of the game, gets through its burn-in with some
            detectors.

    Raises:
        ValueError: none of `TRIED` runs does.
    """
    if all(_known_quiet(detector) for detector in detectors) or passes(detectors, FIRST_TRIED):
        return
    if passes(detectors, TRIED):
        return
    loud = [detector for detector in detectors if not passes([detector], TRIED)]
    raise ValueError(
        f"scenario {scenario!r}: all of {TRIED} clean runs alarm before the game: {far_too_low(loud or detectors)}"
    )


def far_too_low(detectors: Iterable[Detector]) -> str:
    """Words that blame thresholds."""
    words = [f"threshold {written(detector.threshold or math.nan)} of {detector.name!r}" for detector in detectors]
    return f"{' and '.join(words)} {'is' if len(words) == 1 else 'are'} far too low there"


def _known_quiet(detector: Detector) -> bool:
    """Whether alarms in its memory are rare, by its ARL0, or there can be none."""
    if detector.memory == 0 or detector.threshold == math.inf:
        return True
    arl0 = detector.arl0 if detector.calibrated else detector.target_arl0
    return arl0 is not None and arl0 >= 2.0 * (detector.memory + 1)
