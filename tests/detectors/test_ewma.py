import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import Ewma, Mewma, make_detector

FALSE_FAILURE = 1e-7
WEIGHT = 0.1
CELLS = 201


def survival(chain):
    """Chance per epoch of no alarm, long after the start: the greatest eigenvalue (Brook and Evans 1972)."""
    return np.max(np.abs(np.linalg.eigvals(chain)))


def test_the_calibrated_arl0_of_three_axes():
    """A Markov chain of one axis; 4000 first alarms, 6 deviations: 2e-9; the cells are worth less than 1 %."""
    found = calibrate(Ewma(WEIGHT), white_statistics(np.eye(6), 200), 200.0, first_alarms=4000, seed=1)
    limit = found.threshold * np.sqrt(WEIGHT / (2.0 - WEIGHT))
    edges = np.linspace(-limit, limit, CELLS + 1)
    centres = 0.5 * (edges[1:] + edges[:-1])
    chain = np.diff(stats.norm.cdf((edges[None] - (1.0 - WEIGHT) * centres[:, None]) / WEIGHT), axis=1)
    hazard = 1.0 - survival(chain) ** 3
    assert abs(np.log(hazard * 200.0)) < 6.0 / np.sqrt(found.first_alarms) + 0.01


def test_the_calibrated_arl0_of_the_length():
    """A Markov chain of |e| (Runger and Prabhu 1996): |e'|² / λ² is noncentral chi-square; tolerance as above."""
    found = calibrate(Mewma(WEIGHT), white_statistics(np.eye(3), 200), 200.0, first_alarms=4000, seed=2)
    edges = np.linspace(0.0, np.sqrt(found.threshold * WEIGHT / (2.0 - WEIGHT)), CELLS + 1)
    centres = 0.5 * (edges[1:] + edges[:-1])
    noncentrality = ((1.0 - WEIGHT) * centres / WEIGHT) ** 2
    chain = np.diff(stats.ncx2.cdf(edges[None] ** 2 / WEIGHT**2, 3, noncentrality[:, None]), axis=1)
    assert abs(np.log((1.0 - survival(chain)) * 200.0)) < 6.0 / np.sqrt(found.first_alarms) + 0.01


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_weighted_sum_since_the_reset_of_each_run(white, dimension):
    """e = λ Σ (1 − λ)^age w over the fixes; epochs without one do not age the others."""
    rng = np.random.default_rng(3)
    whitened = rng.standard_normal((60, 4, dimension))
    available = rng.random((60, 4)) > 0.2
    resets = {0: [0, 1, 2, 3], 13: [2], 40: [0, 2]}
    axes = white.run(Ewma(WEIGHT, threshold=1.0), whitened, available, resets)
    length = white.run(Mewma(WEIGHT, threshold=1.0), whitened, available, resets)
    since = white.since(60, 4, resets)
    for k in range(60):
        for i in range(4):
            fixes = [j for j in range(since[k, i], k + 1) if available[j, i]][::-1]
            mean = sum((WEIGHT * (1.0 - WEIGHT) ** age * whitened[j, i] for age, j in enumerate(fixes)), np.zeros(1))
            deviation = np.sqrt(WEIGHT / (2.0 - WEIGHT))
            assert axes[k, i] == pytest.approx(np.max(np.abs(mean[:3])) / deviation, rel=1e-10)
            assert length[k, i] == pytest.approx(mean @ mean / deviation**2, rel=1e-10)


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_distribution_in_the_steady_state(white, dimension):
    """After 60 epochs the start is worth 0.9^120 = 3e-6 of the variance."""
    whitened = np.random.default_rng(dimension).standard_normal((60, 30_000, dimension))
    length = white.run(Mewma(WEIGHT, threshold=1.0), whitened)[-1]
    assert stats.kstest(length, stats.chi2(dimension).cdf).pvalue > FALSE_FAILURE
    largest = white.run(Ewma(WEIGHT, threshold=1.0), whitened)[-1]
    assert stats.kstest(largest, lambda x: (2.0 * stats.norm.cdf(x) - 1.0) ** 3).pvalue > FALSE_FAILURE


def test_a_steady_bias_shows_in_full_and_one_that_turns_round_does_not(white):
    steady = np.tile([0.3, 0.0, -0.4], (400, 1, 1))
    turning = steady * np.array([1, -1] * 200)[:, None, None]
    gain = 1.95 / 0.05
    assert white.run(Ewma(threshold=1.0), steady)[-1] == pytest.approx(0.4 * np.sqrt(gain))
    assert white.run(Mewma(threshold=1.0), steady)[-1] == pytest.approx(0.25 * gain)
    assert white.run(Mewma(threshold=1.0), turning)[-1] < 0.01


@pytest.mark.parametrize("detector", [Ewma, Mewma])
def test_runs_are_independent(white, detector):
    whitened = np.random.default_rng(5).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: detector(threshold=1.0), whitened)


def test_names_defaults_and_memory():
    for text in ("ewma", "ewma:weight=0.2,arl0=1000", "mewma", "mewma:weight=0.01,threshold=9"):
        assert make_detector(text).name == text
    for text in ("ewma", "mewma"):
        detector = make_detector(text)
        assert (detector.weight, detector.memory, detector.target_arl0) == (0.05, 60, 1e5)
    assert make_detector("mewma:0.01").memory == 300


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("ewma:0", "weight must be greater than 0 and less than 1, got 0"),
        ("mewma:1", "weight must be greater than 0 and less than 1, got 1"),
        ("ewma:threshold=3,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
