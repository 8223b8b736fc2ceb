"""Damaged sources: whatever bytes a stranger sends, the answer is a log or one line, and nothing is left behind."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.importers.recording import Options
from spoofgym.logs.importers.registry import importer_of, read_source
from spoofgym.logs.importers.tidy import tidy
from spoofgym.logs.importers.writer import write_log
from tests.logs.importers import test_dataflash as dataflash
from tests.logs.importers import test_folders as folders
from tests.logs.importers import test_gnsslogger as gnsslogger
from tests.logs.importers import test_mapped_csv as mapped_csv

TIMES = 12


def one(name: str, content: Callable[[], bytes]) -> Callable[[Path], tuple[Path, Path]]:
    """A source that is a file."""

    def make(folder: Path) -> tuple[Path, Path]:
        (folder / name).write_bytes(content())
        return folder / name, folder / name

    return make


def ulog() -> bytes:
    pytest.importorskip("pyulog")
    from tests.logs.importers.test_px4_ulog import ulog as make

    return make(new=True)


def bag(folder: Path) -> tuple[Path, Path]:
    pytest.importorskip("rosbags")
    from tests.logs.importers.test_ros_bag import bag as make

    path = make(folder / "drive.bag", True)
    return path, path


SOURCES: dict[str, Callable[[Path], tuple[Path, Path]]] = {
    "ulog": one("flight.ulg", ulog),
    "dataflash": one("flight.bin", lambda: dataflash.binary(dataflash.rows())),
    "dataflash text": one("flight.log", lambda: dataflash.text(dataflash.rows()).encode()),
    "gnsslogger": one("phone.txt", lambda: gnsslogger.text([gnsslogger.raw_line(10**9 * k) for k in (1, 2)]).encode()),
    "ros": bag,
    "ubx": lambda folder: (folders.receiver(folder / "ubx"), folder / "ubx" / "drive.ubx"),
    "comma2k19": lambda folder: (
        folders.comma(folder / "segment"),
        folder / "segment" / "processed_log" / "IMU" / "gyro" / "value",
    ),
    "kitti": lambda folder: (folders.kitti(folder / "drive"), folder / "drive" / "oxts" / "timestamps.txt"),
    "csv": lambda folder: (mapped_csv.write(folder / "raw"), folder / "raw" / "gps.txt"),
    "mapping": lambda folder: (mapped_csv.write(folder / "raw"), folder / "raw" / "mapping.toml"),
}
"""By name: what makes a source, and which of its files is damaged."""


def damaged(content: bytes, generator: np.random.Generator) -> bytes:
    """Cut, or with bytes changed, put in or taken out, more often near the beginning, where lengths and counts are."""
    data = bytearray(content)
    for _ in range(generator.integers(1, 20)):
        place = int(len(data) * generator.random() ** generator.integers(1, 5))
        kind = generator.integers(4)
        if kind == 0:
            data[place : place + 1] = bytes([generator.integers(256)])
        elif kind == 1:
            data[place : place + 4] = b"\xff\xff\xff\xff"
        elif kind == 2:
            del data[place : place + int(generator.integers(1, 9))]
        else:
            data[place:place] = generator.bytes(int(generator.integers(1, 9)))
    return bytes(data[: int(len(data) * generator.random())] if generator.random() < 0.2 else data)


@pytest.mark.parametrize("name", SOURCES)
def test_damage_is_a_log_or_a_line(tmp_path: Path, name: str) -> None:
    source, file = SOURCES[name](tmp_path)
    whole, generator = file.read_bytes(), np.random.default_rng(7)
    before = sorted(path.name for path in tmp_path.iterdir())
    for _ in range(TIMES):
        file.write_bytes(damaged(whole, generator))
        told = ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # of absurd numbers
                recording = read_source(source, importer_of(source), Options())
                tidy(recording, None, None)
                write_log(recording, tmp_path / "log", "damaged")
            shutil.rmtree(tmp_path / "log")
        except ValueError as error:
            told = str(error)
        assert len(told.splitlines()) <= 1
        assert sorted(path.name for path in tmp_path.iterdir()) == before
