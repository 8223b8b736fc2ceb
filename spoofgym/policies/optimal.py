"""Spoofers that know the victim's filter and what watches it: optimal attacks, each against a monitor of its own."""

from __future__ import annotations

import numpy as np
from scipy import stats

from spoofgym import validation
from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.detectors.chi_square import quantile
from spoofgym.optimum import LinearTest, bounded_optimum, cumulative_optimum, ewma, gate, window_mean, zero_alarm
from spoofgym.policies.scripted import OffsetSequence
from spoofgym.scenario import Scenario
from spoofgym.specification import write

MEANS = (10, 30, 60)
WEIGHTS = (0.02, 0.05, 0.1)
MISSED = 0.5
"""Probability with which the last, full window misses the worst case against it."""
BEST, WORST, GATE, SIGNED = "best-against-snapshot", "worst-against-window", "lp-gate", "lp-signed"
ORACLES = (BEST, WORST, GATE, SIGNED)


def oracles(scenario: Scenario, arl0: float) -> list[Attack]:
    """Optimal attacks against monitors at an ARL₀; none where the filter is not matched or fixes have velocity.

    - ``best-against-snapshot``: the bounded optimum of the game against the chi-square test of each epoch.
    - ``worst-against-window``: the closed form that the chi-square sum over the whole game, at its end, misses with
      probability one half.
    - ``lp-gate``: the linear programme of zero-alarm attacks against a gate on each axis: the mean innovation stays
      within 30 % of the thresholds, which leaves the rest to the noise. It is no promise of no alarm.
    - ``lp-signed``: the same against the gate, means of 10, 30 and 60 innovations and three EWMAs together.

    Args:
        scenario: of the games.
        arl0: of every monitor by itself, epochs.
    """
    if not has_oracles(scenario):
        return []
    return [oracle(name, scenario, arl0) for name in ORACLES]


def has_oracles(scenario: Scenario) -> bool:
    """Whether optimal attacks against monitors are known there: a matched filter on fixes without velocity."""
    return scenario.matched and scenario.dimension == 3


def oracle(name: str, scenario: Scenario, arl0: float) -> Attack:
    """One of the optimal attacks against monitors at an ARL₀.

    Args:
        name: one of `ORACLES`.
        scenario: of the games.
        arl0: of every monitor by itself, epochs.

    Raises:
        ValueError: an unknown name, or the scenario has none.
    """
    validation.one_of("optimal attack", "name", name, ORACLES)
    if not has_oracles(scenario):
        raise ValueError(
            f"attack {name!r} needs a matched filter and fixes without velocity, scenario {scenario.name!r} has not "
            "both"
        )
    model, rates = scenario.linear_model(), np.array(scenario.drag_off_rate)
    if name == BEST:
        return OffsetSequence(name, bounded_optimum(model, quantile(1.0 / arl0, 3), rates).outcome.offsets)
    if name == WORST:
        epochs = model.num_epochs
        threshold = _threshold(f"windowed:n={epochs}", scenario, arl0)
        return OffsetSequence(name, cumulative_optimum(model, epochs, threshold, MISSED)[0].offsets)
    tests = gate(float(stats.norm.isf(1.0 / (6.0 * arl0))))
    if name == SIGNED:
        tests = [*tests, *signed_tests(scenario, arl0)]
    return OffsetSequence(name, zero_alarm(model, tests, drag_off_rate=rates).offsets)


def signed_tests(scenario: Scenario, arl0: float) -> list[LinearTest]:
    """Means of windows and EWMAs of each axis, at the thresholds that these detectors have in the scenario."""
    tests = []
    for n in MEANS:
        tests += window_mean(n, _threshold(f"mean-innovation:n={n}", scenario, arl0))
    for weight in WEIGHTS:
        tests += ewma(weight, _threshold(f"ewma:weight={weight}", scenario, arl0))
    return tests


def _threshold(detector: str, scenario: Scenario, arl0: float) -> float:
    asked = make_detector(f"{detector},arl0={write(float(arl0))}")
    (ready,) = calibrated_for_play([asked], scenario, scenario.fidelities[0])
    assert ready.threshold is not None
    return ready.threshold
