import dataclasses

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import RampBank, make_detector
from spoofgym.detectors.ramp_bank import ramp_signatures
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-7
SIGMA = (0.2, 0.3, 0.4)


def with_velocity(scenario):
    """The scenario with a receiver that gives velocity, too."""
    receiver, tuning = scenario.family.receiver, scenario.family.tuning
    return scenario.changed(
        receiver=dataclasses.replace(receiver, velocity_sigma=SIGMA),
        tuning=dataclasses.replace(tuning, measurement_sigma=(*tuning.measurement_sigma[:3], *SIGMA)),
    )


FLIGHT = make_scenario("liu-flight:horizon=40,imu=tactical")
DRIVE = make_scenario("foi-drive:onset=90,horizon=50")
SCENARIOS = {3: FLIGHT, 6: with_velocity(FLIGHT)}


def epoch_of(whitened, k=0):
    n, m = whitened.shape
    return Epoch(
        np.full(n, k), np.full(n, float(k)), Innovation(np.zeros((n, m)), np.zeros((n, m, m)), whitened, np.zeros(n))
    )


def ready(detector, runs, scenario=FLIGHT):
    detector.bind(runs, scenario.dimension)
    detector.know(scenario.facts)
    return detector


def run(detector, whitened, first=0, scenario=FLIGHT):
    """Statistics (K, N) of whitened innovations (K, N, m)."""
    ready(detector, whitened.shape[1], scenario)
    return np.array([detector.update(epoch_of(values, first + k)) for k, values in enumerate(whitened)])


def innovations(scenario, attack, runs=1, seed=5):
    """Whitened, (K+1, N, m), of the simulated filter."""
    simulation = Simulation(scenario, None if attack is None else make_attack(attack), num_runs=runs, seed=seed)
    whitened = [simulation.reset().innovation.whitened.copy()]
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        whitened.append(simulation.observe().innovation.whitened.copy())
    return np.array(whitened)


@pytest.mark.parametrize("scenario", [FLIGHT, DRIVE, with_velocity(DRIVE)], ids=["flight", "turns", "velocity"])
@pytest.mark.parametrize("began", [0, 13])
def test_the_signature_is_what_a_ramp_does_to_the_innovations_of_the_simulated_filter(scenario, began):
    """Two simulations with the same noise, of which one is spoofed: the filter is linear."""
    attack = f"ramp:3,direction=30,onset={scenario.timeline.start + began:g}"
    caused = (innovations(scenario, attack) - innovations(scenario, None))[:, 0]
    signature, _ = ramp_signatures(scenario.linear_model(0), scenario.timeline.interval, 60)
    rate = 3.0 * np.array([np.sin(np.radians(30.0)), np.cos(np.radians(30.0))])
    for k in range(began + 1, scenario.timeline.num_epochs + 1):
        expected = signature[k, :, :, k - began - 1] @ rate
        np.testing.assert_allclose(caused[k], expected, rtol=1e-7, atol=1e-9)


def brute_force(whitened, signature, first, length):
    """The largest b' A⁻¹ b at the last of the epochs (K, m), of which the first has the index ``first``."""
    last, ratios = first + len(whitened) - 1, []
    for onset in range(last - length + 1, last + 1):
        b, information = np.zeros(2), np.zeros((2, 2))
        for k in range(onset, last + 1):
            g = signature(k, k - onset)
            information += g.T @ g
            if k >= first:
                b += g.T @ whitened[k - first]
        ratios.append(b @ np.linalg.solve(information, b))
    return max(ratios)


def transient(scenario, k, age):
    """Signature of an onset ``age`` epochs before epoch k, by the recursion in its textbook form."""
    model, interval = scenario.linear_model(0), scenario.timeline.interval
    m = model.dimension
    error = np.zeros((15, 2))
    for place in range(k - age, k + 1):
        row = max(place, 0)
        observation = np.hstack([model.observation[row], np.zeros((m, 6))])
        innovation_covariance = observation @ model.covariance[row] @ observation.T + model.measurement_covariance
        gain = model.covariance[row] @ observation.T @ np.linalg.inv(innovation_covariance)
        offset = np.zeros((m, 2))
        offset[:2] = (place - k + age + 1) * interval * np.eye(2)
        if m == 6:
            offset[3:5] = np.eye(2)
        error = model.transition[row] @ error
        mean = observation @ error - offset
        error = error - gain @ mean
    return np.linalg.solve(np.linalg.cholesky(innovation_covariance), mean)


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_largest_ratio_of_the_onsets_since_the_reset_of_each_run(dimension):
    scenario, length = SCENARIOS[dimension], 4
    whitened = np.random.default_rng(4).standard_normal((16, 3, dimension))
    whitened[6:8, 1] = 0.0  # no fix
    resets = {0: range(3), 7: [2], 11: [0, 2]}
    detector = ready(RampBank(length, threshold=1.0), 3, scenario)
    since = np.zeros(3, dtype=int)
    known = {}

    def signature(k, age):
        return known.setdefault((k, age), transient(scenario, k, age))

    for k in range(16):
        index = k - 3  # the first epochs lie before the game
        if k in resets:
            detector.reset(np.array(list(resets[k])))
            since[list(resets[k])] = k
        statistic = detector.update(epoch_of(whitened[k], index))
        expected = [brute_force(whitened[since[i] : k + 1, i], signature, since[i] - 3, length) for i in range(3)]
        np.testing.assert_allclose(statistic, expected, rtol=1e-8)


