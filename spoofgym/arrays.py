"""Names of the array types; a leading axis of runs (N,) is understood everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Runs = NDArray[np.int64]
Flags = NDArray[np.bool_]
