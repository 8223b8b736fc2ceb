"""``log.toml`` of a recorded log: what a reader must know of it, and notes that nobody reads."""

from __future__ import annotations

import difflib
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.sensors.klobuchar import TERMS, Klobuchar

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SETTINGS = (
    *("name", "imu_to_body_frd", "start_s", "imu_delay_s", "gnss_delay_s", "antenna_lever_arm_m"),
    *("alignment", "heading_deg", "heading_sigma_deg", "declination_deg", "attack_start_s", "attack_end_s"),
    *("static", "antenna_lat_deg", "antenna_lon_deg", "antenna_h_m", "iono_alpha", "iono_beta"),
    *("first_effect_s", "pull_start_s", "pull_end_s"),
)
ALIGNMENTS = ("auto", "static", "attitude", "course", "coarse")
"""What ``alignment`` may say."""
HEADING_SIGMA = 10.0
"""Of a heading that is stated without one, degrees."""
REMARKS = (
    *("vehicle", "source", "licence", "license", "date", "comment", "note", "week", "time"),
    *("imu", "imu_grade", "gyro_noise", "accel_noise", "gnss", "reference", "ranges", "ranges_sbas", "sky"),
    *("wheels", "attitude", "aux", "gnss_spoofed", "attack", "victim"),
    *("first_offset_n_m", "first_offset_e_m", "largest_offset_m", "power_step_s"),
    *("pull_full_s", "pull_slows_s", "pull_m", "range_rate_bias_mps", "rrt0_s"),
)
"""Keys about the log that nothing reads; others lie in the table ``[notes]``."""
NOTES = "notes"
CLOSE = 0.5
"""Similarity from which a key is taken for a mistyped one (`difflib.get_close_matches`)."""
SURE = 0.8
"""Similarity from which a key is taken for a mistyped one where other keys are welcome."""
VALID = f"{', '.join(SETTINGS)}; remarks belong in a table [{NOTES}]"
LONGEST = 1_000_000
"""Most bytes of a ``log.toml``."""
ROTATION_TOLERANCE = 1e-3
FARTHEST_ANTENNA = 100.0
"""Longest lever arm per axis, m."""

