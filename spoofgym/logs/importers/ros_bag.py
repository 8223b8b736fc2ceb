"""Bags of ROS 1 and ROS 2: Imu and NavSatFix, a velocity beside the fixes, magnetometer and barometer.

Messages are read by the definitions of rosbags: those in the bag, from which rosbags would make code, are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import MOST_ROWS, Columns, Options, Recording, check_size

MAGIC = b"#ROSBAG V2.0"
MISSING = 'ROS bags need rosbags: pip install "spoofgym[logs]"'
IMU, FIX = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"
TWISTS = ("geometry_msgs/msg/TwistWithCovarianceStamped", "geometry_msgs/msg/TwistStamped")
MAGNETOMETER, BAROMETER = "sensor_msgs/msg/MagneticField", "sensor_msgs/msg/FluidPressure"
NEAR = 0.011
"""Longest time between a fix and its velocity, s."""
UNKNOWN_COVARIANCE = 0
LARGEST_MESSAGE = 100_000
"""Bytes; those read here have a few hundred."""
UPRIGHT = 5.0
"""Least mean specific force along an axis that is vertical, m/s²."""


def recognises(path: Path) -> bool:
    """Whether the path is a bag of ROS 1, or the folder of one of ROS 2."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read(path: Path, options: Options) -> Recording:
    """Read a bag.

    Raises:
        ValueError: it is damaged, has no Imu or NavSatFix, or several of one and no topic was named.
        ImportError: rosbags is not installed.
    """
    recording = Recording(kind=f"ROS bag {path.name}", clock="of the headers: Unix time, s, unless a node sets another")
    with _opened(path) as (reader, decode):
        imu = _choose(path, reader, IMU, options.imu_topic, "--imu-topic")
        fix = _choose(path, reader, FIX, options.fix_topic, "--fix-topic")
        recording.remarks["topics"] = f"{imu.topic}, {fix.topic}"
        recording.tables["imu"] = _imu(_rows(path, reader, decode, imu))
        _add_fixes(recording, _rows(path, reader, decode, fix))
        for connection in reader.connections:
            if connection.msgtype in TWISTS and "vn_mps" not in recording.tables["gnss"]:
                _add_velocity(recording, connection, _rows(path, reader, decode, connection))
        _add_others(recording, path, reader, decode)
    _guess_axes(recording)
    return recording


Decode = Callable[[Any, str], Any]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Decode]]:
    """The reader of a bag and what decodes a message; whatever rosbags raises becomes one error that names the bag."""
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise ImportError(MISSING) from None
    for file in path.iterdir() if path.is_dir() else [path]:
        if file.is_file():
            check_size(file)
    if path.is_dir():
        decode: Decode = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr
    else:
        decode = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
    try:
        with (Reader2 if path.is_dir() else Reader1)(path) as reader:
            yield reader, decode
    except (ValueError, ImportError, OSError, KeyboardInterrupt):
        raise
    except Exception as error:
        words = " ".join(str(error).split())[:300] or type(error).__name__
        raise ValueError(f"{path}: rosbags cannot read it: {words}") from None


def _choose(path: Path, reader: Any, kind: str, topic: str | None, option: str) -> Any:
    """The connection of a topic, or the only one of a kind."""
    found = {connection.topic: connection for connection in reader.connections if connection.msgtype == kind}
    short = kind.split("/")[-1]
    names = ", ".join(sorted(found)) or "none"
    if topic is None and len(found) == 1:
        return next(iter(found.values()))
    if topic is None and found:
        raise ValueError(f"{path}: several topics have {short}: {names}; {option} chooses one")
    if topic is None:
        others = ", ".join(sorted({f"{each.topic} ({each.msgtype.split('/')[-1]})" for each in reader.connections}))
        raise ValueError(f"{path}: no topic has {short}; there are {others[:500] or 'none'}")
    if topic not in found:
        raise ValueError(f"{path}: no topic {topic!r} with {short}; there are: {names}")
    return found[topic]


def _rows(path: Path, reader: Any, decode: Decode, connection: Any) -> list[Any]:
    """The messages of a connection."""
    rows: list[Any] = []
    for number, (_, _, raw) in enumerate(reader.messages(connections=[connection])):
        if len(raw) > LARGEST_MESSAGE or number >= MOST_ROWS:
            raise ValueError(f"{path}: {connection.topic}, message {number}: {len(raw)} bytes, or too many messages")
        try:
            rows.append(decode(raw, connection.msgtype))
        except Exception as error:  # a damaged message may raise anything
            words = " ".join(str(error).split())[:200] or type(error).__name__
            raise ValueError(f"{path}: {connection.topic}, message {number} cannot be decoded: {words}") from None
    return rows


