"""Who compiles a kernel: of several processes that need it at the same time, one compiles and the others wait for it.

A turn is a lock on a file beside the compiled code. The operating system releases it when its process ends, however it
ends. A process never waits longer than `LONGEST_WAIT`: it then compiles the kernel itself.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import filelock

SUFFIX = ".lock"
LONGEST_WAIT = 60.0
"""Several times what the largest kernel takes to compile, s."""

Found = TypeVar("Found")
_held: dict[Path, filelock.BaseFileLock] = {}


def take(file: Path, look: Callable[[], Found | None]) -> Found | None:
    """Wait for this process's turn to compile a kernel.

    Args:
        file: that the compiled code is kept in.
        look: reads the file.

    Returns:
        What another process has compiled meanwhile; None where it is this process's turn.
    """
    import filelock  # takes as long as the rest of this room together, and most programs compile nothing

    if file in _held:
        return look()
    lock = filelock.FileLock(file.with_suffix(SUFFIX), timeout=LONGEST_WAIT)
    try:
        lock.acquire()
    except (OSError, NotImplementedError, filelock.Timeout):
        return look()  # this folder has no locks, or another process is stuck
    _held[file] = lock
    found = look()
    if found is not None:
        end(file)
    return found


def end(file: Path) -> None:
    """End the turn, if this process has it: the code is on disk, or will never be."""
    lock = _held.pop(file, None)
    if lock is not None:
        with suppress(OSError):
            Path(lock.lock_file).unlink(missing_ok=True)
            lock.release()
