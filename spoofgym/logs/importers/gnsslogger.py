"""Android's GNSSLogger text: Fix, UncalAccel and UncalGyro lines, and ranges from the Raw lines.

A pseudorange is the time of reception less that of transmission; the former is the receiver's own clock with the bias
of the first epoch, so that it runs on without steps (European GNSS Agency, "Using GNSS Raw Measurements on Android
Devices", 2017, section 2.4).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import (
    GPS_EPOCH_UNIX,
    LEAP_SECONDS,
    MOST_ROWS,
    WEEK,
    C,
    Columns,
    Options,
    Recording,
    check_size,
    velocity_of_course,
)

KINDS = ("Raw", "Fix", "UncalAccel", "UncalGyro", "UncalMag", "OrientationDeg", "Pressure")
LONGEST = 10_000
"""Most characters of a line."""
WITHIN_68 = 1.515
"""Radius that holds 68 % of a circular normal distribution, which Android calls accuracy, over its sigma."""
NO_VELOCITY_SIGMA = 999.0
"""Stands for "not measured", m/s."""
CODE_LOCK, TOW_DECODED, TOW_KNOWN = 1, 8, 16_384
GALILEO_KNOWN = 2_048 | 8 | 16_384
"""Flags of a measurement's state: its code is tracked, and its time of week is decoded or known."""
GPS, QZSS, GALILEO = 1, 4, 6
"""Constellations with the time of GPS."""
L1 = 1_575.42e6
NANO = 1e-9

Rows = dict[str, list[list[str]]]
Header = dict[str, list[str]]


def recognises(path: Path) -> bool:
    """Whether the file begins with the header of GNSSLogger, or with its Raw lines."""
    with path.open("rb") as file:
        start = file.read(20_000).decode("utf-8", "replace")
    return "# Raw," in start and ("# Fix," in start or "FullBiasNanos" in start)


def read(path: Path, options: Options) -> Recording:
    """Read a text of GNSSLogger.

    Raises:
        ValueError: it has no header of a kind of line that it has, or no inertial samples or GPS fixes.
    """
    del options
    header, rows, lines = _read(path)
    recording = Recording(
        kind=f"Android GNSSLogger {path.name}", clock="GPS time of week of the first fix, s", axes="unknown"
    )
    _tell_bad(recording, lines)
    fixes = _table(path, header, rows, "Fix")
    raw = _table(path, header, rows, "Raw")
    first = _first_gps_time(path, fixes, raw)
    week = WEEK * np.floor(first / WEEK)
    offset = _boot_to_gps(path, fixes, raw) - week
    _add_fixes(recording, rows, header, fixes, week)
    _add_imu(recording, path, header, rows, offset)
    if len(raw.get("TimeNanos", ())):
        _add_ranges(recording, rows, header, raw, week)
    _add_others(recording, path, header, rows, offset)
    return recording


def _read(path: Path) -> tuple[Header, Rows, list[int]]:
    """Headers and cells of the lines by kind, and the lines that have another number of cells than their header."""
    check_size(path)
    header: Header = {}
    rows: Rows = {kind: [] for kind in KINDS}
    bad = []
    for number, text in _lines(path):
        kind = text.partition(",")[0]
        if text.startswith("#"):
            cells = [cell.strip() for cell in text[1:].split(",")]
            if cells[0] in KINDS:
                header[cells[0]] = cells[1:]
        elif kind in rows:
            cells = text.split(",")[1:]
            needed = len(header.get(kind, ()))
            if len(rows[kind]) >= MOST_ROWS:
                raise ValueError(f"{path}, line {number}: more than {MOST_ROWS} lines of {kind}")
            if needed and len(cells) not in (needed, needed + 1):  # some releases end a line with a comma
                bad.append(number)
            else:
                rows[kind].append(cells[: needed or len(cells)])
    return header, rows, bad


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        number = 0
        while text := file.readline(LONGEST):
            number += 1
            if len(text) == LONGEST:
                raise ValueError(f"{path}, line {number}: has {LONGEST} characters or more: no GNSSLogger text")
            yield number, text.strip()


