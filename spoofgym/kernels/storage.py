"""Compiled code on disk: a file for each kernel, signature and processor, named by what the code is made of.

A file is written in one step and never changed, and holds a digest of its content, so a damaged file is as if it were
not there. Of several processes that need a kernel at the same time one compiles it (`turns`). Nothing that happens to
the files stops a program: it compiles.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from spoofgym.kernels import turns
from spoofgym.kernels.identity import identity, variant
from spoofgym.kernels.place import place
from spoofgym.patience import Compiling

SUFFIX = ".nbc"
COMPILING = Compiling("compiling kernels for this machine, half a minute or so; the next start finds them compiled")
UNUSED = 30 * 86400.0
"""Time after which code that no process has loaded is removed, s."""


class KernelStorage(_Cache):
    """The compiled code of one kernel, as numba asks for it."""

    def __init__(self, kernel: Dispatcher) -> None:
        """Nothing is read or written before the kernel is first called."""
        self._kernel = kernel
        self._name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}".replace("<", "").replace(">", "")
        self._enabled = True

    @property
    def cache_path(self) -> str | None:
        """The folder of the files."""
        folder = place()
        return None if folder is None else str(folder)

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """The code for a signature; None where there is none."""
        # as numba's own cache does before it asks for the processor
        target_context.refresh()
        file = self._file(sig, target_context.codegen())
        content = None if file is None else _read(file) or turns.take(file, lambda: _read(file))
        if content is None:
            COMPILING.begin()
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, unless it holds addresses of this process."""
        COMPILING.end()
        file = self._file(sig, data.codegen)
        if file is None:
            return
        with suppress(OSError):
            if not (data.lifted or data.library.has_dynamic_globals):
                _write(file, dumps(data._reduce()))
                self._remove_others(file)
                _remove_unused(file.parent)
        turns.end(file)

    def enable(self) -> None:
        """Load and save from now on."""
        self._enabled = True

    def disable(self) -> None:
        """Neither load nor save from now on."""
        self._enabled = False

    def flush(self) -> None:
        """Remove all files of this kernel."""
        folder = place()
        for file in [] if folder is None else folder.glob(f"{self._name}-*{SUFFIX}"):
            file.unlink(missing_ok=True)

    def _file(self, signature: Any, codegen: Any) -> Path | None:
        folder = place() if self._enabled else None
        if folder is None:
            return None
        made_of, variant_of = identity(self._kernel), variant(signature, codegen.magic_tuple())
        return folder / f"{self._name}-{made_of}-{variant_of}{SUFFIX}"

    def _remove_others(self, file: Path) -> None:
        """Remove the code of this kernel that was made of other sources."""
        made_of = file.stem.rsplit("-", 2)[1]
        for other in file.parent.glob(f"{self._name}-*{SUFFIX}"):
            if other.stem.rsplit("-", 2)[1] != made_of:
                other.unlink(missing_ok=True)


def _read(file: Path) -> bytes | None:
    """What `_write` has written; None where the file is missing or damaged."""
    try:
        whole = file.read_bytes()
    except OSError:
        return None
    digest, content = whole[:32], whole[32:]
    if hashlib.sha256(content).digest() != digest:
        return None
    with suppress(OSError):
        os.utime(file)  # it was used
    return content


def _write(file: Path, content: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, draft = tempfile.mkstemp(suffix=".draft", dir=file.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(hashlib.sha256(content).digest() + content)
        Path(draft).replace(file)
    except OSError:
        Path(draft).unlink(missing_ok=True)
        raise


@functools.cache
def _remove_unused(folder: Path) -> None:
    """Once in a process: remove what no process has used for long, of other versions, too."""
    oldest = time.time() - UNUSED
    for file in folder.parent.glob("*/*"):
        with suppress(OSError):
            if file.suffix in (SUFFIX, turns.SUFFIX, ".draft") and file.stat().st_mtime < oldest:
                file.unlink()
