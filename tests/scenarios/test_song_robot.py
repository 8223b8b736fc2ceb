"""Song's robot: its truth, its receiver, its options, and that both environments run on it."""

import gymnasium as gym
import numpy as np
import pytest
import stable_baselines3.common.env_checker
from gymnasium.utils.env_checker import check_env
from scipy.stats import chi2

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SONG = "acna:preset=song,position=auxiliary"
LAP = 2.0 * (13.4 + 6.1) - 8.0 * 0.5 + 2.0 * np.pi * 0.5
"""Of the court with corners of 0.5 m, m."""


def test_the_truth_is_the_papers_court():
    scenario = make_scenario("song-robot")
    timeline = scenario.timeline
    assert (timeline.start, timeline.interval, timeline.num_epochs) == (0.0, 1.0, 300)
    motion = scenario.truth.motion()
    yaw = np.radians(248.0)
    along, across = motion.position @ [np.sin(yaw), np.cos(yaw)], motion.position @ [np.cos(yaw), -np.sin(yaw)]
    assert np.ptp(along) == pytest.approx(13.4, abs=1e-2)
    assert np.ptp(across) == pytest.approx(6.1, abs=1e-2)
    np.testing.assert_allclose(np.hypot(*motion.velocity.T), 0.5)
    assert motion.yaw[10] == pytest.approx(yaw)
    assert motion.yaw[-1] - motion.yaw[10] == pytest.approx(2.0 * np.pi * 150.0 / LAP, abs=0.5 * np.pi)


def test_positions_velocities_and_yaws_belong_together():
    """Trapezoids at 10 Hz: off by up to 0.5 m/s² (0.1 s)² / 8 where a corner begins, right on a straight."""
    motion = make_scenario("song-robot").truth.motion(5)
    step = 0.05 * (motion.velocity[1:] + motion.velocity[:-1])
    np.testing.assert_allclose(motion.displacement, step, atol=6.3e-4)
    assert np.median(np.abs(motion.displacement - step)) < 1e-12
    np.testing.assert_allclose(np.sin(motion.yaw), motion.velocity[:, 0] / 0.5, atol=1e-12)
    assert (np.diff(motion.yaw) >= 0.0).all()
    later = make_scenario("song-robot:horizon=600").truth.motion()
    laps = round(10.0 * LAP / 0.5)
    np.testing.assert_allclose(later.position[laps:], later.position[:-laps], atol=0.03)


def test_epochs_are_those_of_the_motion():
    scenario = make_scenario("song-robot:horizon=20,onset=7")
    whole = make_scenario("song-robot")
    np.testing.assert_allclose(scenario.velocity(3), whole.velocity()[4:28], atol=1e-9)
    np.testing.assert_allclose(scenario.track(), whole.track()[7:28] - whole.track()[7], atol=1e-9)
    np.testing.assert_array_equal(scenario.times(2), np.arange(5.0, 28.0))


def test_standing_still():
    scenario = make_scenario("song-robot:data=static")
    assert not scenario.velocity().any()
    assert not scenario.track().any()
    simulation = Simulation(scenario, None, (), None, 2, 0)
    simulation.reset()
    assert not simulation.navigator.displacement.any()


@pytest.mark.parametrize("noise", ["markov", "white"])
def test_the_receiver_errs_by_059_m(noise):
    """Per axis, over 3000 runs at one epoch; a correct variance leaves the interval in 1e-8 of the cases."""
    runs = 3000
    simulation = Simulation(make_scenario(f"song-robot:horizon=2,noise={noise}"), None, (), None, runs, 0)
    simulation.reset()
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], runs) / runs
    ratio = np.square(simulation._noise[:, 0]).mean(axis=0) / 0.59**2
    assert (ratio > low).all()
    assert (ratio < high).all()
    kept = (simulation._noise[:, 0, :2] * simulation._noise[:, 1, :2]).mean() / 0.59**2
    slow = 0.85**2 / (0.85**2 + 0.15**2) * np.exp(-1.0 / 60.0)
    assert kept == pytest.approx(slow if noise == "markov" else 0.0, abs=0.15)


