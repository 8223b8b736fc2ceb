from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize, stats

from spoofgym.calibration import __main__ as program
from spoofgym.calibration import calibrate, calibrated, measure_arl0, poisson_interval
from spoofgym.calibration import thresholds as calibration
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.calibration.first_alarms import FirstAlarms
from spoofgym.detectors import Acna, Snapshot, make_detector
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.white import WhiteInnovations

UNLIKELY = 1e-7
WHITE = white_statistics(np.eye(3), 200)


def fixed(burn_in, statistics):
    """The same clean statistics at every call."""
    return lambda detector, runs, rng: (np.array(burn_in, dtype=float), np.array(statistics, dtype=float))


def assert_poisson(count, mean):
    """The count is one that a Poisson variable of this mean takes, but for a probability of 1e-7."""
    assert stats.poisson.ppf(UNLIKELY / 2, mean) <= count <= stats.poisson.isf(UNLIKELY / 2, mean)


@pytest.mark.parametrize(
    ("threshold", "first_alarms", "epochs_at_risk"),
    [
        (4.0, 2, 2 + 4 + 4),  # the third run alarms in its burn-in and does not count
        (4.5, 3, 2 + 4 + 1 + 4),  # equality is no alarm
        (5.0, 2, 4 + 4 + 1 + 4),
        (9.0, 0, 16),
    ],
)
def test_a_run_is_at_risk_until_its_first_alarm_or_its_end(threshold, first_alarms, epochs_at_risk):
    clean = fixed(
        [[0, 1], [0, 0], [4.5, 0], [1, 1]],
        [[1, 5, 2, 6], [1, 1, 1, 1], [9, 9, 9, 9], [1, 2, 3, 5]],
    )
    result = measure_arl0(Snapshot(), clean, threshold, min_epochs=1)
    assert (result.first_alarms, result.epochs_at_risk) == (first_alarms, epochs_at_risk)
    assert result.arl0 == (epochs_at_risk / first_alarms if first_alarms else float("inf"))
    assert result.threshold == threshold
    assert result.interval == poisson_interval(first_alarms, epochs_at_risk)


def test_poisson_interval_is_exact():
    low, high = poisson_interval(10, 1000)
    assert (1000 / high, 1000 / low) == pytest.approx((4.795, 18.391), abs=1e-3)  # tabulated (Garwood 1936)
    for events in (1, 3, 150):
        low, high = poisson_interval(events, 1000)
        assert stats.poisson.sf(events - 1, 1000 / high) == pytest.approx(0.025)
        assert stats.poisson.cdf(events, 1000 / low) == pytest.approx(0.025)
    low, high = poisson_interval(0, 1000)
    assert 1000 / low == pytest.approx(-np.log(0.025))
    assert high == float("inf")


def test_arl0_of_the_snapshot_test_is_the_inverse_of_p_fa():
    result = measure_arl0(Snapshot(), WHITE, stats.chi2.isf(1e-3, 3), min_epochs=2e6, seed=1)
    assert_poisson(result.first_alarms, result.epochs_at_risk * 1e-3)
    assert result.interval[0] < result.arl0 < result.interval[1]


@pytest.mark.parametrize("arl0", [20.0, 500.0])
def test_the_calibrated_snapshot_threshold_has_the_arl0(arl0):
    result = calibrate(Snapshot(), WHITE, arl0, first_alarms=2000, seed=2)
    assert result.arl0 == pytest.approx(arl0, rel=2e-3)
    assert_poisson(result.first_alarms, result.epochs_at_risk * stats.chi2.sf(result.threshold, 3))


def test_as_many_first_alarms_decide_as_are_asked_for():
    assert calibrate(Snapshot(), WHITE, 100.0, first_alarms=8000).first_alarms >= 8000


def test_calibration_counts_what_a_measurement_at_its_threshold_counts():
    generator = np.random.default_rng(5)
    burn_in = generator.standard_normal((5000, 4)).cumsum(axis=1)
    walks = burn_in[:, -1:] + generator.standard_normal((5000, 60)).cumsum(axis=1)
    clean = fixed(burn_in, walks)
    found = calibrate(Snapshot(), clean, 3000.0, first_alarms=50)
    measured = measure_arl0(Snapshot(), clean, found.threshold, min_epochs=1)
    assert (measured.arl0, measured.threshold) == (found.arl0, found.threshold)
    lower = measure_arl0(Snapshot(), clean, found.threshold - 1e-6, min_epochs=1)
    assert lower.arl0 < 3000.0 <= found.arl0


def test_acna_jump_test_against_the_waiting_time_for_a_run_of_two():
    """Two Rayleigh drifts in a row above h come after (1 + p) / p² epochs, p = exp(-h² / 2)."""
    sigma, arl0 = 3.7, 1000.0
    detector = make_detector("acna:jump_threshold=1,slow_threshold=1e6")
    result = calibrate(detector, white_statistics(sigma * np.eye(3), 300), arl0, first_alarms=1500, seed=3)

    def threshold_for(epochs):
        p = optimize.brentq(lambda p: (1.0 + p) / p**2 - epochs, 1e-3, 0.5)
        return sigma * np.sqrt(-2.0 * np.log(p))

    allowed = 1.18  # 5.3 standard errors of 1200 first alarms, and the warm start
    assert threshold_for(arl0 / allowed) < result.threshold < threshold_for(arl0 * allowed)


