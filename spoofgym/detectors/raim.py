"""Receiver autonomous integrity monitoring on innovations: a test whether the code ranges of one epoch agree.

The code innovations z of S satellites have the covariance S_c, a block of the innovation covariance. A position error d
and a clock error b change them by G (d, b) with G = [-e, 1]. Generalised least squares of these four unknowns leave the
residual

    r = z - G (G'S_c⁻¹G)⁻¹ G'S_c⁻¹ z,      r'S_c⁻¹ r ~ chi-square with S - 4 degrees of freedom

under a matched filter. The residual does not depend on the filter's estimate of position and clock, or on their
covariance. It is the residual of a fix that a receiver computes by itself with the filter's knowledge of the other
errors. L is lower triangular and the code comes first, so the first S components of w = L⁻¹ z are the code whitened by
S_c.
"""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs, read_only
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import DEFAULT_P_FA, at_all_degrees, nominal_p_fa, quantile
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.facts import RANGES, FilterFacts
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.specification import spell

UNKNOWNS = 4
"""Position and clock."""
EXPLAINED = 1e-9
"""Share of the square of a column that is rounding once the others are taken out."""


class Raim(Detector):
    """Alarm where position and clock do not explain the code ranges of one epoch: the residual test of RAIM.

    The statistic is r'S_c⁻¹ r of this module, chi-square with S - 4 degrees of freedom and independent from epoch to
    epoch, so that ARL0 = 1 / P_FA. S counts the satellites that are there; epochs with fewer than the slots are brought
    to the degrees of all slots (`at_all_degrees`), and it is 0 with four satellites or fewer.

    It sees a spoofer who has captured a part of the satellites, or whose ranges contradict each other. One who has
    captured all of them and moves them as one position and one clock leaves no residual, however far it goes: RAIM is
    blind to that. (What the filter takes for errors of the satellites adds a little from the second epoch on, less than
    a hundredth of the noise for a drag-off of 10 m/s; a jump of a kilometre shows.) A slow drag-off of a few satellites
    is learnt by the filter's states of these satellites before it shows. A satellite that a response leaves out is
    still tested here. Whitening with the filter's own S is ours; a receiver alone takes its own error budget.

    Args:
        threshold: compared with the statistic, no unit.
        p_fa: probability of a false alarm per epoch; 1e-5 with nothing given.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: more than one is given, or a value is out of range.
    """

    needs = (RANGES,)

    def __init__(
        self, threshold: float | None = None, p_fa: float | None = None, arl0: float | None = None
    ) -> None:
        validation.at_most_one("raim", threshold=threshold, p_fa=p_fa, arl0=arl0)
        self._given = None if threshold is None else validation.above("raim", "threshold", threshold)
        self._p_fa = None if p_fa is None else validation.probability("raim", "p_fa", p_fa)
        self.target_arl0 = None if arl0 is None else validation.average_run_length("raim", "arl0", arl0)
        self.threshold = self._given
        self._name = spell("raim", threshold=self._given, p_fa=self._p_fa, arl0=self.target_arl0)

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Set the threshold for ranges of ``dimension`` / 2 slots."""
        self._slots = dimension // 2
        self._most = max(self._slots - UNKNOWNS, 1)
        if not self.calibrated:
            p_fa = 1.0 / self.target_arl0 if self.target_arl0 else self._p_fa or DEFAULT_P_FA
            self.threshold = self._given or quantile(p_fa, self._most)
        self._nominal = nominal_p_fa(self.target_arl0, self.threshold, self._most)
        if not self.calibrated and self._nominal > 0.0:
            self.arl0 = 1.0 / self._nominal

    def know(self, facts: FilterFacts) -> None:
        """Check that there is something to test.

        Raises:
            ValueError: the filter has no more than four satellite slots.
        """
        if self._slots <= UNKNOWNS:
            raise ValueError(
                f"detector {self.name!r} needs five satellites or more, scenario {facts.scenario!r} has {self._slots}"
            )

    def update(self, epoch: Epoch) -> Floats:
        """The squared residual brought to the degrees of freedom of all slots, (N,)."""
        squares, degrees = residual_squares(epoch.innovation)
        if epoch.available is not None:
            squares = np.where(epoch.available, squares, 0.0)
        return at_all_degrees(squares, degrees, self._nominal, self._most)


def code_present(innovation: Innovation) -> Flags:
    """Which slots hold a satellite whose code is measured, (N, S).

    Raises:
        ValueError: the innovation is that of fixes.
    """
    if innovation.present is None:
        raise ValueError("these innovations are those of fixes, not of ranges to satellites")
    return innovation.present[:, : innovation.present.shape[1] // 2]


def residual_squares(innovation: Innovation) -> tuple[Floats, Runs]:
    """r'S_c⁻¹ r of the code ranges, (N,), and its degrees of freedom, (N,); both 0 with four satellites or fewer.

    Raises:
        ValueError: the innovation is that of fixes.
    """
    present = code_present(innovation)
    squares, degrees = np.empty(len(present)), np.empty(len(present), dtype=np.int64)
    covariance, response = innovation.covariance, innovation.response
    # one epoch of a filter with shared gains is the same matrix for all runs
    shared = covariance.strides[0] == 0 and response.strides[0] == 0
    if shared:
        covariance, response = covariance[:1], response[:1]
    matrices = read_only(covariance), read_only(response)
    _square_residuals(*matrices, innovation.whitened, np.ascontiguousarray(present), shared, squares, degrees)
    return squares, degrees


@njit(cache=True, nogil=True, error_model="numpy")
def _square_residuals(
    covariance: Floats,
    response: Floats,
    whitened: Floats,
    present: Flags,
    shared: bool,
    squares: Floats,
    degrees: Runs,
) -> None:
    slots = present.shape[1]
    factor, columns = np.empty((slots, slots)), np.empty((slots, slots))
    basis, rest = np.empty((slots, slots)), np.empty(slots)
    size = int(np.int64(0))
    for run in range(len(squares)):
        if run == 0 or not shared:
            inverse_columns(covariance[run], present[run], factor, columns)
            size = _nuisance_basis(response[run], columns, basis)
        for a in range(slots):
            rest[a] = whitened[run, a]
        take_out(basis, size, rest)
        count, squares[run] = -UNKNOWNS, 0.0
        for a in range(slots):
            count += present[run, a]
            squares[run] += rest[a] ** 2
        degrees[run] = max(count, 0)
        if count <= 0:
            squares[run] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def inverse_columns(covariance: Floats, present: Flags, factor: Floats, columns: Floats) -> None:
    """The columns of L⁻¹ by rows: what each of the first n measurements does to w.

    Args:
        covariance: S, (m, m), of which the first n are read.
        present: which of them are there, (n,).
        factor: L, (n, n), overwritten.
        columns: of L⁻¹, (n, n), overwritten; zero for a measurement that is not there.
    """
    slots = len(present)
    kalman.cholesky(covariance[:slots, :slots], factor)
    for i in range(slots):
        for a in range(slots):
            if a < i or not present[i]:
                columns[i, a] = 0.0
                continue
            total = 1.0 if a == i else 0.0
            for b in range(i, a):
                total -= factor[a, b] * columns[i, b]
            columns[i, a] = total / factor[a, a]


@njit(cache=True, nogil=True, error_model="numpy")
def _nuisance_basis(response: Floats, columns: Floats, basis: Floats) -> int:
    """Orthonormal vectors that span what position and clock can do to w; their number.

    Args:
        response: L⁻¹ H on the position, (m, 3), of which the code's rows are read.
        columns: those of L⁻¹, (S, S), by rows.
        basis: by rows, (S, S), overwritten.
    """
    slots = len(columns)
    size = int(np.int64(0))  # numba compiles what it is given to again for a constant
    for c in range(min(UNKNOWNS, slots)):
        for a in range(slots):
            if c < UNKNOWNS - 1:
                basis[size, a] = response[a, c]
            else:
                basis[size, a] = 0.0
                for i in range(slots):
                    basis[size, a] += columns[i, a]
        size = orthonormal(basis, size)
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def orthonormal(basis: Floats, size: int) -> int:
    """Make row ``size`` orthonormal to those before it; their number, the same where nothing is left of it."""
    before = 0.0
    for a in range(basis.shape[1]):
        before += basis[size, a] ** 2
    # once more takes away what rounding has left of the others
    take_out(basis, size, basis[size])
    take_out(basis, size, basis[size])
    after = 0.0
    for a in range(basis.shape[1]):
        after += basis[size, a] ** 2
    if not after > EXPLAINED * before:
        return size
    scale = 1.0 / np.sqrt(after)
    for a in range(basis.shape[1]):
        basis[size, a] *= scale
    return size + 1


@njit(cache=True, nogil=True, error_model="numpy")
def take_out(basis: Floats, size: int, vector: Floats) -> None:
    """Take the components along the first ``size`` rows of an orthonormal basis out of a vector, in place."""
    for row in range(size):
        along = 0.0
        for a in range(len(vector)):
            along += basis[row, a] * vector[a]
        for a in range(len(vector)):
            vector[a] -= along * basis[row, a]
