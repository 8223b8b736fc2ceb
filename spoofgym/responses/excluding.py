"""The base class of responses that leave GNSS out after an alarm."""

from __future__ import annotations

import copy
from typing import TypeVar

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Runs
from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.responses.base import Response, given
from spoofgym.responses.reuse import Consistent, Reuse
from spoofgym.specification import spell

Kind = TypeVar("Kind", bound="ExcludingResponse")


class ExcludingResponse(Response):
    """An alarm begins an exclusion, during which the INS coasts, and a rule of its own ends it.

    At its first epoch the fixes of the last epochs can be taken back, as many as a subclass says in `depth`. A fix
    that the receiver does not give is left out, but neither begins nor ends an exclusion.

    Attributes:
        kind: the registered name.
        reuse: the rule that ends an exclusion.
    """

    kind: str

    def __init__(self, reuse: Reuse, history: int = 0) -> None:
        """Keep the rule; ``history`` is the deepest backtrack of the subclass, epochs."""
        self.reuse = reuse
        self.demands = Demands(excludes=True, history=history)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell()

    def _spell(self, value: object = None, **options: object) -> str:
        """The specification with a subclass's own value and options before those of the rule."""
        return spell(self.kind, value, **options, **self.reuse.options)

    def with_reuse_threshold(self: Kind, threshold: float) -> Kind:
        """A copy whose exclusion ends by this threshold of the NIS.

        Raises:
            ValueError: the exclusion ends by another rule, or the threshold is not a positive finite number.
        """
        if not isinstance(self.reuse, Consistent):
            raise ValueError(f"{self.name}: reuse_threshold needs reuse, a number of consistent fixes, beside it")
        changed = copy.copy(self)
        changed.reuse = Consistent(self.reuse.epochs, validation.above(self.kind, "reuse_threshold", threshold))
        return changed

    def bind(self, num_runs: int) -> None:
        """Allocate the memory of ``num_runs`` runs, in a rule of its own."""
        super().bind(num_runs)
        self.reuse = copy.copy(self.reuse)
        self.reuse.bind(num_runs)
        self._excluding = np.zeros(num_runs, dtype=bool)

    def reset(self, runs: Runs) -> None:
        """Begin with GNSS in use in these runs."""
        self.reuse.reset(runs)
        self._excluding[runs] = False

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Leave the fix out during an exclusion, and take fixes back at its first epoch."""
        self.watch(epoch)
        fix = given(epoch)
        ends = self.reuse.accepts(epoch, alarm, self._excluding & fix)
        begins = self.reuse.heeds(epoch, alarm) & fix & ~self._excluding
        self._excluding = (self._excluding | begins) & ~ends
        backtrack = None
        if self.demands.history and begins.any():
            backtrack = np.where(begins, self.depth(epoch), 0)
        return Decision(fix & ~self._excluding, backtrack)

    def watch(self, epoch: Epoch) -> None:
        """Remember of each epoch what `depth` needs: nothing by default."""

    def depth(self, epoch: Epoch) -> Runs:
        """How many epochs an exclusion that begins now goes back, (N,): none by default."""
        return np.zeros(len(epoch.index), dtype=np.int64)
