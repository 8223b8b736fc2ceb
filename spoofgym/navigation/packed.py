"""Symmetric matrices packed as their lower triangle, by rows: half the memory for histories of covariances."""

from __future__ import annotations

from spoofgym.arrays import Floats
from spoofgym.kernels import njit


def packed_size(n: int) -> int:
    """Entries of the lower triangle of an (n, n) matrix."""
    return n * (n + 1) // 2


@njit(cache=True, nogil=True, error_model="numpy")
def pack(matrix: Floats, packed: Floats) -> None:
    """Write the lower triangle of a matrix (n, n) to ``packed`` (n (n + 1) / 2,)."""
    place = 0
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            packed[place] = matrix[i, j]
            place += 1


@njit(cache=True, nogil=True, error_model="numpy")
def unpack(packed: Floats, matrix: Floats) -> None:
    """The inverse of `pack`: overwrite both triangles of the matrix."""
    place = 0
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            matrix[i, j] = packed[place]
            matrix[j, i] = packed[place]
            place += 1
