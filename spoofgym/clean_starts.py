"""Whether detectors let a game begin: it starts after a clean burn-in without an alarm."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from spoofgym.detectors.base import Detector
from spoofgym.validation import written

FIRST_TRIED, TRIED = 8, 200
"""Clean runs that are tried: where half of the first few pass, no more are."""
LEAST_SHARE = 0.1
"""Of the clean runs that must pass. Where a tenth does, one run in 40,000 still fails a hundred times in a row."""


def require_clean_starts(
    scenario: str, detectors: Sequence[Detector], passing: Callable[[Sequence[Detector], int], int]
) -> None:
    """Refuse detectors that let hardly any clean run begin.

    Detectors that are known to be quiet are not tried, so that this costs nothing where thresholds come from an ARL0.

    Args:
        scenario: its name, for the message.
        detectors: with their thresholds.
        passing: how many of so many clean runs, which are no runs of the game, get through their burn-in with some
            detectors.

    Raises:
        ValueError: less than a tenth of `TRIED` runs do.
    """
    if all(_known_quiet(detector) for detector in detectors) or passing(detectors, FIRST_TRIED) >= FIRST_TRIED / 2:
        return
    passed, least = passing(detectors, TRIED), LEAST_SHARE * TRIED
    if passed >= least:
        return
    loud = [detector for detector in detectors if passing([detector], TRIED) < least]
    raise ValueError(
        f"scenario {scenario!r}: {TRIED - passed} of {TRIED} clean runs alarm before the game begins: "
        f"{far_too_low(loud or detectors)}"
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