def _tell_bad(recording: Recording, lines: list[int]) -> None:
    if lines:
        recording.problems.append(
            f"{len(lines)} lines have another number of cells than their header, and are left out; the first is line "
            f"{lines[0]}"
        )


def _table(path: Path, header: Header, rows: Rows, kind: str) -> dict[str, Floats]:
    """Columns of the lines of a kind as numbers, NaN where a cell is no number; empty = there are none."""
    if not rows[kind]:
        return {}
    if kind not in header:
        raise ValueError(f"{path}: has {kind} lines, but no line '# {kind},...' that names their columns")
    return {name: np.array([_number(row[k]) for row in rows[kind]]) for k, name in enumerate(header[kind])}


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _integers(header: Header, rows: Rows, kind: str, name: str) -> list[int]:
    """A column of nanoseconds, which floating point would round; 0 where a cell is no number."""
    if name not in header.get(kind, ()):
        return [0] * len(rows[kind])
    place = header[kind].index(name)
    return [int(float(row[place])) if not _whole(row[place]) else int(row[place]) for row in rows[kind]]


def _whole(text: str) -> bool:
    return text.strip().lstrip("-").isdigit() and len(text) < 25


def _elapsed(table: dict[str, Floats]) -> Floats | None:
    """Seconds since boot; None = the lines do not tell."""
    milliseconds = ("elapsedRealtimeMillis", "ElapsedRealtimeMillis")
    for name, scale in (("elapsedRealtimeNanos", NANO), *((name, 1e-3) for name in milliseconds)):
        if name in table:
            return table[name] * scale
    return None


def _unix_to_gps(milliseconds: Floats) -> Floats:
    return milliseconds / 1000.0 - GPS_EPOCH_UNIX + LEAP_SECONDS


def _fix_unix(fixes: dict[str, Floats]) -> Floats:
    for name in ("UnixTimeMillis", "(UTC)TimeInMs"):
        if name in fixes:
            return fixes[name]
    return np.empty(0)


def _first_gps_time(path: Path, fixes: dict[str, Floats], raw: dict[str, Floats]) -> float:
    for times in (_fix_unix(fixes), raw.get("utcTimeMillis", np.empty(0))):
        known = times[np.isfinite(times) & (times > 0)]
        if len(known):
            return float(_unix_to_gps(known[:1])[0])
    raise ValueError(f"{path}: neither Fix nor Raw lines tell a time (UnixTimeMillis, utcTimeMillis)")


def _boot_to_gps(path: Path, fixes: dict[str, Floats], raw: dict[str, Floats]) -> float:
    """GPS time less time since boot, s: the median of the fixes, or of the raw epochs.

    In old releases fixes tell no time since boot; a receiver's own clock then gives GPS time, to a microsecond.
    """
    receiver = np.empty(0)
    if {"TimeNanos", "FullBiasNanos"} <= set(raw):
        receiver = (raw["TimeNanos"] - raw["FullBiasNanos"]) * NANO
    for table, gps in ((fixes, _unix_to_gps(_fix_unix(fixes))), (raw, receiver)):
        boot = _elapsed(table)
        if boot is None and "ChipsetElapsedRealtimeNanos" in table:
            boot = table["ChipsetElapsedRealtimeNanos"] * NANO
        if boot is not None and len(gps):
            known = np.isfinite(boot) & np.isfinite(gps) & (boot > 0)
            if known.any():
                return float(np.median(gps[known] - boot[known]))
    raise ValueError(f"{path}: nothing tells the time since boot of a fix: elapsedRealtimeNanos is missing or empty")


