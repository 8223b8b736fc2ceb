import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import MeanInnovation, make_detector
from spoofgym.navigation.interface import Epoch, Innovation

FALSE_FAILURE = 1e-7


def epoch_of(residual, covariance, k=0, available=None):
    n, m = residual.shape
    innovation = Innovation(residual, covariance, np.zeros((n, m)), np.zeros(n))
    return Epoch(np.full(n, k), np.full(n, float(k)), innovation, available=available)


def random_epochs(seed, epochs, runs, dimension):
    """Residuals (K, N, m) and covariances (K, N, m, m) that change with the epoch."""
    rng = np.random.default_rng(seed)
    root = rng.uniform(-1.0, 1.0, (epochs, 1, dimension, dimension)) + 3.0 * np.eye(dimension)
    residual = np.einsum(
        "knij,knj->kni",
        np.broadcast_to(root, (epochs, runs, dimension, dimension)),
        rng.standard_normal((epochs, runs, dimension)),
    )
    return residual, np.broadcast_to(root @ root.swapaxes(2, 3), (epochs, runs, dimension, dimension))


@pytest.mark.parametrize("dimension", [3, 6])
def test_largest_mean_over_its_deviation_since_the_reset_of_each_run(dimension):
    residual, covariance = random_epochs(1, 50, 4, dimension)
    available = np.random.default_rng(2).random((50, 4)) > 0.3
    resets = {0: range(4), 11: [2], 30: [0, 2]}
    detector = MeanInnovation(6, threshold=1.0)
    detector.bind(4, dimension)
    since = np.zeros(4, dtype=int)
    for k in range(50):
        if k in resets:
            detector.reset(np.array(list(resets[k])))
            since[list(resets[k])] = k
        statistic = detector.update(epoch_of(residual[k], covariance[k], k, available[k]))
        for i in range(4):
            fixes = [j for j in range(max(since[i], k - 5), k + 1) if available[j, i]]
            if not fixes:
                assert statistic[i] == 0.0
                continue
            mean = residual[fixes, i].mean(axis=0)
            deviation = np.sqrt(sum(np.diag(covariance[j, i]) for j in fixes)) / len(fixes)
            assert statistic[i] == pytest.approx(np.max(np.abs(mean) / deviation), rel=1e-11)


def test_each_axis_is_standard_normal():
    """Independent axes and full windows: the largest of three moduli."""
    rng = np.random.default_rng(5)
    sigma = np.array([3.7, 2.0, 6.0])
    covariance = np.broadcast_to(np.diag(sigma**2), (50_000, 3, 3))
    detector = MeanInnovation(8, threshold=2.5)
    detector.bind(50_000, 3)
    for k in range(8):
        statistic = detector.update(epoch_of(sigma * rng.standard_normal((50_000, 3)), covariance, k))
    p = 1.0 - (1.0 - 2.0 * stats.norm.sf(2.5)) ** 3
    alarms = np.count_nonzero(statistic > detector.threshold)
    assert stats.binom.ppf(FALSE_FAILURE / 2, 50_000, p) <= alarms <= stats.binom.isf(FALSE_FAILURE / 2, 50_000, p)


def test_it_is_bit_identical_for_any_number_of_runs():
    residual, covariance = random_epochs(3, 40, 130, 3)

    def run(part):
        detector = MeanInnovation(20, threshold=1.0)
        detector.bind(residual[:, part].shape[1], 3)
        return np.array([detector.update(epoch_of(residual[k, part], covariance[k, part], k)) for k in range(40)])

    whole = run(slice(None))
    for part in (slice(0, 1), slice(3, 10), slice(60, 124)):
        np.testing.assert_array_equal(run(part), whole[:, part])


def test_names_and_defaults():
    for text in ("mean-innovation", "mean-innovation:n=50,arl0=1000", "mean-innovation:threshold=4"):
        assert make_detector(text).name == text
    detector = make_detector("mean-innovation")
    assert (detector.n, detector.memory, detector.target_arl0, detector.threshold) == (20, 19, 1e5, None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("mean-innovation:0", "n must be a whole number, 1 or more, got 0"),
        ("mean-innovation:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("mean-innovation:threshold=3,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
