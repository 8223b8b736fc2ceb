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
from spoofgym.logs.log_noise import read_noise
from spoofgym.logs.log_warning import warn
from spoofgym.logs.range_epochs import range_epochs
from spoofgym.logs.range_fixes import range_fixes
from spoofgym.logs.reference import checked_reference
from spoofgym.logs.resting_log import resting_log
from spoofgym.navigation.aids import Aid, make_aids, spell_aids
from spoofgym.navigation.family import COUPLINGS
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import NOISE_FACTORS
from spoofgym.scenarios.log_aids import read_aid
from spoofgym.scenarios.recorded_aided import RecordedAided
from spoofgym.scenarios.recorded_loose import SIGMA_FLOOR, RecordedFixes
from spoofgym.scenarios.recorded_resting import SIMULATED, RestingRanges
from spoofgym.scenarios.recorded_tight import ERRORS, RecordedRanges
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.imu import grade as imu_grade
from spoofgym.sensors.oscillator import OSCILLATORS
from spoofgym.sensors.ranging import RangeErrors
from spoofgym.specification import spell

GRADE = "automotive"
"""That the filter believes in, where nothing else is said."""
OSCILLATOR = "tcxo"
"""Class of the receiver's clock, where nothing else is said."""
ATTACKS = ("recorded",)
"""What a game on a log may be made of."""
FIXES = ("phone", "ranges")
"""Which fixes a filter may take: those in the log, or those made from its raw ranges."""
ESTIMATED = "estimated"
"""The option ``noise`` that names the file in the folder of the log."""
DRAG_OFF_RATE = (4.0, 4.0, 4.0)
"""Largest rate of a spoofed position per axis, and of a spoofed clock, m/s."""
RANGE_SCALES = (0.01, 100.0)
"""Least and largest factor on the sigmas of ranges."""
ALIGNMENT_VELOCITY_SIGMA = (0.5, 0.5, 0.5)
NOISE_FACTOR = 20.0
"""The filter's white inertial noise over the data sheet's, for what its model leaves out (presumably scale factor,
misalignment, vibration). An empirical figure: chosen by the clean errors of four logs, on which it is therefore not
an independent result, and cautious there (mean NIS well below the fix's dimension)."""


def recorded(
    path: str,
    grade: str | None = None,
    onset: float | None = None,
    horizon: int | None = None,
    velocity: bool | None = None,
    sigma_floor: float = SIGMA_FLOOR,
    noise_factor: float | None = None,
    fixes: str = FIXES[0],
    coupling: str | None = None,
    alignment: str | None = None,
    least_speed: float | None = None,
    guidance: str | None = None,
    noise: str | None = None,
    aids: str | None = None,
    imu: str | None = None,
    oscillator: str = OSCILLATOR,
    attack: str | None = None,
    clean: str | None = None,
    code_scale: float = 1.0,
    rate_scale: float = 1.0,
) -> Scenario:
    """A log in the project's format as a game.

    Args:
        path: folder of the log; no comma in it.
        grade: name of the IMU grade that the filter believes in; None = automotive, or that of a simulated IMU.
        onset: time of the last clean epoch, s (the last one up to it is taken); None = a third of the way from the
            log's start to its end, or 20 s before the attack that the log holds, where this is earlier.
        horizon: epochs of the game; None = to the end of the log.
        velocity: whether the filter uses the receiver's velocity beside its position; None = where the log has it.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        noise_factor: the filter's white inertial noise over the data sheet's, from 0.001 to 1000; None = 20, or 1 with
            a simulated IMU.
        fixes: which ones the filter takes: ``phone``, those in the log, whatever receiver made them, or ``ranges``,
            least squares of the log's raw ranges (`range_fixes`).
        coupling: ``loose``: the filter takes fixes; ``tight``: it takes code and rate of the log's raw ranges; None =
            loose, or tight with a simulated IMU.
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
        imu: ``simulated:GRADE``: the antenna rests and the log has no IMU; one of this grade at rest is simulated, each
            run has its own.
        oscillator: class of the receiver's clock that a filter on ranges believes in: ``tcxo``, ``ocxo`` or
            ``rubidium``.
        attack: ``recorded``: the game is the attack that the log holds.
        clean: folder of a log of the same scene without the attack, for thresholds and false alarms; None = what comes
            before the attack.
        code_scale: on the sigma of a code that follows from its C/N0, from 0.01 to 100.
        rate_scale: on that of a range rate.

    Raises:
        ValueError: a path with a comma, an unknown grade, a log that cannot be used or has no ranges, an onset or a
            horizon outside it, a number that is not positive, or options that do not go together.
    """
    path = str(Path(path))
    if "," in path:
        raise ValueError(f"recorded: a path must not contain a comma, which separates options; got {path!r}")
    simulated = None if imu is None else simulated_grade(imu)
    grade = grade or (GRADE if simulated is None else simulated.name)
    if attack is not None:
        validation.one_of("recorded", "attack", attack, ATTACKS)
    if clean is not None and attack is None:
        raise ValueError("recorded: clean names the scene of attack=recorded without its attack; attack is not given")
    options = _Options(
        path=path,
        grade=imu_grade(grade),
        onset=None if onset is None else validation.time("recorded", "onset", onset),
        horizon=horizon,
        velocity=velocity,
        sigma_floor=validation.above("recorded", "sigma_floor", sigma_floor),
        noise_factor=_noise_factor(noise_factor, simulated),
        fixes=validation.one_of("recorded", "fixes", fixes, FIXES),
        coupling=_coupling(coupling, simulated),
        alignment=None if alignment is None else validation.one_of("recorded", "alignment", alignment, METHODS),
        least_speed=None if least_speed is None else validation.above("recorded", "least_speed", least_speed),
        noise=noise,
        aids=make_aids("recorded", aids),
        simulated=simulated,
        oscillator=validation.one_of("recorded", "oscillator", oscillator, tuple(OSCILLATORS)),
        attack=attack,
        clean=None if clean is None else str(Path(clean)),
        code_scale=validation.between("recorded", "code_scale", code_scale, *RANGE_SCALES),
        rate_scale=validation.between("recorded", "rate_scale", rate_scale, *RANGE_SCALES),
    )
    options.check()
    family = options.family()
    made = Scenario(family=family, drag_off_rate=DRAG_OFF_RATE, error_scale=10.0, clock_rate=DRAG_OFF_RATE[0])
    return made.guided(guidance, "lateral")


