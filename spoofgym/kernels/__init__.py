"""Compiled functions: numba's `njit`, whose compiled code never goes stale.

numba's own cache looks at the file of a kernel alone, but compiles the kernels and constants of other files into it.
Here compiled code is kept under the name of everything that went into it (`identity`), in a folder that can be written
(`place`), a file for each kernel, signature and processor (`storage`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from spoofgym.kernels.storage import KernelStorage


def njit(*, cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that compiles a function at its first call, as `numba.njit` does.

    Args:
        cache: whether compiled code is kept on disk.
        options: of `numba.njit`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        # without the wrapper by which numba passes a function as a value, which no kernel does: it compiles slowly
        kernel: Any = numba.njit(**{"no_cfunc_wrapper": True, **options})(function)
        # with NUMBA_DISABLE_JIT it is the function itself
        if cache and kernel is not function:
            kernel._cache = KernelStorage(kernel)
        return kernel

    return decorate
