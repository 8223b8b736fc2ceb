"""To first order guidance leaves innovations and errors alone: a deviation that is driven, and a strapdown filter."""

import math

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from spoofgym.arrays import Floats
from spoofgym.attacks import make_attack
from spoofgym.geodesy import displace, position_difference
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenario import Scenario
from spoofgym.scenarios.simulated import simulated
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation
from spoofgym.trajectory import Straight, Trajectory, Turn, fly, fly_through

ONSET, EPOCHS, RATE = 40, 60, 50.0
NODES = np.arange(0.0, 110.1, 0.5)
ROAD = [Straight(60.0), Turn(math.radians(60.0), 15.0), Straight(40.0)]


@pytest.fixture(scope="module")
def road() -> Floats:
    """Positions of a drive with a turn, every half second."""
    drive = fly(ROAD, position=(0.8, 0.1, 50.0), speed=20.0, heading=0.5, rate=RATE)
    return drive.position[np.round(NODES * RATE).astype(int)]


def driven(road: Floats, deviation: Floats) -> Trajectory:
    """The motion beside the road by so much at each node, (n, 3), m ENU."""
    return fly_through(NODES, displace(road, deviation), rate=RATE)


def scenario(motion: Trajectory) -> Scenario:
    receiver = Receiver(rate=1.0, white_sigma=(1.0, 1.0, 1.0))
    return simulated("drive", motion, onset=float(ONSET), horizon=EPOCHS, imu="fog", receiver=receiver)


def attitude_error(simulation: Simulation, motion: Trajectory) -> float:
    """Norm of the rotation between the filter's attitude and the true one, rad."""
    true = motion.attitude[round((ONSET + simulation.epoch.index[0]) * RATE)]
    return float(np.linalg.norm(simulation.navigator.attitude[0] - true)) / math.sqrt(2.0)  # type: ignore[attr-defined]


def played(place: Scenario, motion: Trajectory, attack: str) -> tuple[Floats, Floats, float]:
    """Errors and innovations of a game (K, 6), m; the deviation (K+1, 3), m; the largest error of the attitude, rad."""
    simulation = Simulation(place, make_attack(attack), (), None, 1, 3, fidelity="strapdown")
    simulation.reset()
    seen, deviation, tilt = [], [np.zeros(3)], 0.0
    for _ in range(EPOCHS):
        simulation.resolve()
        tilt = max(tilt, attitude_error(simulation, motion))
        epoch = simulation.observe()
        seen.append(np.concatenate([simulation.error[0], epoch.innovation.residual[0]]))
        if simulation.steering is not None:
            deviation.append(simulation.steering.deviation[0])
    return np.array(seen), np.array(deviation), tilt


def drift(place: Scenario) -> float:
    """Largest error without fixes from epoch 0 on, m: what the errors of the inertial unit come to."""
    demands = Demands(excludes=True)
    simulation = Simulation(place, None, (), None, 1, 3, fidelity="strapdown", demands=demands)
    simulation.reset()
    largest = 0.0
    for _ in range(EPOCHS):
        simulation.resolve(Decision(np.zeros(1, dtype=bool)))
        simulation.observe()
        largest = max(largest, float(np.linalg.norm(simulation.error)))
    return largest


@pytest.mark.parametrize(("attack", "swerve"), [("ramp:0.5,direction=120", 15.0), ("ramp:1,direction=120", 30.0)])
def test_the_inertial_unit_measures_the_manoeuvre(road: Floats, attack: str, swerve: float) -> None:
    """The vehicle swerves, and errors and innovations change by what is of second order alone.

    The bound: errors of the inertial unit are turned with the vehicle, which changes what they come to by the change of
    the attitude at most; and an error of the attitude turns the force of the manoeuvre, whose second integral is d.
    """
    on_road = driven(road, np.zeros((len(NODES), 3)))
    place = scenario(on_road)
    kept, _, tilt = played(place, on_road, attack)
    same, deviation, _ = played(place.guided("first-order:2", "lateral"), on_road, attack)
    assert np.array_equal(kept, same)

    times = np.concatenate([np.arange(ONSET), ONSET + np.arange(EPOCHS + 1.0)])
    course = make_interp_spline(times, np.concatenate([np.zeros((ONSET, 3)), deviation]), k=5)
    beside = course(np.minimum(NODES, times[-1]))
    swerving = driven(road, beside)
    end = round((ONSET + EPOCHS) * RATE)
    away = position_difference(swerving.position[:end], on_road.position[:end])
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(np.linalg.norm(deviation, axis=1).max(), rel=0.01)
    turned = np.linalg.norm(swerving.attitude[:end] - on_road.attitude[:end], axis=(1, 2)).max() / math.sqrt(2.0)

    flown, _, flown_tilt = played(scenario(swerving), swerving, attack)
    farthest = float(np.linalg.norm(deviation, axis=1).max())
    bound = max(tilt, flown_tilt) * farthest + turned * drift(place)
    assert farthest > swerve
    assert bound < 0.02 * farthest, "a bound that says something"
    assert np.abs(flown - kept).max() < bound
