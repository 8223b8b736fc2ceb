import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import Cusum, SignedCusum, make_detector

CELLS = 400


def steady_hazard(increment_cdf, threshold):
    """Chance per epoch that max(0, S + x) exceeds the threshold, long after its start, if it has not before.

    One minus the greatest eigenvalue of the Markov chain between alarms (Brook and Evans 1972), on `CELLS` cells of
    which the first is the point 0.
    """
    width = threshold / (CELLS - 0.5)
    places = width * np.arange(CELLS)
    below = increment_cdf(places[None] + width / 2 - places[:, None])
    chain = np.diff(below, axis=1, prepend=0.0)
    return 1.0 - np.max(np.abs(np.linalg.eigvals(chain)))


@pytest.mark.parametrize(("k", "dimension"), [(1.5, 3), (1.2, 6)])
def test_the_calibrated_arl0_of_the_sum_of_nis(k, dimension):
    """4000 first alarms, 6 deviations: 2e-9; the cells are worth less than 1 %."""
    clean = white_statistics(np.eye(dimension), 200)
    found = calibrate(Cusum(k), clean, 200.0, first_alarms=4000, seed=1)
    hazard = steady_hazard(lambda x: stats.chi2.cdf(x + k * dimension, dimension), found.threshold)
    assert abs(np.log(hazard * 200.0)) < 6.0 / np.sqrt(found.first_alarms) + 0.01


def test_the_calibrated_arl0_of_six_signed_sums():
    """Three axes with two sides each, whose hazards add up; 4000 first alarms, 6 deviations: 2e-9."""
    found = calibrate(SignedCusum(0.5), white_statistics(np.eye(6), 200), 200.0, first_alarms=4000, seed=2)
    hazard = 6.0 * steady_hazard(lambda x: stats.norm.cdf(x + 0.5), found.threshold)
    assert abs(np.log(hazard * 200.0)) < 6.0 / np.sqrt(found.first_alarms) + 0.02


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_greatest_sum_since_any_epoch_after_the_reset_of_each_run(white, dimension):
    """Page's sum is the greatest of all sums that end now, or 0; epochs without a fix are skipped."""
    rng = np.random.default_rng(3)
    whitened = 1.5 * rng.standard_normal((60, 4, dimension))
    available = rng.random((60, 4)) > 0.2
    resets = {0: [0, 1, 2, 3], 13: [2], 40: [0, 2]}
    squares = white.run(Cusum(1.5, threshold=1.0), whitened, available, resets)
    signed = white.run(SignedCusum(0.25, threshold=1.0), whitened, available, resets)
    since = white.since(60, 4, resets)
    for k in range(60):
        for i in range(4):
            fixes = [j for j in range(since[k, i], k + 1) if available[j, i]][::-1]
            sums = np.cumsum([whitened[j, i] @ whitened[j, i] - 1.5 * dimension for j in fixes])
            assert squares[k, i] == pytest.approx(max([0.0, *sums]), rel=1e-10)
            sides = [side * whitened[j, i, :3] - 0.25 for j in fixes for side in (1, -1)]
            sums = np.cumsum(np.reshape(sides, (-1, 6)), axis=0)
            assert signed[k, i] == pytest.approx(max([0.0, *sums.ravel()]), rel=1e-10)


def test_the_signed_sums_see_a_lean_that_the_sizes_hide(white):
    """A bias of half a deviation in place of noise: nis is small, yet the lean adds up by 0.5 − k an epoch."""
    lean = np.zeros((80, 2, 3))
    lean[:, 0, 2] = 0.5
    lean[:, 1, 2] = 0.5 * np.array([1, -1] * 40)
    np.testing.assert_allclose(white.run(Cusum(threshold=1.0), lean)[-1], [0.0, 0.0])
    np.testing.assert_allclose(white.run(SignedCusum(threshold=1.0), lean)[-1], [20.0, 0.25])


def test_a_velocity_is_left_out_by_the_signed_sums(white):
    whitened = np.random.default_rng(4).standard_normal((30, 3, 6))
    np.testing.assert_array_equal(
        white.run(SignedCusum(threshold=1.0), whitened), white.run(SignedCusum(threshold=1.0), whitened[:, :, :3])
    )


@pytest.mark.parametrize("detector", [Cusum, SignedCusum])
def test_runs_are_independent(white, detector):
    whitened = np.random.default_rng(5).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: detector(threshold=1.0), whitened)


def test_names_defaults_and_memory():
    for text in ("cusum", "cusum:k=2,arl0=1000", "signed-cusum", "signed-cusum:k=0.5,threshold=9"):
        assert make_detector(text).name == text
    for text, k in (("cusum", 1.5), ("signed-cusum", 0.25)):
        detector = make_detector(text)
        assert (detector.k, detector.target_arl0, detector.threshold) == (k, 1e5, None)
    # a slower drift forgets later: three times 2 variance / drift²
    assert [make_detector(f"signed-cusum:{k}").memory for k in (0.5, 0.25, 0.1)] == [60, 96, 600]
    assert [make_detector(f"cusum:{k}").memory for k in (1.5, 1.25)] == [60, 64]


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("cusum:1", "k must be a finite number greater than 1, got 1"),
        ("signed-cusum:0", "k must be a finite number greater than 0, got 0"),
        ("cusum:threshold=3,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
