"""Thresholds at a stated ARL₀, the average run length between false alarms.

ARL₀ = clean epochs at risk / first alarms, each run counted until its first alarm or its end, memories warm (a clean
burn-in without an alarm), then restarted with new noise. What every threshold would have done is kept from one pass.

``python -m spoofgym.calibration`` prints the thresholds that `spoofgym.detectors.chi_square` ships.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.calibration import cache as calibration_cache
from spoofgym.calibration.cache import Setting
from spoofgym.calibration.clean_statistics import (
    CleanStatistics,
    JointStatistics,
    joint_statistics,
    white_statistics,
)
from spoofgym.calibration.first_alarms import FirstAlarms
from spoofgym.detectors.base import Detector
from spoofgym.patience import long_work
from spoofgym.scenario import Scenario
from spoofgym.validation import written

RUNS = 5000
FIRST_ALARMS = 200
MOST_FIRST_ALARMS = 1_000_000
SIMULATED_FIRST_ALARMS = 100
SLOPE_RUNS = 1000
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Calibration:
    """A threshold and the ARL₀ measured at it.

    Attributes:
        threshold: compared with the statistic.
        arl0: epochs at risk per first alarm.
        interval: its 95 % Poisson interval, epochs.
        first_alarms: how many.
        epochs_at_risk: clean epochs.
    """

    threshold: float
    arl0: float
    interval: tuple[float, float]
    first_alarms: int
    epochs_at_risk: int


def poisson_interval(events: int, exposure: int) -> tuple[float, float]:
    """95 % interval of exposure per event; infinite above where there was none (Garwood 1936)."""
    tail = (1.0 - CONFIDENCE) / 2.0
    most = float(special.gammaincinv(events + 1, 1.0 - tail))
    least = float(special.gammaincinv(events, tail)) if events else 0.0
    return exposure / most, exposure / least if least else math.inf


# --- thresholds and ARL₀ ----------------------------------------------------------------------------------------------


class _Search:
    """The search for the threshold of one detector, which goes on until enough first alarms decide.

    Attributes:
        detector: whose statistic.
        result: None until they do.
    """

    def __init__(self, detector: Detector, arl0: float, first_alarms: int) -> None:
        self.detector = detector
        self.result: Calibration | None = None
        self._arl0 = validation.average_run_length("calibration", "arl0", arl0)
        self._first_alarms = validation.whole("calibration", "first_alarms", first_alarms, 10, MOST_FIRST_ALARMS)
        self._counted = FirstAlarms()

    def add(self, burn_in: Floats, statistics: Floats) -> None:
        """Count new runs; arguments as in `FirstAlarms.add`."""
        if not statistics.any():
            raise ValueError(f"detector {self.detector.name!r}: the statistic is 0 in all clean runs")
        counted = self._counted
        try:
            counted.add(burn_in, statistics)
        except ValueError as error:
            raise ValueError(f"detector {self.detector.name!r}: {error}") from error
        threshold = counted.threshold(self._arl0)
        if math.isinf(threshold):
            raise ValueError(
                f"detector {self.detector.name!r}: the statistic is infinite in clean runs more often than arl0 allows"
            )
        alarms, at_risk = counted.at(threshold)
        if alarms >= self._first_alarms:
            self.result = _calibration(threshold, alarms, at_risk)
            return
        floor = counted.threshold(self._arl0 / 8.0)
        if counted.at(floor)[0] >= self._first_alarms:
            counted.forget_below(floor)


def calibrate_together(
    detectors: Sequence[Detector],
    clean: JointStatistics,
    arl0s: Sequence[float],
    *,
    first_alarms: int = FIRST_ALARMS,
    seed: int = 0,
) -> list[Calibration]:
    """The thresholds of several detectors at which the measured ARL₀ are those asked for, from common clean runs.

    Each is the same as if its detector were calibrated alone.

    Args:
        detectors: whose statistics; they are not changed.
        clean: where clean statistics come from.
        arl0s: wanted, one of each detector, epochs.
        first_alarms: at least so many decide; the relative half-width of the interval is 1.96 over their root.
        seed: of the clean runs.

    Raises:
        ValueError: an ARL₀ is not greater than 1, fewer than 10 alarms are asked for, or no run gets through its
            burn-in or ever has a higher statistic in it.
    """
    rng = np.random.default_rng(seed)
    searches = [_Search(detector, arl0, first_alarms) for detector, arl0 in zip(detectors, arl0s, strict=True)]
    while pending := [search for search in searches if search.result is None]:
        found = clean([copy.copy(search.detector) for search in pending], RUNS, rng)
        for search, (burn_in, statistics) in zip(pending, found, strict=True):
            search.add(burn_in, statistics)
    return [search.result for search in searches if search.result is not None]


def calibrate(
    detector: Detector, clean: CleanStatistics, arl0: float, *, first_alarms: int = FIRST_ALARMS, seed: int = 0
) -> Calibration:
    """The threshold at which the measured ARL₀ is the one asked for; arguments as in `calibrate_together`."""

    def alone(detectors: Sequence[Detector], runs: int, rng: np.random.Generator) -> list[tuple[Floats, Floats]]:
        return [clean(detectors[0], runs, rng)]

    return calibrate_together([detector], alone, [arl0], first_alarms=first_alarms, seed=seed)[0]


def _calibration(threshold: float, alarms: int, at_risk: int) -> Calibration:
    arl0 = at_risk / alarms if alarms else math.inf
    return Calibration(threshold, arl0, poisson_interval(alarms, at_risk), alarms, at_risk)


def measure_arl0(
    detector: Detector, clean: CleanStatistics, threshold: float, *, min_epochs: float, seed: int = 0
) -> Calibration:
    """ARL₀ at a given threshold, on at least ``min_epochs`` clean epochs.

    Raises:
        ValueError: every run alarms in its burn-in, or ``threshold`` or ``min_epochs`` is not a positive finite number.
    """

    def alone(detectors: Sequence[Detector], runs: int, rng: np.random.Generator) -> list[tuple[Floats, Floats]]:
        return [clean(detectors[0], runs, rng)]

    return measure_together([detector], alone, [threshold], min_epochs=min_epochs, seed=seed)[0]


def measure_together(
    detectors: Sequence[Detector],
    clean: JointStatistics,
    thresholds: Sequence[float],
    *,
    min_epochs: float,
    seed: int = 0,
) -> list[Calibration]:
    """ARL₀ of several detectors, each at its given threshold, on common clean runs.

    Args:
        detectors: whose statistics; they are not changed.
        clean: where clean statistics come from.
        thresholds: one of each detector.
        min_epochs: clean epochs at risk that each detector sees at least.
        seed: of the clean runs.

    Raises:
        ValueError: every run alarms in its burn-in, or a threshold or ``min_epochs`` is not a positive finite number.
    """
    validation.above("calibration", "min_epochs", min_epochs)
    for threshold in thresholds:
        validation.above("calibration", "threshold", threshold)
    rng = np.random.default_rng(seed)
    alarms, at_risk = [0] * len(detectors), [0] * len(detectors)
    while min(at_risk) < min_epochs:
        found = clean([copy.copy(detector) for detector in detectors], RUNS, rng)
        for place, (threshold, (burn_in, statistics)) in enumerate(zip(thresholds, found, strict=True)):
            counted = FirstAlarms()
            counted.forget_below(threshold)
            counted.add(burn_in, statistics)
            more_alarms, more_at_risk = counted.at(threshold)
            if more_at_risk == 0:
                raise ValueError(f"threshold {written(threshold)}: every clean run alarms in its burn-in")
            alarms[place], at_risk[place] = alarms[place] + more_alarms, at_risk[place] + more_at_risk
    return [_calibration(*result) for result in zip(thresholds, alarms, at_risk, strict=True)]


# --- detectors ready for a scenario ---------------------------------------------------------------------------------

MOST_ARL0 = 1e7
"""Epochs: a larger one takes more clean epochs than anybody waits for."""
LONGEST_MEMORY = 2000
"""Epochs: thousands of runs are kept at once."""

Place = tuple[object, object, str]
_KNOWN: dict[Place, Setting] = {}


def _who(detector: Detector) -> object:
    """What tells a detector from others: names and classes, its members' included."""
    return (detector.name, type(detector), *(_who(member) for member in detector.members))


