"""Arrays of an ``.npz`` file that a stranger may have made: nothing is unpickled, and no header is believed.

NumPy reserves what the header of an array asks for before it looks whether the file has that much, and a small file
can unpack to any size. Here an array is no larger than its bytes, and all of them together than a limit.
"""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

from numpy.lib import format as npy
from numpy.typing import NDArray

from spoofgym import files

LARGEST = 64 * 2**20
"""Bytes that a file may unpack to by default."""
MEMBERS = 1000


def read_arrays(path: Path, largest: int = LARGEST) -> dict[str, NDArray[Any]]:
    """All arrays of a file by their names.

    Args:
        path: of the file.
        largest: bytes that it may unpack to.

    Raises:
        ValueError: it is damaged, unpacks to more, or holds objects.
    """
    with files.reading(path), zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > largest or len(members) > MEMBERS:
            raise ValueError(f"it unpacks to {size} bytes in {len(members)} parts, more than are read")
        return {member.filename.removesuffix(".npy"): _array(archive.read(member)) for member in members}


def _array(content: bytes) -> NDArray[Any]:
    """One array in NumPy's format.

    Raises:
        ValueError: its header does not fit its bytes.
    """
    file = io.BytesIO(content)
    version = npy.read_magic(file)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read_header(file)
    if dtype.hasobject:
        raise ValueError("it holds objects, which are never loaded (allow_pickle=False)")
    if math.prod(shape) * dtype.itemsize != len(content) - file.tell():
        raise ValueError(f"an array of shape {shape} does not fit its {len(content) - file.tell()} bytes")
    file.seek(0)
    return npy.read_array(file, allow_pickle=False)