@pytest.mark.parametrize("dimension", [3, 6])
def test_one_onset_is_chi_square_with_two_degrees_of_freedom(dimension):
    whitened = np.random.default_rng(dimension).standard_normal((1, 40_000, dimension))
    statistic = run(RampBank(1, threshold=1.0), whitened, scenario=SCENARIOS[dimension])[-1]
    assert stats.kstest(statistic, stats.chi2(2).cdf).pvalue > FALSE_FAILURE


def test_many_onsets_lie_between_one_and_the_sum_of_all():
    """P(any of 30) at a threshold, by Bonferroni; binomial bounds that fail falsely once in 1e7."""
    whitened = np.random.default_rng(8).standard_normal((30, 20_000, 3))
    statistic = run(RampBank(30, threshold=1.0), whitened)[-1]
    tail = stats.chi2.sf(12.0, 2)
    alarms = np.count_nonzero(statistic > 12.0)
    assert stats.binom.ppf(FALSE_FAILURE / 2, 20_000, tail) < alarms
    assert alarms < stats.binom.isf(FALSE_FAILURE / 2, 20_000, 30 * tail)


def test_the_calibrated_arl0_in_an_independent_simulation():
    """b of every onset by sums of products, without the detector; its gains stand still, as those of epoch 0."""
    arl0, length, epochs = 100.0, 8, 40
    detector = RampBank(length)
    found = calibrate(detector, white_statistics(np.eye(3), epochs, FLIGHT.facts), arl0, first_alarms=1500, seed=1)
    g = np.stack([transient(FLIGHT, 0, age) for age in range(length)])  # (age, m, 2)
    information = np.cumsum(np.einsum("ami,amj->aij", g, g), axis=0)
    total = length - 1 + epochs
    whitened = np.random.default_rng(77).standard_normal((15_000, length - 1 + total, 3))
    whitened[:, : length - 1] = 0.0  # before the burn-in
    statistic = np.zeros((15_000, total))
    for age in range(length):
        b = np.zeros((15_000, total, 2))
        for a in range(age + 1):
            first = length - 1 - (age - a)
            b += whitened[:, first : first + total] @ g[a]
        statistic = np.maximum(statistic, np.einsum("nki,ij,nkj->nk", b, np.linalg.inv(information[age]), b))
    statistic = statistic[(statistic[:, : length - 1] <= found.threshold).all(axis=1), length - 1 :]
    over = statistic > found.threshold
    alarmed = over.any(axis=1)
    at_risk = np.where(alarmed, over.argmax(axis=1) + 1, epochs).sum()
    # 6 deviations of two independent counts (2e-9), and 3 % for the gains, which are not quite steady
    bound = 6.0 * np.sqrt(1 / alarmed.sum() + 1 / found.first_alarms) + 0.03
    assert abs(np.log(at_risk / alarmed.sum() / arl0)) < bound


def test_the_true_onset_explains_a_ramp_without_noise_completely():
    """By Cauchy-Schwarz no other explains it better: the statistic is then |w|² since the onset."""
    caused = innovations(FLIGHT, "ramp:2,direction=200,onset=815") - innovations(FLIGHT, None)
    statistic = run(RampBank(40, threshold=1.0), caused)[:, 0]
    np.testing.assert_allclose(statistic, np.cumsum((caused[:, 0] ** 2).sum(axis=1)), rtol=1e-6, atol=1e-9)
    assert np.all(statistic[:16] < 1e-9)
    assert statistic[-1] > 100.0


def test_a_slow_ramp_shows_long_before_it_does_in_one_epoch():
    """0.7 m/s at common thresholds of which the bank's is the rarer; 300 runs, 15 deviations apart."""
    whitened = innovations(FLIGHT, "ramp:0.7,direction=60", runs=300, seed=11)
    bank = (run(RampBank(40, threshold=1.0), whitened) > 25.0).any(axis=0)
    snapshot = ((whitened**2).sum(axis=2) > 25.0).any(axis=0)
    assert bank.mean() > snapshot.mean() + 0.4


def test_it_does_not_look_at_a_ramp_of_the_height():
    """Its signatures are horizontal ones; L is not quite diagonal, so that a little is left."""
    upwards = np.zeros((20, 1, 3))
    upwards[:, :, 2] = 2.0
    assert run(RampBank(20, threshold=1.0), upwards).max() < 0.05 * (upwards**2).sum()


def test_it_is_bit_identical_for_any_number_of_runs():
    whitened = np.random.default_rng(3).standard_normal((40, 67, 6))
    whole = run(RampBank(13, threshold=1.0), whitened, scenario=SCENARIOS[6])
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(
            run(RampBank(13, threshold=1.0), whitened[:, part], scenario=SCENARIOS[6]), whole[:, part]
        )


@pytest.mark.parametrize(
    "specification", ["ramp-bank", "ramp-bank:length=10", "ramp-bank:threshold=30", "ramp-bank:length=5,arl0=1000"]
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, RampBank)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.memory == detector.length - 1
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("ramp-bank:0", "length must be a whole number, 1 or more, got 0"),
        ("ramp-bank:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("ramp-bank:threshold=9,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
