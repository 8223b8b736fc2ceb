"""A clean record: thresholds at a share of alarms in it, and what false alarms it lets us claim.

A record of n epochs shows no smaller share than 1 / n. The threshold of a share p leaves k = ⌊p n⌋ epochs above it, so
that, were epochs independent, the true share would lie in the interval of Clopper and Pearson of k in n. How far a
threshold of this record holds elsewhere is measured by halves: that of one half is tried on the other.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.profiles import NoAttack
from spoofgym.attacks.staggered import Stretch
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.real_attacks.passes import UNREACHED, play
from spoofgym.fitting import fit_detectors
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded_family import SETTLING, RecordedFamily, recorded_family

OWNER = "real-attacks"
TOLD = ("receiver-flag",)
"""Detectors that are told whether signals are counterfeit: a model of a receiver, and no test."""
HOUR = 3600.0


@dataclass(frozen=True)
class Watch:
    """The detectors of a record, and where its games begin.

    Attributes:
        scenario: from its `first_epoch` on.
        detectors: with thresholds that nothing reaches.
        names: of the detectors: those of their families, or their specifications where they were given.
        growing: which statistics grow in clean runs, so that a line through them is taken away.
        left_out: why a detector does not watch, by its name.
    """

    scenario: Scenario
    detectors: list[Detector]
    names: list[str]
    growing: list[bool]
    left_out: dict[str, str]

    @property
    def memory(self) -> int:
        """The longest of all detectors, epochs."""
        return max((detector.memory for detector in self.detectors), default=0)


@dataclass(frozen=True)
class CleanRecord:
    """What detectors say of a clean record.

    Attributes:
        time: of its epochs, (n,), s.
        statistic: of each detector, less the growth that is fitted where a detector asks for it, (D, n).
        growth: of each statistic, (D,), 1/s.
        start: from which growth counts, s.
        probability: of a false alarm per epoch.
        thresholds: (D,); NaN = there is none that gives this share.
    """

    time: Floats
    statistic: Floats
    growth: Floats
    start: float
    probability: float
    thresholds: Floats

    @property
    def epochs(self) -> int:
        """n."""
        return len(self.time)

    @property
    def alarms(self) -> int:
        """k, epochs that a threshold of the asked share leaves above it; 0 = the record does not support the share."""
        return int(self.probability * self.epochs + 1e-9)

    def excess(self, since: Floats, statistic: Floats) -> Floats:
        """How far statistics (D, K, N) are above their thresholds, (K,) s after epoch 0; never where there is none."""
        grown = self.growth[:, None, None] * since[None, :, None]
        thresholds = np.where(np.isnan(self.thresholds), np.inf, self.thresholds)
        return np.asarray(statistic - grown - thresholds[:, None, None])

    def held_out(self, place: int) -> Flags | None:
        """Alarms of a detector in each half by the threshold of the other half, (n,).

        None = there is no threshold of this share, or a half is too short for it.
        """
        middle = self.epochs // 2
        first, second = self.statistic[place : place + 1, :middle], self.statistic[place : place + 1, middle:]
        of_first, of_second = exceeded(first, self.probability), exceeded(second, self.probability)
        if np.isnan(self.thresholds[place] + of_first[0] + of_second[0]):
            return None
        return np.hstack([first > of_second, second > of_first])[0]


def first_epoch(family: RecordedFamily, memory: int) -> int:
    """Epoch 0 of the games of a record: the filter has settled for `SETTLING`, or half the log, and memories are full.

    Args:
        family: of the record.
        memory: the longest of its detectors, epochs.
    """
    time = family.epoch_time
    settling = min(SETTLING, 0.5 * float(time[-1] - family.align_time))
    return max(int(np.searchsorted(time, family.align_time + settling)), memory)


def room(scenario: Scenario, attack: bool) -> int:
    """How many epochs a detector may remember: those before the log's real attack, or else half of all.

    Args:
        scenario: a recorded log.
        attack: whether it holds a real attack that is to be played.
    """
    family = recorded_family(scenario)
    if not attack:
        return len(family.epoch_time) // 2
    return int(np.searchsorted(family.epoch_time, family.recorded_spoof().begin - 1e-6)) - 1


def watch(scenario: Scenario, given: Sequence[Detector] | None, longest: int) -> Watch:
    """The detectors that can watch a record, each by itself.

    Args:
        scenario: a recorded log.
        given: detectors; None = one of every family, with its usual options.
        longest: memory that the record has room for, epochs.

    Raises:
        ValueError: the log is too short.
    """
    watched = Watch(scenario, [], [], [], {})
    asked: dict[str, str | Detector] = {name: name for name in DETECTORS if name not in TOLD}
    if given is not None:
        asked = {detector.name: detector for detector in given}
    for name, part in asked.items():
        _admit(watched, name, copy.deepcopy(make_detector(part)), longest)
    if given is None:
        watched.left_out.update(dict.fromkeys(TOLD, "is told whether signals are counterfeit"))
    family, memory = recorded_family(scenario), watched.memory
    first = first_epoch(family, memory)
    if first > len(family.epoch_time) - 3:
        raise ValueError(
            f"scenario {scenario.name!r}: the log ends before the study can begin: {len(family.epoch_time)} epochs "
            f"follow the alignment, of which {first} are needed for the filter to settle and detectors to remember"
        )
    whole = scenario.changed(onset=float(family.epoch_time[first]), horizon=None)
    return replace(watched, scenario=whole)


def _admit(watched: Watch, name: str, detector: Detector, longest: int) -> None:
    """Let a detector watch, or say why it cannot."""
    scenario, grows = watched.scenario, detector.lacks_slope
    lacking = [need for need in detector.needs if need not in scenario.offers]
    try:
        for part in (*detector.members, detector):
            _open(part)
        fit_detectors(OWNER, [detector], scenario, 1)
    except ValueError as error:
        watched.left_out[name] = f"needs {' and '.join(lacking)}" if lacking else str(error)
        return
    if detector.memory > longest:
        watched.left_out[name] = f"remembers {detector.memory} epochs, for which the log is too short"
        return
    watched.detectors.append(detector)
    watched.names.append(name)
    watched.growing.append(grows)


def _open(detector: Detector) -> None:
    """Give a detector a threshold that nothing reaches; its statistic's growth is left in."""
    if detector.lacks_slope:
        detector.set_slope(0.0)
    detector.set_threshold(UNREACHED)


