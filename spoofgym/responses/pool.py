"""Pools of responses, from which every run draws its defender."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Runs
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses.base import Response
from spoofgym.streams import RunStreams

OWNER = "pool of responses"


class ResponsePool(Response):
    """A weighted pool: at its reset each run draws a response from it.

    Attributes:
        names: of the members.
        member: index of each run's response, (N,).
    """

    in_position = False

    def __init__(self, members: Sequence[tuple[Response, float]]) -> None:
        """Draw from ``members``, responses with their weights.

        Raises:
            ValueError: no member, two of one name, or a weight that is not positive.
        """
        if not members:
            raise ValueError("a pool of responses needs at least one member")
        self._members = [member for member, _ in members]
        self.names = tuple(member.name for member in self._members)
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"each response can be in a pool once only, got {', '.join(self.names)}")
        weights = np.array([validation.above(OWNER, "weight", weight) for _, weight in members])
        self._bounds = np.cumsum(weights) / weights.sum()
        self.demands = reduce(or_, (member.demands for member in self._members))
        self.needs = tuple(dict.fromkeys(need for member in self._members for need in member.needs))

    @property
    def name(self) -> str:
        """The names of the members."""
        return " + ".join(self.names)

    def know(self, facts: FilterFacts) -> None:
        """Tell every member what is known of the filter."""
        for member in self._members:
            member.know(facts)

    def bind(self, num_runs: int) -> None:
        """Allocate the memory of ``num_runs`` runs in every member."""
        super().bind(num_runs)
        for member in self._members:
            member.bind(num_runs)
        self.member: Runs = np.zeros(num_runs, dtype=np.int64)

    def join(self, simulation: Any) -> None:
        """Give every member the simulation that it decides in."""
        for member in self._members:
            member.join(simulation)

    def draw(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the response of new episodes, one number per run, and what is random of the members."""
        draws = np.array([streams(run, "defender").random() for run in runs.tolist()])
        self.member[runs] = np.minimum(np.searchsorted(self._bounds, draws, side="right"), len(self._members) - 1)
        for member in self._members:
            member.draw(runs, streams)

    def reset(self, runs: Runs) -> None:
        """Forget everything about these runs."""
        for member in self._members:
            member.reset(runs)

    def begin(self, runs: Runs, epoch: Epoch, alarm: Flags) -> Decision:
        """Each run's response decides on its epoch 0."""
        decisions = [member.begin(runs, _seen_by(member, epoch), alarm) for member in self._members]
        return self._chosen(decisions, self.member[runs])

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Each run's response decides."""
        decisions = [member.decide(_seen_by(member, epoch), alarm) for member in self._members]
        return self._chosen(decisions, self.member)

    def _chosen(self, decisions: list[Decision], member: Runs) -> Decision:
        """Of n runs the decisions of their own responses; member (n,)."""
        whole = decisions[0]
        for place, decision in enumerate(decisions[1:], start=1):
            runs = np.flatnonzero(member == place)
            if len(runs):
                whole = whole.put(runs, decision.of(runs))
        return whole


def _seen_by(member: Response, epoch: Epoch) -> Epoch:
    return epoch.in_position if member.in_position else epoch