@pytest.mark.parametrize(
    "name",
    [
        "song-robot",
        "song-robot:data=static",
        "song-robot:noise=white,sigma=0.9,odometer=set-b",
        "song-robot:auxiliary=free",
        "song-robot:auxiliary=credited,credit=3,horizon=200,onset=50",
    ],
)
def test_the_name_builds_it(name):
    scenario = make_scenario(name)
    assert scenario.name == name
    assert not scenario.matched
    assert scenario.facts.fix_sigma == pytest.approx(scenario.family.tuning.fix_sigma)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("song-robot:data=circle", "data must be one of rectangle, static, got 'circle'"),
        ("song-robot:noise=pink", "noise must be one of markov, white, got 'pink'"),
        ("song-robot:odometer=c", "odometer must be one of set-a, set-b, table-1, got 'c'"),
        ("song-robot:auxiliary=loose", "auxiliary must be one of anchored, credited, free, got 'loose'"),
        ("song-robot:credit=3", "credit 3 is of auxiliary 'credited', got auxiliary 'anchored'"),
        ("song-robot:sigma=0", "sigma must be a finite number greater than 0, got 0.0"),
        ("song-robot:horizon=0", "horizon must be a whole number, 1 or more, got 0"),
    ],
)
def test_bad_options_are_refused(name, message):
    with pytest.raises(ValueError, match=message):
        make_scenario(name)


def test_what_it_offers():
    scenario = make_scenario("song-robot")
    with pytest.raises(ValueError, match="needs inertial solution, which scenario 'song-robot' does not give"):
        calibrated(make_detector("relative-motion:threshold=3"), scenario)
    with pytest.raises(ValueError, match="has no fidelity 'strapdown'; valid fidelities: linear"):
        Simulation(scenario, None, (), None, 1, 0, fidelity="strapdown")
    with pytest.raises(ValueError, match="needs odometer, which scenario 'liu-flight' does not give"):
        calibrated(make_detector(SONG), make_scenario("liu-flight"))


@pytest.mark.parametrize(
    "arguments",
    [
        {"knowledge": "blind"},
        {"knowledge": "shadow", "action": "innovation"},
        {"knowledge": "full", "detector": (SONG, "rio:threshold=4.3"), "on_alarm": "respond"},
    ],
    ids=str,
)
def test_spoofer_checkers(arguments):
    arguments = {"scenario": "song-robot:horizon=15", "detector": SONG} | arguments
    env = gym.make("spoofgym/Spoofer-v0", **arguments)
    check_env(env.unwrapped, skip_render_check=True)
    stable_baselines3.common.env_checker.check_env(env.unwrapped)
    env.close()


def test_the_defender_is_told_that_its_default_detectors_do_not_fit():
    with pytest.raises(ValueError, match=r"'relative-motion' needs inertial solution.*; choose others: detectors="):
        gym.make("spoofgym/Defender-v0", scenario="song-robot")


def test_defender_checkers():
    detectors = ("snapshot:threshold=25.9", SONG)
    env = gym.make("spoofgym/Defender-v0", scenario="song-robot:horizon=60", detectors=detectors)
    check_env(env.unwrapped, skip_render_check=True)
    stable_baselines3.common.env_checker.check_env(env.unwrapped)
    assert env.action_space.nvec.tolist() == [2, 6]
    env.close()


@pytest.mark.parametrize(
    ("single", "vector", "arguments", "action"),
    [
        ("Spoofer-v0", SpooferVectorEnv, {"detector": SONG, "on_alarm": "respond"}, [0.3, -0.2, 0.9]),
        ("Defender-v0", DefenderVectorEnv, {"detectors": (SONG,)}, [1, 2]),
    ],
)
def test_lanes_are_the_single_environment(single, vector, arguments, action):
    arguments = {"scenario": "song-robot:horizon=60"} | arguments
    many = vector(num_envs=3, **arguments)
    seen = [many.reset(seed=4)[0]]
    env = gym.make(f"spoofgym/{single}", **arguments)
    alone = [env.reset(seed=6)[0]]
    for _ in range(10):
        seen.append(many.step(np.array([action] * 3, dtype=many.action_space.dtype))[0])
        alone.append(env.step(np.array(action, dtype=env.action_space.dtype))[0])
    np.testing.assert_array_equal(np.array(seen)[:, 2], np.array(alone))


def test_the_height_of_the_action_does_nothing_to_the_error():
    """The robot knows its height; a spoofed height shows in the innovation alone."""
    errors = []
    for up in (0.0, 1.0):
        env = gym.make("spoofgym/Spoofer-v0", scenario="song-robot:horizon=30", detector="rio:threshold=100")
        env.reset(seed=0)
        action = np.array([0.2, 0.0, up], dtype=np.float32)
        errors.append([env.step(action)[4]["error"] for _ in range(30)])
    assert errors[0] == errors[1]
