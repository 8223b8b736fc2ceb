"""Results of calibration on disk, so that a program need not wait for clean runs that an earlier one has made.

One JSON file per result, in `cache_folder`. Its name is a SHA-256 over everything that decides the result, the source
of the simulation included: a result is used only by the code that made it. Each file holds a checksum over its name and
its content: a file that was damaged, changed by hand or renamed is as good as none, and the result is computed and
written again. The folder can be deleted at any time.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import weakref
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import spoofgym
from spoofgym.cache_folder import folder
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.files import write_json
from spoofgym.scenario import Scenario
from spoofgym.scenarios import SCENARIOS, make_scenario
from spoofgym.specification import Specification

LATER_ROOMS = ("optimum", "policies", "envs", "evaluation", "studies", "report", "learning", "cli")
"""Rooms of the package that use calibration, and that calibration never imports: they decide no threshold."""
PROGRAM_FILES = ("archive.py", "command_line.py", "console.py", "program.py")
"""What programs share, and what calibration never imports either."""
LARGEST_FILE = 2**16
"""Characters; a result takes some hundreds."""


@dataclass(frozen=True)
class Setting:
    """What calibration sets in a detector.

    Attributes:
        threshold: None where the detector has its own.
        arl0: measured at the threshold, epochs.
        slope: growth of the statistic along clean runs, per second; None where none is subtracted.
        low: lower end of the 95 % interval of the ARL₀, epochs.
        high: upper end; None where it is unbounded.
    """

    threshold: float | None = None
    arl0: float | None = None
    slope: float | None = None
    low: float | None = None
    high: float | None = None


def _sources(package: Path) -> list[Path]:
    """The modules that may decide a threshold: all of the package but those that come after calibration.

    A room or a file that is added later is among them, wherever it lies.
    """
    files = sorted(package.rglob("*.py"))
    return [path for path in files if path.relative_to(package).parts[0] not in LATER_ROOMS + PROGRAM_FILES]


def _source() -> str:
    """Digest of the source that decides a result; empty where there is none to read."""
    package = Path(spoofgym.__file__).parent
    digest = hashlib.sha256()
    try:
        for path in _sources(package):
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    except OSError:
        return ""
    return digest.hexdigest()


SOURCE = _source()
"""Read when the program starts: a later edit of a file is not the code that runs."""


def key(*parts: str) -> str:
    """Name of the result that these texts, the source and the numerical libraries decide."""
    return hashlib.sha256(json.dumps([SOURCE, np.__version__, scipy.__version__, *parts]).encode()).hexdigest()


def _checksum(name: str, remark: str, setting: Setting) -> str:
    """Over all that a file says, and its name."""
    return hashlib.sha256(json.dumps([name, remark, dataclasses.asdict(setting)]).encode()).hexdigest()


def load(name: str) -> Setting | None:
    """The result of this name; None where there is none, or its file is not as `store` wrote it."""
    place = folder()
    if place is None or not SOURCE:
        return None
    try:
        with (place / f"{name}.json").open(encoding="utf-8") as file:
            content = json.loads(file.read(LARGEST_FILE))
        setting = Setting(**content["setting"])
        whole = content["checksum"] == _checksum(name, content["what"], setting)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None
    values = [value for value in dataclasses.astuple(setting) if value is not None]
    sound = values and all(isinstance(value, float) and math.isfinite(value) for value in values)
    return setting if whole and sound and (setting.threshold is None or setting.threshold > 0.0) else None


def store(name: str, setting: Setting, remark: str) -> None:
    """Keep a result under its name, in one step; nothing happens where the folder cannot be written."""
    place = folder()
    if place is None or not SOURCE:
        return
    checksum = _checksum(name, remark, setting)
    content = {"what": remark, "setting": dataclasses.asdict(setting), "checksum": checksum}
    with suppress(OSError):
        write_json(place / f"{name}.json", content)


def spelled_out(detector: Detector) -> bool:
    """Whether the name of a detector builds another one like it, from the source that decides a result."""
    try:
        other = make_detector(detector.name)
    except ValueError:
        return False
    return type(other) is type(detector) and type(other).__module__.startswith("spoofgym.detectors.")


def spelled_out_scenario(scenario: Scenario) -> bool:
    """Whether the name of a scenario builds another one like it, from the source that decides a result.

    A scenario that a user has registered is told by the object: what its name builds can change at any time.
    """
    if not dataclasses.is_dataclass(scenario):
        return False
    factory = SCENARIOS.get(Specification.parse(scenario.name).name)
    if factory is None or not factory.__module__.startswith("spoofgym.scenarios."):
        return False
    try:
        other = make_scenario(scenario.name)
    except (ValueError, OSError):
        return False
    return _alike(scenario, other)


def identity(scenario: Scenario) -> object:
    """What tells a scenario from others.

    Returns:
        Its name where the name builds it; else the digest of all that it consists of, so that a scenario of one's own
        is known again in another process; else the object itself, where it holds what no digest covers.
    """
    scenario = scenario.unguided  # how a vehicle is steered changes no statistic
    if spelled_out_scenario(scenario):
        return scenario.name
    if scenario not in _DIGESTS:
        _DIGESTS[scenario] = _content_digest(scenario)
    return _DIGESTS[scenario] or scenario


_DIGESTS: weakref.WeakKeyDictionary[Scenario, str | None] = weakref.WeakKeyDictionary()


def _content_digest(scenario: Scenario) -> str | None:
    """Digest of the fields of a scenario and of all that they hold; None where a part is of a class of the user's."""
    digest = hashlib.sha256()
    try:
        for piece in _content(scenario):
            digest.update(len(piece).to_bytes(8, "little") + piece)
    except TypeError:
        return None
    return f"content {digest.hexdigest()}"


def _content(value: Any) -> Iterator[bytes]:
    """The bytes of a value and of all that it holds.

    Raises:
        TypeError: a value that is neither a number, text, an array, a sequence of these nor a data class of the
            package.
    """
    if dataclasses.is_dataclass(value) and type(value).__module__.startswith("spoofgym."):
        yield f"{type(value).__module__}.{type(value).__qualname__}".encode()
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _content(getattr(value, field.name))
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        yield f"{value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, tuple | list):
        yield f"{type(value).__name__} {len(value)}".encode()
        for item in value:
            yield from _content(item)
    elif value is None or isinstance(value, bool | int | float | str):
        yield f"{type(value).__name__} {value!r}".encode()
    else:
        raise TypeError(f"no digest of a {type(value).__name__}")


def _alike(one: Any, other: Any) -> bool:
    """Whether two values are the same, field by field where they are data classes."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if dataclasses.is_dataclass(one):
        names = (field.name for field in dataclasses.fields(one))
        return all(_alike(getattr(one, name), getattr(other, name)) for name in names)
    return bool(np.array_equal(one, other))