def _place(detector: Detector, scenario: Scenario, fidelity: str) -> Place:
    return _who(detector), calibration_cache.identity(scenario), fidelity


def calibrated(detector: Detector, scenario: Scenario, fidelity: str = "linear") -> Detector:
    """The detector with its threshold set for a scenario, as `calibrated_all` does."""
    return calibrated_all([detector], scenario, fidelity)[0]


def calibrated_all(detectors: Sequence[Detector], scenario: Scenario, fidelity: str = "linear") -> list[Detector]:
    """The detectors with their thresholds set for a scenario, in order.

    A threshold from theory, from a preset or by hand stays. One that was asked for by its ARL₀ is calibrated, in a
    copy: on white innovations where the scenario's filter is matched and the detector sees nothing else, else on clean
    runs of the scenario, which detectors share; always with the same noise. A growth that the detector subtracts is
    fitted before. In a recorded scenario a shipped threshold for white innovations stays, without an ARL₀.

    A detector that was calibrated in another scenario is calibrated anew. What was found is remembered for each
    scenario and detector: in the program, and on disk (`calibration_cache`) where the names of both say all about them.

    The members of a detector are calibrated before it.

    Raises:
        ValueError: calibration is needed, and the scenario lacks the fidelity or has no randomness to calibrate with;
            or a detector needs what the scenario does not offer.
    """
    detectors = [_with_members(detector, scenario, fidelity) for detector in detectors]
    for detector in detectors:
        scenario.facts.require(f"detector {detector.name!r}", detector.needs)
        detector.bind(1, scenario.dimension)
    wanted = [detector for detector in detectors if _needs_calibration(detector, scenario)]
    for detector in wanted:
        if detector.target_arl0 is not None and detector.target_arl0 > MOST_ARL0:
            raise ValueError(
                f"detector {detector.name!r}: arl0 must be {written(MOST_ARL0)} epochs at most to be calibrated, got "
                f"{written(detector.target_arl0)}; give a threshold"
            )
        if detector.memory > LONGEST_MEMORY:
            raise ValueError(
                f"detector {detector.name!r}: it must look back {LONGEST_MEMORY} epochs at most to be calibrated, it "
                f"looks back {detector.memory}; give a threshold"
            )
    if wanted and not scenario.random:
        raise ValueError(
            f"detector {wanted[0].name!r} cannot be calibrated in scenario {scenario.name!r}, which has one "
            "realisation: give it a threshold"
        )
    missing = {detector.name: detector for detector in wanted if _recall(detector, scenario, fidelity) is None}
    with long_work(f"calibrating {', '.join(missing)}, a minute or more; kept for the next time"):
        settings = _find(list(missing.values()), scenario, fidelity) if missing else {}
    for name, setting in settings.items():
        _KNOWN[_place(missing[name], scenario, fidelity)] = setting
        if key := _disk_key(missing[name], scenario, fidelity):
            calibration_cache.store(key, setting, f"{name} in {scenario.name}, {fidelity}")
    return [
        _with(detector, _KNOWN[_place(detector, scenario, fidelity)], calibration_cache.identity(scenario))
        if detector in wanted
        else detector
        for detector in detectors
    ]


