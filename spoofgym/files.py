"""Files that are written whole or not at all, to destinations that are checked before the work begins.

A reader never meets half a file: the content goes into a draft in the same folder, which takes the name of the file in
one step. A kill at any moment leaves the old content or the new one, and at most a draft.
"""

from __future__ import annotations

import io
import json
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

DRAFT = ".draft"
PICTURES = (".png", ".svg", ".pdf")


def check_file(path: str | Path) -> None:
    """Refuse a place where no file can be written; nothing is left there.

    Raises:
        ValueError: it is a folder, lies in none that exists or can be made, or cannot be written.
    """
    path = Path(path)
    try:
        mode = _mode(path)
        if mode is not None and stat.S_ISDIR(mode):
            raise ValueError(f"{path} is a folder, a file is meant")
        if mode is not None and not os.access(path, os.W_OK):
            raise ValueError(f"{path} cannot be written: permission denied")
        if mode is None or stat.S_ISREG(mode):
            _probe(Path(os.path.realpath(path)).parent)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror or error}") from error


def check_folder(path: str | Path) -> None:
    """Refuse a place that is no folder where files can be written and cannot be made one; nothing is left there.

    Raises:
        ValueError: naming the place and the reason.
    """
    path = Path(path)
    try:
        mode = _mode(path)
        if mode is not None and not stat.S_ISDIR(mode):
            raise ValueError(f"{path} is a file, a folder is meant")
        _probe(path)
    except OSError as error:
        raise ValueError(f"{path}: nothing can be written there: {error.strerror or error}") from error


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a file whole or not at all; its folder is made where there is none.

    A link is followed. A device or a pipe is written to as it is.

    Raises:
        OSError: naming the file; what was there before is still there.
    """
    path = Path(path)
    try:
        mode = _mode(path)
        if mode is not None and not stat.S_ISREG(mode):
            path.write_bytes(content)
            return
        target = Path(os.path.realpath(path))
        target.parent.mkdir(parents=True, exist_ok=True)
        _replace(target, content)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def write_text(path: str | Path, content: str) -> None:
    """Write a text file (UTF-8) as `write_bytes`."""
    write_bytes(path, content.encode())


def write_json(path: str | Path, content: Any) -> None:
    """Write a JSON file as `write_bytes`.

    Raises:
        ValueError: a number that is not finite, which JSON does not have.
    """
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_figure(path: str | Path, figure: Any) -> None:
    """Write a Matplotlib figure, in the format that the ending of the name says, as `write_bytes`."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format=Path(path).suffix[1:].lower())
    write_bytes(path, drawn.getvalue())


def remove_drafts(folder: Path) -> None:
    """Remove what a kill has left of files that were being written into a folder."""
    for draft in folder.glob(f".*{DRAFT}"):
        with suppress(OSError):
            draft.unlink()


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Whatever a damaged file makes its reader raise becomes one error that names the file.

    Raises:
        ValueError: naming the file and the reason.
    """
    try:
        yield
    except Exception as error:
        words = " ".join(str(error).split())
        raise ValueError(f"{path} is damaged: {words or type(error).__name__}") from error


def _mode(path: Path) -> int | None:
    """The type of what a name leads to; None where there is nothing yet.

    Raises:
        OSError: the name is too long, or cannot be looked up.
    """
    try:
        return os.stat(path).st_mode
    except FileNotFoundError:
        return None


def _probe(folder: Path) -> None:
    """Write a block into a folder, or into the nearest one above it that exists, and leave nothing.

    Raises:
        OSError: that is no folder, read-only, or full.
    """
    place = folder
    while not os.path.lexists(place):
        place = place.parent
    with tempfile.TemporaryFile(dir=place) as file:
        file.write(bytes(io.DEFAULT_BUFFER_SIZE))


def _replace(target: Path, content: bytes) -> None:
    draft = target.with_name(f".{secrets.token_hex(8)}{DRAFT}")
    try:
        with draft.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, draft)
        os.replace(draft, target)
    except BaseException:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise
