"""What the aids of N runs told their filters, for monitors."""

from __future__ import annotations

from dataclasses import dataclass

from spoofgym.arrays import Floats, Runs


@dataclass(frozen=True)
class AidInnovations:
    """What the aids of a filter told it on the way to the present epoch.

    Attributes:
        names: of the aids.
        first_row: of each aid among the rows of all.
        whitened: sum of the whitened innovations of each aid over the root of their number, (N, rows): white, with unit
            variance, under a matched filter. Zero where an aid did not measure.
        count: measurements of each aid, those that its gate left out included, (N, A).
        rejected: those that its gate left out, (N, A).
    """

    names: tuple[str, ...]
    first_row: tuple[int, ...]
    whitened: Floats
    count: Runs
    rejected: Runs
