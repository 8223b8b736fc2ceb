"""The linear fidelity against the strapdown one on common noise.

The strapdown runs' own generators are replayed, their inertial noise is carried through the transitions of the single
IMU samples to the noise w_k of each epoch, and the linear navigator is given normals = noise_factor^-1 w_k, with the
same initial state, bias drift and receiver noise. What differs is then nonlinearity, and nothing random.
"""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from spoofgym.attacks.profiles import Ramp
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import navigation_dynamics, transition_matrix
from spoofgym.navigation.interface import Clock, Decision, Demands
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.sensors.imu import grade
from spoofgym.sensors.receiver import Receiver
from spoofgym.streams import RunStreams

RUNS = 4
SEED = 50


@njit(cache=True)
def carry(attitude, velocity, position, force, errors, step, noise):
    """Error at the end of an epoch from the sample errors (n, 6) of angular rate and specific force; noise (9,)."""
    dynamics, work = np.empty((9, 9)), np.empty((2, 9, 9))
    one, before, middle, turned = np.empty((9, 15)), np.empty(9), np.empty((3, 3)), np.empty(3)
    noise[:] = 0.0
    for i in range(len(errors)):
        for a in range(3):
            turned[a] = 0.0
            for b in range(3):
                middle[a, b] = 0.5 * (attitude[i, a, b] + attitude[i + 1, a, b])
                turned[a] += middle[a, b] * force[i, b]
        navigation_dynamics(velocity[i], position[i], turned, dynamics)
        transition_matrix(dynamics, middle, step, one, work)
        before[:] = noise
        for a in range(9):
            noise[a] = 0.0
            for b in range(9):
                noise[a] += one[a, b] * before[b]
            for b in range(6):
                noise[a] += one[a, 9 + b] * errors[i, b]


def common_noise(scenario, strapdown, linear, initial):
    """Give the linear runs the noise that the strapdown runs of seed SEED are going to draw."""
    trajectory, model, streams = scenario.truth.trajectory, strapdown.model, RunStreams.from_seed(SEED, RUNS)
    samples = model.max_samples
    first = round((scenario.truth.onset - scenario.family.receiver.interval) * trajectory.rate)
    decay = model.instability_decay
    for run in range(RUNS):
        generator = streams(run, "imu").spawn(1)[0]
        drift = initial[run, 15:21].copy()
        for k in range(scenario.truth.horizon + 1):
            normals, more = np.empty((samples, 6)), np.empty(9)
            generator.standard_normal(out=normals)
            generator.standard_normal(out=more)
            part = slice(first + k * samples, first + (k + 1) * samples)
            ends = slice(part.start, part.stop + 1)
            noise = np.empty(9)
            carry(
                trajectory.attitude[ends],
                trajectory.velocity[ends],
                trajectory.position[ends],
                trajectory.specific_force[part],
                normals * model.true_noise[:6] * np.sqrt(trajectory.rate),
                1.0 / trajectory.rate,
                noise,
            )
            noise[6:] += np.sqrt(scenario.family.receiver.interval) * model.true_noise[6:] * more[:3]
            linear.normals[run, k] = solve_triangular(linear.model.noise_factor[k], noise, lower=True)
            if linear.bias_steps.shape[1]:
                moved = decay * drift + np.sqrt(1.0 - decay**2) * model.instability_sigma * more[3:]
                linear.bias_steps[run, k] = moved - drift
                drift = moved


def play(scenario, attack, excludes=False, out=range(0)):
    """Both fidelities through the game; fixes of the epochs ``out`` are left out.

    Returns:
        Position error after each epoch (2, K+1, N, 3), whitened innovations, nis, and the biases estimated at the end.
    """
    slices = RunSlices(1)
    demands = Demands(excludes=excludes)
    pair = [scenario.family.navigator(fidelity, demands, 0, RUNS, slices) for fidelity in ("strapdown", "linear")]
    runs, streams = np.arange(RUNS), RunStreams.from_seed(SEED, RUNS)
    initial = scenario.family.draw_initial(runs, 0, streams)
    noise = scenario.family.draw_receiver_noise(runs, initial, 0, streams)
    attack.bind(scenario.timeline, RUNS)
    for navigator in pair:
        navigator.reset(runs, initial, streams)
    common_noise(scenario, *pair, initial)
    error, whitened, nis = [], [], []
    for k in range(scenario.truth.horizon + 1):
        deviation = noise[:, k].copy()
        offset = attack.offset(Clock(np.full(RUNS, k), np.full(RUNS, scenario.times(0)[k])))
        deviation[:, :3] += offset
        if scenario.dimension == 6 and k > 0:
            deviation[:, 3:] += attack.rate * np.array([1.0, 0.0, 0.0])
        rows = []
        for navigator in pair:
            navigator.propagate()
            rows.append(navigator.innovate(deviation))
            navigator.resolve(Decision(np.full(RUNS, k not in out)))
        error.append([navigator.error for navigator in pair])
        whitened.append([row.whitened for row in rows])
        nis.append([row.nis for row in rows])
    biases = [navigator.estimated_bias for navigator in pair]
    return *(np.array(item).swapaxes(0, 1) for item in (error, whitened, nis)), biases