def _with_members(detector: Detector, scenario: Scenario, fidelity: str) -> Detector:
    here = detector.origin in (None, calibration_cache.identity(scenario))
    if not detector.members or (detector.calibrated and here):
        return detector
    ready = copy.copy(detector)
    ready.members = calibrated_all(detector.members, scenario, fidelity)
    return ready


def _needs_calibration(detector: Detector, scenario: Scenario) -> bool:
    if detector.calibrated:
        elsewhere = detector.origin is not None and detector.origin != calibration_cache.identity(scenario)
        return elsewhere and detector.target_arl0 is not None
    if detector.lacks_slope:
        return True
    if detector.target_arl0 is None:
        return False
    return detector.threshold is None or (scenario.random and not scenario.matched)


def _disk_key(detector: Detector, scenario: Scenario, fidelity: str) -> str | None:
    """The name of a result on disk; None where no text says all about detector and scenario."""
    where = calibration_cache.identity(scenario)
    if not (calibration_cache.spelled_out(detector) and isinstance(where, str)):
        return None
    if any(member.calibrated and member.origin is None for member in detector.members):
        return None
    numbers = (RUNS, FIRST_ALARMS, SIMULATED_FIRST_ALARMS, SLOPE_RUNS)
    return calibration_cache.key(where, detector.name, fidelity, *map(str, numbers))