def _add_fixes(recording: Recording, rows: Rows, header: Header, fixes: dict[str, Floats], week: float) -> None:
    provider = [row[header["Fix"].index("Provider")].strip().lower() for row in rows["Fix"]] if fixes else []
    gps = np.array([name == "gps" for name in provider], dtype=bool)
    others = sorted(set(provider) - {"gps"})
    if others:
        recording.problems.append(
            f"gnss: {int((~gps).sum())} fixes of other providers ({', '.join(others).upper()[:60]}) are left out"
        )
    if not gps.any():
        return

    def cells(name: str, empty: float, old: str = "") -> Floats:
        values = fixes.get(name, fixes.get(old, np.full(len(gps), np.nan)))[gps]
        return np.where(np.isfinite(values), values, empty)

    speed, course = cells("SpeedMps", np.nan, "Speed"), cells("BearingDegrees", np.nan)
    known = np.isfinite(speed) & (np.isfinite(course) | (speed == 0.0))
    north, east = velocity_of_course(np.nan_to_num(speed), np.nan_to_num(course))
    accuracy = cells("AccuracyMeters", np.nan, "Accuracy") / WITHIN_68
    sigma = np.where(known, cells("SpeedAccuracyMps", 0.0), NO_VELOCITY_SIGMA)
    recording.tables["gnss"] = {
        "t_s": _unix_to_gps(_fix_unix(fixes)[gps]) - week,
        "lat_deg": cells("LatitudeDegrees", np.nan, "Latitude"),
        "lon_deg": cells("LongitudeDegrees", np.nan, "Longitude"),
        "h_m": cells("AltitudeMeters", np.nan, "Altitude"),
        **{"vn_mps": np.where(known, north, 0.0), "ve_mps": np.where(known, east, 0.0), "vd_mps": np.zeros(len(north))},
        **{"sd_n_m": np.nan_to_num(accuracy), "sd_e_m": np.nan_to_num(accuracy)},
        "sd_d_m": cells("VerticalAccuracyMeters", 0.0),
        **{"sd_vn_mps": sigma, "sd_ve_mps": sigma, "sd_vd_mps": sigma},
    }
    if not known.all():
        recording.problems.append(f"gnss: {int((~known).sum())} fixes have no speed or bearing, so no velocity")


def _add_imu(recording: Recording, path: Path, header: Header, rows: Rows, offset: float) -> None:
    """Angular rates at their own times, and specific forces between theirs by straight lines."""
    gyro, accelerometer = (_table(path, header, rows, kind) for kind in ("UncalGyro", "UncalAccel"))
    if not gyro or not accelerometer:
        missing = "UncalGyro" if not gyro else "UncalAccel"
        raise ValueError(f"{path}: has no {missing} lines, and so no inertial samples; log the sensors, too")
    time, other = _elapsed(gyro), _elapsed(accelerometer)
    if time is None or other is None:
        raise ValueError(f"{path}: UncalGyro and UncalAccel lines have no column elapsedRealtimeNanos")
    order = np.flatnonzero(np.isfinite(other))
    order = order[np.argsort(other[order], kind="stable")]
    inside = (time >= other[order[0]]) & (time <= other[order[-1]]) if len(order) else np.zeros(len(time), dtype=bool)
    table = {"t_s": time[inside] + offset}
    for axis in "XYZ":
        table[f"g{axis.lower()}_radps"] = gyro[f"UncalGyro{axis}RadPerSec"][inside]
    for axis in "XYZ":
        values = accelerometer[f"UncalAccel{axis}Mps2"][order]
        table[f"a{axis.lower()}_mps2"] = np.interp(time[inside], other[order], values)
    recording.tables["imu"] = table
    step = float(np.median(np.diff(np.unique(time)))) if len(time) > 2 else 0.0
    if step > 0.1:
        recording.problems.append(f"imu: a sample each {step:.3g} s is too seldom for a filter; 0.02 s is usual")


