"""What a check has found wrong with a log, and what may be done about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One fault of a log.

    Attributes:
        severity: an error stops every command that uses the log; a warning is printed by it once; a note is printed by
            ``spoofgym check-log`` alone.
        file: of the log, such as ``gnss.csv``.
        text: what is wrong.
        advice: what to do; empty = nothing is known.
        line: of the file; None = it is not a matter of a line.
    """

    severity: Severity
    file: str
    text: str
    advice: str = ""
    line: int | None = None

    def __str__(self) -> str:
        """One line: file, line, what is wrong, what to do."""
        place = self.file if self.line is None else f"{self.file}, line {self.line}"
        return f"{place}: {self.text}{'; ' if self.advice else ''}{self.advice}"
