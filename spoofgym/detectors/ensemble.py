"""Several detectors as one, with one false-alarm rate."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector, ThresholdDetector, seen_dimension, statistic_of
from spoofgym.navigation.facts import RANGES, FilterFacts
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.specification import nest


class Ensemble(ThresholdDetector):
    """Alarm where any member alarms: the largest statistic_i / threshold_i of the members.

    A union of detectors at ARL0 A each has an ARL0 of its own, less than A and more than A over their number. So the
    members are calibrated first, which weighs them equally, and then one factor on all their thresholds is calibrated
    such that the union has the ARL0 that was asked for. That factor is the threshold.

    Args:
        members: detectors; those that are to be calibrated, to the ARL0 of the ensemble.
        threshold: the factor on the thresholds of the members.
        arl0: of the union, epochs.

    Raises:
        ValueError: fewer than two members, two of one name, one that is an ensemble, or a value out of range.
    """

    kind = "ensemble"
    _ranges = False

    def __init__(
        self, members: Sequence[Detector], threshold: float | None = None, arl0: float | None = None
    ) -> None:
        names = [member.name for member in members]
        if len(names) < 2 or len(set(names)) < len(names):
            raise ValueError(f"ensemble: members must be two or more detectors, all different, got {names}")
        if any(member.members for member in members):
            raise ValueError(f"ensemble: a member must not be an ensemble itself, got {names}")
        self.members = list(members)
        self.set_up(threshold, arl0, value="+".join(map(nest, names)))
        self.memory = max(member.memory for member in members)
        self.needs_view = any(member.needs_view for member in members)
        self.needs = tuple(dict.fromkeys(need for member in members for need in member.needs))
        self.demands = Demands()
        for member in members:
            self.demands |= member.demands

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the memories of the members, in copies of them."""
        self._bound = num_runs, dimension
        self.members = [copy.copy(member) for member in self.members]
        for member in self.members:
            member.bind(num_runs, seen_dimension(member, dimension, self._ranges))

    def know(self, facts: FilterFacts) -> None:
        """Tell every member, and bind each to what it sees of ranges, if such are measured."""
        if (RANGES in facts.offers) != self._ranges:
            self._ranges = RANGES in facts.offers
            self.bind(*self._bound)
        for member in self.members:
            member.know(facts)

    def join(self, simulation: Any) -> None:
        """Give every member the simulation that it watches."""
        for member in self.members:
            member.join(simulation)

    def reset(self, runs: Runs) -> None:
        """Every member forgets these runs."""
        for member in self.members:
            member.reset(runs)

    def take(self, runs: Runs, other: Detector) -> None:
        """Copy what the members of a copy of this ensemble remember."""
        for mine, theirs in zip(self.members, other.members, strict=True):
            mine.take(runs, theirs)

    def update(self, epoch: Epoch) -> Floats:
        """The largest statistic over its threshold, (N,).

        Raises:
            RuntimeError: a member has no threshold yet.
        """
        largest = np.full(len(epoch.index), -np.inf)
        for member in self.members:
            if member.threshold is None:
                raise RuntimeError(f"detector {self.name!r}: member {member.name!r} has no threshold yet: calibrate it")
            np.maximum(largest, statistic_of(member, epoch) / member.threshold, out=largest)
        return largest
