import numpy as np
import pytest

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import Rio, make_detector
from spoofgym.navigation.interface import Epoch, Innovation


def epoch_of(residual):
    n, m = residual.shape
    return Epoch(
        np.zeros(n, dtype=np.int64), np.zeros(n), Innovation(residual, np.zeros((n, m, m)), residual, np.zeros(n))
    )


@pytest.mark.parametrize("dimension", [3, 6])
def test_it_is_the_horizontal_distance_of_the_fix_from_the_prediction(dimension):
    residual = np.full((3, dimension), 100.0)
    residual[:, :2] = [[3.0, 4.0], [-6.0, 8.0], [0.0, 0.0]]
    assert Rio(4.3).update(epoch_of(residual)).tolist() == pytest.approx([5.0, 10.0, 0.0])


def test_the_calibrated_threshold_is_a_quantile_of_rayleigh():
    """S with 9 m² east and north: ARL0 = exp(threshold² / 18). 2000 first alarms, 6 deviations (2e-9)."""
    clean = white_statistics(np.diag([3.0, 3.0, 5.0]), 100)
    found = calibrate(Rio(arl0=100.0), clean, 100.0, first_alarms=2000, seed=3)
    assert abs(found.threshold**2 / 18.0 - np.log(100.0)) < 6.0 / np.sqrt(found.first_alarms)


def test_each_epoch_is_judged_by_itself():
    detector = Rio(4.3)
    detector.bind(1, 3)
    far, near = np.array([[5.0, 0.0, 0.0]]), np.array([[0.1, 0.0, 50.0]])
    statistics = [detector.update(epoch_of(residual))[0] for residual in (near, far, near)]
    assert [statistic > detector.threshold for statistic in statistics] == [False, True, False]
    assert detector.memory == 0


def test_it_is_bit_identical_for_any_number_of_runs():
    residual = np.random.default_rng(0).standard_normal((67, 3))
    whole = Rio(4.3).update(epoch_of(residual))
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(Rio(4.3).update(epoch_of(residual[part])), whole[part])


@pytest.mark.parametrize("specification", ["rio", "rio:threshold=4.3", "rio:arl0=1000"])
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, Rio)
    assert make_detector(detector.name).name == detector.name == specification
    assert (detector.threshold is None) == (detector.target_arl0 is not None)
    assert make_detector("rio:4.3").threshold == 4.3


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("rio:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("rio:threshold=4.3,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
