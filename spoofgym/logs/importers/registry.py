"""Which importers there are, and which one a source is for."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from spoofgym.logs.importers import (
    comma2k19,
    dataflash,
    gnsslogger,
    kitti,
    mapped_csv,
    px4_ulog,
    ros_bag,
    ubx,
)
from spoofgym.logs.importers.recording import Options, Recording


@dataclass(frozen=True)
class Importer:
    """One kind of source.

    Attributes:
        told: what it is, for people.
        recognises: whether a path that exists is one.
        read: reads it.
    """

    told: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path, Options], Recording]


FILES: dict[str, Importer] = {
    "ulog": Importer("PX4 ULog (.ulg)", px4_ulog.recognises, px4_ulog.read),
    "dataflash": Importer("ArduPilot DataFlash (.bin, .log)", dataflash.recognises, dataflash.read),
    "gnsslogger": Importer("Android GNSSLogger (.txt)", gnsslogger.recognises, gnsslogger.read),
    "ros": Importer("ROS 1 bag, or ROS 2 bag (a folder)", ros_bag.recognises, ros_bag.read),
    "ubx": Importer("u-blox UBX beside an imu.csv", ubx.recognises, ubx.read),
    "csv": Importer("CSV files by a mapping (.toml)", mapped_csv.recognises, mapped_csv.read),
}
"""Sources that are a file."""
FOLDERS: dict[str, Importer] = {
    "comma2k19": Importer("comma2k19 segment", comma2k19.recognises, comma2k19.read),
    "kitti": Importer("KITTI drive with oxts", kitti.recognises, kitti.read),
    "ros": FILES["ros"],
    "ubx": FILES["ubx"],
}
"""Sources that are a folder."""
IMPORTERS = FILES | FOLDERS


def importer_of(source: Path) -> str:
    """The name of the importer that a source is for.

    Raises:
        ValueError: it does not exist, or none knows it.
    """
    if not source.exists():
        raise ValueError(f"{source}: no such file or folder")
    candidates = FOLDERS if source.is_dir() else FILES
    for name, importer in candidates.items():
        if importer.recognises(source):
            return name
    known = "; ".join(f"{name}: {importer.told}" for name, importer in IMPORTERS.items())
    raise ValueError(f"{source}: no format is recognised; known are {known}; --format names one")


def read_source(source: Path, name: str | None, options: Options) -> Recording:
    """Read a source by the importer of this name, or by the one that recognises it.

    Raises:
        ValueError: what the importer refuses, or whatever else a damaged source leads to; the message names the source.
        ImportError: an optional package is not installed.
    """
    if not source.exists():
        raise ValueError(f"{source}: no such file or folder")
    if name is None:
        name = importer_of(source)
    try:
        return IMPORTERS[name].read(source, options)
    except KeyError as error:
        raise ValueError(f"{source}: a field that is needed is missing: {error}") from error
    except (IndexError, TypeError, OverflowError, struct.error, RecursionError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{source}: is damaged: {words}") from error
