"""The folder in which compiled code is kept: the first that can be written.

1. in ``$NUMBA_CACHE_DIR``, where it is set,
2. in ``__pycache__`` beside the sources of the package,
3. in `cache_folder`,
4. in the folder for temporary files, with a warning. Only a folder that belongs to the user and is closed to all others
   is taken there: compiled code is run as it is found.

In all but the second, each copy of the package has a folder of its own.
"""

from __future__ import annotations

import functools
import hashlib
import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np

from spoofgym import cache_folder

PACKAGE = Path(__file__).resolve().parent.parent
TAG = f"{sys.implementation.cache_tag}-numba-{numba.__version__}-numpy-{np.__version__}"
"""Code of other versions lies beside."""


@functools.cache
def place() -> Path | None:
    """Where this process keeps compiled code; None, with a warning, where nothing can be written."""
    for folder in _folders():
        if _writable(folder):
            return folder
    temporary = _temporary()
    if temporary is None:
        _warn("Compiled code is not kept, and each start takes long, because no folder for it can be written")
    else:
        _warn(f"Compiled code is kept in {temporary}, because no other folder for it can be written")
    return temporary


def _folders() -> Iterator[Path]:
    given: str = getattr(numba.config, "CACHE_DIR", "")  # $NUMBA_CACHE_DIR, unless the program has set it
    if given:
        yield Path(given).absolute() / _of_this_copy()
    yield PACKAGE / "__pycache__" / "kernels" / TAG
    cache = cache_folder.folder()
    if cache is not None:
        yield cache.absolute() / "kernels" / _of_this_copy()


def _of_this_copy() -> Path:
    return Path(f"{PACKAGE.name}-{hashlib.sha256(os.fsencode(PACKAGE)).hexdigest()[:16]}", TAG)


def _writable(folder: Path) -> bool:
    """Whether a file can be made in the folder; the folder is made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _temporary() -> Path | None:
    """A folder of the user's own among the temporary files; None where there is none that nobody else can write."""
    try:
        above = Path(tempfile.gettempdir())
        owner = os.geteuid() if hasattr(os, "geteuid") else None
        folder = above / ("spoofgym-kernels" if owner is None else f"spoofgym-kernels-{owner}")
        folder.mkdir(mode=0o700, exist_ok=True)
        if owner is not None and not (_private(folder, owner) and _fixed(above, owner)):
            return None
    except OSError:
        return None
    return folder if _writable(folder := folder / _of_this_copy()) else None


def _private(folder: Path, owner: int) -> bool:
    """Whether it is a folder, no link to one, of this owner and closed to all others."""
    status = folder.lstat()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == owner and not status.st_mode & 0o077


def _fixed(above: Path, owner: int) -> bool:
    """Whether nobody but the owner, and root, can put another folder in the place of one in this folder."""
    status = above.stat()
    return bool(status.st_mode & stat.S_ISVTX or (status.st_uid in (0, owner) and not status.st_mode & 0o022))


def _warn(what: str) -> None:
    # without a line number, so that no line of source is printed below
    text = f"{what}. Set SPOOFGYM_CACHE to a folder of your own."
    warnings.warn_explicit(text, UserWarning, __name__, 0, module=__name__)
