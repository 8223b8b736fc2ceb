"""Layers of a network, lane by lane: what a lane's policy does never depends on how many lanes play beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spoofgym.kernels import njit

Singles = NDArray[np.float32]


def affine(inputs: Singles, weight: Singles, bias: Singles) -> Singles:
    """One layer before its nonlinearity, W x + b, summed in the same order for every lane.

    A product by BLAS is not: its order depends on the number of rows.

    Args:
        inputs: x, (N, I).
        weight: W, (O, I).
        bias: b, (O,).

    Returns:
        (N, O).
    """
    outputs = np.empty((len(inputs), len(bias)), dtype=np.float32)
    _affine(np.ascontiguousarray(inputs), np.ascontiguousarray(weight.T), np.ascontiguousarray(bias), outputs)
    return outputs


@njit(cache=True, nogil=True)
def _affine(inputs: Singles, weight: Singles, bias: Singles, outputs: Singles) -> None:
    """Write the layer of inputs (N, I) with weights (I, O), transposed so that outputs are computed side by side."""
    for lane in range(inputs.shape[0]):
        for o in range(bias.shape[0]):
            outputs[lane, o] = bias[o]
        for i in range(inputs.shape[1]):
            for o in range(bias.shape[0]):
                outputs[lane, o] += inputs[lane, i] * weight[i, o]
