"""A response that follows one detector among several."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

from spoofgym.arrays import Flags, Runs
from spoofgym.detectors.base import Detector, require_threshold
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses.base import Response
from spoofgym.streams import RunStreams


class Watching(Response):
    """Hands a response the alarm of one detector instead of that of any.

    Several detectors can then run in one simulation, and each defender follows its own.
    """

    def __init__(self, response: Response, detector: str, detectors: Sequence[Detector]) -> None:
        """Let ``response`` follow the one of ``detectors`` that is called ``detector``.

        Raises:
            ValueError: there is none of that name, or it has no threshold that is a positive finite number.
        """
        found = [item for item in detectors if item.name == detector]
        if not found:
            names = ", ".join(item.name for item in detectors)
            raise ValueError(f"no detector {detector!r}; there are: {names}; a response follows a detector of its game")
        self._response = response
        self._detector = detector
        self._threshold = require_threshold(found[0])
        self.demands = response.demands
        self.needs = response.needs
        self.in_position = response.in_position

    @property
    def name(self) -> str:
        """Detector and response; no specification builds it."""
        return f"{self._detector} > {self._response.name}"

    def know(self, facts: FilterFacts) -> None:
        """Tell the response what is known of the filter."""
        self._response.know(facts)

    def bind(self, num_runs: int) -> None:
        """Allocate the memory of ``num_runs`` runs, in a copy of the response."""
        self._response = copy.copy(self._response)
        self._response.bind(num_runs)

    def join(self, simulation: Any) -> None:
        """Give the response the simulation that it decides in."""
        self._response.join(simulation)

    def draw(self, runs: Runs, streams: RunStreams) -> None:
        """Draw what is random of the response."""
        self._response.draw(runs, streams)

    def reset(self, runs: Runs) -> None:
        """Forget everything about these runs."""
        self._response.reset(runs)

    def begin(self, runs: Runs, epoch: Epoch, alarm: Flags) -> Decision:
        """The response's decision on epoch 0 of some runs alone."""
        return self._response.begin(runs, epoch, epoch.statistics[self._detector] > self._threshold)

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """The response's decision on the alarm of the one detector."""
        return self._response.decide(epoch, epoch.statistics[self._detector] > self._threshold)

    def take(self, runs: Runs, other: Response) -> None:
        """Copy the memory of a copy bound to fewer runs."""
        assert isinstance(other, Watching)
        self._response.take(runs, other._response)