ENU_OF_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""East, north, up from north, east, down; and right, forward, up from forward, right, down."""


@dataclass(frozen=True)
class StatedHeading:
    """The heading at the start of a log.

    Attributes:
        value: clockwise from true north, rad.
        sigma: rad.
    """

    value: float
    sigma: float


@dataclass(frozen=True)
class Effects:
    """When an attack that was recorded as it was acts on the log's own tables.

    Attributes:
        begin: of the first effect, s.
        end: of the last, s; None = that of the log.
        pull: when the pull begins, s; None = not stated.
    """

    begin: float
    end: float | None
    pull: float | None


class Notes:
    """The settings in a ``log.toml``, each checked where it is asked for."""

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            ValueError: it is missing, too large or no TOML, or has a key that is none of the format.
        """
        self.path = path
        self._values = _read(path)
        for key, value in self._values.items():
            if fault := _table_fault(key, value) if _tables(value) else _key_fault(key, value):
                raise ValueError(f"{path}: {fault}; valid are {VALID}")

    def __contains__(self, key: str) -> bool:
        """Whether the file has this key."""
        return key in self._values

    def name(self, default: str) -> str:
        """Of the log.

        Raises:
            ValueError: it is no text.
        """
        value = self._values.get("name", default)
        if not isinstance(value, str):
            raise ValueError(f"{self.path}: name must be a text, got {value!r:.100}")
        return value

    def seconds(self, key: str, default: float | None) -> float:
        """A time; None as default = it must be there.

        Raises:
            ValueError: it is missing, no finite number, or larger than a time can be.
        """
        value = self._values.get(key, default)
        if value is None:
            raise ValueError(f"{self.path}: {key} is missing; it must be a finite number of seconds")
        if not _is_number(value):
            raise ValueError(f"{self.path}: {key} must be a finite number of seconds, got {value!r:.100}")
        return validation.time(str(self.path), key, value)

    def alignment(self) -> str | None:
        """How the filter is to be aligned; None = the file does not say.

        Raises:
            ValueError: it is none of `ALIGNMENTS`.
        """
        value = self._values.get("alignment")
        return None if value is None else validation.one_of(str(self.path), "alignment", value, ALIGNMENTS)

    def heading(self) -> StatedHeading | None:
        """Of the vehicle at the start; None = the file does not say.

        Raises:
            ValueError: it is no number in range, or a sigma stands alone.
        """
        heading = self._degrees("heading_deg", -360.0, 360.0)
        sigma = self._degrees("heading_sigma_deg", 0.01, 180.0)
        if heading is None:
            if sigma is not None:
                raise ValueError(f"{self.path}: heading_sigma_deg stands alone; heading_deg is missing")
            return None
        return StatedHeading(math.radians(heading), math.radians(HEADING_SIGMA if sigma is None else sigma))

    def declination(self) -> float | None:
        """Of the magnetic field, east of true north, rad; None = the file does not say.

        Raises:
            ValueError: it is no number in range.
        """
        value = self._degrees("declination_deg", -180.0, 180.0)
        return None if value is None else math.radians(value)

    def attacked(self) -> tuple[float, float] | None:
        """Times of the first and the last spoofed fix, s; None = the file states none.

        Raises:
            ValueError: one is missing or no number, or the end lies before the start.
        """
        if "attack_start_s" not in self and "attack_end_s" not in self:
            return None
        begin, end = self.seconds("attack_start_s", None), self.seconds("attack_end_s", None)
        if end < begin:
            raise ValueError(f"{self.path}: attack_end_s = {end:g} lies before attack_start_s = {begin:g}")
        return begin, end

    def effects(self) -> Effects | None:
        """When the log's own tables are spoofed; None = the file states no ``first_effect_s``.

        The end is that of ``attack_end_s``, else of ``pull_end_s``, else none.

        Raises:
            ValueError: a time is no number, or they come in another order.
        """
        if "first_effect_s" not in self:
            return None
        begin = self.seconds("first_effect_s", None)
        last = next((key for key in ("attack_end_s", "pull_end_s") if key in self), None)
        end = None if last is None else self.seconds(last, None)
        pull = self.seconds("pull_start_s", None) if "pull_start_s" in self else None
        for key, time in (("pull_start_s", pull), (last, end)):
            if time is not None and time < begin:
                raise ValueError(f"{self.path}: {key} = {time:g} lies before first_effect_s = {begin:g}")
        return Effects(begin, end, pull)

    def antenna(self) -> Floats | None:
        """Where a static antenna is, latitude rad, longitude rad, height m, (3,); None = ``static`` is not true.

        Raises:
            ValueError: ``static`` is no truth value, or the position is missing or out of range.
        """
        static = self._values.get("static", False)
        if not isinstance(static, bool):
            raise ValueError(f"{self.path}: static must be true or false, got {static!r:.100}")
        if not static:
            return None
        limits = {"antenna_lat_deg": (-89.0, 89.0), "antenna_lon_deg": (-360.0, 360.0), "antenna_h_m": (-12e3, 1e5)}
        place = []
        for key, (low, high) in limits.items():
            value = self._values.get(key)
            if value is None or not _is_number(value) or not low <= value <= high:
                raise ValueError(
                    f"{self.path}: static = true needs {key}, a number between {low:g} and {high:g}, got {value!r:.100}"
                )
            place.append(float(value))
        return np.array([math.radians(place[0]), math.radians(place[1]), place[2]])

    def ionosphere(self) -> Klobuchar | None:
        """The broadcast model of the ionosphere; None = the file does not state it.

        Raises:
            ValueError: one half is missing, or is not four numbers.
        """
        if "iono_alpha" not in self and "iono_beta" not in self:
            return None
        halves = []
        for key in ("iono_alpha", "iono_beta"):
            value = self._values.get(key)
            if not isinstance(value, list) or len(value) != TERMS or not all(map(_is_number, value)):
                raise ValueError(f"{self.path}: {key} must be {TERMS} numbers of the GPS broadcast, got {value!r:.100}")
            halves.append(tuple(map(float, value)))
        return Klobuchar(*halves)

    def _degrees(self, key: str, low: float, high: float) -> float | None:
        value = self._values.get(key)
        if value is None:
            return None
        if not _is_number(value) or not low <= value <= high:
            raise ValueError(f"{self.path}: {key} must be a number between {low:g} and {high:g}, got {value!r:.100}")
        return float(value)

    def lever_arm(self) -> Floats:
        """From the IMU to the antenna, body right, forward, up, (3,), m.

        Raises:
            ValueError: it is not three numbers, or too long.
        """
        value = self._values.get("antenna_lever_arm_m", [0.0, 0.0, 0.0])
        fits = isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))
        if not fits or max(map(abs, value)) > FARTHEST_ANTENNA:
            raise ValueError(
                f"{self.path}: antenna_lever_arm_m must be 3 numbers (metres from the IMU to the antenna, body "
                f"forward, right, down) between {-FARTHEST_ANTENNA:g} and {FARTHEST_ANTENNA:g}, got {value!r:.100}"
            )
        return np.asarray(ENU_OF_NED @ np.array(value, dtype=np.float64))

    def mounting(self) -> Floats | None:
        """Rotation from sensor axes to body right, forward, up, (3, 3); None = unknown.

        Raises:
            ValueError: the key is missing, or its value is no rotation.
        """
        key = "imu_to_body_frd"
        if key not in self._values:
            raise ValueError(f"{self.path}: {key} is missing; where the mounting is unknown it must be [], empty")
        value = self._values[key]
        if value == []:
            return None
        message = (
            f"{self.path}: {key} must be a rotation, 3 rows of 3 numbers (body forward, right, down), got "
            f"{value!r:.200}"
        )
        rows = value if isinstance(value, list) and all(isinstance(row, list) for row in value) else []
        if len(rows) != 3 or not all(len(row) == 3 and all(map(_is_number, row)) for row in rows):
            raise ValueError(message)
        left, scale, right = np.linalg.svd(np.array(rows, dtype=np.float64))
        rotation: Floats = left @ right
        if np.any(np.abs(scale - 1.0) > ROTATION_TOLERANCE) or np.linalg.det(rotation) < 0.0:
            raise ValueError(message)
        return np.asarray(ENU_OF_NED @ rotation)