def _recall(detector: Detector, scenario: Scenario, fidelity: str) -> Setting | None:
    """What was found before, in this program or in an earlier one."""
    place = _place(detector, scenario, fidelity)
    if place not in _KNOWN and (key := _disk_key(detector, scenario, fidelity)):
        setting = calibration_cache.load(key)
        if setting is not None:
            _KNOWN[place] = setting
    return _KNOWN.get(place)


def _with(detector: Detector, setting: Setting, origin: object = None) -> Detector:
    """A copy of the detector with its slope and its threshold set."""
    ready = copy.copy(detector)
    if setting.slope is not None:
        ready.set_slope(setting.slope)
    if setting.threshold is not None:
        interval = None
        if setting.low is not None:
            interval = setting.low, math.inf if setting.high is None else setting.high
        ready.set_threshold(setting.threshold, setting.arl0, interval, origin)
    return ready


def _find(detectors: Sequence[Detector], scenario: Scenario, fidelity: str) -> dict[str, Setting]:
    """Calibrate, by name: on white innovations what can be, the others in as few passes as give each its own noise."""
    found: dict[str, Setting] = {}
    groups: dict[int, list[Detector]] = {}
    for detector in detectors:
        if scenario.matched and not detector.needs_view and detector.target_arl0 is not None:
            clean = white_statistics(scenario.family.white_innovations(), scenario.timeline.num_epochs, scenario.facts)
            result = calibrate(detector, clean, detector.target_arl0)
            found[detector.name] = _setting(result, None)
        else:
            # a burn-in of the filter that a companion asks for would change the runs
            groups.setdefault(0 if scenario.matched else detector.memory, []).append(detector)
    for group in groups.values():
        found |= _find_simulated(group, scenario, fidelity)
    return found


def _find_simulated(detectors: Sequence[Detector], scenario: Scenario, fidelity: str) -> dict[str, Setting]:
    """Calibrate on common clean runs, by name: first the slopes of those that lack them, then the thresholds."""
    clean = joint_statistics(scenario, fidelity)
    growing = [detector for detector in detectors if detector.lacks_slope]
    slopes: dict[str, float] = {}
    if growing:
        runs = clean([copy.copy(detector) for detector in growing], SLOPE_RUNS, np.random.default_rng(1))
        for detector, (_, statistics) in zip(growing, runs, strict=True):
            slopes[detector.name] = growth(detector, scenario.timeline.times, statistics)
    found = {detector.name: Setting(slope=slopes.get(detector.name)) for detector in detectors}
    asked = [_with(detector, found[detector.name]) for detector in detectors if detector.target_arl0 is not None]
    arl0s = [detector.target_arl0 for detector in asked if detector.target_arl0 is not None]
    results = calibrate_together(asked, clean, arl0s, first_alarms=SIMULATED_FIRST_ALARMS)
    for detector, result in zip(asked, results, strict=True):
        found[detector.name] = _setting(result, slopes.get(detector.name))
    return found


def _setting(result: Calibration, slope: float | None) -> Setting:
    low, high = result.interval
    return Setting(result.threshold, result.arl0, slope, low, high if math.isfinite(high) else None)


def growth(detector: Detector, time: Floats, statistics: Floats) -> float:
    """Slope of the least-squares line, its intercept free, through the mean statistic of clean runs, per second.

    Args:
        detector: for the message.
        time: of the epochs, (K,), s.
        statistics: (n, K); epochs in which all are 0, before a window is full, do not count.

    Raises:
        ValueError: fewer than two epochs count.
    """
    full = statistics.any(axis=0)
    if np.count_nonzero(full) < 2:
        raise ValueError(f"detector {detector.name!r}: the game is too short for its window")
    since = time[full] - time[full].mean()
    mean = statistics[:, full].mean(axis=0)
    return float(np.sum(since * mean) / np.sum(since**2))
