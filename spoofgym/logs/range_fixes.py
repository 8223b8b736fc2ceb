"""Fixes made from the ranges of a recorded log: weighted least squares, with single faulty ranges left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np
from scipy.stats import chi2

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.logs.log import Fixes, Log
from spoofgym.logs.mounting import NO_RANGE_DELAY, find_delay
from spoofgym.logs.ranges_log import CorrectedRanges, Ranges, correct, read_ranges
from spoofgym.logs.table import has_table
from spoofgym.sensors.least_squares import Fix, VelocityFix, fix, velocity_fix

FALSE_ALARM = 1e-3
"""Probability that the residuals of an epoch without fault fail their test."""
LEAST_CHECKED = 5
"""Fewest ranges whose residuals tell of a fault."""
LEAST_LEFT = 6
"""Fewest ranges that must be left for one to be left out: with fewer, any range can be blamed for any fault."""
MAX_SIGMA = 20.0
"""A fix with a larger horizontal 1 sigma is none, m."""
MAX_VELOCITY_SIGMA = 2.0
"""A velocity with a larger 1 sigma is none, m/s."""
LEAST_SHARE = 0.1
"""Least share of positions with a velocity. Where range rates are wrong, hardly any position has one."""
PASSES = 2
"""Of corrections and fixes, before faults are looked for: a first clock and place, then good ones."""


@dataclass(frozen=True, eq=False)
class RangeSolution:
    """What the ranges of a log say epoch by epoch; NaN where not ``solved``.

    Attributes:
        position: latitude rad, longitude rad, height m, (E, 3).
        clock: offset of the receiver's clock as a range, (E,), m.
        clock_sigma: (E,), m.
        velocity: ENU, (E, 3), m/s.
        clock_drift: (E,), m/s.
        clock_drift_sigma: (E,), m/s.
        position_sigma: ENU, (E, 3), m.
        velocity_sigma: ENU, (E, 3), m/s.
        placed: position passed the test of its residuals and has a small sigma, (E,).
        solved: so did position and velocity, (E,).
        corrected: the ranges, at these positions.
        used: ranges that were not left out, (E, S).
        used_rate: range rates that were not left out, (E, S).
    """

    position: Floats
    clock: Floats
    clock_sigma: Floats
    velocity: Floats
    clock_drift: Floats
    clock_drift_sigma: Floats
    position_sigma: Floats
    velocity_sigma: Floats
    placed: Flags
    solved: Flags
    corrected: CorrectedRanges
    used: Flags
    used_rate: Flags


Solution = TypeVar("Solution", Fix, VelocityFix)
Solver = Callable[[Runs, Flags], Solution]
"""Least squares of these epochs (n,), of the ranges (n, S) that are to be used."""


def range_fixes(log: Log) -> Fixes:
    """The fixes of the log's ranges, on the clock of its IMU.

    Raises:
        ValueError: the log has no ranges, they cannot be used, or the drive does not tell their delay.
    """
    if not has_table(log.folder, "ranges"):
        raise ValueError(f"log {str(log.folder)!r} has no ranges (ranges.csv, ephemeris.csv) to make fixes from")
    ranges = read_ranges(log.folder, ionosphere=log.ionosphere)
    solution = solve_ranges(ranges, log.fixes.position[0])
    check_solved(log, ranges, solution)
    return fixes_of(solution, range_delay(log, solution))


def check_solved(log: Log, ranges: Ranges, solution: RangeSolution) -> None:
    """Refuse ranges that hardly give a fix, and say whether the codes or the rates are to blame.

    Raises:
        ValueError: there are fewer than 2 positions, or velocities for less than `LEAST_SHARE` of them.
    """
    owner, epochs = f"log {str(log.folder)!r}: ranges", len(ranges.time)
    placed, solved = int(solution.placed.sum()), int(solution.solved.sum())
    if placed < 2:
        raise ValueError(
            f"{owner} must give a fix in 2 epochs or more, pseudorange_m gives a position in {placed} of {epochs}; it "
            "must be in metres, t_s the time of the GPS week, and the fixes within 100 km"
        )
    if solved < max(2.0, LEAST_SHARE * placed):
        turned = solve_ranges(replace(ranges, range_rate=-ranges.range_rate), log.fixes.position[0])
        sign = "; with all signs changed they fit" if turned.solved.sum() > LEAST_SHARE * placed else ""
        raise ValueError(
            f"{owner} must give a fix in 2 epochs or more: range_rate_mps gives a velocity in {solved} of {placed} "
            "epochs that have a position; the rates must be in m/s and positive where the satellite recedes, "
            f"- Doppler x c / f{sign}"
        )


def fixes_of(solution: RangeSolution, delay: float) -> Fixes:
    """The epochs that are solved as fixes.

    Args:
        solution: of the ranges.
        delay: how much later than on the log's clock they are received, s.
    """
    solved = solution.solved
    return Fixes(
        time=solution.corrected.geometry.time[solved] - delay,
        position=solution.position[solved],
        velocity=solution.velocity[solved],
        position_sigma=solution.position_sigma[solved],
        velocity_sigma=solution.velocity_sigma[solved],
    )


def range_delay(log: Log, solution: RangeSolution) -> float:
    """How much later than on the log's clock the ranges are received on the clock of GPS, s.

    It is found from the drive, as the delay of the fixes is where the mounting is unknown (`find_delay`). An antenna
    that rests has no IMU but a simulated one, on the clock of GPS.

    Raises:
        ValueError: the drive does not tell it.
    """
    if log.antenna is not None:
        return 0.0
    time, velocity = solution.corrected.geometry.time[solution.solved], solution.velocity[solution.solved]
    after = time >= log.start
    moved = time[after], velocity[after]
    return find_delay(
        f"log {str(log.folder)!r}", log.imu_time, log.angular_rate, log.specific_force, *moved, failure=NO_RANGE_DELAY
    )


def solve_ranges(ranges: Ranges, start: Floats) -> RangeSolution:
    """Weighted least squares of every epoch, without the single ranges that make its residuals too large.

    Args:
        ranges: of a receiver.
        start: latitude rad, longitude rad, height m, (3,), within 100 km.
    """
    epochs = len(ranges.time)
    position, clock = np.tile(start, (epochs, 1)), np.zeros(epochs)
    for _ in range(PASSES):
        corrected = correct(ranges, position, clock)
        everything = _position(corrected, start)(np.arange(epochs), corrected.geometry.present)
        position, clock = _filled(everything, start)
    corrected = correct(ranges, position, clock)
    place, used = without_faults(_position(corrected, start), corrected.geometry.present, corrected.sigma)
    rate, used_rate = without_faults(_velocity(corrected, position), corrected.has_rate, corrected.rate_sigma)
    sigma, rate_sigma = (np.sqrt(np.diagonal(part.covariance, axis1=1, axis2=2)[:, :3]) for part in (place, rate))
    placed = place.solved & (np.hypot(sigma[:, 0], sigma[:, 1]) <= MAX_SIGMA)
    solved = placed & rate.solved & (np.hypot(rate_sigma[:, 0], rate_sigma[:, 1]) <= MAX_VELOCITY_SIGMA)
    return RangeSolution(
        position=place.position,
        clock=place.clock,
        clock_sigma=np.sqrt(place.covariance[:, 3, 3]),
        velocity=rate.velocity,
        clock_drift=rate.clock_drift,
        clock_drift_sigma=np.sqrt(rate.covariance[:, 3, 3]),
        position_sigma=sigma,
        velocity_sigma=rate_sigma,
        placed=placed,
        solved=solved,
        corrected=corrected,
        used=used,
        used_rate=used_rate,
    )


def along_fixes(values: Floats, solution: RangeSolution) -> Floats:
    """Values of every epoch, (E,), by straight lines between the epochs that are solved."""
    solved = np.flatnonzero(solution.solved)
    return np.interp(np.arange(len(values)), solved, values[solved])


def between_fixes(solution: RangeSolution) -> tuple[Floats, Floats]:
    """Position and velocity of every epoch, (E, 3) each, by straight lines between the epochs that are solved."""
    origin = solution.position[solution.solved][0]
    track = position_difference(np.where(solution.solved[:, None], solution.position, origin), origin)
    return (
        displace(origin, np.column_stack([along_fixes(track[:, a], solution) for a in range(3)])),
        np.column_stack([along_fixes(solution.velocity[:, a], solution) for a in range(3)]),
    )


def without_faults(solve: Solver[Solution], present: Flags, sigma: Floats) -> tuple[Solution, Flags]:
    """Least squares of E epochs, each without the ranges that make its residuals too large.

    The sum of the squared residuals over sigma has a chi-square distribution with n - 4 degrees of freedom. Where it
    fails the test, the range is left out whose absence makes the sum smallest, and so on while one can be spared (RAIM;
    Groves 2013, section 17.4.1). What fails to the end, or cannot be tested, is not solved.

    Args:
        solve: least squares of chosen epochs.
        present: ranges that there are, (E, S).
        sigma: of the ranges, (E, S).

    Returns:
        The solution, and the ranges that it uses, (E, S).
    """
    used = present.copy()
    solution = solve(np.arange(len(present)), used)
    failed = np.flatnonzero(_fails(solution, used, sigma))
    while len(failed := failed[used[failed].sum(axis=1) > LEAST_LEFT]):
        smallest, worst = np.full(len(failed), np.inf), np.full(len(failed), -1)
        for slot in range(present.shape[1]):
            less = used[failed].copy()
            less[:, slot] = False
            trial = _sum_of_squares(solve(failed, less), sigma[failed])
            better = used[failed, slot] & (trial < smallest)
            smallest[better], worst[better] = trial[better], slot
        failed, worst = failed[worst >= 0], worst[worst >= 0]
        used[failed, worst] = False
        again = solve(failed, used[failed])
        for item in fields(solution):
            getattr(solution, item.name)[failed] = getattr(again, item.name)
        failed = failed[_fails(again, used[failed], sigma[failed])]
    solution.solved[:] &= (used.sum(axis=1) >= LEAST_CHECKED) & ~_fails(solution, used, sigma)
    return solution, used


def _fails(solution: Fix | VelocityFix, used: Flags, sigma: Floats) -> Flags:
    """Epochs with a solution whose residuals fail their test, (n,)."""
    spare = np.maximum(used.sum(axis=1) - 4, 0)
    threshold = chi2.isf(FALSE_ALARM, np.arange(used.shape[1] + 1))[spare]
    return np.asarray(solution.solved & (spare > 0) & (_sum_of_squares(solution, sigma) > threshold))


def _sum_of_squares(solution: Fix | VelocityFix, sigma: Floats) -> Floats:
    """Of the residuals over sigma, (n,); infinite where there is no solution."""
    normalised = solution.residual / np.where(sigma > 0.0, sigma, 1.0)
    return np.where(solution.solved, np.add.reduce(normalised**2, axis=1), np.inf)


def _position(corrected: CorrectedRanges, start: Floats) -> Solver[Fix]:
    place = corrected.geometry.position
    return lambda epochs, used: fix(place[epochs], corrected.pseudorange[epochs], used, corrected.sigma[epochs], start)


def _velocity(corrected: CorrectedRanges, position: Floats) -> Solver[VelocityFix]:
    geometry = corrected.geometry
    return lambda epochs, used: velocity_fix(
        geometry.position[epochs],
        geometry.velocity[epochs],
        corrected.range_rate[epochs],
        used,
        corrected.rate_sigma[epochs],
        position[epochs],
    )


def _filled(solution: Fix, start: Floats) -> tuple[Floats, Floats]:
    """Position and clock of every epoch, those of the nearest solved one where there is none."""
    solved = np.flatnonzero(solution.solved)
    if len(solved) == 0:
        return np.tile(start, (len(solution.solved), 1)), np.zeros(len(solution.solved))
    index = np.arange(len(solution.solved))
    right = np.clip(np.searchsorted(solved, index), 0, len(solved) - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(solved[left] - index) <= np.abs(solved[right] - index), solved[left], solved[right])
    return solution.position[nearest], solution.clock[nearest]