def noise_file(path: str, noise: str) -> Path:
    """The file that the option ``noise`` of a log in the folder ``path`` names."""
    return Path(path) / NOISE if noise == ESTIMATED else Path(noise)


def simulated_grade(imu: str) -> ImuGrade:
    """The grade of a simulated IMU, spelled ``simulated:GRADE``.

    Raises:
        ValueError: another word, or an unknown grade.
    """
    kind, _, name = str(imu).partition(":")
    if kind != SIMULATED or not name:
        raise ValueError(f"recorded: imu must be {SIMULATED}:GRADE, e.g. {SIMULATED}:tactical, got {imu!r}")
    with validation.argument("recorded", "imu"):
        return imu_grade(name)


def _noise_factor(given: float | None, simulated: ImuGrade | None) -> float:
    usual = NOISE_FACTOR if simulated is None else 1.0
    low, high = map(math.sqrt, NOISE_FACTORS)
    return validation.between("recorded", "noise_factor", usual if given is None else given, low, high)


def _coupling(given: str | None, simulated: ImuGrade | None) -> str:
    if simulated is None:
        return validation.one_of("recorded", "coupling", COUPLINGS[0] if given is None else given, COUPLINGS)
    if given not in (None, "tight"):
        raise ValueError(f"recorded: imu={SIMULATED} needs coupling=tight, got {given!r}")
    return "tight"


