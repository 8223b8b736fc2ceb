"""What a worker of an engine computes to be measured. It imports nothing of the package: a worker begins with that."""

import time
from typing import Any


def seconds(store: Any, spoofer: str, defender: str) -> float:
    """Seconds of the processor that this process has taken when the cell is played.

    Args:
        store: the `spoofgym.evaluation.cell_store.CellStore` that keeps it.
        spoofer: its specification.
        defender: its specification.
    """
    store.cell(spoofer, defender)
    return time.process_time()
