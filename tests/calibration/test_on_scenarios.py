"""Thresholds at a stated average run length, against distributions that are known exactly and independent simulations.

Statistical bands: a correct program fails each with a probability below 1e-7 (normal approximation with 6
deviations, 2e-9, where no exact distribution is at hand).
"""

import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate, calibrated, measure_arl0
from spoofgym.calibration import thresholds as calibration
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import Ensemble, make_detector
from spoofgym.detectors.chi_square import WINDOWED_THRESHOLDS
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenarios import make_scenario
from tests.one_detector import simulated_statistics

DEVIATIONS = 6.0
FALSE_FAILURE = 1e-8
UNMATCHED = "liu-flight:markov_sigma=2,markov_time=30"
FACTOR = np.array([[4.0, 0.0, 0.0], [1.0, 3.0, 0.0], [-2.0, 0.5, 6.0]])


@pytest.fixture(autouse=True)
def _empty_cache(monkeypatch, tmp_path):
    """What is calibrated here is calibrated here."""
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))


def assert_poisson(events, low, high):
    """Events whose expectation lies between low and high."""
    assert stats.poisson.ppf(FALSE_FAILURE / 2, low) <= events <= stats.poisson.isf(FALSE_FAILURE / 2, high)


def assert_bernoulli(result, p):
    """Epochs that alarm independently with probability p: alarms - p epochs is a martingale, however runs end."""
    deviation = math.sqrt(p * (1 - p) * result.epochs_at_risk)
    assert abs(result.first_alarms - p * result.epochs_at_risk) < DEVIATIONS * deviation


def sliding_two(threshold, num_epochs, m):
    """Survival of a sum of two successive chi-square numbers, exactly: S_0 = 1, S_k after k epochs at risk.

    The state is the last number y; its density among the runs still silent goes on as f(x) int_0^{h-x} phi(y) dy.
    Before epoch 1 one number has come, and it is not above the threshold.
    """
    nodes, weights = np.polynomial.legendre.leggauss(400)
    root = 0.5 * math.sqrt(threshold) * (nodes + 1)  # y = root^2 takes the root out of the density at 0
    density = stats.chi2.pdf(root**2, m) * 2 * root
    weights = 0.5 * math.sqrt(threshold) * weights
    phi = density / (density @ weights)
    survival = [1.0]
    for _ in range(num_epochs):
        cumulative = np.polynomial.Legendre.fit(root, phi, 60, domain=[0.0, math.sqrt(threshold)]).integ(lbnd=0.0)
        phi = density * cumulative(np.sqrt(threshold - root**2))
        survival.append(float(phi @ weights))
    return np.array(survival)


@pytest.mark.parametrize("dimension", [3, 6])
def test_arl0_of_snapshot_is_one_over_p_fa(dimension):
    detector = make_detector("snapshot:p_fa=0.01")
    detector.bind(1, dimension)
    factor = np.linalg.cholesky(np.eye(dimension) + 0.5)
    result = measure_arl0(detector, white_statistics(factor, 100), detector.threshold, min_epochs=4e5)
    assert result.epochs_at_risk >= 4e5
    assert result.arl0 == result.epochs_at_risk / result.first_alarms
    assert_bernoulli(result, stats.chi2.sf(detector.threshold, dimension))
    assert_bernoulli(result, 1 / detector.arl0)


def test_white_statistics_have_the_stated_covariance_and_warm_windows():
    """The burn-in is the window filling up, the first epoch at risk has a full one."""
    seen = []

    class Spy(type(make_detector("windowed"))):
        def update(self, epoch):
            seen.append(epoch)
            return super().update(epoch)

    burn_in, kept = white_statistics(FACTOR, 7)(Spy(5), 4000, np.random.default_rng(0))
    assert (burn_in.shape, kept.shape) == ((4000, 4), (4000, 7))
    assert [int(epoch.index[0]) for epoch in seen] == list(range(-4, 7))
    residual = np.concatenate([epoch.innovation.residual for epoch in seen])
    nis = np.array([epoch.innovation.nis for epoch in seen])
    assert np.einsum("ni,ij,nj->n", residual, np.linalg.inv(FACTOR @ FACTOR.T), residual) == pytest.approx(nis.ravel())
    assert seen[0].innovation.covariance[0] == pytest.approx(FACTOR @ FACTOR.T)
    assert kept[:, 3] == pytest.approx(nis[3:8].sum(axis=0))
    assert stats.kstest(kept[:, 0], stats.chi2(15).cdf).pvalue > FALSE_FAILURE


