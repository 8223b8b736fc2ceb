"""One try, and whether it keeps the promise: played without a warning, or refused by name."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

REFUSED = (ValueError, TypeError)


@dataclass(frozen=True)
class Try:
    """One try.

    Attributes:
        words: what was done, to do it again.
        owners: one of these, and
        arguments: one of these must stand in the message of a refusal.
        build: makes the thing.
        play: plays it.
    """

    words: str
    owners: tuple[str, ...]
    arguments: tuple[str, ...]
    build: Callable[[], Any]
    play: Callable[[Any], None]


def broken_promise(attempt: Try) -> str | None:
    """What is wrong with a try, if anything is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            attempt.play(attempt.build())
    except REFUSED as error:
        message = str(error)
        if _names(message, attempt.owners) and _names(message, attempt.arguments):
            return None
        wanted = f"{attempt.owners} and {attempt.arguments}"
        return f"{attempt.words}: {type(error).__name__} that does not name {wanted}: {message[:300]}"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return f"{attempt.words}: {type(error).__name__}: {str(error)[:300]}"
    return None


def _names(message: str, names: tuple[str, ...]) -> bool:
    return any(re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", message) for name in names)