def clean_record(watched: Watch, probability: float, seed: int) -> CleanRecord:
    """Play the clean record and set thresholds.

    Args:
        watched: its detectors; members of an ensemble get the thresholds that they have by themselves.
        probability: of a false alarm per epoch.
        seed: of a simulated IMU.
    """
    for detector in watched.detectors:
        if detector.members:
            _weigh(watched.scenario, detector, probability, seed)
    time, statistic = _clean(watched.scenario, watched.detectors, seed)
    start = watched.scenario.timeline.start
    fitted = [max(float(np.polyfit(time - start, line, 1)[0]), 0.0) for line in statistic]
    growth = np.where(np.array(watched.growing, dtype=bool), np.array(fitted), 0.0)
    flat = statistic - growth[:, None] * (time - start)
    thresholds = exceeded(flat, probability)
    return CleanRecord(time, flat, growth, start, probability, thresholds)


def _clean(scenario: Scenario, detectors: Sequence[Detector], seed: int) -> tuple[Floats, Floats]:
    """Times of the clean run, (n,), s, and the statistics in it, (D, n)."""
    played = play(scenario, detectors, [Stretch(NoAttack(), 0, scenario.timeline.num_epochs)], seed)
    return played.time, played.statistic[:, :, 0]


def _weigh(scenario: Scenario, ensemble: Detector, probability: float, seed: int) -> None:
    """Give each member the threshold that it has by itself, which weighs all of them equally."""
    members = [copy.deepcopy(member) for member in ensemble.members]
    fit_detectors(OWNER, members, scenario, 1)
    _, statistic = _clean(scenario, members, seed)
    for member, threshold in zip(ensemble.members, exceeded(statistic, probability), strict=True):
        if not np.isnan(threshold):
            member.set_threshold(float(threshold))


def exceeded(statistic: Floats, probability: float) -> Floats:
    """The thresholds that a share of the values exceeds, (D,); NaN where there is none.

    Args:
        statistic: (D, n).
        probability: the share.
    """
    number, epochs = len(statistic), statistic.shape[1]
    alarms = int(probability * epochs + 1e-9)
    if not 1 <= alarms < epochs:
        return np.full(number, np.nan)
    highest = np.sort(statistic, axis=1)[:, ::-1]
    above, below = highest[:, alarms - 1], np.maximum(highest[:, alarms], 0.0)
    return np.where((above > below) & np.isfinite(above), 0.5 * (above + below), np.nan)


def false_alarms(record: CleanRecord, place: int) -> dict[str, Any]:
    """The false alarms of a detector by halves: epochs with one, their exact interval, and how often one begins.

    None where the record is too short for halves.
    """
    alarm = record.held_out(place)
    if alarm is None:
        return dict.fromkeys(("alarms", "epochs", "share", "ci95", "begun", "hours"))
    number, begun = int(alarm.sum()), int(alarm[0]) + int(np.sum(alarm[1:] & ~alarm[:-1]))
    return {
        "alarms": number,
        "epochs": len(alarm),
        "share": number / len(alarm),
        "ci95": exact_interval(number, len(alarm)),
        "begun": begun,
        "hours": float(record.time[-1] - record.start) / HOUR,
    }
