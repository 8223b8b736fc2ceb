"""The FOI drive: its truth, its matched filter, and the nine states of the report against a textbook recursion."""

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.attacks.profiles import Ramp
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.foi_drive import foi_trajectory
from spoofgym.simulation import Simulation
from tests.navigation import test_fidelities as fidelities

FALSE_FAILURE = 2e-8


def test_the_truth_is_the_reports_drive():
    truth = foi_trajectory()
    second = truth.velocity[:: round(truth.rate)]
    speed = np.hypot(second[:, 0], second[:, 1])
    azimuth = np.degrees(np.unwrap(np.arctan2(second[:, 0], second[:, 1])))
    assert (len(second), truth.rate) == (251, 50.0)
    np.testing.assert_allclose(speed[:11], 0.01)
    np.testing.assert_allclose(speed[20:], 20.0)
    np.testing.assert_allclose(azimuth[[20, 110, 120, 165, 175, 250]], [90.0, 90.0, 30.0, 30.0, -30.0, -30.0])
    np.testing.assert_allclose(np.diff(azimuth)[[*range(110), *range(120, 165), *range(175, 250)]], 0.0, atol=1e-9)


def test_the_track_is_the_sum_of_the_velocity():
    """Trapezoids at the IMU rate: to a millimetre on the first straight, to 0.3 m when parallels have shortened."""
    scenario = make_scenario("foi-drive")
    truth = foi_trajectory()
    velocity = truth.velocity[1000:]
    moved = np.vstack([np.zeros(3), np.cumsum(0.01 * (velocity[1:] + velocity[:-1]), axis=0)])
    np.testing.assert_allclose(scenario.track()[:, :2], moved[::50, :2], atol=0.3)
    np.testing.assert_allclose(scenario.track()[:80, :2], moved[::50, :2][:80], atol=0.001)
    np.testing.assert_allclose(scenario.velocity(), velocity[::50])


def test_the_game():
    scenario = make_scenario("foi-drive")
    assert (scenario.timeline.start, scenario.timeline.end, scenario.timeline.num_epochs) == (20.0, 250.0, 230)
    assert scenario.manoeuvres() == (111.0, 166.0)
    assert make_scenario("liu-flight").manoeuvres() == ()
    assert (scenario.depth_table, scenario.history) == ((0, 3, 5, 8, 12, 16, 20, 25, 30, 40, 50), 60)
    assert scenario.defender_scale == 10.0
    assert make_scenario("liu-flight").defender_scale == 50.0
    np.testing.assert_allclose(scenario.bias_sigma[[0, 3]], [np.radians(0.1) / 3600.0, 50e-6 * 9.80665])
    tactical = make_scenario("foi-drive:imu=tactical")
    grade = tactical.family.grade
    np.testing.assert_allclose(tactical.bias_sigma, np.sqrt(grade.bias_sigma**2 + grade.instability_sigma**2))


@pytest.mark.parametrize(
    ("options", "matched"),
    [
        ("", True),
        (":receiver=foi", False),
        (":process_noise=1000", False),
        (":bias_states=false", False),
        (":imu=tactical", False),
        (":horizon=50,onset=100,imu=industrial,receiver=foi,process_noise=0.5,bias_states=false", False),
    ],
)
def test_the_name_builds_the_same_scenario(options, matched):
    scenario = make_scenario("foi-drive" + options)
    assert scenario.name == "foi-drive" + options
    assert scenario.matched == matched
    assert make_scenario("foi-drive:imu=fog,receiver=white,horizon=230").name == "foi-drive"


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("foi-drive:receiver=gps", "receiver must be one of white, foi, got 'gps'"),
        ("foi-drive:process_noise=0", "process_noise must be a finite number greater than 0"),
        ("foi-drive:imu=kvh", "valid grades: navigation, fog, tactical"),
        ("foi-drive:horizon=231", "does not fit the trajectory of 250 s"),
        ("foi-drive:bias_states=no", "bias_states must be true or false"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_scenario(specification)


def play(scenario, num_runs, fidelity, epochs):
    """Innovations of clean epochs, (epochs, N), and final horizontal errors."""
    simulation = Simulation(make_scenario(scenario), num_runs=num_runs, seed=11, fidelity=fidelity)
    simulation.reset()
    nis = [simulation.epoch.innovation.nis]
    for _ in range(epochs):
        simulation.resolve()
        nis.append(simulation.observe().innovation.nis)
    return np.array(nis), simulation


@pytest.mark.parametrize(("fidelity", "runs"), [("linear", 300), ("strapdown", 20)])
def test_clean_innovations_of_the_default_are_white(fidelity, runs):
    """Sum of all nis is chi-square with three degrees each; false-failure probability 2e-8."""
    nis, simulation = play("foi-drive", runs, fidelity, 230)
    degrees = 3 * nis.size
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees)
    assert low < nis.sum() < high
    error, covariance = simulation.error, simulation.navigator.position_covariance
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], 3 * runs)
    assert low < squares.sum() < high