def _is_number(value: object) -> bool:
    """Whether a value is a finite number, as a float too."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise ValueError(f"{path} is missing")
    if path.stat().st_size > LONGEST:
        raise ValueError(f"{path}: has {path.stat().st_size} bytes; valid are {LONGEST} at most")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # bad TOML or UTF-8, or a number of too many digits
        raise ValueError(f"{path}: not valid TOML: {error}") from None


def _tables(value: object) -> list[dict[str, Any]]:
    """The tables that a value is or, in a list, consists of; empty = it is no table."""
    tables = value if isinstance(value, list) else [value]
    return [table for table in tables if isinstance(table, dict)]


def _key_fault(key: str, value: object) -> str | None:
    """What is wrong with a key of the file that is no table; None = nothing."""
    if key == NOTES:
        return f"{NOTES} must be a table, got {value!r:.100}"
    if key in (*SETTINGS, *REMARKS):
        return None
    meant = nearest(key, CLOSE)
    return f"unknown key {key!r}" + ("" if meant is None else f" (did you mean {meant!r}?)")


def _table_fault(table: str, value: object) -> str | None:
    """What is wrong with a table of the file, or a list of tables; None = nothing.

    In TOML whatever follows ``[notes]`` belongs to it: a setting that is added at the end of a file.
    """
    for content in _tables(value):
        if fault := _misplaced(table, content):
            return fault
    if table in (*SETTINGS, *REMARKS):
        return f"{table} must not be a table"
    if table != NOTES:
        return f"unknown table [{table}]"
    return None if isinstance(value, dict) else f"{NOTES} must be one table [{NOTES}], not a list of tables"


def _misplaced(table: str, content: dict[str, Any]) -> str | None:
    """Which setting a table holds, at any depth; None = none."""
    for key, value in content.items():
        if meant := _setting(key, value):
            return f"{meant!r} must stand above all tables, got {key!r} in [{table}]"
        for inner in _tables(value):
            if fault := _misplaced(f"{table}.{key}", inner):
                return fault
    return None


def _setting(key: str, value: object) -> str | None:
    """The setting that is meant by a key among others that are welcome; None = none.

    Text is a remark, unless the key is a setting's own or the text is a number.
    """
    lower = key.lower()
    remark = isinstance(value, str) and not _is_numeral(value)
    if remark:
        return lower if lower in SETTINGS and lower != "name" else None
    whole = [setting for setting in SETTINGS if "_" in lower and lower in setting]
    if len(whole) == 1:  # lever_arm, imu_delay
        return whole[0]
    meant = nearest(key, SURE)
    return meant if meant in SETTINGS and not (meant == "name" and isinstance(value, str)) else None


def _is_numeral(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def nearest(key: str, similarity: float) -> str | None:
    """The key of the format that a key resembles most, whatever its case; None = none is so similar."""
    lower = key.lower()
    if lower in REMARKS:
        return lower
    found = difflib.get_close_matches(lower, SETTINGS, 1, similarity)
    return found[0] if found else None
