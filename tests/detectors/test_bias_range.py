from types import SimpleNamespace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated, measure_arl0
from spoofgym.calibration import thresholds as calibration
from spoofgym.detectors import BiasRange, make_detector
from spoofgym.detectors import at_arl0 as with_arl0
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.one_detector import simulated_statistics

DEGREE_PER_HOUR = np.pi / 180 / 3600
MICRO_G = 9.80665e-6


def epoch_of(bias):
    n = len(bias)
    blank = Innovation(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n))
    return Epoch(np.zeros(n, dtype=np.int64), np.zeros(n), blank, view=SimpleNamespace(estimated_bias=bias))


def facts_of(bias_sigma):
    return FilterFacts("made up", 1.0, np.array(bias_sigma), (), lambda burn_in: pytest.fail("needs no model"))


def test_the_largest_bias_in_data_sheet_units():
    detector = make_detector("bias-range:factor=4,gyro=0.1,accelerometer=50")
    detector.bind(3, 3)
    detector.know(facts_of([1e9] * 6))  # what is given stays
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
        detector.know(facts_of([1.0, 1.0, 1.0, 0.0, 1.0, 1.0]))


def test_names():
    texts = ("bias-range", "bias-range:factor=3", "bias-range:gyro=0.01,accelerometer=100", "bias-range:arl0=5000")
    for text in texts:
        assert make_detector(text).name == text
    assert make_detector("bias-range:factor=5").name == "bias-range"
    assert make_detector("bias-range").target_arl0 is None
    # an ARL0 that all are brought to leaves a factor that was given
    assert with_arl0("bias-range", 1000.0) == "bias-range:arl0=1000"
    assert with_arl0("bias-range:factor=3", 1000.0) == "bias-range:factor=3"


def test_the_factor_can_be_calibrated_on_clean_games(monkeypatch, tmp_path):
    """The threshold is a factor, and attains the ARL0 in other clean games of the scenario.

    At least 100 first alarms decide it and about 300 measure; 6 deviations of both counts: 2e-9.
    """
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 1000)
    scenario = make_scenario("liu-flight:horizon=60")
    detector = calibrated(make_detector("bias-range:arl0=300"), scenario)
    other = simulated_statistics(scenario, "linear")
    measured = measure_arl0(BiasRange(detector.threshold), other, 1.0, min_epochs=1e5, seed=9)
    assert abs(np.log(measured.arl0 / 300.0)) < 6.0 * np.sqrt(1 / 100 + 1 / measured.first_alarms)
    assert detector.calibrated


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("bias-range:0", "factor must be a finite number greater than 0, got 0"),
        ("bias-range:arl0=1", "arl0 must be a finite number greater than 1, got 1"),
        ("bias-range:factor=3,arl0=100", "at most one of factor, arl0; got factor and arl0"),
        ("bias-range:gyro=1", "gyro needs accelerometer beside it"),
        ("bias-range:accelerometer=1", "accelerometer needs gyro beside it"),
        ("bias-range:gyro=-1,accelerometer=1", "gyro must be a finite number greater than 0, got -1"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
