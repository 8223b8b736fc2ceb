from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import DETECTORS, Snapshot, Windowed, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import WINDOWED_THRESHOLDS
from spoofgym.navigation.interface import Epoch, Innovation


def epoch_of(nis, k=0):
    nis = np.asarray(nis, dtype=float)
    n = len(nis)
    empty = Innovation(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3)), nis)
    return Epoch(np.full(n, k), np.full(n, float(k)), empty)


def run(detector, nis):
    """Statistics (K, N) of nis (K, N)."""
    detector.bind(nis.shape[1], 3)
    return np.array([detector.update(epoch_of(values, k)).copy() for k, values in enumerate(nis)])


def bound(specification, dimension=3):
    detector = make_detector(specification)
    detector.bind(4, dimension)
    return detector


def test_default_snapshot_has_the_published_threshold_and_its_arl0():
    detector = bound("snapshot")
    assert detector.threshold == 25.9
    assert detector.arl0 == pytest.approx(1.0 / stats.chi2.sf(25.9, 3), rel=1e-12)
    assert detector.arl0 == pytest.approx(1e5, rel=2e-3)
    assert bound("snapshot:preset=shadmehri").threshold == 25.9


@pytest.mark.parametrize(("p_fa", "published"), [(1e-3, 16.27), (1e-5, 25.90), (1e-7, 35.41)])
def test_snapshot_quantiles_for_three_degrees_of_freedom(p_fa, published):
    assert bound(f"snapshot:p_fa={p_fa}").threshold == pytest.approx(published, abs=0.006)


@pytest.mark.parametrize("specification", ["snapshot", "snapshot:p_fa=1e-5", "snapshot:arl0=1e5"])
def test_snapshot_of_six_dimensions_by_the_closed_form(specification):
    half = bound(specification, 6).threshold / 2.0
    assert math.exp(-half) * (1.0 + half + half**2 / 2.0) == pytest.approx(1e-5, rel=1e-9)


def test_snapshot_arl0_is_the_inverse_of_p_fa():
    assert bound("snapshot:arl0=1e4").threshold == bound("snapshot:p_fa=1e-4").threshold
    assert bound("snapshot:p_fa=1e-4").arl0 == pytest.approx(1e4, rel=1e-9)
    assert bound("snapshot:arl0=1e4").target_arl0 == 1e4
    assert bound("snapshot:threshold=12").arl0 == pytest.approx(1.0 / stats.chi2.sf(12, 3), rel=1e-9)


def test_snapshot_false_alarms_of_white_innovations():
    """False-failure probability 1e-7."""
    whitened = np.random.default_rng(1).standard_normal((200_000, 3))
    detector = bound("snapshot:p_fa=0.01")
    alarms = np.count_nonzero(detector.update(epoch_of((whitened**2).sum(axis=1))) > detector.threshold)
    assert stats.binom.ppf(5e-8, 200_000, 0.01) <= alarms <= stats.binom.isf(5e-8, 200_000, 0.01)


@pytest.mark.parametrize(("n", "published"), [(5, 50.49), (10, 75.02), (20, 118.58), (60, 272.63)])
def test_windowed_quantiles_have_m_n_degrees_of_freedom(n, published):
    detector = bound(f"windowed:n={n},p_fa=1e-5")
    assert detector.threshold == pytest.approx(published, abs=0.006)
    assert detector.arl0 is None
    assert detector.memory == n - 1
    assert bound(f"windowed:n={n},p_fa=1e-5", 6).threshold == pytest.approx(stats.chi2.isf(1e-5, 6 * n), rel=1e-9)


def test_default_window_comes_from_the_table():
    detector = bound("windowed")
    assert (detector.n, detector.arl0, detector.target_arl0) == (20, 1e5, 1e5)
    assert detector.threshold == WINDOWED_THRESHOLDS[3, 20, 1e5]


def test_table_lies_between_what_overlap_allows():
    """A union bound on one side, the quantile that would hold if windows alarmed independently on the other."""
    for (m, n, arl0), threshold in WINDOWED_THRESHOLDS.items():
        assert stats.chi2.sf(threshold, m * n) > 1.0 / arl0
        assert stats.chi2.sf(threshold, m * n) < n / arl0


@pytest.mark.parametrize(
    ("specification", "dimension"), [("windowed:n=7", 3), ("windowed:arl0=1e4", 3), ("windowed", 6)]
)
def test_other_windows_wait_for_calibration(specification, dimension):
    detector = bound(specification, dimension)
    assert detector.threshold is None
    assert detector.arl0 is None
    assert detector.target_arl0 in (1e4, 1e5)
    detector.set_threshold(42.0, 1.01e5)
    detector.bind(2, dimension)
    assert (detector.threshold, detector.arl0, detector.calibrated) == (42.0, 1.01e5, True)


def test_published_mean_threshold_is_n_times_the_quantile_of_one_epoch():
    detector = bound("windowed:n=5,preset=shadmehri")
    assert detector.threshold == pytest.approx(5 * 25.9)
    assert stats.chi2.sf(detector.threshold, 15) == pytest.approx(2.7e-20, rel=0.05)