def test_an_over_stated_covariance_makes_innovations_small():
    """R is 9 m² per axis, the change of the error within a second 0.03 m² or less."""
    nis, _ = play("foi-drive:receiver=foi,process_noise=1000,bias_states=false", 50, "linear", 230)
    assert nis.mean() < 0.1


def nine_states(scenario, use):
    """Covariance of the nine navigation states before each fix of the whole drive, by the textbook: (E, 9, 9).

    The drive starts with the first transition; ``use`` says which fixes the filter uses.
    """
    epochs = round(scenario.timeline.end)
    dynamics, tuning = scenario.family.dynamics, scenario.family.tuning
    sigma = np.concatenate([tuning.attitude_sigma, tuning.velocity_sigma, tuning.position_sigma])
    covariance = np.diag((tuning.initial_scale * sigma) ** 2)
    density = np.repeat([scenario.family.grade.noise_density[0], scenario.family.grade.noise_density[3]], 3) ** 2
    assert np.allclose(np.diag(dynamics.process_noise[0])[:6], tuning.process_noise_scale * density, rtol=0.01)
    noise = np.eye(3) * tuning.measurement_sigma[0] ** 2
    priors = []
    for k in range(epochs):
        transition, step = dynamics.transition[k][:9, :9], dynamics.process_noise[k][:9, :9]
        covariance = transition @ covariance @ transition.T + step
        priors.append(covariance)
        if use(k):
            observed = dynamics.observation[k]
            gain = covariance @ observed.T @ np.linalg.inv(observed @ covariance @ observed.T + noise)
            left = np.eye(9) - gain @ observed
            covariance = left @ covariance @ left.T + gain @ noise @ gain.T
    return np.array(priors)


@pytest.mark.parametrize("process_noise", [1, 1000])
@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_without_bias_states_the_filter_has_nine(process_noise, fidelity):
    """Every fix used to epoch 40 (60 s), then none for 30 epochs, then all; position covariance before each fix."""
    scenario = make_scenario(f"foi-drive:receiver=foi,process_noise={process_noise},bias_states=false,horizon=90")
    pause = range(40, 70)
    demands = Demands(excludes=True)
    simulation = Simulation(scenario, num_runs=2, seed=0, fidelity=fidelity, demands=demands)
    simulation.reset()
    seen = [simulation.navigator.position_covariance[0].copy()]
    for k in range(90):
        simulation.resolve(Decision(np.full(2, k not in pause)))
        simulation.observe()
        seen.append(simulation.navigator.position_covariance[0].copy())
    first = round(scenario.timeline.start) - 1
    expected = nine_states(scenario, lambda k: k - first not in pause)[first:, 6:9, 6:9][:91]
    tolerance = 1e-8 if fidelity == "linear" else 0.02  # the strapdown filter linearises along its own estimate
    scale = np.abs(expected).max(axis=(1, 2))[:, None, None]
    assert np.all(np.abs(seen - expected) < tolerance * scale)
    np.testing.assert_allclose(simulation.navigator.estimated_bias, 0.0, atol=1e-9)


def cross(vector):
    return np.cross(vector, np.eye(3), axisb=0, axisc=0)


def nine_states_from_the_motion(scenario, use):
    """As `nine_states`, from the true velocity and position alone, at every IMU step of 20 ms.

    φ' = -ω × φ,  v' = f × φ - 2 ω × v + gravity's gradient,  p' = v; ω is the earth's rate at the start, and the
    earth is flat but for that.
    """
    truth, tuning, step = scenario.truth.trajectory, scenario.family.tuning, 1.0 / scenario.truth.trajectory.rate
    latitude = truth.position[0, 0]
    spin = cross(7.292115e-5 * np.array([0.0, np.cos(latitude), np.sin(latitude)]))
    gyro, accelerometer = np.radians(0.012) / 60.0, 120e-6 * 9.80665
    density = tuning.process_noise_scale * np.repeat([gyro**2, accelerometer**2, 0.0], 3)
    arcsecond = np.radians(1.0 / 3600.0)
    covariance = np.diag(np.square([20 * arcsecond, 20 * arcsecond, 180 * arcsecond, *[0.01] * 3, *[3.0] * 3]))
    rate = np.zeros((9, 9))
    rate[:3, :3], rate[3:6, 3:6], rate[6:, 3:6] = -spin, -2.0 * spin, np.eye(3)
    rate[3:6, 6:] = 9.81 / 6.37e6 * np.diag([-1.0, -1.0, 2.0])
    priors = []
    for i, acceleration in enumerate(np.diff(truth.velocity[: round(250 * truth.rate) + 1], axis=0) / step):
        rate[3:6, :3] = cross(acceleration + np.array([0.0, 0.0, 9.81]))
        transition = np.eye(9) + step * rate + 0.5 * step**2 * rate @ rate
        covariance = transition @ covariance @ transition.T + step * np.diag(density)
        if (i + 1) % round(truth.rate) == 0:
            priors.append(covariance)
            if use(len(priors)):
                # H takes the position and R is 9 m² per axis, so that the fix adds to the information
                information = np.linalg.inv(covariance)
                information[range(6, 9), range(6, 9)] += 1.0 / 9.0
                covariance = np.linalg.inv(information)
    return np.array(priors)


