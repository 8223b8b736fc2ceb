"""A real attack on the ranges of a log: in a table beside the true ones, or in the log's own table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.logs.log import Log
from spoofgym.logs.ranges_log import Ranges, read_ranges
from spoofgym.logs.table import has_table, seconds

TABLE = "ranges_spoofed"
SAME_TIME = 2e-3
"""Epochs of both tables this close to each other are the same, s."""


@dataclass(frozen=True, eq=False)
class RangeSpoof:
    """What a recorded attack does to the ranges of a log, on their own clock.

    Attributes:
        begin: of the first effect, s; infinite = there is no attack.
        end: of the last effect, s.
        code: the victim's pseudoranges less those of the log, zero outside the attack, (E, S), m; None = the log's own
            ranges are those that the victim got.
        rate: its range rates less those of the log, (E, S), m/s; None = as above.
    """

    begin: float = np.inf
    end: float = np.inf
    code: Floats | None = None
    rate: Floats | None = None

    def during(self, time: Floats) -> Flags:
        """Whether the attack acts at times of the receiver's clock, (E,)."""
        return np.asarray((time >= self.begin - SAME_TIME) & (time <= self.end + SAME_TIME))

    def marked(self, read: Ranges, ranges: Ranges) -> Ranges:
        """Ranges with what the attack adds in their place; ``has_rate`` says whether it acts.

        Args:
            read: the ranges as they were read.
            ranges: the same epochs, steps of the clock taken away.
        """
        nothing = np.zeros(ranges.pseudorange.shape)
        return replace(
            ranges,
            pseudorange=nothing if self.code is None else self.code,
            range_rate=nothing if self.rate is None else self.rate,
            has_rate=np.broadcast_to(self.during(read.time)[:, None], nothing.shape),
        )


def spoofed_within(log: Log) -> bool:
    """Whether the log's own ranges are spoofed: it states a first effect and has no table beside them."""
    return log.effects is not None and not has_table(log.folder, TABLE)


def spoofed_ranges(log: Log, ranges: Ranges) -> RangeSpoof:
    """The attack that a log holds on its ranges.

    ``ranges_spoofed.csv`` has the columns of ``ranges.csv`` and the same times; the attack lasts from
    ``attack_start_s`` to ``attack_end_s`` of ``log.toml``. Without this table ``first_effect_s`` says from when on
    ``ranges.csv`` itself is spoofed. A satellite that the victim had lost keeps its true range.

    Args:
        log: its notes and its folder.
        ranges: as they were read.

    Raises:
        ValueError: the table cannot be read, its interval is missing or empty, or an epoch has no counterpart.
    """
    if not has_table(log.folder, TABLE):
        return RangeSpoof() if log.effects is None else RangeSpoof(log.effects.begin, log.effects.end or np.inf)
    owner = f"log {str(log.folder)!r}: {TABLE}.csv"
    if log.attacked is None:
        raise ValueError(f"{owner}: log.toml must state attack_start_s and attack_end_s, of the first and last range")
    whole = RangeSpoof(*log.attacked)
    during = whole.during(ranges.time)
    if not during.any():
        raise ValueError(f"{owner}: no epoch of ranges.csv lies between attack_start_s and attack_end_s")
    victim = read_ranges(log.folder, TABLE)
    after = np.clip(np.searchsorted(victim.time, ranges.time), 1, len(victim.time) - 1)
    near = np.where(ranges.time - victim.time[after - 1] < victim.time[after] - ranges.time, after - 1, after)
    missing = during & (np.abs(victim.time[near] - ranges.time) > SAME_TIME)
    if missing.any():
        raise ValueError(f"{owner} has no epoch at {seconds(float(ranges.time[np.argmax(missing)]))} s")
    both = during[:, None] & (ranges.satellite >= 0) & (victim.satellite[near] >= 0)
    code = np.where(both, victim.pseudorange[near] - ranges.pseudorange, 0.0)
    return replace(whole, code=code, rate=np.where(both, victim.range_rate[near] - ranges.range_rate, 0.0))
