"""One played game, epoch by epoch: what a page, a table or a story in the terminal is made of.

All series stand on one time axis, the epochs 0..K of the game. What belongs to an epoch before its fix is resolved
(innovation, statistics, offset) and what the decision made of it (use, backtrack, error) stand in the same row.
`spoofgym.evaluation.game_recording` plays and records.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spoofgym import __version__
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.evaluation.departures import Departure
from spoofgym.evaluation.plain_series import PlainReader, decimals, significant
from spoofgym.geodesy import horizontal
from spoofgym.validation import shown

KIND, SCHEMA_VERSION = "game", 1
AXES = ("east", "north", "up")
ONSET, END, ALARM, EXCLUSION = "onset", "end of the attack", "alarm", "exclusion"
BACKTRACK, REUSE, RESET, DIVERGENCE = "backtrack", "re-use", "reset", "divergence"
LEFT, BACK = "corridor left", "back in the corridor"


@dataclass(frozen=True)
class Players:
    """Who played on what, each by its specification.

    Attributes:
        scenario: of the game.
        fidelity: of the simulation.
        attack: who spoofs; None = nobody.
        drawn: whom a pool of attacks has drawn, "none" for a clean game; None = the attack is no pool.
        response: who decides; None = every fix is used.
        seed: of the game.
    """

    scenario: str
    fidelity: str
    attack: str | None
    drawn: str | None
    response: str | None
    seed: int


@dataclass(frozen=True)
class Statistic:
    """A detector's statistic.

    Attributes:
        name: specification of the detector.
        threshold: it alarms above it.
        arl0: epochs between false alarms at the threshold; None = unknown.
        values: (T,); infinite = a certain alarm.
    """

    name: str
    threshold: float
    arl0: float | None
    values: Floats

    @property
    def alarm(self) -> Flags:
        """Whether it alarms, (T,)."""
        return self.values > self.threshold


@dataclass(frozen=True)
class ProtectionLevel:
    """A bound of the position error.

    Attributes:
        name: what gives it: "filter", K sigma of its own covariance, which spoofing does not change; or a detector.
        direction: "horizontal", "up", "east" or "north".
        alert_limit: of the scenario in this direction, m.
        values: (T,), m; infinite = there is none.
    """

    name: str
    direction: str
    alert_limit: float
    values: Floats


@dataclass(frozen=True)
class GameEvent:
    """Something that happened in a game.

    Attributes:
        kind: what, one of the names at the head of this module.
        epoch: when.
        detail: more of it: which detectors alarm, how many epochs are taken back; may be empty.
    """

    kind: str
    epoch: int
    detail: str = ""


@dataclass(frozen=True, eq=False)
class GameTrace:
    """A game of T = K + 1 epochs; shorter where its filter diverged.

    Attributes:
        players: who played on what.
        time: scenario time, (T,), s.
        true: position of the vehicle, (T, 3), m ENU from where it is at epoch 0; beside its path where it is steered by
            its estimate.
        estimated: by the filter after the decision on the epoch, (T, 3), m ENU: the real-time output.
        spoofed: where the spoofer's signals put the vehicle, (T, 3), m ENU; the true position where there is no attack.
        attacked: whether the fix is spoofed, (T,).
        sigma: that the filter predicts before it resolves the fix, horizontal and up, (T, 2), m.
        innovation: of the position, the filter's prediction minus the fix, (T, 3), m ENU; of ranges, the position that
            they ask for by generalised least squares.
        innovation_sigma: square root of the diagonal of its covariance, (T, 3), m.
        statistics: of the detectors, in order.
        levels: protection levels, where filter or detectors give one.
        used: whether the fix was used, (T,).
        backtracked: epochs whose fixes were taken back at the epoch, (T,).
        reset: whether the filter was reset to the fix, (T,).
        left_out: satellites left out of a fix that is used, (T,); zero on fixes of position.
        diverged: whether the filter diverged in the last epoch.
        departure: of the vehicle from its path; None where it keeps it.
    """

    players: Players
    time: Floats
    true: Floats
    estimated: Floats
    spoofed: Floats
    attacked: Flags
    sigma: Floats
    innovation: Floats
    innovation_sigma: Floats
    statistics: tuple[Statistic, ...]
    levels: tuple[ProtectionLevel, ...]
    used: Flags
    backtracked: Runs
    reset: Flags
    left_out: Runs
    diverged: bool = False
    departure: Departure | None = None

    @cached_property
    def error_vector(self) -> Floats:
        """Estimated minus true position, (T, 3), m ENU."""
        return self.estimated - self.true

    @cached_property
    def error(self) -> Floats:
        """Horizontal error of the real-time output, (T,), m."""
        return horizontal(self.error_vector)

    @cached_property
    def alarm(self) -> Flags:
        """Whether any detector alarms, (T,)."""
        return np.any([np.zeros(len(self.time), dtype=bool), *(part.alarm for part in self.statistics)], axis=0)

    @cached_property
    def events(self) -> tuple[GameEvent, ...]:
        """What happened, in order: attacks, alarms and exclusions where they begin."""
        order = (ONSET, END, ALARM, LEFT, BACK, BACKTRACK, EXCLUSION, REUSE, RESET, DIVERGENCE)
        return tuple(sorted(self._events(), key=lambda event: (event.epoch, order.index(event.kind))))

    def first(self, kind: str) -> GameEvent | None:
        """The first event of a kind; None = there is none."""
        return next((event for event in self.events if event.kind == kind), None)

    @property
    def undetected(self) -> bool:
        """Whether no detector alarms from the onset on."""
        onset = self.first(ONSET)
        return onset is None or not self.alarm[onset.epoch :].any()

    def _events(self) -> Iterator[GameEvent]:
        for epoch in _begins(self.attacked):
            yield GameEvent(ONSET, epoch)
        for epoch in _ends(self.attacked):
            yield GameEvent(END, epoch)
        for epoch in _begins(self.alarm):
            yield GameEvent(ALARM, epoch, ", ".join(part.name for part in self.statistics if part.alarm[epoch]))
        for epoch in _begins(~self.used):
            yield GameEvent(EXCLUSION, epoch)
        for epoch in _ends(~self.used):
            yield GameEvent(REUSE, epoch)
        for epoch in np.flatnonzero(self.backtracked).tolist():
            yield GameEvent(BACKTRACK, epoch, _epochs(int(self.backtracked[epoch])))
        for epoch in np.flatnonzero(self.reset).tolist():
            yield GameEvent(RESET, epoch)
        if self.departure is not None:
            for kind, epochs in ((LEFT, _begins(self.departure.outside)), (BACK, _ends(self.departure.outside))):
                yield from (GameEvent(kind, epoch) for epoch in epochs)
        if self.diverged:
            yield GameEvent(DIVERGENCE, len(self.time) - 1)

    def columns(self) -> dict[str, list[Any]]:
        """Every series by its name and unit, as a table has it."""
        table: dict[str, Any] = {"epoch": np.arange(len(self.time)), "time_s": self.time}
        for name, series in (("true", self.true), ("estimated", self.estimated), ("spoofed", self.spoofed)):
            table |= {f"{name}_{axis}_m": series[:, place] for place, axis in enumerate(AXES)}
        table |= {"attacked": self.attacked, "error_m": self.error, "error_up_m": self.error_vector[:, 2]}
        if self.departure is not None:
            table |= {"deviation_m": self.departure.deviation}
        table |= {"sigma_horizontal_m": self.sigma[:, 0], "sigma_up_m": self.sigma[:, 1]}
        for place, axis in enumerate(AXES):
            table[f"innovation_{axis}_m"] = self.innovation[:, place]
            table[f"innovation_sigma_{axis}_m"] = self.innovation_sigma[:, place]
        for part in self.statistics:
            table |= {f"statistic of {part.name}": part.values, f"threshold of {part.name}": part.threshold}
        for level in self.levels:
            table[f"protection level {level.direction} of {level.name}, m"] = level.values
        table |= {"alarm": self.alarm, "used": self.used, "backtracked": self.backtracked}
        table |= {"reset": self.reset, "satellites_left_out": self.left_out}
        return {name: np.broadcast_to(values, self.time.shape).tolist() for name, values in table.items()}

    def to_csv(self) -> str:
        """A table with a row per epoch: numbers as they are, flags as 0 and 1, events by name in the last column."""
        table = self.columns()
        happened: dict[int, list[str]] = {}
        for event in self.events:
            happened.setdefault(event.epoch, []).append(event.kind)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([*table, "events"])
        for epoch, row in enumerate(zip(*table.values(), strict=True)):
            writer.writerow([*(_cell(value) for value in row), "; ".join(happened.get(epoch, []))])
        return text.getvalue()

    def to_json(self) -> dict[str, Any]:
        """Plain values: positions to the millimetre, statistics to six digits, events and errors for readers."""
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": KIND,
            "spoofgym": __version__,
            "players": asdict(self.players),
            "diverged": self.diverged,
            "time_s": decimals(self.time, 4),
            "true_m": _by_axis(self.true),
            "estimated_m": _by_axis(self.estimated),
            "spoofed_m": _by_axis(self.spoofed),
            "attacked": _counts(self.attacked),
            "error_m": decimals(self.error),
            "sigma_m": {"horizontal": decimals(self.sigma[:, 0], 4), "up": decimals(self.sigma[:, 1], 4)},
            "innovation_m": _by_axis(self.innovation),
            "innovation_sigma_m": _by_axis(self.innovation_sigma, 4),
            "statistics": [
                {"name": part.name, "threshold": part.threshold, "arl0": part.arl0, "values": significant(part.values)}
                for part in self.statistics
            ],
            "protection_levels": [
                {"name": level.name, "direction": level.direction, "alert_limit_m": level.alert_limit,
                 "values_m": decimals(level.values)}
                for level in self.levels
            ],
            "used": _counts(self.used),
            "backtracked": _counts(self.backtracked),
            "reset": _counts(self.reset),
            "satellites_left_out": _counts(self.left_out),
            **({} if self.departure is None else {"departure": _departure_json(self.departure)}),
            "events": [asdict(event) for event in self.events],
        }

    @classmethod
    def from_json(cls, content: object) -> GameTrace:
        """The game that `to_json` has written, as exactly as it was rounded there.

        Args:
            content: as `json.loads` gives it; errors and events are not read but found anew.

        Raises:
            ValueError: it is no game, of another version, or damaged; the message says what.
        """
        reader = PlainReader("game", content)
        if reader.member("kind") != KIND:
            raise ValueError(f"not a game: its kind is {shown(reader.member('kind'))}")
        if (version := reader.member("schema_version")) != SCHEMA_VERSION:
            raise ValueError(f"game: this version reads schema_version {SCHEMA_VERSION}, got {shown(version)}")
        time = reader.floats("time_s")
        size = len(time)
        sigma = reader.part("sigma_m")
        return cls(
            players=_players(reader.part("players")),
            time=time,
            true=_axes(reader.part("true_m"), size),
            estimated=_axes(reader.part("estimated_m"), size),
            spoofed=_axes(reader.part("spoofed_m"), size),
            attacked=reader.flags("attacked", size),
            sigma=np.stack([sigma.floats("horizontal", size), sigma.floats("up", size)], axis=1),
            innovation=_axes(reader.part("innovation_m"), size),
            innovation_sigma=_axes(reader.part("innovation_sigma_m"), size),
            statistics=tuple(_statistic(part, size) for part in reader.parts("statistics")),
            levels=tuple(_level(part, size) for part in reader.parts("protection_levels")),
            used=reader.flags("used", size),
            backtracked=reader.counts("backtracked", size),
            reset=reader.flags("reset", size),
            left_out=reader.counts("satellites_left_out", size),
            diverged=reader.flag("diverged"),
            departure=_departure(reader.part("departure"), size) if reader.has("departure") else None,
        )


def _by_axis(series: Floats, digits: int = 3) -> dict[str, list[Any]]:
    return {axis: decimals(series[:, place], digits) for place, axis in enumerate(AXES)}


def _axes(reader: PlainReader, length: int) -> Floats:
    return np.stack([reader.floats(axis, length) for axis in AXES], axis=1)


def _counts(series: Flags | Runs) -> list[int]:
    return [int(value) for value in series.tolist()]


def _players(reader: PlainReader) -> Players:
    return Players(
        scenario=reader.text("scenario"),
        fidelity=reader.text("fidelity"),
        attack=reader.text_or_none("attack"),
        drawn=reader.text_or_none("drawn"),
        response=reader.text_or_none("response"),
        seed=reader.whole("seed"),
    )


def _statistic(reader: PlainReader, length: int) -> Statistic:
    return Statistic(
        name=reader.text("name"),
        threshold=reader.number("threshold"),
        arl0=reader.number_or_none("arl0"),
        values=reader.floats("values", length),
    )


def _level(reader: PlainReader, length: int) -> ProtectionLevel:
    return ProtectionLevel(
        name=reader.text("name"),
        direction=reader.text("direction"),
        alert_limit=reader.number("alert_limit_m"),
        values=reader.floats("values_m", length),
    )


def _departure(reader: PlainReader, length: int) -> Departure:
    return Departure(reader.floats("deviation_m", length), reader.number("corridor_m"))


def _departure_json(departure: Departure) -> dict[str, Any]:
    return {"corridor_m": departure.corridor, "deviation_m": decimals(departure.deviation)}


def _epochs(number: int) -> str:
    return "1 epoch" if number == 1 else f"{number} epochs"


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    return str(int(value))


def _begins(flags: Flags) -> list[int]:
    """Epochs at which a stretch of flags begins."""
    return np.flatnonzero(flags & ~np.concatenate([[False], flags[:-1]])).tolist()


def _ends(flags: Flags) -> list[int]:
    """Epochs that follow a stretch of flags."""
    return np.flatnonzero(~flags & np.concatenate([[False], flags[:-1]])).tolist()