def test_arl0_of_a_window_of_two_by_quadrature():
    """Overlapping windows, where 1 / P_FA is wrong: the exact ratio of alarms and epochs at risk."""
    threshold, epochs = 16.0, 50
    survival = sliding_two(threshold, epochs, 3)
    k = np.arange(1, epochs + 1)
    alarm_at = survival[:-1] - survival[1:]
    rate = (1 - survival[-1]) / survival[:-1].sum()
    variance = alarm_at @ (1 - rate * k) ** 2 + survival[-1] * (rate * epochs) ** 2
    detector = make_detector("windowed:n=2")
    result = measure_arl0(detector, white_statistics(FACTOR, epochs), threshold, min_epochs=2e6)
    runs = result.first_alarms / (1 - survival[-1])
    excess = result.first_alarms - rate * result.epochs_at_risk
    assert abs(excess) < DEVIATIONS * math.sqrt(variance * runs)
    naive = stats.chi2.sf(threshold, 6)
    assert abs(result.first_alarms - naive * result.epochs_at_risk) > 2 * DEVIATIONS * math.sqrt(variance * runs)


SHIPPED = WINDOWED_THRESHOLDS[3, 20, 1e5]
SHIPPED_ARL0 = (0.925e5, 1.075e5)
"""The calibration's 95 % interval is 0.973e5 to 1.028e5; this is its 5.3-deviation interval."""


def test_shipped_threshold_in_an_independent_simulation():
    """Chi-square numbers and their sliding sums, without any of the package's code."""
    rng = np.random.default_rng(77)
    alarms = at_risk = 0
    for _ in range(20):
        total = np.cumsum(rng.chisquare(3, (2000, 1019)), axis=1)
        sums = total.copy()
        sums[:, 20:] -= total[:, :-20]
        silent = (sums[:, :19] <= SHIPPED).all(axis=1)
        over = sums[silent, 19:] > SHIPPED
        alarmed = over.any(axis=1)
        alarms += int(alarmed.sum())
        at_risk += int(np.where(alarmed, over.argmax(axis=1) + 1, 1000).sum())
    assert_poisson(alarms, *(at_risk / arl0 for arl0 in reversed(SHIPPED_ARL0)))


def test_simulated_snapshot_agrees_with_theory_on_the_matched_flight(monkeypatch):
    monkeypatch.setattr(calibration, "RUNS", 2000)
    detector = make_detector("snapshot:p_fa=0.01")
    detector.bind(1, 3)
    clean = simulated_statistics(make_scenario("liu-flight:horizon=30"), "linear")
    result = measure_arl0(detector, clean, detector.threshold, min_epochs=5e4)
    assert_bernoulli(result, 0.01)


def test_simulated_window_agrees_with_white_innovations_on_the_matched_flight():
    """A game of 4 epochs: runs that were already alarming when it begins would nearly double the alarms."""
    scenario = make_scenario("liu-flight:horizon=4")
    factor = scenario.linear_model().innovation_factor[0]
    threshold = calibrate(make_detector("windowed"), white_statistics(factor, 4), 100.0, first_alarms=2000).threshold
    results = [
        measure_arl0(make_detector("windowed"), clean, threshold, min_epochs=epochs, seed=9)
        for clean, epochs in ((white_statistics(factor, 4), 2e5), (simulated_statistics(scenario, "linear"), 1.9e4))
    ]
    ratio = math.log(results[0].arl0 / results[1].arl0)
    assert abs(ratio) < DEVIATIONS * math.sqrt(sum(1 / result.first_alarms for result in results))


