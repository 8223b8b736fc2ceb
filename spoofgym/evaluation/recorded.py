"""Attacks on a recorded log: how good the filter is on clean fixes, and what each attack does to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import NoAttack
from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.departure_rows import departure_entry
from spoofgym.evaluation.departures import departures_of
from spoofgym.geodesy import horizontal, position_difference
from spoofgym.logs.log import interpolate
from spoofgym.scenario import Scenario
from spoofgym.scenarios.clean_run import coasted_positions
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.simulation import Simulation

RECOVERED = 1.0
"""So near to the filter of the clean log a victim has recovered from an attack, horizontally, m."""
SAME_TIME = 1e-3
"""A reference epoch this close to a fix, s, is that fix and no independent check."""


@dataclass(frozen=True)
class CleanFigures:
    """The filter on unspoofed fixes, from `SETTLING` after the alignment to the end of the log.

    Attributes:
        errors: horizontal, against the reference where it is no fix, (n,), m; None = the log has no reference.
        mean_nis: over the epochs.
        false_alarms: epochs in which any detector alarms.
        epochs: how many.
    """

    errors: Floats | None
    mean_nis: float
    false_alarms: int
    epochs: int


def evaluate_recorded(
    scenario: Scenario, attacks: Sequence[Attack], detectors: Sequence[Detector], seed: int = 0
) -> list[dict[str, Any]]:
    """The rows of all attacks; arguments and errors as `recorded_rows`."""
    return list(recorded_rows(scenario, attacks, detectors, seed))


def recorded_rows(
    scenario: Scenario, attacks: Sequence[Attack], detectors: Sequence[Detector], seed: int = 0
) -> Iterator[dict[str, Any]]:
    """Play every attack on the log, every fix used, and compare with the unspoofed run.

    Args:
        scenario: the log.
        attacks: in the order of the rows.
        detectors: each with its threshold set, or with one of its own; an alarm of any counts.
        seed: of what an attack draws; nothing else on a log is drawn.

    Yields:
        A row per attack: attack, clean_error_median_m, clean_error_p95_m, mean_nis, false_alarms, clean_epochs,
        alarms_before_onset (epochs of the game before the attack in which any detector alarms: false ones),
        detected, time_to_detect_s (from the attack's onset to the first alarm owed to it), error_at_detection_m,
        alarm_after_pull_s (from the pull's beginning, where the log states it, to the first alarm from then on),
        max_error_m (largest horizontal error after the onset), error_epochs (after the onset, whose error is known:
        those in a hole of the reference have none), alarms_after_end (after the last spoofed fix, as far as the clean
        log has none there), recovery_s (from the last spoofed fix until the filter is back within `RECOVERED` of that
        of the clean log, for good); deviation (of the whole game) where the vehicle is steered by its estimate. None
        where a thing does not exist: clean errors without a reference, the largest of no errors, time and error of a
        detection that did not happen, what follows the end of an attack that has none.
        An alarm without an attack is no detection, nor is one that comes at the same epoch of the clean log.

        Where the log's own ranges are spoofed, clean figures are those of the clean scene (`clean_scene`), no alarm of
        the game has a clean counterpart, and the filter has recovered where its error is within `RECOVERED` of that
        before the attack.

    Raises:
        ValueError: what `Simulation` refuses, a log too short for clean figures, or another attack on ranges that hold
            one already.
    """
    scene = clean_scene(scenario)
    clean = clean_figures(scene, detectors)
    common = {
        "clean_error_median_m": None if clean.errors is None else float(np.median(clean.errors)),
        "clean_error_p95_m": None if clean.errors is None else float(np.percentile(clean.errors, 95.0)),
        "mean_nis": clean.mean_nis,
        "false_alarms": clean.false_alarms,
        "clean_epochs": clean.epochs,
    }
    false = _clean_alarms(scenario, detectors) if scene is scenario else np.zeros(scenario.timeline.num_epochs, bool)
    for attack in attacks:
        if scene is not scenario and attack.name != RECORDED:
            raise ValueError(
                f"scenario {scenario.name!r}: its ranges hold the recorded attack already; attack must be {RECORDED}, "
                f"got {attack.name!r}"
            )
        yield {"attack": attack.name} | common | _play(scenario, attack, detectors, false, seed)


def clean_figures(scenario: Scenario, detectors: Sequence[Detector]) -> CleanFigures:
    """Play the clean log from `SETTLING` after the alignment on, or from where the memory of the detectors is full.

    Raises:
        ValueError: the log ends before.
    """
    log = recorded_family(scenario)
    time, begin = log.epoch_time, log.align_time + SETTLING
    for detector in detectors:
        detector.bind(1, scenario.dimension)
    memory = max((detector.memory for detector in detectors), default=0)
    first = max(int(np.searchsorted(time, begin)), memory)
    if first > len(time) - 2:
        raise ValueError(
            f"scenario {scenario.name!r}: {time[-1] - log.align_time:.3g} s of the log, {len(time)} fixes, follow the "
            f"alignment; clean figures need more than {SETTLING:g} s, in which the filter settles"
            + (f", and more than {memory} fixes, which the detectors remember" if memory else "")
        )
    whole = scenario.changed(onset=float(time[first]), horizon=None)
    simulation = Simulation(whole, None, detectors, seed=0, fidelity="strapdown")
    epoch = simulation.reset()
    nis, alarms = [epoch.innovation.nis[0]], [simulation.alarm[0]]
    for _ in range(whole.timeline.num_epochs):
        simulation.resolve()
        nis.append(simulation.observe().innovation.nis[0])
        alarms.append(simulation.alarm[0])
    return CleanFigures(
        errors=held_out_errors(scenario, float(time[first])),
        mean_nis=float(np.mean(nis)),
        false_alarms=int(np.sum(alarms)),
        epochs=len(nis),
    )


def held_out_errors(scenario: Scenario, begin: float) -> Floats | None:
    """Horizontal error of the clean run at the reference's own times that are no fixes, from ``begin`` on, (n,), m.

    Between the fixes the filter's state is carried on by its inertial samples alone. Where the reference has no epochs
    of its own, all of them count, after the fix was used, but those in its holes. None = there is nothing to compare.
    """
    log = recorded_family(scenario)
    reference = log.log.reference
    if reference is None:
        return None
    model, clean = log.model, log.clean
    end = log.epoch_time[-1]
    inside = (reference.time >= begin) & (reference.time < end)
    nearest = np.searchsorted(log.epoch_time, reference.time)
    distance = np.minimum(
        np.abs(reference.time - log.epoch_time[np.minimum(nearest, len(log.epoch_time) - 1)]),
        np.abs(reference.time - log.epoch_time[np.maximum(nearest - 1, 0)]),
    )
    own = inside & (distance > SAME_TIME)
    if not own.any():
        late = (log.epoch_time >= begin) & log.compared
        if not late.any():
            return None
        truth, _ = interpolate(reference, log.epoch_time[late])
        return horizontal(position_difference(clean.position[1:][late], truth))
    origin = clean.position[0]
    start = recorded_family(scenario).align_time
    ends = start + np.cumsum(model.step)
    track = position_difference(coasted_positions(model, clean), origin)
    at_fixes = position_difference(clean.position[:-1], origin)
    errors = []
    truth = position_difference(reference.position[own], origin)
    for moment, true in zip(reference.time[own], truth, strict=True):
        step = min(int(np.searchsorted(ends, moment)), len(ends) - 1)
        epoch = int(np.searchsorted(model.boundaries, step, side="right")) - 1
        fresh = step == model.boundaries[epoch]
        before = at_fixes[epoch] if fresh else track[step - 1]
        share = 1.0 - (ends[step] - moment) / model.step[step]
        errors.append(before + share * (track[step] - before) - true)
    return horizontal(np.array(errors))


def _clean_alarms(scenario: Scenario, detectors: Sequence[Detector]) -> Flags:
    """Whether any detector alarms in the game without an attack, at epochs 1..K, (K,)."""
    simulation = Simulation(scenario, None, detectors, seed=0, fidelity="strapdown")
    alarms = []
    simulation.reset()
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        simulation.observe()
        alarms.append(simulation.alarm[0])
    return np.array(alarms)


def _play(
    scenario: Scenario, attack: Attack, detectors: Sequence[Detector], false: Flags, seed: int
) -> dict[str, Any]:
    """The part of a row that depends on the attack; ``false``: the alarms without one, (K,)."""
    simulation = Simulation(scenario, attack, detectors, seed=seed, fidelity="strapdown")
    onset = scenario.timeline.start if attack.onset is None else attack.onset
    effects = recorded_family(scenario).log.effects
    pull = effects.pull if effects is not None and attack.name == RECORDED else None
    before, pulled = 0, None
    spoofing = not isinstance(attack, NoAttack)
    detection: tuple[float, float | None] | None = None
    errors, log = [], recorded_family(scenario)
    after_end, departed = 0, None
    clean = position_difference(log.clean.position[1:], log.true_position)
    if log.attacked and log.spoofed_within:
        clean[:] = clean[np.searchsorted(log.epoch_time, onset)]
    clean = clean[log.first + 1 :]
    simulation.reset()
    simulation.resolve()
    for alarmed, compared, unspoofed in zip(false, log.compared[log.first + 1 :], clean, strict=False):
        time = float(simulation.observe().time[0])
        after = time > onset
        before += bool(not after and simulation.alarm[0])
        if pull is not None and pulled is None and time >= pull and simulation.alarm[0]:
            pulled = time - pull
        if after and spoofing and detection is None and simulation.alarm[0] and not alarmed:
            detection = time - onset, float(horizontal(simulation.error)[0]) if compared else None
        simulation.resolve()
        if after and compared:
            errors.append(float(horizontal(simulation.error)[0]))
        if attack.end is not None and time > attack.end:
            after_end += bool(simulation.alarm[0] and not alarmed)
            if float(horizontal(simulation.error - unspoofed)[0]) > RECOVERED:
                departed = time
    last = float(scenario.timeline.end)
    back = attack.end is not None and (departed is None or departed < last)
    return {
        "detected": detection is not None,
        "time_to_detect_s": None if detection is None else detection[0],
        "alarms_before_onset": before,
        "alarm_after_pull_s": pulled,
        "error_at_detection_m": None if detection is None else detection[1],
        "max_error_m": float(np.max(errors)) if errors else None,
        "error_epochs": len(errors),
        "alarms_after_end": None if attack.end is None else after_end,
        "recovery_s": max((departed or attack.end) - attack.end, 0.0) if back and attack.end is not None else None,
        **departure_entry(departures_of(simulation)),
    }
