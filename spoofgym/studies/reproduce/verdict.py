"""The rule that gives the verdict on a published figure, by numbers alone.

- **reproduced**: our median lies within 20 % of the published value, or within its rounding, and the published value
  lies in the range of our runs. The range is not asked for where it is narrower than 20 % of the value: a precise
  result may miss a rounded one.
- **compatible**: the published value lies in our range, but our median is farther away. It is one of the draws that
  our runs could have had, no more.
- **partly**: it lies outside the range, but within a factor of two of our median.
- **not reproduced**: neither.

A probability that spans decades is judged by its decimal logarithm: 0.3 stands for the 20 %, 0.6 for the factor of
two. An event needs at least 80 % of the runs to agree with the paper on whether it happens, and half of them for
"partly". A statement in words is reproduced where it holds in every run, and partly where it holds in more than half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spoofgym.arrays import Flags, Floats

Verdict = Literal["reproduced", "compatible", "partly", "not reproduced"]
Value = float | str
NEVER = "never"
TOLERANCE = 0.2
FACTOR = 2.0
DECADES, FAR_DECADES = 0.3, 0.6
AGREE, HALF = 0.8, 0.5


@dataclass(frozen=True)
class Published:
    """A value as a paper prints it.

    Attributes:
        value: the number, a statement in words, or "never".
        low: smallest number that is printed so.
        high: largest; infinite for a value that is a lower limit.
    """

    value: Value
    low: float = math.nan
    high: float = math.nan


def rounded(value: float, place: float = 1.0) -> Published:
    """A number whose last significant digit has the place ``place``: rounding moved it by half of that at most."""
    return Published(value, value - 0.5 * place, value + 0.5 * place)


def number_verdict(published: Published, low: float, median: float, high: float) -> Verdict:
    """The rule for a number.

    Args:
        published: as printed.
        low: smallest of our runs, or the lower end of an interval.
        median: of our runs.
        high: largest.
    """
    centre = _centre(published, median)
    tolerance = TOLERANCE * abs(centre)
    printed = published.low <= median <= published.high
    near = printed or abs(median - centre) <= tolerance
    inside = published.low <= high and published.high >= low
    if near and (inside or high - low < tolerance):
        return "reproduced"
    if inside:
        return "compatible"
    ratio = median / centre if centre else math.nan
    return "partly" if 1.0 / FACTOR <= ratio <= FACTOR else "not reproduced"


def _centre(published: Published, median: float) -> float:
    """What the paper prints; of a limit the nearest number that it allows."""
    if isinstance(published.value, str):
        return min(max(median, published.low), published.high)
    return published.value


def probability_verdict(published: float, low: float, median: float, high: float) -> Verdict:
    """The rule for a probability of which the order of magnitude counts; arguments as `number_verdict`."""
    inside = low <= published <= high
    if published <= 0.0 or median <= 0.0:
        return "reproduced" if published == median else "compatible" if inside else "not reproduced"
    decades = abs(math.log10(median / published))
    if decades <= DECADES and (inside or low <= 0.0 or math.log10(high / low) < DECADES):
        return "reproduced"
    if inside:
        return "compatible"
    return "partly" if decades <= FAR_DECADES else "not reproduced"


def event_verdict(published: Published, times: Floats) -> Verdict:
    """The rule for the time of an event, or "never".

    Args:
        published: the time from the onset, or "never".
        times: ours from the onset, (N,), infinite where a run never sees it.
    """
    seen = np.isfinite(times)
    share = float(np.mean(~seen if published.value == NEVER else seen))
    if share < HALF:
        return "not reproduced"
    if published.value == NEVER:
        return "reproduced" if share >= AGREE else "partly"
    found = times[seen]
    verdict = number_verdict(published, float(found.min()), float(np.median(found)), float(found.max()))
    return verdict if share >= AGREE or verdict == "not reproduced" else "partly"


def statement_verdict(holds: Flags) -> Verdict:
    """The rule for a statement in words, which holds or not in each run, (N,)."""
    share = float(np.mean(holds))
    return "reproduced" if share == 1.0 else "partly" if share > HALF else "not reproduced"
