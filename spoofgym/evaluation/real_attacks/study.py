"""The study: clean records, thresholds, real and injected attacks, as one report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.profiles import NoAttack
from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.attacks.recorded import Recorded
from spoofgym.attacks.staggered import Stretch
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.real_attacks.clean_record import (
    CleanRecord,
    Watch,
    clean_record,
    false_alarms,
    first_epoch,
    room,
    watch,
)
from spoofgym.evaluation.real_attacks.injected import injected
from spoofgym.evaluation.real_attacks.outcomes import Game, game, outcome, standing
from spoofgym.evaluation.real_attacks.passes import Pass, play
from spoofgym.evaluation.real_attacks.records import Record
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.scenario import Scenario
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.scenarios.recorded_family import recorded_family
from spoofgym.scenarios.recorded_resting import RestingRanges

KIND = "real-attacks"
GAMES = 8
PROBABILITY = 0.01
TOO_EARLY = "the real attack begins before the filter has settled"


@dataclass(frozen=True)
class Asked:
    """What the study is to do.

    Attributes:
        words: specifications of the injected attacks by the words of tables.
        detectors: None = one of every family.
        probability: of a false alarm per epoch.
        games: of each injected attack in each record.
        seed: of simulated IMUs, and of what attacks draw.
    """

    words: dict[str, str]
    detectors: Sequence[Detector] | None = None
    probability: float = PROBABILITY
    games: int = GAMES
    seed: int = 0


@dataclass
class _Found:
    """What the study has found so far."""

    logs: list[dict[str, Any]] = field(default_factory=list)
    false_alarms: list[dict[str, Any]] = field(default_factory=list)
    rows: list[dict[str, Any]] = field(default_factory=list)
    left_out: list[dict[str, Any]] = field(default_factory=list)

    def report(self, asked: Asked) -> dict[str, Any]:
        """The report."""
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": KIND,
            "false_alarm_probability": asked.probability,
            "games": asked.games,
            "seed": asked.seed,
            "logs": list(self.logs),
            "false_alarms": list(self.false_alarms),
            "rows": list(self.rows),
            "left_out": list(self.left_out),
        }


def real_attacks(
    records: Sequence[Record], asked: Asked, progress: Progress = silent, *, lenient: bool = False
) -> Iterator[dict[str, Any]]:
    """The ``"real-attacks"`` report after every record; the last one is whole.

    Args:
        records: in the order of the tables.
        asked: what to do.
        progress: shows which record is played.
        lenient: whether a record that cannot be used is left out, with the reason.

    Raises:
        ValueError: a record cannot be used, or an attack is unknown.
    """
    found = _Found()
    for record in records:
        with progress(record.name):
            try:
                _study(record, asked, found)
            except ValueError as error:
                if not lenient:
                    raise
                found.left_out.append({"log": record.name, "part": "the log", "reason": str(error)})
        yield found.report(asked)


def _study(record: Record, asked: Asked, found: _Found) -> None:
    """Play one record."""
    scenario = record.attacked() if record.within else record.scenario()
    scene = clean_scene(scenario) if record.within else scenario
    longest = min(room(scene, record.beside), room(scenario, record.beside or record.within))
    watched = watch(scene, asked.detectors, longest)
    clean = clean_record(watched, asked.probability, asked.seed)
    for part, reason in watched.left_out.items():
        found.left_out.append({"log": record.name, "part": part, "reason": reason})
    found.logs.append(_log(record, watched, clean))
    for place, detector in enumerate(watched.names):
        if np.isnan(clean.thresholds[place]) and clean.alarms:
            reason = "its statistic is one value, or none above 0, in too many clean epochs"
            found.left_out.append({"log": record.name, "part": detector, "reason": reason})
        if not record.within:
            threshold = _finite(float(clean.thresholds[place]))
            entry = {"log": record.name, "detector": detector, "threshold": threshold}
            found.false_alarms.append(entry | false_alarms(clean, place))
    if not clean.alarms:
        return
    if record.within:
        found.rows += _within(record, scenario, watched, clean, asked.seed)
    else:
        found.rows += _beside(record, watched, clean, asked, found)


def _log(record: Record, watched: Watch, clean: CleanRecord) -> dict[str, Any]:
    """What the clean record of a log supports."""
    family = recorded_family(watched.scenario)
    return {
        "log": record.name,
        "scenario": watched.scenario.name,
        "clean": "its own" if not record.within else record.scene.name if record.scene else "before the attack",
        "filter": "tight" if watched.scenario.slots else "loose",
        "simulated_imu": family.imu.name if isinstance(family, RestingRanges) else None,
        "interval_s": watched.scenario.timeline.interval,
        "settling_s": watched.scenario.timeline.start - family.align_time,
        "clean_epochs": clean.epochs,
        "clean_s": float(clean.time[-1] - clean.start),
        "least_probability": 1.0 / clean.epochs,
        "supported": clean.alarms > 0,
        "alarms_set": clean.alarms,
        "set_ci95": exact_interval(clean.alarms, clean.epochs) if clean.alarms else None,
        "nis_per_degree": family.clean.nis_per_degree(family.first),
    }


def _beside(
    record: Record, watched: Watch, clean: CleanRecord, asked: Asked, found: _Found
) -> Iterator[dict[str, Any]]:
    """Rows of the injected attacks, and of the real one beside the true fixes or ranges: one pass plays them all."""
    scenario = watched.scenario
    last = scenario.timeline.num_epochs
    attacks, left_out = injected(scenario, asked.words, asked.games)
    found.left_out += [{"log": record.name, "part": word, "reason": reason} for word, reason in left_out.items()]
    stretches, groups = [Stretch(NoAttack(), 0, last)], []
    if record.beside and scenario.timeline.start < recorded_family(scenario).recorded_spoof().begin - 1e-6:
        groups.append((RECORDED, RECORDED, [len(stretches)]))
        stretches.append(Stretch(Recorded(), 0, last))
    elif record.beside:
        found.left_out.append({"log": record.name, "part": RECORDED, "reason": TOO_EARLY})
    for one in attacks:
        games = one.staggered()
        groups.append((one.word, one.attack.name, list(range(len(stretches), len(stretches) + len(games)))))
        stretches += games
    played = play(scenario, watched.detectors, stretches, asked.seed)
    excess = clean.excess(played.time - clean.start, played.statistic)
    for word, name, runs in groups:
        games_of = [_game(played, run, played.solution[:, 0]) for run in runs]
        head = _head(record, word, name, games_of)
        for place, detector in enumerate(watched.names):
            if not np.isnan(clean.thresholds[place]):
                alarms = [excess[place, :, run] > 0.0 for run in runs]
                against = [excess[place, :, 0] > 0.0] * len(runs)
                yield {**head, "detector": detector, **outcome(games_of, alarms, against)}


def _within(
    record: Record, scenario: Scenario, watched: Watch, clean: CleanRecord, seed: int
) -> Iterator[dict[str, Any]]:
    """Rows of the real attack that the log's own ranges hold."""
    family = recorded_family(scenario)
    spoof = family.recorded_spoof()
    first = first_epoch(family, watched.memory)
    whole = scenario.changed(onset=float(family.epoch_time[first]), horizon=None)
    if not whole.timeline.start < spoof.begin - 1e-6:
        raise ValueError(f"scenario {scenario.name!r}: {TOO_EARLY}")
    played = play(whole, watched.detectors, [Stretch(Recorded(), 0, whole.timeline.num_epochs)], seed)
    before = int(np.searchsorted(played.time, spoof.begin)) - 1
    effects = family.log.effects
    one = _game(played, 0, played.solution[max(before, 0), 0], None if effects is None else effects.pull)
    excess = clean.excess(played.time - whole.timeline.start, played.statistic)
    head = _head(record, RECORDED, RECORDED, [one])
    for place, detector in enumerate(watched.names):
        if not np.isnan(clean.thresholds[place]):
            alarm = excess[place, :, 0] > 0.0
            yield {**head, "detector": detector, **outcome([one], [alarm], [standing(alarm, one.first)])}


def _game(played: Pass, run: int, unspoofed: Floats, pull: float | None = None) -> Game:
    return game(
        played.time, played.active[:, run], played.error[:, run], played.solution[:, run], unspoofed,
        played.offset[:, run], pull,
    )  # fmt: skip


def _head(record: Record, word: str, name: str, games: Sequence[Game]) -> dict[str, Any]:
    """What all rows of one attack on one record have in common."""
    largest = [each.largest for each in games if each.largest is not None]
    back = [math.inf if each.recovery is None else each.recovery for each in games if each.ends]
    return {
        "log": record.name,
        "attack": word,
        "specification": name,
        "real": word == RECORDED,
        "onsets_s": [each.begin for each in games],
        "lasts_s": float(np.median([each.time[each.last] - each.begin for each in games])),
        "largest_offset_m": float(np.median([each.largest_offset for each in games])),
        "largest_error_m": float(np.median(largest)) if largest else None,
        "recovered": sum(math.isfinite(time) for time in back),
        "ended": len(back),
        "recovery_s": _finite(float(np.median(back))) if back else None,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
