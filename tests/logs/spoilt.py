"""A good log, which a test spoils, and the changes that spoil one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from spoofgym.geodesy import displace
from spoofgym.logs.log import (
    IMU_COLUMNS,
    POSITION_COLUMNS,
    POSITION_SIGMA_COLUMNS,
    VELOCITY_COLUMNS,
    VELOCITY_SIGMA_COLUMNS,
)
from tests.logs.importers.drive import FRD, SIGN

RATE = 25
Columns = dict[str, np.ndarray]
LATITUDE, LONGITUDE = 47.4, 8.55


@dataclass
class Files:
    """A log that is being spoilt.

    Attributes:
        tables: columns by file.
        notes: ``log.toml``.
        after: changes the folder when it is written.
    """

    tables: dict[str, Columns]
    notes: str = "imu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nstart_s = 1002.0\n"
    after: Callable[[Path], None] | None = None

    def write(self, folder: Path) -> Path:
        """Write it."""
        folder.mkdir()
        (folder / "log.toml").write_text(self.notes, encoding="utf-8")
        for name, table in self.tables.items():
            values = np.column_stack(list(table.values()))
            path = folder / f"{name}.csv"
            np.savetxt(path, values, delimiter=",", header=",".join(table), comments="", fmt="%.9f")
        if self.after is not None:
            self.after(folder)
        return folder


@cache
def _drive() -> dict[str, Columns]:
    """150 s of a level car with turns to both sides: fixes at 2 Hz with noise, the truth at 5 Hz as reference."""
    generator = np.random.default_rng(5)
    time = np.arange(0.0, 150.0, 1.0 / RATE)
    speed = 11.0 + 3.0 * np.sin(time / 6.0) + 1.5 * np.sin(time / 2.3)
    turns = 0.14 * np.sin(time / 4.0) + 0.1 * np.sin(time / 2.9 + 1.0) + 0.06 * np.sin(time / 1.7) + 0.02
    yaw = np.where(time > 8.0, turns, 0.0)
    course = 0.6 + np.concatenate([[0.0], np.cumsum(0.5 * (yaw[1:] + yaw[:-1]) / RATE)])
    climb = 0.8 * np.sin(time / 9.0)
    velocity = np.column_stack([speed * np.sin(course), speed * np.cos(course), climb])
    track = np.vstack([np.zeros(3), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) / RATE, axis=0)])
    origin = np.array([np.radians(LATITUDE), np.radians(LONGITUDE), 450.0])
    position = displace(origin, track)
    rates = np.column_stack([0.0 * yaw, 0.0 * yaw, yaw])
    up = 9.81 + np.gradient(climb, time)
    samples = np.hstack([rates, np.column_stack([np.gradient(speed, time), speed * yaw, -up])])
    samples += np.repeat([5e-4, 1e-2], 3) * generator.standard_normal(samples.shape)
    imu = np.column_stack([1000.0 + time, samples])

    def fixes(index: np.ndarray, sigma: float) -> np.ndarray:
        place = displace(position[index], sigma * generator.standard_normal((len(index), 3)))
        place[:, :2] = np.degrees(place[:, :2])
        noisy = velocity[index] + 0.1 * sigma * generator.standard_normal((len(index), 3))
        return np.column_stack([1000.0 + time[index], place, noisy[:, FRD] * SIGN])

    index = np.arange(RATE // 2, len(time) - 5, RATE // 2)
    columns = (*POSITION_COLUMNS, *VELOCITY_COLUMNS)
    gnss = dict(zip(columns, fixes(index, 0.7).T, strict=True))
    gnss |= {name: np.full(len(index), 0.7) for name in POSITION_SIGMA_COLUMNS}
    gnss |= {name: np.full(len(index), 0.1) for name in VELOCITY_SIGMA_COLUMNS}
    reference = dict(zip(columns, fixes(np.arange(0, len(time), RATE // 5), 0.0).T, strict=True))
    return {"imu": dict(zip(IMU_COLUMNS, imu.T, strict=True)), "gnss": gnss, "reference": reference}


def good() -> Files:
    """A log without a fault."""
    return Files({name: {key: values.copy() for key, values in table.items()} for name, table in _drive().items()})


Change = Callable[[Files], None]


def scaled(table: str, names: tuple[str, ...], factor: float) -> Change:
    def change(files: Files) -> None:
        for name in names:
            files.tables[table][name] = files.tables[table][name] * factor

    return change


def swapped(table: str, one: str, other: str) -> Change:
    def change(files: Files) -> None:
        columns = files.tables[table]
        columns[one], columns[other] = columns[other], columns[one]

    return change


def added(table: str, name: str, value: float, rows: slice = slice(None)) -> Change:
    def change(files: Files) -> None:
        files.tables[table][name][rows] += value

    return change


def put(table: str, values: dict[str, float], rows: slice) -> Change:
    def change(files: Files) -> None:
        for name, value in values.items():
            files.tables[table][name][rows] = value

    return change


def without(table: str, rows: slice) -> Change:
    def change(files: Files) -> None:
        for name, values in files.tables[table].items():
            files.tables[table][name] = np.delete(values, rows)

    return change


def doubled(table: str, row: int, *, backward: bool = False) -> Change:
    def change(files: Files) -> None:
        for name, values in files.tables[table].items():
            place = row - 3 if backward else row
            files.tables[table][name] = np.insert(values, row + 1, values[place])

    return change


def less(table: str, names: tuple[str, ...]) -> Change:
    def change(files: Files) -> None:
        for name in names:
            del files.tables[table][name]

    return change


def noted(old: str, new: str) -> Change:
    def change(files: Files) -> None:
        assert not old or old in files.notes
        files.notes = files.notes.replace(old, new) if old else new + "\n" + files.notes

    return change


def text(name: str, edit: Callable[[str], str]) -> Change:
    def change(files: Files) -> None:
        def after(folder: Path) -> None:
            path = folder / name
            path.write_bytes(edit(path.read_text(encoding="utf-8")).encode("utf-8"))

        files.after = after

    return change


def cell(whole: str, line: int, place: int, value: str) -> str:
    lines = [row.split(",") for row in whole.splitlines()]
    lines[line][place] = value
    return "\n".join(map(",".join, lines)) + "\n"


def both(*changes: Change) -> Change:
    def change(files: Files) -> None:
        for each in changes:
            each(files)

    return change


def rounded(table: str, names: tuple[str, ...], digits: int) -> Change:
    def change(files: Files) -> None:
        for name in names:
            files.tables[table][name] = np.round(files.tables[table][name], digits)

    return change


def single(table: str, names: tuple[str, ...]) -> Change:
    def change(files: Files) -> None:
        for name in names:
            files.tables[table][name] = files.tables[table][name].astype(np.float32).astype(np.float64)

    return change


def turned(angle: float) -> Change:
    """The mounting in ``log.toml`` turned about the vertical, degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return noted(
        "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        f"[[{c!r}, {-s!r}, 0], [{s!r}, {c!r}, 0], [0, 0, 1]]".replace("np.float64(", "").replace(")", ""),
    )


def column(name: str, values: Callable[[int], np.ndarray]) -> Change:
    def change(files: Files) -> None:
        files.tables["gnss"][name] = values(len(files.tables["gnss"]["t_s"]))

    return change
