"""A short drive that the tests write in every format that can be imported, and what must come back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from spoofgym.logs.importers.recording import Options, Recording
from spoofgym.logs.importers.registry import importer_of, read_source
from spoofgym.logs.importers.tidy import tidy
from spoofgym.logs.importers.writer import write_log
from spoofgym.logs.log import Log, read_log
from spoofgym.trajectory import Accelerate, Straight, Turn, fly

DATA = Path(__file__).parents[4] / "shared" / "data"
ABSENT = "../shared/data, real logs for tests, is absent"
FRD = [1, 0, 2]
"""Forward, right, down of right, forward, up; north, east, down of east, north, up; less the sign of the last."""
SIGN = np.array([1.0, 1.0, -1.0])
RATE = 50
EVERY = 10
"""Steps from one fix to the next."""


@dataclass(frozen=True)
class Drive:
    """Samples and fixes.

    Attributes:
        time: of the samples from 0 on, (n,), s.
        rate: forward, right, down, (n, 3), rad/s.
        force: forward, right, down, (n, 3), m/s².
        fix_time: (f,), s.
        place: latitude and longitude in degrees, height in m, (f, 3).
        velocity: north, east, down, (f, 3), m/s.
    """

    time: np.ndarray
    rate: np.ndarray
    force: np.ndarray
    fix_time: np.ndarray
    place: np.ndarray
    velocity: np.ndarray

    @property
    def speed(self) -> np.ndarray:
        """Over ground, (f,), m/s."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])

    @property
    def course(self) -> np.ndarray:
        """Clockwise from north, (f,), degrees."""
        return np.degrees(np.arctan2(self.velocity[:, 1], self.velocity[:, 0])) % 360.0


@cache
def drive() -> Drive:
    """20 s of a car in Zürich: straight on, a turn to the right, faster."""
    truth = fly(
        [Straight(6.0), Turn(np.radians(80.0), 8.0), Accelerate(1.0, 6.0)],
        position=(np.radians(47.4), np.radians(8.55), 450.0),
        speed=10.0,
        heading=0.6,
        rate=RATE,
    )
    index = np.arange(EVERY, truth.num_steps, EVERY)
    place = truth.position[index].copy()
    place[:, :2] = np.degrees(place[:, :2])
    return Drive(
        time=truth.time[:-1] + 0.5 / RATE,
        rate=truth.angular_rate[:, FRD] * SIGN,
        force=truth.specific_force[:, FRD] * SIGN,
        fix_time=truth.time[index],
        place=place,
        velocity=truth.velocity[index][:, FRD] * SIGN,
    )


def imported(
    source: Path, folder: Path, options: Options | None = None, axes: str | None = None
) -> tuple[Recording, Log]:
    """What the importer that recognises a source makes of it, written and read again."""
    recording = read_source(source, importer_of(source), options or Options())
    if axes is not None:
        recording.axes = axes
    tidy(recording, None, None)
    write_log(recording, folder, "test")
    return recording, read_log(folder)


def check(log: Log, start: float, *, sample: float = 1e-6, place: float = 1e-8, velocity: float = 1e-3) -> None:
    """The log is the drive, within the resolution of a format.

    Args:
        log: that was read.
        start: its time at the drive's 0, s.
        sample: rad/s and m/s².
        place: degrees; of the height a million times as much in m.
        velocity: m/s.
    """
    true = drive()
    assert len(log.imu_time) == len(true.time)
    np.testing.assert_allclose(log.imu_time - start, true.time, atol=2e-6)
    np.testing.assert_allclose(log.angular_rate[:, FRD] * SIGN, true.rate, atol=sample)
    np.testing.assert_allclose(log.specific_force[:, FRD] * SIGN, true.force, atol=sample)
    check_fixes(log, start, place=place, velocity=velocity)


def check_fixes(log: Log, start: float, *, place: float = 1e-8, velocity: float | None = 1e-3) -> None:
    """The fixes of the log are those of the drive; velocity None = the log has none."""
    true = drive()
    np.testing.assert_allclose(log.fixes.time - start, true.fix_time, atol=2e-6)
    np.testing.assert_allclose(np.degrees(log.fixes.position[:, :2]), true.place[:, :2], atol=place)
    np.testing.assert_allclose(log.fixes.position[:, 2], true.place[:, 2], atol=1e6 * place)
    if velocity is None:
        assert log.fixes.velocity is None
    else:
        assert log.fixes.velocity is not None
        np.testing.assert_allclose(log.fixes.velocity[:, FRD] * SIGN, true.velocity, atol=velocity)
