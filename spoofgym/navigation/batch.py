"""What N runs of any filter share: the order of an epoch's second half, backtracking, and the unaided solution.

A filter derives its navigator from `FilterBatch` and writes a few methods with its equations. Everything that a run
needs to go through an epoch again (state, covariance, truth, what it has learnt) stands in arrays that the `History`
knows. A backtrack restores them and calls the same method that carries a run to its next epoch, with the stored noise
of the episode. Fixes taken back therefore equal fixes left out, bit for bit.

Methods that are called on slices of runs by threads (`_carry`, and what is given to `_on_slices`) write into rows of
arrays. They never assign an attribute.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.navigation.error_model import NUM_INERTIAL, POSITION
from spoofgym.navigation.history import History, restore
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


class Weights(NamedTuple):
    """How an innovation weights its measurements.

    Attributes:
        noise_scale: factor on their variance R, (n,).
        satellites: which slots' ranges are used, (n, S); shape (n, 0) for fixes of position.
    """

    noise_scale: Floats
    satellites: Flags

    def of(self, places: Runs | slice) -> Weights:
        """The weights of some of these runs."""
        return Weights(self.noise_scale[places], self.satellites[places])


class InnovationArrays(NamedTuple):
    """What kernels fill with the innovations of n runs; shapes as in `Innovation`."""

    residual: Floats
    covariance: Floats
    whitened: Floats
    nis: Floats


def empty_innovation(n: int, m: int) -> InnovationArrays:
    """Arrays for the innovations of ``n`` runs with ``m`` measurements each."""
    return InnovationArrays(np.empty((n, m)), np.empty((n, m, m)), np.empty((n, m)), np.empty(n))


class FilterBatch(ABC):
    """N runs of one filter.

    Attributes:
        index: the epoch where each run stands, (N,); -1 before the first.
        diverged: whether the filter has diverged in its episode, (N,).
        backtracked: epochs that the last `resolve` took back, (N,).
        auxiliary: inertial states of the unaided solution minus those of the filter, (N, 15); shape (N, 0) if not
            demanded. Both solutions meet the same noise, so that Φ alone carries it.
    """

    grain: int
    """Runs below which a slice is not worth a thread."""
    carry_grain: int
    """Runs below which a slice is not worth a thread when runs are carried to their next epoch."""
    past: History

    def __init__(self, num_runs: int, dimension: int, slices: RunSlices, demands: Demands, num_slots: int = 0) -> None:
        """Allocate what every filter needs; the filter sets ``past``.

        Args:
            num_runs: N.
            dimension: m, of the measurement.
            slices: the threads to use.
            demands: of the players.
            num_slots: S, of satellites, where ranges are measured.
        """
        self.index = np.full(num_runs, -1)
        self.diverged = np.zeros(num_runs, dtype=bool)
        self.backtracked = np.zeros(num_runs, dtype=np.int64)
        self.auxiliary = np.zeros((num_runs, NUM_INERTIAL if demands.auxiliary else 0))
        self._deviation = np.zeros((num_runs, dimension))
        self._whitened = np.zeros((num_runs, dimension))
        self._unweighted = Weights(np.ones(num_runs), np.ones((num_runs, num_slots), dtype=bool))
        self._slices = slices
        self._all = np.arange(num_runs)
        self._one_epoch = np.ones(num_runs, dtype=np.int64)

    # the equations of a filter

    @abstractmethod
    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        """Carry runs over several epochs without any fix; called on slices of runs by threads.

        Before each epoch the states are kept (`keep`). ``past`` holds all that is changed here, except ``auxiliary``.

        Args:
            runs: which, (n,).
            epochs: how many, of all runs, (N,).
            auxiliary: of all runs, (N, 15), or (N, 0) where it stays.
        """

    @abstractmethod
    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        """Form the innovation of the present deviation of runs (n,), and keep what `_correct` needs."""

    @abstractmethod
    def _correct(self, runs: Runs) -> None:
        """Apply the present fix of runs by their last innovation."""

    @abstractmethod
    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """Let the position of runs (n,), at least one, jump to the fix; it has this variance (n,) afterwards."""

    @abstractmethod
    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        """Copies of what `_moved` compares."""

    @abstractmethod
    def _moved(self, before: tuple[Floats, ...], after: tuple[Floats, ...]) -> Floats:
        """Inertial states of one solution minus those of another, (n, 15)."""

    @abstractmethod
    def _past_error(self, epochs: Runs) -> Floats:
        """Errors of the position after past epochs (N, E) as the history holds them, (N, E, 3), m ENU."""

    # what some filters do beside

    def _settle(self, runs: Runs) -> None:  # noqa: B027 - most filters have nothing to do
        """Called after runs have been carried or corrected: hold what has diverged."""

    def _formed(self, runs: Runs, innovation: Innovation, weights: Weights) -> None:  # noqa: B027 - most filters have nothing to do
        """Called after an innovation of runs has been formed: a filter may learn from it."""

    def _corrected(self, runs: Runs) -> None:  # noqa: B027 - most filters have nothing to do
        """Called after runs have used their fix: a filter may learn from it."""

    # what they share

    @property
    def history(self) -> int:
        """Epochs that can be taken back."""
        return self.past.depth

    def _select(self, runs: Runs | None) -> Runs:
        """The runs meant: all where none are named."""
        return self._all if runs is None else runs

    def _where(self, runs: Runs) -> Runs | slice:
        """Where runs stand in the arrays of all: a slice if all are meant, which NumPy copies a few times faster."""
        return slice(None) if runs is self._all else runs

    def _on_slices(self, function: Callable[[Runs], object], runs: Runs) -> None:
        """Call a function on slices of runs, by threads."""
        self._slices.call(function, runs, self.grain)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: what the scenario has drawn for them, (n, ...).
            streams: the random streams of all runs.
        """
        self.index[runs] = -1
        self.backtracked[runs] = 0
        self.auxiliary[runs] = 0.0
        self.diverged[runs] = False

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided inertial solution of runs, where there is one, begin anew from the filter's."""
        self.auxiliary[runs] = 0.0

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by inertial measurements."""
        runs = self._select(runs)
        self._slices.call(lambda part: self._carry(part, self._one_epoch, self.auxiliary), runs, self.carry_grain)
        self._settle(runs)

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: what lies between the measurement and the true one: receiver noise plus offset, (n, m).
            runs: which, (n,).
        """
        runs = self._select(runs)
        self._deviation[self._where(runs)] = deviation
        return self._form(runs, self._plain(len(runs)))

    def _plain(self, n: int) -> Weights:
        """The weights of n runs whose measurements are used as they are."""
        return self._unweighted if n == len(self._all) else self._unweighted.of(slice(n))

    def _form(self, runs: Runs, weights: Weights) -> Innovation:
        innovation = self._innovate(runs, weights)
        self._formed(runs, innovation, weights)
        return innovation

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take fixes back, then apply the present one, or reset to it, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history, or what shared gains cannot follow.
        """
        runs = self._select(runs)
        before = self._solution(runs) if self.auxiliary.shape[1] else None
        fixed = self._decide(decision, runs)
        self._correct(fixed)
        self._corrected(fixed)
        self._settle(runs)
        if before is not None:  # the unaided solution stays where it is while the filter's has moved
            self.auxiliary[runs] += self._moved(before, self._solution(runs))

    def _decide(self, decision: Decision, runs: Runs) -> Runs:
        """Take back, form anew and reset as decided; which runs use their fix otherwise, (k,)."""
        self._form_anew(decision, runs, self._take_back(decision, runs))
        return runs[self._reset_where_decided(decision, runs)]

    def _take_back(self, decision: Decision, runs: Runs) -> Flags:
        """Go back where it is decided, as far as history and episode reach; which runs have, (n,)."""
        self.backtracked[runs] = 0
        if decision.backtrack is None or not decision.backtrack.any():
            return np.zeros(len(runs), dtype=bool)
        if not self.history:
            raise ValueError("a backtrack is decided, but the navigator keeps no history: demand one when it is built")
        depth = np.minimum(np.minimum(decision.backtrack, self.history), self.index[runs])
        self.backtracked[runs] = depth
        epochs, ring, unaided = self.backtracked + 1, self.past.ring, self.auxiliary[:, :0]

        def go_back(part: Runs) -> None:
            restore(part, epochs, self.index, ring)
            self._carry(part, epochs, unaided)

        self._slices.call(go_back, runs[depth > 0], 1)
        return depth > 0

    def _form_anew(self, decision: Decision, runs: Runs, moved: Flags) -> None:
        """Form the innovations of fixes to be used again, where the filter has moved or the decision weights them."""
        again = moved
        if decision.noise_scale is not None:
            again = again | (decision.noise_scale != 1.0)
        if decision.satellites is not None:
            again = again | ~decision.satellites.all(axis=1)
        places = np.flatnonzero(again & decision.use)
        if len(places):
            plain = self._plain(len(runs))
            scale = plain.noise_scale if decision.noise_scale is None else decision.noise_scale
            satellites = plain.satellites if decision.satellites is None else decision.satellites
            self._form(runs[places], Weights(scale, satellites).of(places))

    def _reset_where_decided(self, decision: Decision, runs: Runs) -> Flags:
        """Reset to the fix where it is decided; which runs use their fix otherwise, (n,)."""
        if decision.reset is None:
            return decision.use
        jumps = decision.use & (decision.reset > 0.0)
        if jumps.any():
            self._reset_to_fix(runs[jumps], decision.reset[jumps])
        return decision.use & ~jumps

    def recomputed_error(self, epochs: int) -> Floats:
        """Errors after each of the last epochs as backtracking has rewritten them, (N, epochs, 3), m ENU, oldest first.

        The present epoch, which is not resolved yet or has been resolved last, is not among them. Epochs before the
        episode are zero. Errors of record are those of the real-time output, `error`.

        Raises:
            ValueError: more epochs than the history holds.
        """
        if not 0 <= epochs <= self.history:
            raise ValueError(f"epochs must be from 0 to the history of {self.history}, got {epochs}")
        order = self.index[:, None] - epochs + np.arange(epochs)
        return np.where(order[:, :, None] >= 0, self._past_error(order), 0.0)

    @property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """
        if not self.auxiliary.shape[1]:
            raise RuntimeError("this navigator has no unaided inertial solution: demand it when it is built")
        return self.auxiliary[:, POSITION].copy()


class SharedGains(FilterBatch):
    """N runs whose gains are those of the model: every run uses every measurement."""

    def _decide(self, decision: Decision, runs: Runs) -> Runs:
        """All runs use their measurement.

        Raises:
            ValueError: a measurement is left out or weighted, which shared gains cannot follow.
        """
        others = (decision.backtrack, decision.reset, decision.noise_scale, decision.satellites)
        if not decision.use.all() or any(part is not None for part in others):
            raise ValueError("a fix is left out, but the gains are shared: the navigator needs a covariance per run")
        return runs

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        raise NotImplementedError("a reset is refused")

    def _past_error(self, epochs: Runs) -> Floats:
        return np.zeros((*epochs.shape, 3))  # there is no history, so that these are no epochs
