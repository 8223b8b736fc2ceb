from types import SimpleNamespace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import BiasRange, make_detector
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

DEGREE_PER_HOUR = np.pi / 180 / 3600
MICRO_G = 9.80665e-6


def epoch_of(bias):
    n = len(bias)
    blank = Innovation(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n))
    return Epoch(np.zeros(n, dtype=np.int64), np.zeros(n), blank, view=SimpleNamespace(estimated_bias=bias))


def test_the_largest_bias_in_data_sheet_units():
    detector = make_detector("bias-range:factor=4,gyro=0.1,accelerometer=50")
    detector.bind(3, 3)
    detector.know(np.full(6, 1e9))  # what is given stays
    bias = np.zeros((3, 6))
    bias[0, 1] = -0.6 * DEGREE_PER_HOUR
    bias[1, [0, 5]] = [0.1 * DEGREE_PER_HOUR, 150.0 * MICRO_G]
    np.testing.assert_allclose(detector.update(epoch_of(bias)), [1.5, 0.75, 0.0], rtol=1e-12)
    assert detector.threshold == 1.0


def test_the_scenario_tells_the_data_sheet():
    """A drag-off that no filter mistakes for anything but a bias, against the filter's own biases over the IMU's."""
    scenario = make_scenario("liu-flight:horizon=120")
    detector = make_detector("bias-range")
    simulation = Simulation(scenario, make_attack("ramp:2"), [detector, make_detector("snapshot")], None, 5, 1)
    simulation.reset()
    sigma = np.repeat([0.01 * DEGREE_PER_HOUR, 100.0 * MICRO_G], 3)
    statistics = []
    for _ in range(120):
        simulation.resolve()
        bias = simulation.observe().view.estimated_bias
        statistics.append(simulation.epoch.statistics["bias-range"].copy())
        np.testing.assert_allclose(statistics[-1], np.abs(bias / sigma).max(axis=1) / 5.0, rtol=1e-12)
    assert np.median(statistics[5]) < 1.0 < np.median(statistics[-1])


def test_epochs_without_a_filter_have_no_bias():
    detector = BiasRange(3.0, 1.0, 1.0)
    epoch = epoch_of(np.ones((2, 6)))
    assert detector.update(Epoch(epoch.index, epoch.time, epoch.innovation)).tolist() == [0.0, 0.0]


def test_a_data_sheet_is_needed():
    detector = make_detector("bias-range:3")
    with pytest.raises(RuntimeError, match="does not know the data-sheet biases yet"):
        detector.update(epoch_of(np.ones((2, 6))))
    with pytest.raises(ValueError, match="no data-sheet bias on every axis: give gyro"):
        detector.know(np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0]))


def test_names():
    for text in ("bias-range", "bias-range:factor=3", "bias-range:gyro=0.01,accelerometer=100"):
        assert make_detector(text).name == text


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("bias-range:0", "factor must be a finite number greater than 0, got 0"),
        ("bias-range:gyro=1", "gyro needs accelerometer beside it"),
        ("bias-range:accelerometer=1", "accelerometer needs gyro beside it"),
        ("bias-range:gyro=-1,accelerometer=1", "gyro must be a finite number greater than 0, got -1"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
