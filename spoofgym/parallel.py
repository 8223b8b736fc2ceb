"""Slices of runs in a thread pool: the kernels are serial and release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Runs


class RunSlices:
    """Calls a function on slices of the runs, one per thread.

    The pool is made when first needed, anew after a fork, and is never pickled. Results do not depend on the number of
    threads, because no run's arithmetic depends on another's.
    """

    def __init__(self, threads: int = 1) -> None:
        """Use up to ``threads`` threads.

        Raises:
            ValueError: ``threads`` is no whole number from 1 to 1024.
        """
        self.threads = validation.threads("slices of runs", threads)
        self._pool: ThreadPoolExecutor | None = None
        self._process: int | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"threads": self.threads}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    def call(self, function: Callable[[Runs], object], runs: Runs, grain: int) -> None:
        """Run ``function`` on slices of ``runs``; return, or raise, when every slice has come to its end.

        Args:
            function: takes the slice's runs, writes its results in place.
            runs: indices, (n,).
            grain: runs below which a slice is not worth a thread.

        Raises:
            Exception: what ``function`` raised, of the first slice that did.
        """
        slices = min(self.threads, max(1, len(runs) // grain))
        if slices == 1:
            function(runs)
            return
        if self._pool is None or self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(self.threads - 1), os.getpid()
        first, *others = np.array_split(runs, slices)
        futures = [self._pool.submit(function, part) for part in others]
        try:
            function(first)
        finally:
            wait(futures)  # a slice that still writes would spoil what the caller does after an error
        for future in futures:
            future.result()
