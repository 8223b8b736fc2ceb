"""No NaN leaves a navigator: exact turns of any size, absurd fixes, and filters that diverge."""

import gymnasium as gym
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.attacks import make_attack
from spoofgym.detectors.base import Detector
from spoofgym.navigation.divergence import FilterDivergedError
from spoofgym.navigation.loose.kernels import rotate
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

BREAKING = "kujur-flight:horizon=60,onset=60,imu=industrial"
"""A jump of 100 km makes this filter diverge: code and carrier of the ranges contradict each other."""
GRADES = ("navigation", "tactical", "industrial")
FLIGHTS = (
    *(f"liu-flight:horizon=40,onset=300,imu={grade}" for grade in GRADES),
    *(f"kujur-flight:horizon=40,onset=60,imu={grade}" for grade in GRADES),
    *(f"liu-flight:horizon=40,onset=300,coupling=tight,imu={grade}" for grade in GRADES),
    "foi-drive:horizon=40",
    "shadmehri-flight:filter=self-tuning,window=10,guard=all",
)


@pytest.mark.parametrize("length", [1e-9, 0.1, 1.0, 1.41, 2.0, 3.0, 3.2, 10.0, 1e3])
def test_an_attitude_is_turned_exactly_by_any_rotation_vector(length):
    rng = np.random.default_rng(1)
    axis = rng.standard_normal(3)
    vector = length * axis / np.linalg.norm(axis)
    attitude = Rotation.random(rng=rng).as_matrix()
    expected = Rotation.from_rotvec(vector).as_matrix() @ attitude
    rotate(attitude, *vector)
    # a turn of θ is known to the rounding of θ itself
    np.testing.assert_allclose(attitude, expected, rtol=0, atol=1e-15 * max(length, 4.0))
    np.testing.assert_allclose(attitude @ attitude.T, np.eye(3), rtol=0, atol=1e-15)


def test_an_attitude_stays_orthonormal_through_many_turns():
    rng = np.random.default_rng(2)
    attitude = np.eye(3)
    for vector in rng.standard_normal((20_000, 3)):
        rotate(attitude, *vector)
    np.testing.assert_allclose(attitude @ attitude.T, np.eye(3), rtol=0, atol=1e-15)


class Silent(Detector):
    """Never alarms."""

    name, threshold = "silent", 1.0

    def update(self, epoch):
        return np.zeros(len(epoch.index))


def numbers_of(simulation):
    """All that leaves the navigator in the present epoch."""
    navigator, innovation = simulation.navigator, simulation.epoch.innovation
    return {
        "error": navigator.error,
        "velocity_error": navigator.velocity_error,
        "position_covariance": navigator.position_covariance,
        "estimated_bias": navigator.estimated_bias,
        "residual": innovation.residual,
        "covariance": innovation.covariance,
        "whitened": innovation.whitened,
        "nis": innovation.nis,
        "in_position": innovation.in_position.whitened,
    }


@pytest.mark.parametrize("jump", [200.0, 1e4, 1e5, 1e6])
@pytest.mark.parametrize("flight", FLIGHTS)
def test_absurd_fixes_give_finite_numbers(flight, jump):
    """Fixes 200 m to 1000 km away: each run goes on with finite numbers, or says that it has diverged."""
    scenario, attack = make_scenario(flight), make_attack(f"jump:{jump!r}")
    simulation = Simulation(scenario, attack, num_runs=4, seed=0, fidelity="strapdown", on_divergence="hold")
    simulation.reset()
    for _ in range(40):
        simulation.resolve()
        simulation.observe()
        for name, values in numbers_of(simulation).items():
            assert np.isfinite(values).all(), f"{name} of {flight} with jump:{jump:g}"


def test_a_simulation_that_does_not_hold_a_diverged_run_names_it():
    simulation = Simulation(
        make_scenario(BREAKING), make_attack("jump:100000"), num_runs=3, seed=0, fidelity="strapdown"
    )
    simulation.reset()

    def play():
        for _ in range(60):
            simulation.resolve()
            simulation.observe()

    with pytest.raises(FilterDivergedError, match=r"the filter of run \d diverged at \d+\.\d+ s.*latitude within"):
        play()


def test_a_diverged_run_is_held_until_it_is_reset_and_leaves_the_others_alone():
    attack, scenario = make_attack("jump:100000"), make_scenario(BREAKING)
    simulation = Simulation(scenario, attack, num_runs=3, seed=0, fidelity="strapdown", on_divergence="hold")
    simulation.reset()
    held = {}
    for _ in range(60):
        simulation.resolve()
        simulation.observe()
        for run in np.flatnonzero(simulation.navigator.diverged):
            position = held.setdefault(int(run), simulation.navigator.position[run].copy())
            np.testing.assert_array_equal(simulation.navigator.position[run], position)
    assert set(held) == {0, 1, 2}
    simulation.reset(np.array([1]))
    np.testing.assert_array_equal(simulation.navigator.diverged, [True, False, True])
    assert np.linalg.norm(simulation.error[1]) < 100.0


def test_a_spoofer_that_makes_the_filter_diverge_ends_its_game_and_gains_nothing():
    environment = gym.make(
        "spoofgym/Spoofer-v0",
        scenario=f"{BREAKING},drag_off_rate=100000",
        detector=Silent(),
        fidelity="strapdown",
        knowledge="blind",
    ).unwrapped
    environment.reset(seed=0)
    total, step = 0.0, 0
    while True:
        action = np.array([1.0, -1.0, 1.0, 1.0]) * (-1.0) ** step
        observation, reward, terminated, _, info = environment.step(action.astype(np.float32))
        assert np.isfinite(observation).all()
        assert np.isfinite(reward)
        total, step = total + reward, step + 1
        if terminated:
            break
    assert (info["outcome"], info["is_success"]) == ("diverged", False)
    assert total == pytest.approx(0.0, abs=1e-6)
    assert np.isfinite(info["error"])


def test_a_defender_whose_filter_diverges_pays_for_the_epochs_that_are_left():
    environment = gym.make(
        "spoofgym/Defender-v0",
        scenario=BREAKING,
        attacks="jump:100000",
        detectors="snapshot",
        fidelity="strapdown",
        clean=0.0,
        outage=0.0,
        multipath=0.0,
        error_clip=5.0,
    ).unwrapped
    environment.reset(seed=0)
    rewards, action = [], np.zeros(environment.action_space.shape, dtype=np.int64)
    while True:
        observation, reward, terminated, _, info = environment.step(action)
        assert np.isfinite(observation).all()
        rewards.append(reward)
        if terminated:
            break
    assert info["outcome"] == "diverged"
    left = 60 - info["epoch"]
    assert left > 0
    assert rewards[-1] == -5.0 * (left + 1)
    assert info["mean_error"] > info["error"] * left / 60
