"""PX4's ULog: inertial samples, fixes and what else its topics hold, by the field names of old and new releases."""

from __future__ import annotations

import contextlib
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import (
    Columns,
    Options,
    Recording,
    check_size,
    column,
    damaged,
    euler_angles,
)

MAGIC = b"ULog\x01\x12\x35"
MISSING = 'PX4 ULog files need pyulog: pip install "spoofgym[logs]"'
TOPICS = (
    *("sensor_combined", "vehicle_imu", "vehicle_gps_position", "sensor_gps", "vehicle_attitude"),
    *("vehicle_air_data", "vehicle_magnetometer", "vehicle_global_position", "wheel_encoders", "airspeed_validated"),
)
DEFINITIONS, DATA = b"BFIMPQ", b"ADRSOLC"
"""Kinds of messages before the data, and in them."""
MOST_FIELDS = 5000
"""Most numbers in a message, nested ones counted: those of PX4 have a few hundred."""
DEEPEST = 16
"""Most levels of nested messages."""
MICRO = 1e-6
OTHERS = {
    "barometer": ("vehicle_air_data", {"baro_m": "baro_alt_meter", "pressure_pa": "baro_pressure_pa"}),
    "magnetometer": ("vehicle_magnetometer", {f"m{a}_gauss": f"magnetometer_ga[{k}]" for k, a in enumerate("xyz")}),
    "airspeed": ("airspeed_validated", {"true_airspeed_mps": "true_airspeed_m_s"}),
    "wheels": ("wheel_encoders", {f"wheel_{k}_radps": f"wheel_speed[{k}]" for k in range(2)}),
    "solution": ("vehicle_global_position", {"lat_deg": "lat", "lon_deg": "lon", "h_m": "alt_ellipsoid"}),
}
"""Topics that only a reader of the log wants: table, topic, and its fields by column."""


