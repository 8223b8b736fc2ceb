import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrated
from spoofgym.detectors import Acceleration, make_detector
from spoofgym.scenarios import make_scenario

FALSE_FAILURE = 1e-7


def expected(motion, n):
    """‖d_k - 2 d_(k-n) + d_(k-2n)‖ / T² of east and north, epoch by epoch, (K, N)."""
    d = (motion.gnss - motion.ins)[:, :, :2].copy()
    d[~motion.available | (motion.index < 0)] = np.nan
    values = np.zeros(d.shape[:2])
    for k in range(2 * n, len(d)):
        change = (d[k] - 2.0 * d[k - n] + d[k - 2 * n]) / (n * motion.interval) ** 2
        values[k] = np.nan_to_num(np.sqrt((change**2).sum(axis=1)))
    return values


@pytest.mark.parametrize("n", [1, 4])
def test_it_is_the_second_difference_of_gnss_against_the_inertial_solution(motion, n):
    """What the filter believes drops out; epochs before the game and without a fix leave their terms out."""
    played = motion(3, 30, 6)
    played.index -= 5
    played.available[17, 2] = False
    played.available[[12, 20], 4] = False
    want = expected(played, n)
    np.testing.assert_allclose(played.run(Acceleration(n, threshold=1.0)), want, rtol=1e-9, atol=1e-12)
    assert np.count_nonzero(want) > 50


def test_epochs_that_are_not_equally_spaced_have_divided_differences(motion):
    """A parabola has the same second divided difference wherever it is taken: 2 a."""
    played = motion(3, 12, 1)
    steps = np.array([1, 1, 3, 1, 2, 1, 1, 5, 1, 1, 2, 1])
    played.index = np.cumsum(steps)[:, None]
    time = played.interval * played.index
    played.ins = played.gnss - np.stack([0.3 * time**2 + time, 0.4 * time**2 - 7.0, 9.0 * time**2], axis=2)
    statistic = played.run(Acceleration(3, threshold=1.0))[:, 0]
    np.testing.assert_allclose(statistic[6:], 1.0, rtol=1e-9)
    assert np.all(statistic[:6] == 0.0)


@pytest.mark.parametrize("n", [1, 5])
def test_white_fixes_give_each_axis_the_standard_deviation_root_six_sigma_over_t_squared(motion, n):
    """A perfect inertial solution: 20,000 runs at one epoch, Rayleigh."""
    played = motion(1, 2 * n + 1, 20_000)
    played.ins = np.zeros_like(played.gnss)
    played.gnss = 2.5 * np.random.default_rng(n).standard_normal(played.gnss.shape)
    deviation = np.sqrt(6.0) * 2.5 / (n * played.interval) ** 2
    statistic = played.run(Acceleration(n, threshold=1.0))[-1]
    assert stats.kstest(statistic / deviation, stats.rayleigh.cdf).pvalue > FALSE_FAILURE


def test_the_spread_in_clean_games_is_that_of_the_receiver():
    """On the flight, whose inertial solution hardly drifts within ten epochs: 3.7 m of white noise per axis.

    Epochs judged each by itself, 101 of 121, would make the ratio 1; windows overlap, so that it is somewhat less. 100
    first alarms: 5.3 deviations are a factor of 1.7 either way.
    """
    detector = calibrated(make_detector("acceleration:arl0=1000"), make_scenario("liu-flight"))
    tail = np.exp(-0.5 * (detector.threshold / (np.sqrt(6.0) * 3.7 / 100.0)) ** 2)
    assert 0.3 < 1.0 / tail / (1000.0 * 101 / 121) < 1.7


def test_it_sees_a_ramp_begin_and_no_more(motion):
    """0 before, rate / T at most after: the kink lies in the window for 2 n epochs."""
    played = motion(3, 40, 1)
    played.interval = 1.0
    played.gnss[:] = played.ins[:] = 0.0
    played.gnss[:, 0, 1] = 2.0 * np.maximum(np.arange(40) - 15, 0)
    statistic = played.run(Acceleration(5, threshold=1.0))[:, 0]
    assert statistic.max() == pytest.approx(2.0 / 5.0)
    assert statistic.argmax() == 20
    assert np.all(statistic[16:25] > 0.0)
    assert np.all(statistic[:16] == 0.0)
    assert np.all(np.abs(statistic[25:]) < 1e-12)


def test_a_reset_forgets_one_run(motion):
    played = motion(5, 25, 3)
    detector, other = Acceleration(3, threshold=1.0), Acceleration(3, threshold=1.0)
    detector.bind(3, 3)
    for k in range(12):
        detector.update(played.epoch(k))
    detector.reset(np.array([1]))
    other.bind(3, 3)
    for k in range(12, 25):
        got, new = detector.update(played.epoch(k)), other.update(played.epoch(k))
        assert got[1] == new[1]
        assert got[0] != 0.0
        assert (got[1] == 0.0) == (k < 18)


def test_it_is_bit_identical_for_any_number_of_runs(motion):
    played = motion(8, 30, 67)
    whole = played.run(Acceleration(4, threshold=1.0))
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(played.run(Acceleration(4, threshold=1.0), part), whole[:, part])


@pytest.mark.parametrize(
    "specification", ["acceleration", "acceleration:n=20", "acceleration:threshold=0.3", "acceleration:n=5,arl0=1000"]
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, Acceleration)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.demands.auxiliary
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("acceleration:0", "n must be a whole number, 1 or more, got 0"),
        ("acceleration:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("acceleration:threshold=9,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
