import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import SignedMean, make_detector
from spoofgym.navigation.interface import Epoch, Innovation

FALSE_FAILURE = 1e-7
FACTOR = np.array([[4.0, 0.0, 0.0], [1.0, 3.0, 0.0], [-2.0, 0.5, 6.0]])


def epoch_of(whitened, k=0):
    n, m = whitened.shape
    innovation = Innovation(np.zeros((n, m)), np.zeros((n, m, m)), whitened, np.zeros(n))
    return Epoch(np.full(n, k), np.full(n, float(k)), innovation)


def run(detector, whitened):
    """Statistics (K, N) of whitened innovations (K, N, m)."""
    detector.bind(whitened.shape[1], whitened.shape[2])
    return np.array([detector.update(epoch_of(values, k)) for k, values in enumerate(whitened)])


def test_one_term_is_the_horizontal_nis_by_its_own_covariance():
    residual = np.random.default_rng(0).standard_normal((1, 50, 3)) @ FACTOR.T
    whitened = np.linalg.solve(FACTOR, residual[0].T).T
    horizontal = residual[0, :, :2]
    expected = np.einsum("ni,ij,nj->n", horizontal, np.linalg.inv((FACTOR @ FACTOR.T)[:2, :2]), horizontal)
    np.testing.assert_allclose(run(SignedMean(1, threshold=1.0), whitened[None])[0], expected, rtol=1e-12)


@pytest.mark.parametrize(("n", "dimension"), [(1, 3), (5, 3), (20, 6)])
def test_two_degrees_of_freedom_for_any_window_and_dimension(n, dimension):
    """Non-overlapping windows, which are independent: a binomial count and the whole distribution."""
    whitened = np.random.default_rng(n).standard_normal((n, 60_000, dimension))
    detector = make_detector(f"signed-mean:n={n},p_fa=0.01")
    statistic = run(detector, whitened)[-1]
    assert detector.threshold == pytest.approx(-2.0 * np.log(0.01))
    alarms = np.count_nonzero(statistic > detector.threshold)
    low, high = stats.binom.ppf(FALSE_FAILURE / 2, 60_000, 0.01), stats.binom.isf(FALSE_FAILURE / 2, 60_000, 0.01)
    assert low <= alarms <= high
    assert stats.kstest(statistic, stats.chi2(2).cdf).pvalue > FALSE_FAILURE


def test_the_signed_sum_since_the_reset_of_each_run():
    generator = np.random.default_rng(4)
    whitened = generator.standard_normal((60, 4, 3))
    whitened[20:24, 1] = 0.0  # no fix
    resets = {0: range(4), 13: [2], 40: [0, 2]}
    detector = SignedMean(7, threshold=1.0)
    detector.bind(4, 3)
    since = np.zeros(4, dtype=int)
    for k in range(60):
        if k in resets:
            detector.reset(np.array(list(resets[k])))
            since[list(resets[k])] = k
        statistic = detector.update(epoch_of(whitened[k], k))
        sums = np.array([whitened[max(since[i], k - 6) : k + 1, i, :2].sum(axis=0) for i in range(4)])
        np.testing.assert_allclose(statistic, (sums**2).sum(axis=1) / 7, rtol=1e-11, atol=1e-13)


def test_a_bias_that_turns_round_cancels_and_a_steady_one_adds_up():
    steady = np.tile([0.6, -0.8, 5.0], (10, 1, 1))
    turning = steady * np.array([1, -1] * 5)[:, None, None]
    assert run(SignedMean(10, threshold=1.0), steady)[-1] == pytest.approx(10.0)
    assert run(SignedMean(10, threshold=1.0), turning)[-1] == pytest.approx(0.0, abs=1e-20)


def test_the_calibrated_arl0_in_an_independent_simulation():
    """Cumulative sums of normal numbers, without any of the package's code; 4000 first alarms decide the threshold."""
    arl0 = 200.0
    found = calibrate(SignedMean(5), white_statistics(FACTOR, 200), arl0, first_alarms=4000, seed=1)
    rng = np.random.default_rng(77)
    alarms = at_risk = 0
    for _ in range(4):
        total = np.cumsum(rng.standard_normal((5000, 204, 2)), axis=1)
        total[:, 5:] -= total[:, :-5].copy()
        statistic = (total**2).sum(axis=2) / 5
        statistic = statistic[(statistic[:, :4] <= found.threshold).all(axis=1), 4:]
        over = statistic > found.threshold
        alarmed = over.any(axis=1)
        alarms += int(alarmed.sum())
        at_risk += int(np.where(alarmed, over.argmax(axis=1) + 1, 200).sum())
    assert alarms > 9000
    # 6 deviations of two independent counts: 2e-9
    assert abs(np.log(at_risk / alarms / arl0)) < 6.0 * np.sqrt(1 / alarms + 1 / found.first_alarms)
    # windows overlap: the independent rate would be wrong
    assert stats.chi2.sf(found.threshold, 2) > 1.3 / arl0


def test_it_is_bit_identical_for_any_number_of_runs():
    whitened = np.random.default_rng(3).standard_normal((40, 257, 3))
    whole = run(SignedMean(20, threshold=1.0), whitened)
    for part in (slice(0, 1), slice(3, 10), slice(100, 164)):
        np.testing.assert_array_equal(run(SignedMean(20, threshold=1.0), whitened[:, part]), whole[:, part])


@pytest.mark.parametrize(
    "specification",
    ["signed-mean", "signed-mean:n=10", "signed-mean:arl0=100000", "signed-mean:threshold=9", "signed-mean:p_fa=0.001"],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, SignedMean)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.memory == detector.n - 1
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


def test_defaults():
    detector = make_detector("signed-mean")
    assert (detector.n, detector.target_arl0, detector.threshold) == (5, 1e3, None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("signed-mean:0", "n must be a whole number, 1 or more, got 0"),
        ("signed-mean:threshold=-2", "threshold must be a finite number greater than 0, got -2"),
        ("signed-mean:p_fa=1", "p_fa must be greater than 0 and less than 1, got 1"),
        ("signed-mean:arl0=1", "arl0 must be a finite number greater than 1, got 1"),
        ("signed-mean:p_fa=0.1,arl0=10", "at most one of threshold, p_fa, arl0; got p_fa and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
