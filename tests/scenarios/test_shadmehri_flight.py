"""The flight of Shadmehri and Mahboobi Esfanjani: what the paper prints, options, and that games run on it."""

import gymnasium
import numpy as np
import pytest

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.navigation.loose.adaptation import Adaptation
from spoofgym.navigation.loose.adaptive import AdaptiveNavigator, AdaptiveStrapdownNavigator
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

ALL = "shadmehri-flight:filter=self-tuning,window=10,guard=all"


def test_it_is_the_flight_of_the_paper():
    """Section 4: 200 m/s east and 50 m/s north, 160 and 10 Hz, 30 s, R, and the sensors' densities per sample."""
    scenario = make_scenario("shadmehri-flight")
    np.testing.assert_allclose(scenario.velocity(), np.tile([200.0, 50.0, 0.0], (299, 1)), atol=1e-9)
    assert scenario.truth.trajectory.rate == 160.0
    assert scenario.timeline.interval == 0.1
    assert scenario.timeline.end == pytest.approx(30.0)
    np.testing.assert_array_equal(scenario.family.tuning.measurement_covariance, np.diag([3.7**2, 3.7**2, 36.0]))
    density = scenario.family.tuning.noise_density(scenario.family.grade)
    gyro, accelerometer = np.deg2rad(0.005) / 60.0, 20e-6 * 9.80665
    expected = np.repeat([gyro, accelerometer, 1.0 / 60.0, 0.0, 0.0], 3) ** 2
    np.testing.assert_allclose(density, expected, rtol=1e-12)
    assert scenario.matched
    assert scenario.family.adaptation is None


def test_the_attack_of_the_paper_spoofs_east_and_north_at_the_rate_each():
    scenario = make_scenario("shadmehri-flight:rate=160")
    simulation = Simulation(scenario, make_attack("ramp:2.8284271247461903,direction=45,onset=20"), (), None, 1, 0)
    simulation.reset()
    assert scenario.timeline.num_epochs == 4798
    while simulation.epoch.time[0] < 25.0 - 1e-6:
        simulation.resolve()
        simulation.observe()
    np.testing.assert_allclose(simulation.offset, [[10.0, 10.0, 0.0]], atol=1e-8)


def test_the_correlated_noise_keeps_999_thousandths_per_tenth_of_a_second():
    """Autocorrelation of 2000 runs at lag 1 and 100; its error is below 2e-4 and 0.01, and ten times is allowed."""
    scenario = make_scenario("shadmehri-flight:noise=markov")
    simulation = Simulation(scenario, None, (), None, 2000, 0)
    simulation.reset()
    noise = simulation._noise
    np.testing.assert_allclose(noise.std(axis=(0, 1)), [1.6, 1.6, 3.0], rtol=0.15)
    for lag, wide in ((1, 2e-3), (100, 0.1)):
        kept = (noise[:, lag:] * noise[:, :-lag]).mean() / np.square(noise).mean()
        assert kept == pytest.approx(0.999**lag, abs=wide)
    assert not scenario.matched


@pytest.mark.parametrize(
    "name",
    [
        "shadmehri-flight",
        "shadmehri-flight:noise=markov,rate=160,speed=50,onset=3",
        "shadmehri-flight:filter=self-tuning",
        "shadmehri-flight:filter=self-tuning,noise=markov,window=100,guard=lagged+non-cumulative",
    ],
)
def test_its_name_builds_it_again(name):
    scenario = make_scenario(name)
    again = make_scenario(scenario.name)
    assert scenario.name == again.name == name
    assert (scenario.timeline, scenario.family.adaptation) == (again.timeline, again.family.adaptation)


@pytest.mark.parametrize("rate", [1, 4, 5, 8, 10, 16, 20, 32, 40, 80, 160])
def test_the_game_begins_with_the_second_fix_and_ends_with_the_flight(rate):
    timeline = make_scenario(f"shadmehri-flight:rate={rate}").timeline
    assert timeline.start == pytest.approx(2.0 / rate)
    assert timeline.end == pytest.approx(30.0)


def test_a_self_tuning_filter_is_built_in_both_fidelities_with_the_common_filter_s_model():
    common, own = make_scenario("shadmehri-flight"), make_scenario(ALL)
    assert own.family.adaptation == Adaptation(10, "all")
    assert not own.matched
    np.testing.assert_array_equal(own.linear_model().whitened_gain, common.linear_model().whitened_gain)
    for fidelity, kind in (("linear", AdaptiveNavigator), ("strapdown", AdaptiveStrapdownNavigator)):
        simulation = Simulation(own, None, [make_detector("snapshot")], None, 2, 0, fidelity=fidelity)
        simulation.reset()
        assert type(simulation.navigator) is kind
        simulation.resolve()
        assert np.isfinite(simulation.observe().innovation.nis).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("filter=kalman", "filter must be one of common, self-tuning"),
        ("noise=pink", "noise must be one of white, markov"),
        ("window=5", "window and guard are of filter 'self-tuning', got filter 'common'"),
        ("filter=self-tuning,guard=some", "guard must be one of none, hold"),
        ("filter=self-tuning,window=0", "window must be a whole number"),
        ("speed=0", "speed must be a finite number greater than 0"),
        ("rate=3", "must divide the IMU's 160 Hz"),
        ("onset=0.1", "onset must be a finite number greater than 0, from 0.2 to 29.9, got 0.1"),
        ("onset=30", "onset must be a finite number greater than 0, from 0.2 to 29.9, got 30.0"),
        ("onset=888", "onset must be a finite number greater than 0, from 0.2 to 29.9, got 888.0"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        make_scenario(f"shadmehri-flight:{options}").family.navigator("strapdown", None, 0, 1, None)


def test_a_threshold_is_calibrated_on_the_self_tuning_filter():
    scenario = make_scenario("shadmehri-flight:filter=self-tuning,rate=5,onset=24,window=5,guard=hold")
    detector = calibrated(make_detector("snapshot:arl0=50"), scenario)
    assert detector.calibrated
    assert detector.arl0 == pytest.approx(50.0, rel=0.05)


@pytest.mark.parametrize("name", ["shadmehri-flight", ALL])
@pytest.mark.parametrize(
    ("env", "arguments"),
    [
        ("spoofgym/Spoofer-v0", {"detector": "snapshot:threshold=25.9"}),
        ("spoofgym/Defender-v0", {"detectors": ("snapshot:threshold=25.9",)}),
    ],
)
def test_both_games_are_played_on_it(name, env, arguments):
    game = gymnasium.make(env, scenario=name, **arguments)
    game.action_space.seed(0)
    observation, _ = game.reset(seed=0)
    for _ in range(60):
        observation, reward, terminated, truncated, _ = game.step(game.action_space.sample())
        assert game.observation_space.contains(observation)
        assert np.isfinite(reward)
        if terminated or truncated:
            game.reset()
