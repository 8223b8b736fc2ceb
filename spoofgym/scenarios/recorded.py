"""A recorded drive or flight as a game: real inertial samples and fixes, to which the spoofer adds its offset.

The filter is aligned on the log, run over the clean fixes up to the onset, and goes on from there. A log is one
realisation: nothing is drawn. Episodes differ only by what the players do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.logs.alignment import METHODS
from spoofgym.logs.alignment.course import SIGMA as COURSE_SIGMA
from spoofgym.logs.checks.check import check_ranges_of, checked_log
from spoofgym.logs.fix_rows import DEFAULT_SIGMA
from spoofgym.logs.lever_arm import with_velocity_at_imu
from spoofgym.logs.log import Log
from spoofgym.logs.log_files import NOISE
from spoofgym.logs.log_noise import LogNoise, read_noise
from spoofgym.logs.log_warning import warn
from spoofgym.logs.range_epochs import range_epochs
from spoofgym.logs.range_fixes import range_fixes
from spoofgym.logs.reference import checked_reference
from spoofgym.navigation.aids import Aid, make_aids, spell_aids
from spoofgym.navigation.family import COUPLINGS
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import NOISE_FACTORS
from spoofgym.scenarios.log_aids import read_aid
from spoofgym.scenarios.recorded_aided import RecordedAided
from spoofgym.scenarios.recorded_loose import SIGMA_FLOOR, RecordedFixes
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.sensors.imu import grade as imu_grade
from spoofgym.specification import spell

FIXES = ("phone", "ranges")
"""Which fixes a filter may take: those in the log, or those made from its raw ranges."""
ESTIMATED = "estimated"
"""The option ``noise`` that names the file in the folder of the log."""
DRAG_OFF_RATE = (4.0, 4.0, 4.0)
"""Largest rate of a spoofed position per axis, and of a spoofed clock, m/s."""
ALIGNMENT_VELOCITY_SIGMA = (0.5, 0.5, 0.5)
NOISE_FACTOR = 20.0
"""The filter's white inertial noise over the data sheet's, for what its model leaves out (presumably scale factor,
misalignment, vibration). An empirical figure: chosen by the clean errors of four logs, on which it is therefore not
an independent result, and cautious there (mean NIS well below the fix's dimension)."""


def recorded(
    path: str,
    grade: str = "automotive",
    onset: float | None = None,
    horizon: int | None = None,
    velocity: bool | None = None,
    sigma_floor: float = SIGMA_FLOOR,
    noise_factor: float = NOISE_FACTOR,
    fixes: str = FIXES[0],
    coupling: str = COUPLINGS[0],
    alignment: str | None = None,
    least_speed: float | None = None,
    guidance: str | None = None,
    noise: str | None = None,
    aids: str | None = None,
) -> Scenario:
    """A log in the project's format as a game.

    Args:
        path: folder of the log; no comma in it.
        grade: name of the IMU grade that the filter believes in.
        onset: time of the last clean epoch, s (the last one up to it is taken); None = a third of the way from the
            log's start to its end.
        horizon: epochs of the game; None = to the end of the log.
        velocity: whether the filter uses the receiver's velocity beside its position; None = where the log has it.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        noise_factor: the filter's white inertial noise over the data sheet's, from 0.001 to 1000.
        fixes: which ones the filter takes: ``phone``, those in the log, whatever receiver made them, or ``ranges``,
            least squares of the log's raw ranges (`range_fixes`).
        coupling: ``loose``: the filter takes fixes; ``tight``: it takes code and rate of the log's raw ranges.
        alignment: how the filter starts (`spoofgym.logs.alignment`): ``auto``, ``static``, ``attitude``, ``course`` or
            ``coarse``; None = as ``log.toml`` says, else ``auto``.
        least_speed: whose course counts as heading, m/s; None = 5 m/s, or what the accuracy of the velocity allows.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.
        noise: what the filter believes in place of grade, noise_factor and sigma_floor: ``estimated``, the file
            ``noise.toml`` of the log, which ``spoofgym estimate-noise`` writes, or another such file; None = nothing.
        aids: what corrects the filter beside GNSS, from the log's own tables: ``barometer``, ``magnetometer``,
            ``wheel-speed`` and ``zero-velocity``, those that there are joined by ``+``, each with ``/`` in place of the
            commas between its options; None = nothing.

    Raises:
        ValueError: a path with a comma, an unknown grade, a log that cannot be used or has no ranges, an onset or a
            horizon outside it, a number that is not positive, a file of noises that is missing or wrong, or options
            that do not go together.
    """
    path = str(Path(path))
    if "," in path:
        raise ValueError(f"recorded: a path must not contain a comma, which separates options; got {path!r}")
    imu = imu_grade(grade)
    if onset is not None:
        onset = validation.time("recorded", "onset", onset)
    sigma_floor = validation.above("recorded", "sigma_floor", sigma_floor)
    noise_factor = validation.between("recorded", "noise_factor", noise_factor, *map(math.sqrt, NOISE_FACTORS))
    fixes = validation.one_of("recorded", "fixes", fixes, FIXES)
    coupling = validation.one_of("recorded", "coupling", coupling, COUPLINGS)
    if alignment is not None:
        alignment = validation.one_of("recorded", "alignment", alignment, METHODS)
    if least_speed is not None:
        least_speed = validation.above("recorded", "least_speed", least_speed)
    if coupling == "tight" and (velocity is not None or sigma_floor != SIGMA_FLOOR or fixes != FIXES[0]):
        raise ValueError("recorded: velocity, sigma_floor and fixes are of fixes; coupling=tight takes none")
    if noise is not None and "," in noise:
        raise ValueError(f"recorded: noise must not contain a comma, which separates options; got {noise!r}")
    if noise is not None and (noise_factor != NOISE_FACTOR or sigma_floor != SIGMA_FLOOR or coupling == "tight"):
        raise ValueError("recorded: noise takes the place of noise_factor and sigma_floor, and needs coupling=loose")
    believed = None if noise is None else read_noise(noise_file(path, noise))
    sensors = make_aids("recorded", aids)
    if coupling == "tight" and sensors:
        raise ValueError("recorded: aids go with coupling=loose; the filter that takes ranges has none yet")
    options = {
        "grade": (grade, "automotive"),
        "onset": (None if onset is None else np.format_float_positional(onset, trim="-"), None),
        "horizon": (horizon, None),
        "velocity": (velocity, None),
        "sigma_floor": (sigma_floor, SIGMA_FLOOR),
        "noise_factor": (noise_factor, NOISE_FACTOR),
        "fixes": (fixes, FIXES[0]),
        "coupling": (coupling, COUPLINGS[0]),
        "alignment": (alignment, None),
        "least_speed": (least_speed, None),
        "noise": (noise, None),
        "aids": (spell_aids(sensors), None),
    }
    name = spell("recorded", path, **{key: value for key, (value, default) in options.items() if value != default})
    tuning = FilterTuning(
        attitude_sigma=COURSE_SIGMA,  # replaced by that of the alignment
        velocity_sigma=ALIGNMENT_VELOCITY_SIGMA,
        position_sigma=DEFAULT_SIGMA[:3],
        initial_scale=1.0,
        process_noise_scale=noise_factor**2,
        measurement_sigma=DEFAULT_SIGMA,
    )
    asked = _Fixes(fixes, velocity, sigma_floor, believed, sensors)
    common = {"name": name, "grade": imu, "tuning": tuning, "onset": onset, "horizon": horizon}
    common |= {"aligned": alignment, "least_speed": least_speed}
    log = checked_log(path)
    if coupling == "tight" or fixes == "ranges":
        check_ranges_of(path)
    family = FAMILIES[coupling](log, asked, **common)
    made = Scenario(family=family, drag_off_rate=DRAG_OFF_RATE, error_scale=10.0, clock_rate=DRAG_OFF_RATE[0])
    return made.guided(guidance, "lateral")


def noise_file(path: str, noise: str) -> Path:
    """The file that the option ``noise`` of a log in the folder ``path`` names."""
    return Path(path) / NOISE if noise == ESTIMATED else Path(noise)


@dataclass(frozen=True)
class _Fixes:
    """What a user says of the fixes; as in `recorded`."""

    kind: str
    velocity: bool | None
    sigma_floor: float
    noise: LogNoise | None
    aids: tuple[Aid, ...]


def _loose(log: Log, asked: _Fixes, *, tuning: FilterTuning, **common: Any) -> RecordedFixes:
    """The filter that takes fixes."""
    if asked.kind == "ranges":
        log = replace(log, fixes=range_fixes(log))
    log = with_velocity_at_imu(checked_reference(log))
    if asked.velocity is False or (asked.velocity is None and log.fixes.velocity is None):
        tuning = replace(tuning, measurement_sigma=DEFAULT_SIGMA[:3])
    common |= {"log": log, "tuning": tuning, "sigma_floor": asked.sigma_floor, "noise": asked.noise}
    if not asked.aids:
        return RecordedFixes(**common)
    found = [read_aid(log, aid) for aid in asked.aids]
    return RecordedAided(
        aids=tuple(aid for aid, _ in found), readings=tuple(readings for _, readings in found), **common
    )


def _tight(log: Log, asked: _Fixes, **common: Any) -> RecordedRanges:
    """The filter that takes code and rate of the raw ranges."""
    epochs = range_epochs(log)
    log = checked_reference(replace(log, fixes=epochs.fixes, lever_arm=_no_arm(log)))
    return RecordedRanges(log=log, epochs=epochs, **common)


FAMILIES: dict[str, Callable[..., RecordedFixes | RecordedRanges]] = {"loose": _loose, "tight": _tight}
"""What makes the filter, by coupling."""


def _no_arm(log: Log) -> Floats:
    """The lever arm of a filter that knows none, (3,), m, with a warning where the log has one."""
    if log.lever_arm.any():
        warn(
            log.folder,
            "log.toml: coupling=tight does not know antenna_lever_arm_m and takes the antenna for the IMU: positions "
            f"err by up to {np.linalg.norm(log.lever_arm):.1f} m",
        )
    return np.zeros(3)
