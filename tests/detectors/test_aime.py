import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import Aime, make_detector
from spoofgym.detectors.aime import sweep
from spoofgym.navigation.interface import Epoch, Innovation

FALSE_FAILURE = 1e-7


def random_epochs(seed, epochs, runs, dimension):
    """Residuals (K, N, m) of covariances (K, N, m, m) that differ between epochs and runs."""
    rng = np.random.default_rng(seed)
    factor = np.tril(rng.uniform(-1.0, 1.0, (epochs, runs, dimension, dimension))) + 3.0 * np.eye(dimension)
    residual = np.einsum("knij,knj->kni", factor, rng.standard_normal((epochs, runs, dimension)))
    return residual, np.einsum("knij,knlj->knil", factor, factor)


def epoch_of(residual, covariance, k=0, available=None):
    n, m = residual.shape
    innovation = Innovation(residual, covariance, np.zeros((n, m)), np.zeros(n))
    return Epoch(np.full(n, k), np.full(n, float(k)), innovation, available=available)


@pytest.mark.parametrize("dimension", [3, 6])
def test_sweeping_inverts(dimension):
    _, covariance = random_epochs(1, 1, 5, dimension)
    vector = np.arange(5.0 * dimension).reshape(5, dimension) - 4.0
    rows, columns = np.tril_indices(dimension)
    packed = np.concatenate([covariance[0][:, rows, columns].T, vector.T, np.zeros((1, 5))])
    sweep(packed)
    inverse = np.linalg.inv(covariance[0])
    solved = np.einsum("nij,nj->ni", inverse, vector)
    np.testing.assert_allclose(packed[: len(rows)], -inverse[:, rows, columns].T, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(packed[len(rows) : -1], solved.T, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(packed[-1], -np.einsum("ni,ni->n", vector, solved), rtol=1e-9)


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_weighted_mean_of_the_fixes_since_the_reset_of_each_run(white, dimension):
    """The published formulas, one window after the other, with outages longer than a window."""
    residual, covariance = random_epochs(2, 60, 4, dimension)
    available = np.random.default_rng(3).random((60, 4)) > 0.3
    available[35:50, 3] = False
    resets = {0: [0, 1, 2, 3], 11: [2], 30: [0, 2]}
    since = white.since(60, 4, resets)
    detector = Aime("4+9", threshold=1.0)
    detector.bind(4, dimension)
    for k in range(60):
        if k in resets:
            detector.reset(np.array(resets[k]))
        statistic = detector.update(epoch_of(residual[k], covariance[k], k, available[k]))
        for i in range(4):
            expected = [0.0]
            for length in (4, 9):
                fixes = [j for j in range(max(since[k, i], k - length + 1), k + 1) if available[j, i]]
                if fixes:
                    inverses = np.linalg.inv(covariance[fixes, i])
                    spread = np.linalg.inv(inverses.sum(axis=0))
                    mean = spread @ sum(inverse @ residual[j, i] for inverse, j in zip(inverses, fixes, strict=True))
                    expected.append(float(mean @ np.linalg.solve(spread, mean)))
            assert statistic[i] == pytest.approx(max(expected), rel=1e-9, abs=0.0)


def test_chi_square_with_m_degrees_of_freedom_for_any_covariances():
    """60 000 independent windows of five fixes: the whole distribution."""
    residual, covariance = random_epochs(4, 5, 60_000, 3)
    detector = Aime("5", threshold=1.0)
    detector.bind(60_000, 3)
    for k in range(5):
        statistic = detector.update(epoch_of(residual[k], covariance[k], k))
    assert stats.kstest(statistic, stats.chi2(3).cdf).pvalue > FALSE_FAILURE


def test_a_bias_adds_up_over_each_window_and_one_that_turns_round_cancels(white):
    steady = np.tile([0.6, 0.0, -0.8], (20, 1, 1))
    turning = steady * np.array([1, -1] * 10)[:, None, None]
    assert white.run(Aime("4+10", threshold=1.0), steady)[-1] == pytest.approx(10.0)
    assert white.run(Aime("4+10", threshold=1.0), turning)[-1] == pytest.approx(0.0, abs=1e-20)
    # five epochs after its end the short window has forgotten it, and the long one has half of it left
    ended = np.concatenate([steady, np.zeros((5, 1, 3))])
    assert white.run(Aime("4+10", threshold=1.0), ended)[-1] == pytest.approx(2.5)


def test_runs_are_independent(white):
    whitened = np.random.default_rng(5).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: Aime("4+9", threshold=1.0), whitened)


def test_names_and_defaults():
    for text in ("aime", "aime:windows=20,arl0=1000", "aime:windows=10+40,threshold=20"):
        assert make_detector(text).name == text
    detector = make_detector("aime")
    assert (detector.windows, detector.memory, detector.target_arl0) == ((30, 60, 120), 119, 1e5)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("aime:60+30", r"windows must be whole numbers, 1 or more and increasing, .* got '60\+30'"),
        ("aime:threshold=-1", "threshold must be a finite number greater than 0, got -1"),
        ("aime:threshold=1,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
