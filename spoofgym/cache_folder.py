"""The folder in which spoofgym keeps what it can compute again: ``$SPOOFGYM_CACHE``, or one in the user's cache."""

from __future__ import annotations

import os
from pathlib import Path


def folder() -> Path | None:
    """``$SPOOFGYM_CACHE``, else ``$XDG_CACHE_HOME/spoofgym``, else ``~/.cache/spoofgym``.

    The folder need not exist. None where none of them is named: a home that does not exist is not made.
    """
    if given := os.environ.get("SPOOFGYM_CACHE"):
        return Path(given)
    if given := os.environ.get("XDG_CACHE_HOME"):
        return Path(given) / "spoofgym"
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home / ".cache" / "spoofgym" if home.is_dir() else None
