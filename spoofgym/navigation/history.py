"""The history of N runs: a ring of what they knew before each step, so that a backtrack can restore it.

Covariances are kept by their lower triangles, which halves the memory of a filter with many states.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, cast

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.packed import pack, packed_size, unpack

PARTS = 9
"""Arrays of a ring: a filter with fewer adds empty ones, because kernels are compiled for a number of arrays."""


class Ring(NamedTuple):
    """The present states of all runs, and their past: epoch k stands at k % slots.

    Attributes:
        states: present arrays that a run is restored to, (N, a), (N, b), ...; integers by their bits; `PARTS` at least.
        past: their values before the step to each epoch, (N, slots, a), (N, slots, b), ...
        parts: how many of these arrays the filter has; the others are empty.
        covariance: present P, (N, n, n).
        past_covariance: lower triangles by rows, (N, slots, n (n + 1) / 2).
    """

    states: tuple[Floats, ...]
    past: tuple[Floats, ...]
    parts: int
    covariance: Floats
    past_covariance: Floats


class History:
    """The states of N runs after each of the last resolved epochs.

    Attributes:
        depth: epochs that can be taken back; 0 = none, and nothing is allocated.
    """

    def __init__(self, depth: int, covariance: Floats, /, **states: Any) -> None:
        """Keep arrays whose leading axis is the runs.

        Args:
            depth: epochs that can be taken back.
            covariance: P, (N, n, n), exactly symmetric; shape (N, 0, 0) if the filter keeps it among its states.
            states: arrays of 64-bit numbers, (N, ...) each, by their names.
        """
        num_runs, n, _ = covariance.shape
        slots = depth + 1 if depth else 0
        self.depth = depth
        self._covariance = covariance
        self._past_covariance = np.zeros((num_runs, slots, packed_size(n)))
        self._states: dict[str, Any] = {}
        self._past: dict[str, Floats] = {}
        self.add(**states)

    def add(self, **states: Any) -> None:
        """Keep more arrays, of 64-bit numbers, (N, ...) each, by their names."""
        num_runs, slots = self._past_covariance.shape[:2]
        for name, state in states.items():
            self._states[name] = state
            self._past[name] = np.zeros((num_runs, slots, math.prod(state.shape[1:])))
        self._ring = self._flattened()

    def __getstate__(self) -> dict[str, Any]:
        # its views would become arrays of their own in a copy
        return {name: value for name, value in self.__dict__.items() if name != "_ring"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._ring = self._flattened()

    def _flattened(self) -> Ring:
        num_runs, slots = self._past_covariance.shape[:2]
        missing = max(PARTS - len(self._states), 0)
        flat = (*map(_flat, self._states.values()), *[np.zeros((num_runs, 0))] * missing)
        past = (*self._past.values(), *[np.zeros((num_runs, slots, 0))] * missing)
        return Ring(flat, past, len(self._states), self._covariance, self._past_covariance)

    @property
    def ring(self) -> Ring:
        """The arrays without their inner axes, for `keep` and `restore`: one kernel serves every filter."""
        return self._ring

    def recall(self, name: str, epochs: Runs) -> Floats:
        """Values of one array of numbers after past epochs (N, E), (N, E, ...)."""
        past = self._past[name]
        values = past[np.arange(len(past))[:, None], (epochs + 1) % max(past.shape[1], 1)]
        return values.reshape(*epochs.shape, *self._states[name].shape[1:])


def _flat(state: Any) -> Floats:
    """An array (N, ...) of 64-bit numbers as (N, a) of floats, integers by their bits; not a view if it is that."""
    if state.ndim == 2 and state.dtype == np.float64:
        return cast(Floats, state)
    return cast(Floats, state.reshape(len(state), -1).view(np.float64))


@njit(cache=True, nogil=True, error_model="numpy")
def keep(run: int, epoch: int, ring: Ring) -> None:
    """Write the states of a run before its step to ``epoch`` into its history, where it has one."""
    slots = ring.past_covariance.shape[1]
    if slots == 0:
        return
    slot = epoch % slots
    for part in range(ring.parts):
        state, past = ring.states[part], ring.past[part]
        for i in range(state.shape[1]):
            past[run, slot, i] = state[run, i]
    pack(ring.covariance[run], ring.past_covariance[run, slot])


@njit(cache=True, nogil=True, error_model="numpy")
def restore(runs: Runs, epochs: Runs, index: Runs, ring: Ring) -> None:
    """Put runs (n,) back to where they stood so many epochs (N,) ago, before the step to the first of them.

    The epochs where all runs stand, index (N,), go back with them.
    """
    slots = ring.past_covariance.shape[1]
    for run in runs:
        index[run] -= epochs[run]
        slot = (index[run] + 1) % slots
        for part in range(ring.parts):
            state, past = ring.states[part], ring.past[part]
            for i in range(state.shape[1]):
                state[run, i] = past[run, slot, i]
        unpack(ring.past_covariance[run, slot], ring.covariance[run])
