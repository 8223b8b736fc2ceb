"""A response that leaves out single satellites, and uses them again when they agree with the others.

Each satellite has two innovations: one of its code, one of its carrier or range rate. A common error of position and
clock changes all codes, another one changes all carriers (an error of velocity and clock rate changes all range rates).
The matrix G of these errors has eight columns. An error of one satellite alone is a combination of its two columns F_i
of L⁻¹. Let M be the projector that removes L⁻¹G and the columns of the satellites that are left out. Then

    t_i² = w'M F_i (F_i'M F_i)⁻¹ F_i'M w,

is chi-square with two degrees of freedom under a matched filter. It compares the measurements of a satellite with the
prediction by the others (Baarda 1968, for two measurements at once). It does not depend on the filter's estimate of
position, velocity and clock.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.chi_square import DEFAULT_P_FA, quantile
from spoofgym.detectors.raim import UNKNOWNS, inverse_columns, orthonormal
from spoofgym.kernels import njit
from spoofgym.navigation.facts import RANGES
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses.base import Response, given
from spoofgym.responses.reuse import DEFAULT_P
from spoofgym.specification import spell

DEFAULT_REUSE = 10
BOTH = 2
"""Measurements of a satellite."""
LEAST_TO_JUDGE = UNKNOWNS + 2
"""Satellites of which one that is off can be told: among five all leave-one-out residuals are the same."""


class ExcludeSatellites(Response):
    """A satellite whose range contradicts the others is left out until it agrees with them again.

    In every epoch t² of each satellite in use is formed: its code and its carrier or range rate against what the others
    predict. While the largest t² exceeds its threshold, the satellite that has it is left out and the others are judged
    anew, as long as six or more are in use. One that is left out is judged against those in use, and used again after
    ``reuse`` epochs in a row in which it agrees. Its two measurements go together. The alarms of detectors are not
    heard, and an epoch without a fix counts neither way.

    The report names such methods (FOI-R-5687, chapter 2): satellites are left out one at a time until the rest is
    consistent, and used again when they are near the expected range. Against a spoofer who has captured most satellites
    the honest ones are in the minority and go first; against one who has captured all, nothing contradicts.

    Args:
        p_fa: probability with which each satellite is left out in an epoch without spoofing.
        reuse: epochs in a row after which it is used again, 1 or more.
        reuse_threshold: of t² of a satellite that agrees; None = the quantile at 1e-3.

    Raises:
        ValueError: a value out of range.
    """

    kind = "exclude-satellites"
    needs = (RANGES,)
    in_position = False

    def __init__(
        self, p_fa: float = DEFAULT_P_FA, reuse: int = DEFAULT_REUSE, reuse_threshold: float | None = None
    ) -> None:
        self.threshold = quantile(validation.probability(self.kind, "p_fa", p_fa), BOTH)
        self.reuse = validation.whole(self.kind, "reuse", reuse, 1)
        given_threshold = quantile(DEFAULT_P, BOTH) if reuse_threshold is None else reuse_threshold
        self.reuse_threshold = validation.above(self.kind, "reuse_threshold", given_threshold)
        self._name = spell(
            self.kind,
            p_fa=None if p_fa == DEFAULT_P_FA else p_fa,
            reuse=None if reuse == DEFAULT_REUSE else self.reuse,
            reuse_threshold=reuse_threshold,
        )

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._name

    def bind(self, num_runs: int) -> None:
        """Allocate the memory of ``num_runs`` runs; the first epoch tells how many slots there are."""
        super().bind(num_runs)
        self._allot(0)

    def _allot(self, slots: int) -> None:
        self._left_out = np.zeros((self._num_runs, slots), dtype=bool)
        self._agreed = np.zeros((self._num_runs, slots), dtype=np.int64)

    def reset(self, runs: Runs) -> None:
        """Begin with every satellite in use in these runs."""
        self._left_out[runs] = False
        self._agreed[runs] = 0

    def take(self, runs: Runs, other: Response) -> None:
        """Copy the memory of a copy bound to fewer runs, whose run j becomes ``runs[j]``."""
        assert isinstance(other, ExcludeSatellites)
        if not self._left_out.shape[1]:
            self._allot(other._left_out.shape[1])
        super().take(runs, other)

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Leave out the satellites that contradict the others."""
        innovation = epoch.innovation
        present = innovation.present
        assert present is not None
        if not self._left_out.shape[1]:
            self._allot(present.shape[1] // BOTH)
        fix = given(epoch)
        ranges = Ranges(innovation.covariance, innovation.response, innovation.whitened, present)
        rule = Rule(self.threshold, self.reuse_threshold, self.reuse)
        _judge(ranges, fix, rule, self._left_out, self._agreed)
        return Decision(fix.copy(), satellites=~self._left_out if self._left_out.any() else None)


class Ranges(NamedTuple):
    """The innovations of the present ranges; m = 2 S.

    Attributes:
        covariance: S, (N, m, m).
        response: L⁻¹ H on the position, (N, m, 3), 1/m.
        whitened: (N, m).
        present: whether each measurement is there, (N, m).
    """

    covariance: Floats
    response: Floats
    whitened: Floats
    present: Flags


class Rule(NamedTuple):
    """When a satellite is left out, and when it is used again.

    Attributes:
        threshold: of the squared residual of a satellite in use.
        reuse_threshold: of the squared residual of one that is left out.
        reuse: epochs in a row below it.
    """

    threshold: float
    reuse_threshold: float
    reuse: int


@njit(cache=True, nogil=True, error_model="numpy")
def _judge(ranges: Ranges, fix: Flags, rule: Rule, left_out: Flags, agreed: Runs) -> None:
    """Who is left out in each run with a fix, (N,); the last two, (N, S), in place."""
    present = ranges.present
    m, slots = present.shape[1], left_out.shape[1]
    factor, columns, basis = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    for run in range(len(fix)):
        if not fix[run]:
            continue
        inverse_columns(ranges.covariance[run], present[run], factor, columns)
        used = 0
        for i in range(slots):
            if not present[run, i]:
                left_out[run, i], agreed[run, i] = False, 0
            used += present[run, i] and not left_out[run, i]
        while used >= LEAST_TO_JUDGE:
            size = nuisance_basis(ranges.response[run], factor, columns, left_out[run], slots, basis)
            worst, largest = -1, rule.threshold
            for i in range(slots):
                if present[run, i] and not left_out[run, i]:
                    square = squared_residual(basis, size, columns, i, ranges.whitened[run])
                    if square > largest:
                        worst, largest = i, square
            if worst < 0:
                break
            left_out[run, worst], agreed[run, worst] = True, 0
            used -= 1
        for i in range(slots):
            if left_out[run, i]:
                size = nuisance_basis(ranges.response[run], factor, columns, left_out[run], i, basis)
                square = squared_residual(basis, size, columns, i, ranges.whitened[run])
                agreed[run, i] = agreed[run, i] + 1 if square < rule.reuse_threshold else 0
        for i in range(slots):
            if left_out[run, i] and agreed[run, i] >= rule.reuse:
                left_out[run, i], agreed[run, i] = False, 0


@njit(cache=True, nogil=True, error_model="numpy")
def nuisance_basis(
    response: Floats, factor: Floats, columns: Floats, left_out: Flags, but: int, basis: Floats
) -> int:
    """Orthonormal vectors that span what G and the satellites left out can do to w; their number.

    Args:
        response: L⁻¹ H on the position, (m, 3).
        factor: L, (m, m).
        columns: those of L⁻¹, (m, m), by rows.
        left_out: which satellites are, (S,).
        but: one that is not, whatever ``left_out`` says; S = none.
        basis: by rows, (m, m), overwritten.
    """
    m, slots = len(columns), len(left_out)
    size = int(np.int64(0))  # numba compiles what it is given to again for a constant
    for c in range(UNKNOWNS):
        for block in range(BOTH):
            basis[size] = 0.0
            for i in range(slots):
                design = 1.0
                if c < UNKNOWNS - 1:
                    # the code's row of H, from L⁻¹ H
                    design = 0.0
                    for b in range(i + 1):
                        design += factor[i, b] * response[b, c]
                for a in range(m):
                    basis[size, a] += design * columns[block * slots + i, a]
            size = orthonormal(basis, size)
    for i in range(slots):
        if left_out[i] and i != but:
            size = _add_columns(basis, size, columns, i)
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def _add_columns(basis: Floats, size: int, columns: Floats, satellite: int) -> int:
    """Take both columns of a satellite into an orthonormal basis; its new size."""
    m = len(columns)
    for block in range(BOTH):
        if size < m:
            for a in range(m):
                basis[size, a] = columns[block * (m // BOTH) + satellite, a]
            size = orthonormal(basis, size)
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def squared_residual(basis: Floats, size: int, columns: Floats, satellite: int, whitened: Floats) -> float:
    """t² of a satellite against the others; 0 where these do not predict it.

    Args:
        basis: what the nuisances span, (m, m), by rows; those from ``size`` on are overwritten.
        size: of it.
        columns: those of L⁻¹, (m, m), by rows.
        satellite: its slot.
        whitened: w, (m,).
    """
    total = 0.0
    for row in range(size, _add_columns(basis, size, columns, satellite)):
        along = 0.0
        for a in range(len(whitened)):
            along += basis[row, a] * whitened[a]
        total += along * along
    return total