def _add_ranges(recording: Recording, rows: Rows, header: Header, raw: dict[str, Floats], week: float) -> None:
    """GPS L1 as ``ranges``; other signals that keep GPS time as ``ranges_other``."""
    received = _receiver_time(header, rows, raw, week)
    sent = np.array(_integers(header, rows, "Raw", "ReceivedSvTimeNanos"), dtype=np.int64)
    state = np.nan_to_num(raw["State"]).astype(np.int64)
    constellation = raw["ConstellationType"]
    carrier = raw.get("CarrierFrequencyHz", np.full(len(sent), np.nan))
    carrier = np.where(np.isfinite(carrier), carrier, L1)
    flight = (received - sent) * NANO + raw.get("TimeOffsetNanos", np.zeros(len(sent))) * NANO
    flight -= WEEK * np.round(flight / WEEK)
    decoded = (state & CODE_LOCK > 0) & (state & (TOW_DECODED | TOW_KNOWN) > 0)
    decoded |= (constellation == GALILEO) & (state & GALILEO_KNOWN > 0)
    own_time = np.isin(constellation, (GPS, QZSS, GALILEO))
    good = decoded & own_time
    if "MultipathIndicator" in raw:
        flagged = int(np.count_nonzero(raw["MultipathIndicator"] == 1))
        recording.remarks["multipath"] = f"the phone flags multipath in {flagged} ranges"
    table: Columns = {
        "t_s": received * NANO,
        "svid": raw["Svid"],
        "pseudorange_m": flight * C,
        "range_rate_mps": raw["PseudorangeRateMetersPerSecond"],
        "cn0_dbhz": raw["Cn0DbHz"],
        "pr_std": raw["ReceivedSvTimeUncertaintyNanos"] * NANO * C,
        "rr_std": raw["PseudorangeRateUncertaintyMetersPerSecond"],
    }
    first = good & (constellation == GPS) & (np.abs(carrier - L1) < 1e6)
    recording.tables["ranges"] = {name: values[first] for name, values in table.items()}
    other = good & ~first
    more = {"constellation": constellation, "carrier_hz": carrier}
    recording.tables["ranges_other"] = {name: values[other] for name, values in (table | more).items()}
    recording.problems.append(
        f"ranges: {int((~good).sum())} of {len(good)} have no time of week of GPS (GLONASS and BeiDou keep another "
        "time), and are left out; ephemeris.csv is missing: take it from a RINEX navigation file"
    )


def _receiver_time(header: Header, rows: Rows, raw: dict[str, Floats], week: float) -> np.ndarray:
    """The receiver's clock, nanoseconds of the week: that of the first epoch runs on until the hardware's steps."""
    ticks, bias = (_integers(header, rows, "Raw", name) for name in ("TimeNanos", "FullBiasNanos"))
    steps = np.nan_to_num(raw.get("HardwareClockDiscontinuityCount", np.zeros(len(ticks))))
    result, held, counted = [], 0, None
    for tick, full, count in zip(ticks, bias, steps.tolist(), strict=True):
        if counted != count:
            held, counted = full, count
        result.append(tick - held - int(week) * 1_000_000_000)
    return np.array([value if abs(value) < 2**62 else 0 for value in result], dtype=np.int64)


def _add_others(recording: Recording, path: Path, header: Header, rows: Rows, offset: float) -> None:
    wanted = {
        "magnetometer": ("UncalMag", {f"m{a.lower()}_ut": f"UncalMag{a}MicroT" for a in "XYZ"}),
        "attitude": ("OrientationDeg", {f"{name}_deg": f"{name}Deg" for name in ("roll", "pitch", "yaw")}),
        "barometer": ("Pressure", {"pressure_hpa": "PressureHpa"}),
    }
    for name, (kind, columns) in wanted.items():
        table = _table(path, header, rows, kind) if kind in header else {}
        time = _elapsed(table)
        if time is not None and all(column in table for column in columns.values()):
            recording.tables[name] = {"t_s": time + offset} | {key: table[column] for key, column in columns.items()}