def _stamps(rows: list[Any]) -> Floats:
    return np.array([row.header.stamp.sec + 1e-9 * row.header.stamp.nanosec for row in rows])


def _imu(rows: list[Any]) -> Columns:
    rate = np.array([(r.angular_velocity.x, r.angular_velocity.y, r.angular_velocity.z) for r in rows]).reshape(-1, 3)
    force = np.array([(r.linear_acceleration.x, r.linear_acceleration.y, r.linear_acceleration.z) for r in rows])
    force = force.reshape(-1, 3)
    return {
        "t_s": _stamps(rows),
        **{f"g{axis}_radps": rate[:, k] for k, axis in enumerate("xyz")},
        **{f"a{axis}_mps2": force[:, k] for k, axis in enumerate("xyz")},
    }


def _add_fixes(recording: Recording, rows: list[Any]) -> None:
    good = [row for row in rows if row.status.status >= 0]
    if len(good) < len(rows):
        recording.problems.append(f"gnss: {len(rows) - len(good)} of {len(rows)} NavSatFix have no fix; left out")
    table: Columns = {
        "t_s": _stamps(good),
        "lat_deg": np.array([row.latitude for row in good]),
        "lon_deg": np.array([row.longitude for row in good]),
        "h_m": np.array([row.altitude for row in good]),
    }
    known = [row.position_covariance_type != UNKNOWN_COVARIANCE for row in good]
    if good and all(known):
        variance = np.array([np.asarray(row.position_covariance)[[4, 0, 8]] for row in good])
        sigma = np.sqrt(np.maximum(variance, 0.0))
        table |= {f"sd_{axis}_m": sigma[:, k] for k, axis in enumerate("ned")}
    elif any(known):
        recording.problems.append("gnss: the covariance is unknown in some fixes; sigmas are left out")
    recording.tables["gnss"] = table


def _add_velocity(recording: Recording, connection: Any, rows: list[Any]) -> None:
    """Velocity east, north, up of a topic whose times are those of the fixes, as receivers' drivers publish it."""
    fixes = recording.tables["gnss"]
    if len(rows) < 2 or not len(fixes["t_s"]):
        return
    stamps = _stamps(rows)
    order = np.argsort(stamps, kind="stable")
    stamps = stamps[order]
    place = np.clip(np.searchsorted(stamps, fixes["t_s"]), 1, len(stamps) - 1)
    place -= fixes["t_s"] - stamps[place - 1] < stamps[place] - fixes["t_s"]
    near = np.abs(stamps[place] - fixes["t_s"]) < NEAR
    if np.mean(near) < 0.9:
        return
    twist = [row.twist.twist if hasattr(row.twist, "twist") else row.twist for row in rows]
    linear = np.array([(each.linear.x, each.linear.y, each.linear.z) for each in twist])[order][place]
    for name, values in (("vn_mps", linear[:, 1]), ("ve_mps", linear[:, 0]), ("vd_mps", -linear[:, 2])):
        fixes[name] = np.where(near, values, np.nan)
    if connection.msgtype == TWISTS[0]:
        variance = np.array([np.asarray(row.twist.covariance)[[7, 0, 14]] for row in rows])[order][place]
        if np.all(variance > 0.0):
            fixes |= {f"sd_v{axis}_mps": np.sqrt(variance[:, k]) for k, axis in enumerate("ned")}
    recording.remarks["velocity"] = f"{connection.topic}, taken as east, north, up"


def _add_others(recording: Recording, path: Path, reader: Any, decode: Decode) -> None:
    for connection in reader.connections:
        if connection.msgtype == MAGNETOMETER and "magnetometer" not in recording.tables:
            rows = _rows(path, reader, decode, connection)
            field = {f"m{axis}_t": np.array([getattr(row.magnetic_field, axis) for row in rows]) for axis in "xyz"}
            recording.tables["magnetometer"] = {"t_s": _stamps(rows), **field}
        elif connection.msgtype == BAROMETER and "barometer" not in recording.tables:
            rows = _rows(path, reader, decode, connection)
            pressure = np.array([row.fluid_pressure for row in rows])
            recording.tables["barometer"] = {"t_s": _stamps(rows), "pressure_pa": pressure}


def _guess_axes(recording: Recording) -> None:
    """REP 103's forward, left, up where z points up; forward, right, down where it points down."""
    force = recording.tables["imu"]["az_mps2"]
    mean = float(np.nanmean(force)) if len(force) else 0.0
    recording.axes = "flu" if mean > UPRIGHT else "frd" if mean < -UPRIGHT else "unknown"
    if recording.axes != "unknown":
        recording.problems.append(
            f"imu: axes are taken as {recording.axes}, since z reads {mean:.1f} m/s²; a bag does not tell. --axes says "
            "otherwise, --axes unknown finds them from the drive"
        )
