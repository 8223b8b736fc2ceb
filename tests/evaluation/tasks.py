"""Tasks for engines. They import nothing of the package, so that each worker that is begun is there at once."""

import os
import signal
from pathlib import Path


def square(number: int) -> int:
    return number * number


def refuse(number: int) -> int:
    raise ValueError(f"{number} is refused")


def keep(path: str) -> str:
    Path(path).touch()
    return path


def die_once(path: str) -> int:
    """The worker dies at the first call and lives at the second."""
    if not Path(path).exists():
        Path(path).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 7


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
