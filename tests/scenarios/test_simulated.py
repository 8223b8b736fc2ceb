"""A scenario of one's own: on a trajectory, with an IMU and a receiver, played, trained on and found by its name."""

import gymnasium as gym
import numpy as np
import pytest

from spoofgym.calibration import cache, calibrated
from spoofgym.detectors import make_detector
from spoofgym.scenario import Scenario
from spoofgym.scenarios import SCENARIOS, make_scenario
from spoofgym.scenarios.simulated import matched_tuning, simulated
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation
from spoofgym.trajectory import Straight, Turn, fly

OWN = ImuGrade(
    name="own",
    gyro_bias=5.0,
    gyro_random_walk=0.2,
    gyro_instability=0.0,
    accelerometer_bias=1500.0,
    accelerometer_random_walk=150.0,
    accelerometer_instability=0.0,
    correlation_time=300.0,
    source="a data sheet",
)
FIXES = Receiver(rate=2.0, white_sigma=(1.2, 1.2, 2.5), velocity_sigma=(0.1, 0.1, 0.2))


@pytest.fixture(scope="module")
def trajectory():
    manoeuvres = (Straight(30.0), Turn(1.5, 15.0), Straight(45.0))
    return fly(manoeuvres, position=(0.9, 0.2, 120.0), speed=15.0, heading=0.0, rate=50.0)


def own(trajectory, **changes):
    return simulated("own", trajectory, **{"onset": 40.0, "horizon": 60, "imu": OWN, "receiver": FIXES, **changes})


def test_the_filter_is_matched_and_consistent(trajectory):
    """Mean NIS of E epochs and N runs: chi-square with 6 degrees of freedom; the band fails once in a million."""
    scenario = own(trajectory)
    assert scenario.matched
    assert (scenario.dimension, scenario.timeline.interval, scenario.timeline.end) == (6, 0.5, 70.0)
    for fidelity, runs in (("linear", 400), ("strapdown", 400)):
        simulation = Simulation(scenario, num_runs=runs, fidelity=fidelity, seed=3)
        simulation.reset()
        nis = []
        for _ in range(scenario.timeline.num_epochs):
            simulation.resolve()
            nis.append(simulation.observe().innovation.nis.copy())
        spread = 4.9 * np.sqrt(12.0 / np.size(nis))
        assert np.mean(nis) == pytest.approx(6.0, abs=spread), fidelity


def test_slow_noise_is_in_the_filters_variance_and_ends_the_match(trajectory):
    slow = Receiver(white_sigma=(3.0, 3.0, 6.0), markov_sigma=(4.0, 4.0, 8.0), markov_time=60.0)
    assert matched_tuning(slow).measurement_sigma == (5.0, 5.0, 10.0)
    assert not own(trajectory, receiver=slow, horizon=20).matched


def test_every_environment_takes_the_object(trajectory):
    scenario = own(trajectory)
    for name, arguments in (
        ("Spoofer", {"knowledge": "shadow"}),
        ("Defender", {"detectors": "snapshot"}),
        # the usual detectors of a duel would be calibrated
        ("DuelSpoofer", {"defender": "snapshot > exclude", "detectors": "snapshot"}),
        ("DuelDefender", {"detectors": "snapshot"}),
    ):
        environment = gym.make(f"spoofgym/{name}-v0", scenario=scenario, **arguments)
        environment.reset(seed=0)
        *_, info = environment.step(environment.action_space.sample())
        assert np.isfinite(info["error"])


def test_a_registered_scenario_is_found_by_its_name_and_built_anew_when_it_changes(trajectory, monkeypatch):
    def build(horizon: int = 60) -> Scenario:
        return own(trajectory, horizon=horizon)

    monkeypatch.setitem(SCENARIOS, "own", build)
    assert make_scenario("own:horizon=20").timeline.num_epochs == 20
    before = make_scenario("own")
    assert make_scenario("own") is before
    monkeypatch.setitem(SCENARIOS, "own", lambda: own(trajectory, imu="industrial"))
    assert make_scenario("own").family.grade.name == "industrial"


def test_thresholds_of_a_registered_scenario_are_not_kept_for_another_one_of_its_name(trajectory, monkeypatch):
    monkeypatch.setitem(SCENARIOS, "own", lambda: own(trajectory))
    assert not cache.spelled_out_scenario(make_scenario("own"))
    assert cache.identity(make_scenario("own")) == cache.identity(own(trajectory)) != "own"
    detector = make_detector("snapshot:arl0=200")
    quiet = calibrated(detector, make_scenario("own")).threshold
    slow = Receiver(white_sigma=(1.2, 1.2, 2.5), markov_sigma=(4.0, 4.0, 8.0), markov_time=60.0)
    tuning = matched_tuning(Receiver(white_sigma=(1.2, 1.2, 2.5)))
    monkeypatch.setitem(SCENARIOS, "own", lambda: own(trajectory, receiver=slow, tuning=tuning, horizon=20))
    assert calibrated(detector, make_scenario("own")).threshold > 1.3 * quiet


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"imu": "fogg"}, "unknown IMU grade 'fogg'"),
        ({"onset": 80.0}, "valid from 1 to 60 s"),
        ({"horizon": 0}, "horizon"),
        ({"receiver": Receiver(rate=3.0), "onset": 40.0}, "must divide the IMU's 50 Hz"),
        ({"receiver": Receiver(white_sigma=(0.0, 0.0, 0.0))}, "measurement_sigma must be 3 or 6 positive numbers"),
        ({"trajectory": None}, "must be a Trajectory"),
        ({"drag_off_rate": 0.0}, "drag_off_rate"),
    ],
)
def test_what_does_not_fit_is_named(trajectory, changes, words):
    given = {"onset": 40.0, "horizon": 60, "receiver": FIXES, "trajectory": trajectory, **changes}
    with pytest.raises((ValueError, TypeError), match=words):
        simulated("own", given.pop("trajectory"), **given)