class Stub(SimpleNamespace):
    __hash__ = object.__hash__

    @property
    def unguided(self):
        return self


def scenario_of(factor, *, matched=True, num_epochs=120):
    factors = np.broadcast_to(factor, (num_epochs + 1, *factor.shape))
    return Stub(
        name=f"stub-{factor[0, 0]}-{matched}",
        random=True,
        dimension=len(factor),
        matched=matched,
        timeline=SimpleNamespace(num_epochs=num_epochs),
        family=SimpleNamespace(white_innovations=lambda: WhiteInnovations(factors)),
        facts=FilterFacts("stub", 1.0, np.ones(6), (), lambda burn_in: None),
    )


def test_acna_threshold_scales_with_the_innovation(monkeypatch):
    monkeypatch.setattr(calibration, "_KNOWN", {})
    unit = calibrated(make_detector("acna:arl0=300"), scenario_of(np.eye(3)))
    wide = calibrated(make_detector("acna:arl0=300"), scenario_of(4.0 * np.eye(3)))
    assert wide.threshold == pytest.approx(4.0 * unit.threshold, rel=1e-9)
    assert unit.calibrated
    assert unit.arl0 == pytest.approx(300.0, rel=0.02)


def test_calibrated_detectors_are_calibrated_once_and_kept_by_bind(monkeypatch):
    monkeypatch.setattr(calibration, "_KNOWN", {})
    scenario = scenario_of(np.eye(3))
    first = calibrated(make_detector("windowed:n=4,arl0=200"), scenario)
    monkeypatch.setattr(calibration, "calibrate", lambda *arguments, **options: pytest.fail("calibrated twice"))
    again = calibrated(make_detector("windowed:n=4,arl0=200"), scenario)
    again.bind(7, 3)
    assert first.threshold == again.threshold
    assert stats.chi2.isf(4 / 200, 12) < first.threshold < stats.chi2.isf(1 / 200, 12)


@pytest.mark.parametrize(
    ("specification", "threshold"),
    [
        ("snapshot", 25.9),
        ("snapshot:arl0=1e4", stats.chi2.isf(1e-4, 3)),
        ("windowed:p_fa=1e-3", stats.chi2.isf(1e-3, 60)),
        ("acna:preset=song", 1.0),
    ],
)
def test_a_threshold_that_is_known_stays(specification, threshold, monkeypatch):
    monkeypatch.setattr(calibration, "calibrate", lambda *arguments, **options: pytest.fail("needs no calibration"))
    detector = calibrated(make_detector(specification), scenario_of(np.eye(3)))
    assert detector.threshold == pytest.approx(threshold, rel=1e-9)
    assert not detector.calibrated


def test_a_threshold_is_never_looked_for_below_what_was_forgotten():
    """Runs whose statistic is 0 at first: what was forgotten must not look like thresholds that hardly ever alarm."""
    rng = np.random.default_rng(6)
    counted = FirstAlarms()
    everything = FirstAlarms()
    for forget in (True, False, False):
        statistics = 20.0 + rng.chisquare(3, (4000, 30))
        statistics[:, :5] = 0.0
        for counter in (counted, everything):
            counter.add(np.empty((4000, 0)), statistics)
        if forget:
            counted.forget_below(counted.threshold(500.0))
    assert counted.threshold(3000.0) == pytest.approx(everything.threshold(3000.0), rel=1e-12)
    assert counted.threshold(3000.0) > counted.floor > 0.0


def test_the_program_prints_a_row(monkeypatch, capsys):
    monkeypatch.setattr(
        sys, "argv", ["calibration", "--window", "3", "--arl0", "100", "--alarms", "200", "--epochs", "50"]
    )
    program.main()
    words = capsys.readouterr().out.split()
    threshold = float(words[words.index("threshold") + 1])
    assert stats.chi2.isf(3 / 100, 9) < threshold < stats.chi2.isf(1 / 100, 9)


@pytest.mark.parametrize("arl0", [1.0, 0.0, -5.0, float("nan")])
def test_an_arl0_must_be_more_than_one_epoch(arl0):
    with pytest.raises(ValueError, match="arl0 must be"):
        calibrate(Acna(), WHITE, arl0)


def test_too_few_alarms_are_refused():
    with pytest.raises(ValueError, match="first_alarms must be"):
        calibrate(Acna(), WHITE, 100.0, first_alarms=9)


@pytest.mark.parametrize("threshold", [np.nan, np.inf, 0.0, -1.0])
def test_no_arl0_is_measured_at_a_threshold_that_decides_nothing(threshold):
    with pytest.raises(ValueError, match=r"threshold must be .* greater than 0"):
        measure_arl0(Snapshot(), WHITE, threshold, min_epochs=1)


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_a_statistic_that_no_threshold_can_hold_is_refused_by_name(value):
    """Runs are not drawn without end in search of first alarms."""

    def clean(detector, runs, rng):
        statistics = rng.random((runs, 20))
        statistics[rng.random(statistics.shape) < 0.1] = value
        return np.empty((runs, 0)), statistics

    with pytest.raises(ValueError, match=r"detector 'snapshot:threshold=9': .* (infinite in|not a number)"):
        calibrate(Snapshot(9.0), clean, 100.0)