@pytest.mark.parametrize("n", [1, 2, 5, 20, 50])
def test_windowed_is_the_sum_of_the_last_n_since_the_reset_of_each_run(n):
    generator = np.random.default_rng(n)
    nis = generator.chisquare(3, (90, 5))
    resets = {0: range(5), 13: [2], 14: [0, 4], 40: [2], 41: [2], 77: [1, 3]}
    detector = Windowed(n, threshold=1.0)
    detector.bind(5, 3)
    since = np.zeros(5, dtype=int)
    for k in range(90):
        if k in resets:
            detector.reset(np.array(list(resets[k])))
            since[list(resets[k])] = k
        statistic = detector.update(epoch_of(nis[k], k))
        expected = [math.fsum(nis[max(since[i], k - n + 1) : k + 1, i]) for i in range(5)]
        np.testing.assert_allclose(statistic, expected, rtol=1e-14)


def test_windowed_does_not_drift_after_a_huge_value():
    nis = np.ones((200, 1))
    nis[50] = 1e17
    statistics = run(Windowed(20, threshold=1.0), nis)
    np.testing.assert_array_equal(statistics[70:], 20.0)
    np.testing.assert_array_equal(statistics[:20, 0], np.arange(1.0, 21.0))


@pytest.mark.parametrize("n", [3, 8, 20, 130])
def test_windowed_is_bit_identical_for_any_number_of_runs(n):
    nis = np.random.default_rng(n).chisquare(3, (n + 40, 1024))
    whole = run(Windowed(n, threshold=1.0), nis)
    for first, last in ((0, 1), (5, 6), (3, 10), (500, 564)):
        np.testing.assert_array_equal(run(Windowed(n, threshold=1.0), nis[:, first:last]), whole[:, first:last])


def test_take_brings_the_memory_of_fewer_runs():
    nis = np.random.default_rng(0).chisquare(3, (30, 6))
    runs = np.array([4, 1])
    whole, part = Windowed(5, threshold=1.0), Windowed(5, threshold=1.0)
    run(whole, nis[:17] + 100.0)
    run(part, nis[3:17][:, runs])
    whole.take(runs, part)
    for k in range(17, 30):
        statistic, expected = whole.update(epoch_of(nis[k])), part.update(epoch_of(nis[k, runs]))
        np.testing.assert_array_equal(statistic[runs], expected)
    assert not np.array_equal(whole.update(epoch_of(nis[0]))[[0, 2]], part.update(epoch_of(nis[0, runs])))


@pytest.mark.parametrize(
    "specification",
    [
        "snapshot",
        "snapshot:threshold=12.5",
        "snapshot:p_fa=1e-07",
        "snapshot:preset=shadmehri",
        "snapshot:arl0=10000",
        "windowed",
        "windowed:n=7",
        "windowed:n=7,arl0=10000",
        "windowed:threshold=100",
        "windowed:n=60,p_fa=0.001",
        "windowed:preset=shadmehri",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert detector.name == specification
    assert make_detector(detector.name).name == specification


def test_make_detector_takes_objects():
    detector = Snapshot(p_fa=1e-3)
    assert make_detector(detector) is detector
    assert {"snapshot", "windowed", "acna"} < set(DETECTORS)
    assert all(isinstance(make_detector(name), Detector) for name in DETECTORS)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("snapshoot", "unknown detector 'snapshoot': did you mean 'snapshot'\\? valid names: acceleration, "),
        ("snapshot:window=3", "no option 'window'; valid options: threshold, p_fa, preset, arl0"),
        ("snapshot:0", "threshold must be a finite number greater than 0, got 0.0"),
        ("snapshot:nan", "threshold must be a finite number greater than 0, got nan"),
        ("snapshot:inf", "threshold must be a finite number"),
        ("snapshot:p_fa=0", "p_fa must be greater than 0 and less than 1, got 0.0"),
        ("snapshot:p_fa=1", "p_fa must be greater than 0 and less than 1, got 1.0"),
        ("snapshot:arl0=1", "arl0 must be a finite number greater than 1, got 1.0"),
        ("snapshot:preset=song", "preset must be one of shadmehri, got 'song'"),
        ("snapshot:25.9,p_fa=1e-5", "at most one of threshold, p_fa, preset, arl0; got threshold and p_fa"),
        ("windowed:0", "n must be a whole number, 1 or more, got 0"),
        ("windowed:2.5", "n must be a whole number, got '2.5'"),
        ("windowed:n=5,p_fa=1e-3,arl0=100", "at most one of threshold, p_fa, preset, arl0; got p_fa and arl0"),
        ("windowed:threshold=-1", "threshold must be a finite number greater than 0, got -1.0"),
        ("windowed:arl0=0.5", "arl0 must be a finite number greater than 1, got 0.5"),
        ("windowed:preset=foi", "preset foi is for n = 6 and 21"),
        ("windowed:preset=song", "preset must be one of shadmehri, foi, got 'song'"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)


@pytest.mark.parametrize("n", [True, "20", 2.5, None])
def test_a_window_must_be_a_whole_number(n):
    with pytest.raises(ValueError, match="n must be a whole number, 1 or more"):
        Windowed(n)


@pytest.mark.parametrize("specification", ["snapshot:preset=shadmehri", "windowed:preset=shadmehri"])
def test_a_preset_holds_for_its_dimension_only(specification):
    with pytest.raises(ValueError, match="published for fixes of dimension 3, got 6"):
        bound(specification, 6)


def test_a_threshold_from_calibration_must_be_positive():
    with pytest.raises(ValueError, match="threshold must be a finite number greater than 0, got nan"):
        Windowed(5).set_threshold(float("nan"))


def test_make_detector_refuses_other_things():
    with pytest.raises(TypeError, match="detector must be a specification"):
        make_detector(25.9)
