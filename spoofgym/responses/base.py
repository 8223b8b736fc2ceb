"""The base class of every response."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Runs, take_runs
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.streams import RunStreams


def given(epoch: Epoch) -> Flags:
    """Whether the receiver gives a fix, (N,)."""
    return np.ones(len(epoch.index), dtype=bool) if epoch.available is None else epoch.available


class Response(ABC):
    """What follows an alarm, in N runs.

    Attributes:
        demands: what it asks of the navigator: by default that a fix can be left out; a response that backtracks
            demands the history it needs.
        needs: what the scenario must offer beside innovations, e.g. ranges to satellites.
        in_position: it sees ranges turned into a position (`Innovation.in_position`); else the ranges themselves.
    """

    demands: Demands = Demands(excludes=True)
    needs: tuple[str, ...] = ()
    in_position: bool = True

    @property
    @abstractmethod
    def name(self) -> str:
        """The specification that builds this response."""

    def know(self, facts: FilterFacts) -> None:  # noqa: B027 - most responses need no facts
        """Learn what is known of the filter before any epoch; before `bind`."""

    def bind(self, num_runs: int) -> None:
        """Allocate the memory of ``num_runs`` runs."""
        self._num_runs = num_runs

    def join(self, simulation: Any) -> None:  # noqa: B027 - most responses see no more than each epoch
        """Take the `Simulation` that the response decides in, when it has been set up; after `bind`."""

    def draw(self, runs: Runs, streams: RunStreams) -> None:  # noqa: B027 - most responses know no chance
        """Draw what is random of new episodes, from the stream "defender" of each run; before `reset`."""

    def reset(self, runs: Runs) -> None:  # noqa: B027 - a response without a memory has nothing to forget
        """Forget everything about these runs."""

    def begin(self, runs: Runs, epoch: Epoch, alarm: Flags) -> Decision:
        """See epoch 0 of some runs alone, as `decide` does; the others see nothing.

        Args:
            runs: n indices.
            epoch: that of these runs.
            alarm: whether any detector alarms, (n,).

        Returns:
            The decisions on these runs.
        """
        part = copy.copy(self)
        part.bind(len(runs))
        part.reset(np.arange(len(runs)))
        decision = part.decide(epoch, alarm)
        self.take(runs, part)
        return decision

    @abstractmethod
    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """What becomes of this epoch's fix.

        Args:
            epoch: the present one.
            alarm: whether any detector alarms, (N,).
        """

    def take(self, runs: Runs, other: Response) -> None:
        """Copy the memory of ``other``, a copy of this response bound to fewer runs; its run j becomes ``runs[j]``."""
        take_runs(self, runs, other)
