"""A detector that needs what the scenario does not offer is refused wherever it is put into a game."""

import gymnasium
import numpy as np
import pytest

import spoofgym  # noqa: F401
from spoofgym.calibration import calibrated
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.geodesy import displace
from spoofgym.navigation.facts import AIDS, COASTING, INERTIAL_SOLUTION, LINEAR_MODEL, RANGES
from spoofgym.navigation.interface import Demands
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.simulation import Simulation
from spoofgym.trajectory import Straight, Turn, fly

SCENARIO = "liu-flight:horizon=10"
ODOMETER = (
    r"detector 'wheels' needs odometer, which scenario 'liu-flight:horizon=10' does not give; it gives: inertial "
    "solution, linear model"
)


class Wheels(Detector):
    """A user's detector that compares the fix with an odometer."""

    name = "wheels"
    threshold = 1.0
    needs = ("odometer",)

    def update(self, epoch):
        raise AssertionError("it must not come to this")


class ToBeCalibrated(Wheels):
    threshold = None
    target_arl0 = 100.0


@pytest.mark.parametrize(
    "begin",
    [
        lambda: Simulation(make_scenario(SCENARIO), None, [Wheels()]),
        lambda: calibrated(ToBeCalibrated(), make_scenario(SCENARIO)),
        lambda: calibrated(Wheels(), make_scenario(SCENARIO)),
        lambda: gymnasium.make("spoofgym/Spoofer-v0", scenario=SCENARIO, detector=Wheels()),
        lambda: gymnasium.make("spoofgym/Defender-v0", scenario=SCENARIO, detectors=Wheels()),
    ],
    ids=["simulation", "calibration", "threshold by hand", "spoofer", "defender"],
)
def test_a_need_that_no_scenario_meets(begin):
    with pytest.raises(ValueError, match=ODOMETER):
        begin()


def table(header, *columns):
    return header + "\n" + "".join(",".join(f"{x:.12g}" for x in row) + "\n" for row in np.column_stack(columns))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A drive of 60 s with a turn as a recorded game, without noise."""
    folder = tmp_path_factory.mktemp("logs") / "drive"
    folder.mkdir()
    manoeuvres = [Straight(25.0), Turn(1.5, 10.0), Straight(25.0)]
    truth = fly(manoeuvres, position=(0.8, 0.15, 100.0), speed=12.0, heading=0.5, rate=50)
    body = np.hstack([truth.angular_rate, truth.specific_force]) @ np.kron(
        np.eye(2), [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    )
    fixes = np.arange(50, truth.num_steps, 50)
    position = displace(truth.position[fixes], np.zeros((len(fixes), 3)))
    (folder / "log.toml").write_text(
        'name = "made-up"\nimu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nimu_delay_s = 0.0\nstart_s = 5.0\n'
    )
    (folder / "imu.csv").write_text(
        table("t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", truth.time[:-1] + 0.01, body)
    )
    (folder / "gnss.csv").write_text(
        table("t_s,lat_deg,lon_deg,h_m", truth.time[fixes], np.degrees(position[:, :2]), position[:, 2])
    )
    return recorded(str(folder))


@pytest.mark.parametrize("specification", ["ramp-bank:threshold=30", "solution-separation:threshold=30"])
def test_a_log_has_no_linear_model(log, specification):
    message = rf"detector '{specification}' needs linear model, which scenario 'recorded:.*' does not give"
    with pytest.raises(ValueError, match=message):
        Simulation(log, None, [make_detector(specification)], fidelity="strapdown")
    with pytest.raises(ValueError, match=message):
        calibrated(make_detector(specification), log)


@pytest.mark.parametrize(
    "specification",
    [
        "acceleration:n=2,threshold=50",
        "relative-motion:k=4,threshold=50",
        "px4-gate",
        "ardupilot-gate",
        "rio:threshold=50",
    ],
)
def test_a_log_has_an_unaided_solution(log, specification):
    detector = make_detector(specification)
    simulation = Simulation(log, None, [detector], num_runs=2, seed=1, fidelity="strapdown")
    simulation.reset()
    largest = np.zeros(2)
    for _ in range(20):
        simulation.resolve()
        largest = np.maximum(largest, simulation.observe().statistics[detector.name])
    assert np.all(largest > 0.0)
    assert np.all(largest < detector.threshold)


@pytest.mark.parametrize("name", list(DETECTORS))
def test_what_a_detector_asks_of_the_navigator_it_also_asks_of_the_scenario(name):
    detector = make_detector(name)
    if detector.demands == Demands(auxiliary=True):
        assert INERTIAL_SOLUTION in detector.needs
        # a bank on ranges reads the view where there is one, and else the tables of the model
        assert detector.needs_view or RANGES in detector.needs
    assert set(detector.needs) <= {AIDS, COASTING, INERTIAL_SOLUTION, LINEAR_MODEL, RANGES}


def test_an_ensemble_needs_what_its_members_need():
    ensemble = make_detector("ensemble:snapshot+ramp-bank+acceleration,arl0=1000")
    assert ensemble.needs == (LINEAR_MODEL, INERTIAL_SOLUTION)