def recognises(path: Path) -> bool:
    """Whether the file begins as an ULog."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read(path: Path, options: Options) -> Recording:
    """Read an ULog file.

    Raises:
        ValueError: it is damaged, or has no inertial samples or fixes.
        ImportError: pyulog is not installed.
    """
    del options
    log, told = _load(path)
    recording = Recording(
        kind=f"PX4 ULog {path.name}",
        clock="the autopilot's, since boot (simulators: Unix time)",
        axes="frd",
        problems=told,
    )
    if "ver_sw_release" in log.msg_info_dict or "sys_name" in log.msg_info_dict:
        words = (log.msg_info_dict.get(key, "") for key in ("sys_name", "ver_hw"))
        recording.remarks["vehicle"] = " ".join(map(str, words)).strip()
    _add_imu(recording, log, path)
    _add_fixes(recording, log, path)
    _add_lever_arm(recording, log.initial_parameters)
    _add_others(recording, log)
    if len(log.dropouts):
        lost = sum(dropout.duration for dropout in log.dropouts) / 1000.0
        recording.problems.append(f"the logger dropped {lost:.2f} s in {len(log.dropouts)} pieces")
    return recording


def _load(path: Path) -> tuple[Any, list[str]]:
    """The file by pyulog, once its definitions are known to be harmless, and what pyulog says of it."""
    try:
        import pyulog
    except ImportError:
        raise ImportError(MISSING) from None
    check_definitions(path)
    said, content = io.StringIO(), path.read_bytes()
    end = sound_end(content)
    try:
        with contextlib.redirect_stdout(said):
            log = pyulog.ULog(io.BytesIO(content[:end]), list(TOPICS))
    except Exception as error:  # pyulog raises whatever a damaged file leads to
        words = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{path}: pyulog cannot read it: {words}") from None
    told = list(dict.fromkeys(line.strip() for line in said.getvalue().splitlines() if line.strip()))
    if end < len(content):
        told.append(f"the file is damaged or cut at offset {end} of {len(content)}; what comes after it is left out")
    return log, told[:5]


def check_definitions(path: Path) -> None:
    """Walk the definitions of a file: every message lies in it, and no format unfolds into too many numbers.

    Raises:
        ValueError: naming file and offset.
    """
    size, formats, offset = check_size(path), {}, 16
    with path.open("rb") as file:
        if size < 16 or file.read(16)[:7] != MAGIC:
            raise damaged(path, 0, "no ULog header")
        while len(head := file.read(3)) == 3:
            length, kind = struct.unpack("<HB", head)
            if kind in DATA:
                break
            if kind not in DEFINITIONS:
                raise damaged(path, offset, f"a message of kind {kind} among the definitions")
            content = file.read(length)
            if len(content) < length:
                raise damaged(path, offset, f"a definition of {length} bytes goes beyond the end of the file")
            if kind == ord("F"):
                name, _, fields = content.decode("utf-8", "replace").partition(":")
                formats[name] = (offset, [entry.split(" ")[0] for entry in fields.split(";") if entry])
            offset += 3 + length
    counts: dict[str, int] = {}
    for name in formats:
        _count(path, name, formats, counts, 0)


def sound_end(content: bytes) -> int:
    """Where the first message is that goes beyond the end or is of no kind; the length where there is none.

    pyulog seeks a way through whatever follows, byte by byte, which can take for ever.
    """
    offset, kinds = 16, DEFINITIONS + DATA
    while offset + 3 <= len(content):
        length = content[offset] + 256 * content[offset + 1]
        if content[offset + 2] not in kinds or length == 0 or offset + 3 + length > len(content):
            return offset
        offset += 3 + length
    return offset if offset < len(content) else len(content)


def _count(path: Path, name: str, formats: dict[str, tuple[int, list[str]]], counts: dict[str, int], depth: int) -> int:
    """Numbers in a message, nested ones counted."""
    if name not in formats or name in counts:
        return counts.get(name, 1)
    offset, fields = formats[name]
    if depth > DEEPEST:
        raise damaged(path, offset, f"format {name!r:.100} is nested in itself or more than {DEEPEST} levels deep")
    total = 0
    for entry in fields:
        inner, _, rest = entry.partition("[")
        digits = rest.rstrip("]")
        times = int(digits) if digits.isdigit() and len(digits) < 9 else 1
        total += times * _count(path, inner, formats, counts, depth + 1)
        if total > MOST_FIELDS:
            raise damaged(path, offset, f"format {name!r:.100} has more than {MOST_FIELDS} numbers")
    counts[name] = total
    return total


def _topic(log: Any, *names: str) -> dict[str, Any] | None:
    """The instance with the most rows of the first of some topics that has any."""
    for name in names:
        found = [data.data for data in log.data_list if data.name == name and len(data.data.get("timestamp", ())) > 1]
        if found:
            best: dict[str, Any] = max(found, key=lambda data: len(data["timestamp"]))
            return best
    return None


def _time(topic: dict[str, Any]) -> Floats:
    """When a row was sampled, or, where that is not told, logged, s."""
    stamp = column(topic, "timestamp")
    sampled = column(topic, "timestamp_sample")
    assert stamp is not None
    if sampled is None:
        return stamp * MICRO
    return np.where((sampled > 0) & (np.abs(stamp - sampled) < 1e6), sampled, stamp) * MICRO


def _need(path: Path, topic: dict[str, Any], *names: str) -> Floats:
    values = column(topic, *names)
    if values is None:
        raise ValueError(f"{path}: a topic has no field {' or '.join(names)}; it has {', '.join(topic)[:300]}")
    return values


def _add_imu(recording: Recording, log: Any, path: Path) -> None:
    topic, table = _topic(log, "sensor_combined"), {}
    if topic is not None:
        half = 0.5 * MICRO * np.median(_need(path, topic, "gyro_integral_dt"))
        table["t_s"] = _time(topic) - half
        for axis, letter in enumerate("xyz"):
            table[f"g{letter}_radps"] = _need(path, topic, f"gyro_rad[{axis}]")
        for axis, letter in enumerate("xyz"):
            table[f"a{letter}_mps2"] = _need(path, topic, f"accelerometer_m_s2[{axis}]")
    elif (topic := _topic(log, "vehicle_imu")) is not None:
        turned = _need(path, topic, "delta_angle_dt") * MICRO
        moved = _need(path, topic, "delta_velocity_dt") * MICRO
        table["t_s"] = _time(topic) - 0.5 * turned
        with np.errstate(divide="ignore", invalid="ignore"):
            for axis, letter in enumerate("xyz"):
                table[f"g{letter}_radps"] = _need(path, topic, f"delta_angle[{axis}]") / turned
            for axis, letter in enumerate("xyz"):
                table[f"a{letter}_mps2"] = _need(path, topic, f"delta_velocity[{axis}]") / moved
    else:
        raise ValueError(f"{path}: neither sensor_combined nor vehicle_imu has samples")
    recording.tables["imu"] = table


def _add_fixes(recording: Recording, log: Any, path: Path) -> None:
    topic = _topic(log, "vehicle_gps_position", "sensor_gps")
    if topic is None:
        raise ValueError(f"{path}: neither vehicle_gps_position nor sensor_gps has fixes")
    told = _time(topic)
    fix = _need(path, topic, "fix_type") >= 3
    measured = column(topic, "time_utc_usec")
    if measured is not None and np.any(measured > 0):
        again = np.concatenate([[False], (np.diff(measured) == 0) & (measured[1:] > 0)])
        if again.any():
            recording.problems.append(f"gnss: {int(again.sum())} rows repeat the fix before, and are left out")
            fix &= ~again
    _tell_lost(recording, fix)
    degrees = "latitude_deg" in topic
    table = {
        "t_s": told,
        "lat_deg": _need(path, topic, "latitude_deg", "lat") * (1.0 if degrees else 1e-7),
        "lon_deg": _need(path, topic, "longitude_deg", "lon") * (1.0 if degrees else 1e-7),
        "h_m": _need(path, topic, "altitude_ellipsoid_m", "alt_ellipsoid") * (1.0 if degrees else 1e-3),
    }
    if np.all(_need(path, topic, "vel_ned_valid")[fix] > 0):
        for letter in "ned":
            table[f"v{letter}_mps"] = _need(path, topic, f"vel_{letter}_m_s")
    else:
        recording.problems.append("gnss: vel_ned_valid is not set in every fix; velocities are left out")
    horizontal, vertical = _need(path, topic, "eph"), _need(path, topic, "epv")
    table |= {"sd_n_m": horizontal, "sd_e_m": horizontal, "sd_d_m": vertical}
    if "vn_mps" in table:
        speed = _need(path, topic, "s_variance_m_s")
        table |= {"sd_vn_mps": speed, "sd_ve_mps": speed, "sd_vd_mps": speed}
    table["n_sat"] = _need(path, topic, "satellites_used")
    recording.tables["gnss"] = {name: values[fix] for name, values in table.items()}
    delay = float(log.initial_parameters.get("EKF2_GPS_DELAY", 0.0)) / 1000.0
    sampled = column(topic, "timestamp_sample")
    if 0.0 < delay < 1.0 and (sampled is None or not np.any(sampled > 0)):
        recording.settings["gnss_delay_s"] = round(delay, 4)
        recording.remarks["gnss_delay"] = "EKF2_GPS_DELAY: what the autopilot believed; fixes are stamped on arrival"


def _tell_lost(recording: Recording, fix: Any) -> None:
    lost = int(np.count_nonzero(~fix))
    if lost:
        recording.problems.append(f"gnss: {lost} of {len(fix)} rows are no 3D fix, or repeat one, and are left out")


def _add_lever_arm(recording: Recording, parameters: dict[str, Any]) -> None:
    antenna, imu = (
        np.array([float(parameters.get(f"EKF2_{part}_POS_{axis}", 0.0)) for axis in "XYZ"]) for part in ("GPS", "IMU")
    )
    arm = np.round(antenna - imu, 4).tolist()
    if any(arm):
        recording.settings["antenna_lever_arm_m"] = arm


def _add_others(recording: Recording, log: Any) -> None:
    """Attitude, air data, magnetometer and the autopilot's own solution, where they are logged."""
    if (topic := _topic(log, "vehicle_attitude")) is not None and "q[3]" in topic:
        quaternion = np.column_stack([topic[f"q[{k}]"] for k in range(4)]).astype(np.float64)
        roll, pitch, yaw = euler_angles(quaternion)
        recording.tables["attitude"] = {"t_s": _time(topic), "roll_rad": roll, "pitch_rad": pitch, "yaw_rad": yaw}
    for name, (topic_name, fields) in OTHERS.items():
        _add_other(recording, log, name, topic_name, fields)


def _add_other(recording: Recording, log: Any, name: str, topic: str, fields: dict[str, str]) -> None:
    data = _topic(log, topic)
    if data is not None and all(field in data for field in fields.values()):
        table: Columns = {"t_s": _time(data)}
        recording.tables[name] = table | {key: np.asarray(data[field], np.float64) for key, field in fields.items()}