@pytest.mark.parametrize("process_noise", [1, 1000])
def test_the_nine_states_follow_from_the_motion(process_noise):
    """The whole drive with 50 s unaided from 100 s on, through a turn; to half a percent of the largest element.

    With bias states, or with the noise of another grade, the filter would be sure of its position otherwise.
    """
    options = f"receiver=foi,process_noise={process_noise}"
    pause = range(100, 150)

    def played(specification):
        simulation = Simulation(make_scenario(specification), num_runs=1, seed=0, demands=Demands(excludes=True))
        simulation.reset()
        seen = [simulation.navigator.position_covariance[0].copy()]
        for time in range(20, 250):
            simulation.resolve(Decision(np.array([time not in pause])))
            simulation.observe()
            seen.append(simulation.navigator.position_covariance[0].copy())
        return np.array(seen)

    scenario = make_scenario(f"foi-drive:{options},bias_states=false")
    expected = nine_states_from_the_motion(scenario, lambda time: time not in pause)[19:, 6:, 6:]
    scale = np.abs(expected).max(axis=(1, 2))[:, None, None]
    assert np.max(np.abs(played(scenario.name) - expected) / scale) < 0.005
    if process_noise == 1:
        assert np.max(np.abs(played(f"foi-drive:{options}") - expected) / scale) > 0.05
        assert np.max(np.abs(played(scenario.name + ",imu=tactical") - expected) / scale) > 0.05


@pytest.mark.parametrize(
    ("options", "out"),
    [
        ("", range(0)),
        (":receiver=foi,process_noise=1000,bias_states=false", range(0)),
        (":receiver=foi,process_noise=1000,bias_states=false", range(80, 120)),
    ],
)
def test_fidelities_agree_on_common_noise(options, out):
    """Under a ramp of 1 m/s to the east, through both turns, and with 40 fixes left out: 2 cm and 20 cm."""
    error, whitened, nis, _ = fidelities.play(
        make_scenario("foi-drive" + options), Ramp(1.0), excludes=len(out) > 0, out=out
    )
    assert np.abs(error[0, :, :, 0]).max() > 200.0
    difference = fidelities.differences(error).max(axis=(0, 1))
    assert difference[:2].max() <= 0.02
    assert difference[2] <= 0.2
    assert fidelities.differences(whitened).max() < 0.05
    assert (fidelities.differences(nis) / (1.0 + nis[1])).max() < 0.05


def test_without_bias_states_the_truth_still_has_biases():
    """The true errors of 4000 starts: bias errors as the data sheet says, chi-square with 4000 degrees per axis."""
    scenario = make_scenario("foi-drive:bias_states=false")
    with_states = make_scenario("foi-drive")
    factor = scenario.family.warm_start(0).joint_factor
    variance = np.sum(factor[9:15] ** 2, axis=1)
    np.testing.assert_allclose(np.sqrt(variance), scenario.bias_sigma, rtol=1e-9)
    assert np.all(scenario.family.warm_start(0).filter_covariance[9:15] == 0.0)
    assert np.sum(with_states.family.warm_start(0).filter_covariance[9:15, 9:15] ** 2) > 0.0
    nis, _ = play("foi-drive:bias_states=false", 300, "linear", 230)
    assert nis.sum() > chi2.isf(FALSE_FAILURE, 3 * nis.size)


def test_the_flight_with_a_tactical_imu_can_be_defended():
    """250 epochs with a covariance per run and a history of 60; a backtrack of 60 equals never having used them."""
    scenario = make_scenario("liu-flight:horizon=250,imu=tactical")
    runs, demands = 3, Demands(excludes=True, history=60)

    def play_to(epochs, decide):
        simulation = Simulation(scenario, num_runs=runs, seed=2, demands=demands)
        simulation.reset()
        for k in range(epochs):
            simulation.resolve(decide(k))
            simulation.observe()
        return simulation

    use, leave = Decision(np.ones(runs, dtype=bool)), Decision(np.zeros(runs, dtype=bool))
    back = play_to(250, lambda k: use)
    back.resolve(Decision(np.zeros(runs, dtype=bool), backtrack=np.full(runs, 60)))
    coasted = play_to(250, lambda k: use if k < 190 else leave)
    coasted.resolve(leave)
    np.testing.assert_allclose(back.error, coasted.error, rtol=1e-9, atol=1e-9)
    assert np.all(np.isfinite(back.error))
