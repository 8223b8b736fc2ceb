"""The warning about a recorded log that can be used, but hardly as it is."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any


class LogWarning(UserWarning):
    """A recorded log seems to be wrong, or part of it is left out."""


_SHOWN: dict[str, dict[Any, Any]] = {}
"""By folder, what `warnings` keeps to show a warning once."""


def warn(folder: Path, text: str, line: int = 1) -> None:
    """Warn once of a fault of a log; by default programs show it as one line, which begins with the folder.

    Args:
        folder: of the log.
        text: names the file.
        line: of that file.
    """
    shown = _SHOWN.setdefault(str(folder), {})
    warnings.warn_explicit(text, LogWarning, str(folder), line, "spoofgym.scenarios", shown)