@dataclass(frozen=True, kw_only=True)
class _Options:
    """Those of `recorded`, checked one by one and with their defaults in place."""

    path: str
    grade: ImuGrade
    onset: float | None
    horizon: int | None
    velocity: bool | None
    sigma_floor: float
    noise_factor: float
    fixes: str
    coupling: str
    alignment: str | None
    least_speed: float | None
    noise: str | None
    aids: tuple[Aid, ...]
    simulated: ImuGrade | None
    oscillator: str
    attack: str | None
    clean: str | None
    code_scale: float
    rate_scale: float

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises:
            ValueError: naming them.
        """
        of_fixes = self.velocity is not None or self.sigma_floor != SIGMA_FLOOR or self.fixes != FIXES[0]
        if self.coupling == "tight" and of_fixes:
            raise ValueError("recorded: velocity, sigma_floor and fixes are of fixes; coupling=tight takes none")
        if self.noise is not None and "," in self.noise:
            raise ValueError(f"recorded: noise must not contain a comma, which separates options; got {self.noise!r}")
        stated = self.noise_factor != NOISE_FACTOR or self.sigma_floor != SIGMA_FLOOR
        if self.noise is not None and (stated or self.coupling == "tight"):
            told = "takes the place of noise_factor and sigma_floor, and needs coupling=loose"
            raise ValueError(f"recorded: noise {told}")
        if self.coupling == "tight" and self.aids:
            raise ValueError("recorded: aids go with coupling=loose")
        if self.coupling != "tight" and self.oscillator != OSCILLATOR:
            raise ValueError("recorded: oscillator is that of a receiver of ranges: coupling=tight is needed")
        if self.coupling != "tight" and (self.code_scale, self.rate_scale) != (1.0, 1.0):
            raise ValueError("recorded: code_scale and rate_scale are of ranges: coupling=tight is needed")
        if self.simulated is not None and (self.alignment is not None or self.least_speed is not None):
            raise ValueError(f"recorded: alignment and least_speed are not for imu={SIMULATED}: its attitude is known")

    @property
    def name(self) -> str:
        """The specification, without what is usual."""
        simulated = self.simulated
        usual = {
            "grade": GRADE if simulated is None else simulated.name,
            "sigma_floor": SIGMA_FLOOR,
            "noise_factor": NOISE_FACTOR if simulated is None else 1.0,
            "fixes": FIXES[0],
            "oscillator": OSCILLATOR,
            "coupling": COUPLINGS[0] if simulated is None else "tight",
            "code_scale": 1.0,
            "rate_scale": 1.0,
        }
        given = {
            "grade": self.grade.name,
            "onset": None if self.onset is None else np.format_float_positional(self.onset, trim="-"),
            "horizon": self.horizon,
            "velocity": self.velocity,
            "sigma_floor": self.sigma_floor,
            "noise_factor": self.noise_factor,
            "fixes": self.fixes,
            "coupling": self.coupling,
            "alignment": self.alignment,
            "least_speed": self.least_speed,
            "noise": self.noise,
            "aids": spell_aids(self.aids),
            "imu": None if simulated is None else f"{SIMULATED}:{simulated.name}",
            "oscillator": self.oscillator,
            "attack": self.attack,
            "clean": self.clean,
            "code_scale": self.code_scale,
            "rate_scale": self.rate_scale,
        }
        return spell("recorded", self.path, **{key: value for key, value in given.items() if value != usual.get(key)})

    @property
    def errors(self) -> RangeErrors:
        """What a filter on ranges believes of them."""
        clock = OSCILLATORS[self.oscillator]
        return replace(ERRORS, clock_h0=clock.h0, clock_h2=clock.h2)

    def family(self) -> RecordedFixes | RecordedRanges:
        """The filters on the log."""
        tuning = FilterTuning(
            attitude_sigma=COURSE_SIGMA,  # replaced by that of the alignment
            velocity_sigma=ALIGNMENT_VELOCITY_SIGMA,
            position_sigma=DEFAULT_SIGMA[:3],
            initial_scale=1.0,
            process_noise_scale=self.noise_factor**2,
            measurement_sigma=DEFAULT_SIGMA,
        )
        common = {"name": self.name, "grade": self.grade, "tuning": tuning, "onset": self.onset}
        common |= {"horizon": self.horizon, "aligned": self.alignment, "least_speed": self.least_speed}
        common |= {"attacked": self.attack is not None}
        if self.coupling == "tight" or self.fixes == "ranges":
            check_ranges_of(self.path)
        if self.coupling == "tight":
            common |= {"code_scale": self.code_scale, "rate_scale": self.rate_scale}
        if self.simulated is not None:
            return _resting(resting_log(self.path), imu=self.simulated, errors=self.errors, **common)
        return FAMILIES[self.coupling](checked_log(self.path), self, **common)


def _loose(log: Log, asked: _Options, *, tuning: FilterTuning, **common: Any) -> RecordedFixes:
    """The filter that takes fixes."""
    noise = None if asked.noise is None else read_noise(noise_file(asked.path, asked.noise))
    if asked.fixes == "ranges":
        log = replace(log, fixes=range_fixes(log))
    log = with_velocity_at_imu(checked_reference(log))
    if asked.velocity is False or (asked.velocity is None and log.fixes.velocity is None):
        tuning = replace(tuning, measurement_sigma=DEFAULT_SIGMA[:3])
    common |= {"log": log, "tuning": tuning, "sigma_floor": asked.sigma_floor, "noise": noise}
    if not asked.aids:
        return RecordedFixes(**common)
    found = [read_aid(log, aid) for aid in asked.aids]
    return RecordedAided(
        aids=tuple(aid for aid, _ in found), readings=tuple(readings for _, readings in found), **common
    )


def _tight(log: Log, asked: _Options, **common: Any) -> RecordedRanges:
    """The filter that takes code and rate of the raw ranges."""
    epochs = range_epochs(log)
    log = checked_reference(replace(log, fixes=epochs.fixes, lever_arm=_no_arm(log)))
    return RecordedRanges(log=log, epochs=epochs, errors=asked.errors, **common)


def _resting(log: Log, **common: Any) -> RestingRanges:
    """The filter on the ranges of an antenna that rests, with a simulated IMU."""
    epochs = range_epochs(log)
    return RestingRanges(log=checked_reference(replace(log, fixes=epochs.fixes)), epochs=epochs, **common)


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