@pytest.mark.parametrize(("text", "target"), [("snapshot:arl0=100", 100.0), ("windowed:arl0=300", 300.0)])
def test_an_unmatched_scenario_gets_its_own_threshold(text, target, monkeypatch):
    """Coloured noise that the filter does not know: the threshold of white innovations alarms far too often."""
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 1000)  # of 120 epochs: some hundred first alarms
    scenario = make_scenario(UNMATCHED)
    detector = calibrated(make_detector(text), scenario)
    assert detector.calibrated
    assert detector.arl0 == pytest.approx(target, rel=0.01)
    clean = simulated_statistics(scenario, "linear")
    result = measure_arl0(make_detector(text), clean, detector.threshold, min_epochs=9e4, seed=123)
    deviation = math.sqrt(1 / result.first_alarms + 1 / (9e4 / target))
    assert abs(math.log(result.arl0 / target)) < DEVIATIONS * deviation
    white = calibrate(make_detector(text), white_statistics(np.eye(3), 120), target)
    assert detector.threshold > 1.1 * white.threshold

    def never(*_, **__):
        raise AssertionError("calibrated twice")

    monkeypatch.setattr(calibration, "calibrate", never)
    assert calibrated(make_detector(text), scenario).threshold == detector.threshold
    assert calibrated(detector, scenario) is detector


def test_a_matched_scenario_keeps_theory_and_presets(monkeypatch):
    def never(*_, **__):
        raise AssertionError("nothing to calibrate")

    monkeypatch.setattr(calibration, "calibrate", never)
    scenario = make_scenario("liu-flight:horizon=30")
    for text in ("snapshot", "snapshot:arl0=500", "windowed", "windowed:n=5,p_fa=1e-3", "acna:preset=song"):
        detector = calibrated(make_detector(text), scenario)
        assert not detector.calibrated
        assert detector.threshold is not None


def test_acna_is_calibrated_in_metres_of_the_scenario(monkeypatch):
    """Horizontal residuals of covariance S decide; doubling them doubles the threshold."""
    monkeypatch.setattr(calibration, "_KNOWN", {})
    scenario = make_scenario("liu-flight:horizon=30")
    detector = calibrated(make_detector("acna:arl0=100"), scenario)
    assert detector.calibrated
    factors = scenario.linear_model().innovation_factor
    single, double = (calibrate(make_detector("acna"), white_statistics(f, 30), 100.0) for f in (factors, 2 * factors))
    assert double.threshold == pytest.approx(2 * single.threshold, rel=1e-9)
    assert detector.threshold == pytest.approx(single.threshold, rel=1e-9)


def test_a_threshold_of_another_scenario_is_calibrated_anew(monkeypatch):
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 1000)
    here, there = (make_scenario(f"liu-flight:horizon=20,imu={imu}") for imu in ("navigation", "automotive"))
    fresh = calibrated(make_detector("rio:arl0=100"), there).threshold
    carried = calibrated(calibrated(make_detector("rio:arl0=100"), here), there)
    assert carried.threshold == fresh
    ready = [calibrated(make_detector(name), here) for name in ("rio:arl0=100", "acna:arl0=100")]
    union = calibrated(Ensemble(ready, arl0=100.0), there)
    assert union.members[0].threshold == fresh
    by_hand = make_detector("rio:arl0=100")
    by_hand.set_threshold(7.0, 55.0)
    assert calibrated(by_hand, there).threshold == 7.0


def test_two_scenarios_of_one_name_have_thresholds_of_their_own(monkeypatch):
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 1000)
    base = make_scenario("liu-flight:horizon=20")
    bold = base.changed(tuning=FilterTuning(measurement_sigma=(1.85, 1.85, 3.0)))
    assert base.name == bold.name
    detector = make_detector("windowed:n=5,arl0=100")
    assert calibrated(detector, bold).threshold > 1.5 * calibrated(detector, base).threshold


def test_white_innovations_have_the_covariance_of_their_epoch(monkeypatch):
    """On a flight whose innovations get smaller by a third, metres mean something else in every epoch.

    The threshold and the count at it have a thousand first alarms each and more, together a deviation of 0.045: nine
    deviations.
    """
    monkeypatch.setattr(calibration, "RUNS", 1500)
    scenario = make_scenario("shadmehri-flight")
    detector = calibrated(make_detector("rio:arl0=300"), scenario)
    clean = simulated_statistics(scenario, "linear")
    result = measure_arl0(detector, clean, detector.threshold, min_epochs=4e5)
    assert result.first_alarms > 1000
    assert abs(math.log(result.arl0 / 300.0)) < 0.4


def test_a_rate_that_nobody_waits_for_is_refused():
    with pytest.raises(ValueError, match="arl0 must be 10000000 epochs at most"):
        calibrated(make_detector("cusum:arl0=1e9"), make_scenario("liu-flight"))
