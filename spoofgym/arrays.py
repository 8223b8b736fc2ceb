"""Names of the array types; a leading axis of runs (N,) is understood everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Runs = NDArray[np.int64]
Flags = NDArray[np.bool_]


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written: numba compiles a kernel again for arrays that can."""
    view = array.view()
    view.flags.writeable = False
    return view


def take_runs(mine: Any, runs: Runs, theirs: Any) -> None:
    """Copy the memory of an object that serves n runs into one of the same class that serves more.

    Copied are array attributes whose leading axis is the runs, and attributes with a ``take(runs, other)``.

    Args:
        mine: the object that is changed.
        runs: where run j of ``theirs`` goes, (n,).
        theirs: the object that serves n runs.
    """
    for name, value in vars(mine).items():
        other = getattr(theirs, name, None)
        if value is other:
            continue
        if hasattr(value, "take") and not isinstance(value, np.ndarray):
            value.take(runs, other)
        elif isinstance(value, np.ndarray) and isinstance(other, np.ndarray) and value.ndim and len(other) == len(runs):
            value[runs] = other