def differences(pair):
    return np.abs(pair[0] - pair[1])


@pytest.fixture(scope="module")
def ramp():
    scenario = liu_flight(horizon=280)
    return scenario, *play(scenario, Ramp(1.0))


def test_position_agrees_while_the_error_grows_to_300_m(ramp):
    """The bound of the project: 2 cm horizontally and 20 cm vertically."""
    _, error, *_ = ramp
    reached = np.linalg.norm(error[0, :, :, :2], axis=-1).max()
    assert 250.0 < reached < 300.0
    difference = differences(error).max(axis=(0, 1))
    assert difference[:2].max() <= 0.02
    assert difference[2] <= 0.2


def test_innovations_and_statistics_agree(ramp):
    """A centimetre or two over sqrt(S) of 3.8 m, and decimetres over 6 m."""
    _, _, whitened, nis, _ = ramp
    assert differences(whitened).max() < 0.05
    assert (differences(nis) / (1.0 + nis[1])).max() < 0.05
    assert nis.max() > 20.0


def test_estimated_biases_agree(ramp):
    scenario, *_, (strapdown, linear) = ramp
    sigma = np.sqrt(np.diag(scenario.linear_model().covariance[-1]))[9:]
    assert (np.abs(strapdown - linear) / sigma).max() < 0.2


def test_the_noise_is_what_makes_them_agree(ramp):
    """With noise of its own the linear run differs by its sigma, so the agreement above is no matter of course."""
    scenario, error, *_ = ramp
    runs, streams = np.arange(RUNS), RunStreams.from_seed(SEED, RUNS)
    initial = scenario.family.draw_initial(runs, 0, streams)
    noise = scenario.family.draw_receiver_noise(runs, initial, 0, streams)
    own = scenario.family.navigator("linear", Demands(), 0, RUNS, RunSlices(1))
    own.reset(runs, initial, streams)
    for k in range(60):
        own.propagate()
        deviation = noise[:, k].copy()
        deviation[:, 0] += k
        own.innovate(deviation)
        own.resolve(Decision(np.ones(RUNS, dtype=bool)))
    assert np.abs(own.error - error[0, 59])[:, :2].max() > 0.05


def variant(**changes):
    base = liu_flight(horizon=100, onset=640.0)  # through the turn that begins at 680 s
    sigma = changes.pop("sigma", base.family.tuning.measurement_sigma)
    return base.changed(tuning=dataclasses.replace(base.family.tuning, measurement_sigma=sigma), **changes)


VARIANTS = {
    "turn": variant,
    "velocity": lambda: variant(
        receiver=Receiver(velocity_sigma=(0.1, 0.1, 0.2)), sigma=(3.7, 3.7, 6.0, 0.1, 0.1, 0.2)
    ),
    "lever-arm": lambda: variant(receiver=Receiver(lever_arm=(1.0, -8.0, 2.0))),
    "latency": lambda: variant(
        receiver=Receiver(velocity_sigma=(0.1, 0.1, 0.2), latency=0.2), sigma=(3.7, 3.7, 6.0, 0.1, 0.1, 0.2)
    ),
    "five-hertz": lambda: variant(receiver=Receiver(rate=5.0), rate=5.0),
    "unstable-bias": lambda: variant(grade=grade("tactical")),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_variants_agree_under_a_ramp(name):
    """Same bounds as above."""
    scenario = VARIANTS[name]()
    error, whitened, *_ = play(scenario, Ramp(0.5))
    difference = differences(error).max(axis=(0, 1))
    assert difference[:2].max() <= 0.02
    assert difference[2] <= 0.2
    assert differences(whitened).max() < 0.1


def test_coasting_runs_agree():
    """Fixes left out for 40 epochs: unaided errors grow to metres, each run with a covariance of its own."""
    error, _, nis, _ = play(liu_flight(horizon=80), Ramp(0.5), excludes=True, out=range(20, 60))
    difference = differences(error).max(axis=(0, 1))
    assert difference[:2].max() <= 0.02
    assert difference[2] <= 0.2
    assert (differences(nis) / (1.0 + nis[1])).max() < 0.05
