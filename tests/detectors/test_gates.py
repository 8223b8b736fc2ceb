import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import ArduPilotGate, Px4Gate, at_arl0, make_detector
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.responses.ardupilot import ArduPilotGlitch
from spoofgym.responses.px4 import Px4Auto

KINDS = {"px4-gate": Px4Gate, "ardupilot-gate": ArduPilotGate}


def epoch_of(residual, covariance):
    n, m = residual.shape
    covariance = np.broadcast_to(covariance, (n, m, m))
    return Epoch(np.zeros(n, dtype=np.int64), np.zeros(n), Innovation(residual, covariance, residual, np.zeros(n)))


def made_up(runs, dimension, seed=0):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((runs, dimension, dimension))
    covariance = root @ root.transpose(0, 2, 1) + np.eye(dimension)
    return 10.0 * rng.standard_normal((runs, dimension)), covariance


@pytest.mark.parametrize("dimension", [3, 6])
@pytest.mark.parametrize("gate", [None, 3.0])
def test_the_ratios_of_the_autopilots_code(dimension, gate):
    residual, covariance = made_up(50, dimension)
    sigma = 5.0 if gate is None else gate
    px4 = Px4Gate(gate).update(epoch_of(residual, covariance))
    ardupilot = ArduPilotGate(gate).update(epoch_of(residual, covariance))
    for i in range(50):
        squares, variances = residual[i] ** 2, np.diag(covariance[i])
        assert px4[i] == pytest.approx(max(squares[a] / (sigma**2 * variances[a]) for a in range(dimension)))
        joint = (squares[0] + squares[1]) / (sigma**2 * (variances[0] + variances[1]))
        assert ardupilot[i] == pytest.approx(joint)


def test_they_alarm_where_the_response_of_the_autopilot_leaves_the_fix_out():
    """As long as the fix holds no velocity and the height is inside its gate."""
    residual, covariance = made_up(400, 3, 1)
    residual[:, 2] *= 0.01
    epoch = epoch_of(residual, covariance)
    px4, ardupilot = Px4Auto(), ArduPilotGlitch()
    outside = ~px4.passes(epoch)
    assert 50 < outside.sum() < 350
    np.testing.assert_array_equal(Px4Gate().update(epoch) > 1.0, outside)
    axes, ratio = ardupilot.ratios(epoch)[0]
    assert (axes.start, axes.stop) == (0, 2)
    np.testing.assert_array_equal(ArduPilotGate().update(epoch), ratio)


def tails(threshold):
    """False-alarm probabilities of one epoch at a threshold on the ratio to 5 sigma, for S = diag(9, 9, 25)."""
    axis = 2.0 * stats.norm.sf(5.0 * np.sqrt(threshold))
    return {"px4-gate": 1.0 - (1.0 - axis) ** 3, "ardupilot-gate": stats.chi2.sf(50.0 * threshold, 2)}


@pytest.mark.parametrize("kind", list(KINDS))
def test_the_calibrated_arl0_is_the_reciprocal_of_the_tail(kind):
    """Epochs are independent: 2000 first alarms, 6 deviations (2e-9)."""
    clean = white_statistics(np.diag([3.0, 3.0, 5.0]), 100)
    found = calibrate(make_detector(f"{kind}:arl0=100"), clean, 100.0, first_alarms=2000, seed=3)
    assert abs(np.log(100.0 * tails(found.threshold)[kind])) < 6.0 / np.sqrt(found.first_alarms)


def test_the_published_gates_hardly_ever_alarm():
    """Two-sided 5 sigma per axis, 5.7e-7, and exp(-25)."""
    assert tails(1.0)["px4-gate"] == pytest.approx(3 * 5.73e-7, rel=2e-3)
    assert tails(1.0)["ardupilot-gate"] == pytest.approx(np.exp(-25.0))


@pytest.mark.parametrize("kind", list(KINDS))
def test_published_gate_or_calibrated_threshold(kind):
    published, wider, asked = make_detector(kind), make_detector(f"{kind}:gate=7"), make_detector(f"{kind}:arl0=1000")
    assert (published.gate, published.threshold, published.target_arl0) == (5.0, 1.0, None)
    assert (wider.gate, wider.threshold, wider.target_arl0) == (7.0, 1.0, None)
    assert (asked.gate, asked.threshold, asked.target_arl0) == (5.0, None, 1000.0)
    assert make_detector(f"{kind}:5").name == kind
    for detector in (published, wider, asked):
        assert type(make_detector(detector.name)) is KINDS[kind]
        assert make_detector(detector.name).name == detector.name
    assert at_arl0(f"{kind}:gate=7", 1e4) == f"{kind}:gate=7"
    assert at_arl0(kind, 1e4) == f"{kind}:arl0=10000"


def test_an_epoch_without_a_fix_is_no_alarm():
    for detector in (Px4Gate(), ArduPilotGate()):
        assert detector.update(epoch_of(np.zeros((2, 3)), 4.0 * np.eye(3))).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("kind", list(KINDS))
def test_it_is_bit_identical_for_any_number_of_runs(kind):
    residual, covariance = made_up(67, 6)
    whole = make_detector(kind).update(epoch_of(residual, covariance))
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(
            make_detector(kind).update(epoch_of(residual[part], covariance[part])), whole[part]
        )


@pytest.mark.parametrize("kind", list(KINDS))
def test_bad_specifications_are_refused(kind):
    for options, message in [
        ("gate=0.5", "gate must be 1 sigma or more, got 0.5"),
        ("gate=nan", "gate must be a finite number, got nan"),
        ("arl0=1", "arl0 must be a finite number greater than 1, got 1"),
        ("gate=5,arl0=100", "at most one of gate, arl0; got gate and arl0"),
    ]:
        with pytest.raises(ValueError, match=message):
            make_detector(f"{kind}:{options}")
