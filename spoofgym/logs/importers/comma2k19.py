"""Segments of comma2k19: folders of NumPy arrays, times since boot.

Arrays are mapped into memory and never unpickled (the data set's own layout: commaai/comma2k19, README).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import ecef_to_enu_rotation, ecef_to_geodetic
from spoofgym.logs.importers.recording import (
    GPS_EPOCH_UNIX,
    LEAP_SECONDS,
    MOST_ROWS,
    Columns,
    Options,
    Recording,
    check_size,
    time_of_week,
    velocity_of_course,
)

LOG = "processed_log"
BOOT = "the device's, since boot"
GPS_TIME = "GPS time of week, s; the clock since boot was moved so that the fix that is logged soonest has no delay"
POSE = "global_pose"
MOST_DELAY = 10.0
"""Largest difference between the delays of two fixes on their way to the log, s."""
MILLISECONDS = 1e11
"""Larger times since 1970 are in milliseconds: segments differ."""


def recognises(path: Path) -> bool:
    """Whether the folder is a segment."""
    return (path / LOG / "IMU").is_dir() or (path / "IMU" / "accelerometer").is_dir()


def read(path: Path, options: Options) -> Recording:
    """Read a segment.

    Raises:
        ValueError: an array is missing or damaged, or has another shape than the data set's.
    """
    del options
    inner = path / LOG if (path / LOG).is_dir() else path
    recording = Recording(kind=f"comma2k19 segment {path.name}", clock=BOOT, axes="frd")
    time, rate = _series(inner / "IMU" / "gyro", 3)
    other, force = _series(inner / "IMU" / "accelerometer", 3)
    inside = (time >= other[0]) & (time <= other[-1])
    recording.tables["imu"] = {
        "t_s": time[inside],
        **{f"g{axis}_radps": rate[inside, k] for k, axis in enumerate("xyz")},
        **{f"a{axis}_mps2": np.interp(time[inside], other, force[:, k]) for k, axis in enumerate("xyz")},
    }
    _add_wheels(recording, inner)
    _add_pose(recording, path / POSE)
    _add_fixes(recording, inner)
    _add_ranges(recording, inner)
    return recording


def _to_gps_time(recording: Recording, shift: float) -> None:
    """Move all times since boot to GPS time of week, in which the ranges are."""
    recording.clock = GPS_TIME
    for table in recording.tables.values():
        table["t_s"] = table["t_s"] + shift


def _array(path: Path) -> np.ndarray[Any, Any]:
    """An array of numbers in a file, mapped: a header that lies about its size is an error, and no allocation."""
    check_size(path)
    try:
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError, SyntaxError, MemoryError, OverflowError) as error:
        raise ValueError(f"{path}, offset 0: no NumPy array: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu" or not 1 <= values.ndim <= 2:
        raise ValueError(f"{path}: must be an array of numbers with 1 or 2 dimensions")
    if len(values) > MOST_ROWS or values.size > 32 * MOST_ROWS:
        raise ValueError(f"{path}: has {len(values)} rows; valid are {MOST_ROWS} at most")
    return np.asarray(values, dtype=np.float64)


def _series(folder: Path, columns: int) -> tuple[Floats, Floats]:
    """Times (n,) and values (n, columns or more) of a signal.

    Raises:
        ValueError: they do not fit.
    """
    time, values = _array(folder / "t"), _array(folder / "value")
    values = values.reshape(len(values), -1)
    if time.ndim != 1 or len(time) != len(values) or values.shape[1] < columns or len(time) < 2:
        raise ValueError(
            f"{folder}: t has the shape {time.shape}, value {values.shape}; valid are (n,) and (n, {columns}), n > 1"
        )
    return time, values


def _add_fixes(recording: Recording, folder: Path) -> None:
    """u-blox's own fixes, or those of Qualcomm's receiver; the time of the fix is UTC less the least delay."""
    for name in ("live_gnss_ublox", "live_gnss_qcom"):
        if (folder / "GNSS" / name / "t").is_file():
            break
    else:
        raise ValueError(f"{folder / 'GNSS'}: neither live_gnss_ublox nor live_gnss_qcom is there")
    logged, values = _series(folder / "GNSS" / name, 6)
    latitude, longitude, speed, utc, height, course = values[:, :6].T
    utc = utc / 1000.0 if np.median(utc) > MILLISECONDS else utc
    delay = logged - utc
    if np.all(np.isfinite(delay)) and np.ptp(delay) < MOST_DELAY:
        gps = utc - GPS_EPOCH_UNIX + LEAP_SECONDS
        time = time_of_week(gps)
        _to_gps_time(recording, float(time[0] - gps[0] - GPS_EPOCH_UNIX + LEAP_SECONDS - np.min(delay)))
    else:
        time = logged
        recording.problems.append("gnss: UTC does not run with the clock since boot; fixes have their times of logging")
    north, east = velocity_of_course(speed, course)
    recording.tables["gnss"] = {
        **{"t_s": time, "lat_deg": latitude, "lon_deg": longitude, "h_m": height},
        **{"vn_mps": north, "ve_mps": east, "vd_mps": np.zeros(len(time))},
    }
    recording.remarks["gnss_receiver"] = f"{name}: no sigma; the vertical velocity is not measured"


def _add_ranges(recording: Recording, folder: Path) -> None:
    place = folder / "GNSS" / "raw_gnss_ublox"
    if not (place / "t").is_file():
        return
    _, values = _series(place, 8)
    gps = (values[:, 0] >= 1) & (values[:, 0] <= 32)
    names = ("svid", "week", "t_s", "gnss_id", "pseudorange_m", "pr_std", "range_rate_mps", "rr_std")
    table: Columns = {name: values[gps, k] for k, name in enumerate(names) if name not in ("week", "gnss_id")}
    table["cn0_dbhz"] = values[gps, 8] if values.shape[1] > 8 else np.full(int(gps.sum()), 45.0)
    if values.shape[1] <= 8:
        recording.problems.append("ranges: the source has no C/N0; cn0_dbhz is set to 45")
    recording.tables["ranges"] = table
    recording.problems.append("ranges: ephemeris.csv is missing: take it from a RINEX navigation file")


def _add_wheels(recording: Recording, folder: Path) -> None:
    place = folder / "CAN" / "wheel_speed"
    if (place / "t").is_file():
        time, values = _series(place, 4)
        names = ("front_left_mps", "front_right_mps", "rear_left_mps", "rear_right_mps")
        recording.tables["wheels"] = {"t_s": time} | {name: values[:, k] for k, name in enumerate(names)}


def _add_pose(recording: Recording, folder: Path) -> None:
    """The fused pose of the camera as a reference, in ECEF in the source."""
    if not (folder / "frame_times").is_file():
        return
    time, position, velocity = (_array(folder / f"frame_{name}") for name in ("times", "positions", "velocities"))
    if [time.shape, position.shape, velocity.shape] != [(len(time),), (len(time), 3), (len(time), 3)]:
        raise ValueError(f"{folder}: frame_times has the shape {time.shape}, the positions {position.shape}")
    geodetic = ecef_to_geodetic(position)
    enu = np.einsum("nij,nj->ni", ecef_to_enu_rotation(geodetic), velocity)
    recording.tables["reference"] = {
        "t_s": time,
        **{"lat_deg": np.degrees(geodetic[:, 0]), "lon_deg": np.degrees(geodetic[:, 1]), "h_m": geodetic[:, 2]},
        **{"vn_mps": enu[:, 1], "ve_mps": enu[:, 0], "vd_mps": -enu[:, 2]},
    }
    recording.remarks["reference_of"] = "INS, GNSS and vision of the same device: not independent"
