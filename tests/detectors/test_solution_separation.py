import dataclasses

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import SolutionSeparation, make_detector
from spoofgym.detectors.solution_separation import separation_map
from spoofgym.navigation.interface import Decision, Demands, Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-7
SIGMA = (0.2, 0.3, 0.4)
POSITION = slice(6, 8)


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


@pytest.mark.parametrize("scenario", [FLIGHT, DRIVE, with_velocity(DRIVE)], ids=["flight", "turns", "velocity"])
@pytest.mark.parametrize("n", [1, 7, 20])
def test_its_variance_is_that_of_the_unaided_solution_less_that_of_the_filter(scenario, n):
    """P_INS - P_KF by the covariance recursion, from the P that both had n epochs before."""
    model = scenario.linear_model(0)
    gain = separation_map(model, n)
    for k in (n, 30, 40):
        after = model.covariance - model.whitened_gain.transpose(0, 2, 1) @ model.whitened_gain
        unaided = after[k - n]
        for j in range(k - n + 1, k + 1):
            unaided = model.transition[j] @ unaided @ model.transition[j].T + model.process_noise[j]
        variance = np.einsum("nam,nbm->ab", gain[k], gain[k])
        np.testing.assert_allclose(variance, (unaided - after[k])[POSITION, POSITION], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("attack", [None, "ramp:3,direction=70"])
def test_it_is_the_difference_to_a_filter_that_leaves_the_last_fixes_out(attack):
    """Two simulations with the same noise, one of which uses no fix in the last n epochs."""
    n, runs, last = 12, 5, 30
    simulations = [
        Simulation(
            DRIVE,
            None if attack is None else make_attack(attack),
            num_runs=runs,
            seed=2,
            demands=Demands(excludes=True),
        )
        for _ in range(2)
    ]
    whitened = np.empty((last + 1, runs, 3))
    decisions = np.ones(runs, dtype=bool), np.zeros(runs, dtype=bool)
    for k in range(last + 1):
        epochs = [simulation.observe() if k else simulation.reset() for simulation in simulations]
        whitened[k] = epochs[0].innovation.whitened
        for simulation, use in zip(simulations, decisions, strict=True):
            simulation.resolve(Decision(use if k > last - n else decisions[0]))
    separation = (simulations[0].error - simulations[1].error)[:, :2]
    gain = separation_map(DRIVE.linear_model(0), n)[last]
    np.testing.assert_allclose(np.einsum("amj,arj->rm", gain, whitened[: last - n : -1]), separation, atol=1e-7)
    variance = np.einsum("nam,nbm->ab", gain, gain)
    expected = np.einsum("ra,ab,rb->r", separation, np.linalg.inv(variance), separation)
    statistic = run(SolutionSeparation(n, threshold=1.0), whitened, scenario=DRIVE)[-1]
    np.testing.assert_allclose(statistic, expected, rtol=1e-6)


@pytest.mark.parametrize("dimension", [3, 6])
@pytest.mark.parametrize("n", [1, 10])
def test_two_degrees_of_freedom_for_any_window_and_dimension(n, dimension):
    whitened = np.random.default_rng(n).standard_normal((n, 30_000, dimension))
    statistic = run(SolutionSeparation(n, threshold=1.0), whitened, first=5, scenario=SCENARIOS[dimension])[-1]
    assert stats.kstest(statistic, stats.chi2(2).cdf).pvalue > FALSE_FAILURE


def test_the_fixes_since_the_reset_of_each_run():
    generator = np.random.default_rng(4)
    whitened = generator.standard_normal((30, 4, 3))
    whitened[20:24, 1] = 0.0  # no fix
    resets = {0: range(4), 13: [2], 22: [0, 2]}
    n, gain = 6, separation_map(FLIGHT.linear_model(0), 6)
    detector = ready(SolutionSeparation(n, threshold=1.0), 4)
    since = np.zeros(4, dtype=int)
    for k in range(30):
        if k in resets:
            detector.reset(np.array(list(resets[k])))
            since[list(resets[k])] = k
        statistic = detector.update(epoch_of(whitened[k], k - 8))
        b = gain[max(k - 8, 0)]
        weight = np.linalg.inv(np.einsum("nam,nbm->ab", b, b))
        for i in range(4):
            d = sum((b[a] @ whitened[k - a, i] for a in range(n) if k - a >= since[i]), np.zeros(2))
            assert statistic[i] == pytest.approx(d @ weight @ d, rel=1e-9)


def test_the_calibrated_arl0_in_an_independent_simulation():
    """A moving sum with fixed weights, without any of the detector's code."""
    arl0, n, epochs = 100.0, 6, 40
    detector = SolutionSeparation(n)
    found = calibrate(detector, white_statistics(np.eye(3), epochs, FLIGHT.facts), arl0, first_alarms=1500, seed=1)
    b = separation_map(FLIGHT.linear_model(0), n)[20]
    weight = np.linalg.inv(np.einsum("nam,nbm->ab", b, b))
    whitened = np.random.default_rng(5).standard_normal((20_000, 2 * (n - 1) + epochs, 3))
    whitened[:, : n - 1] = 0.0  # before the burn-in
    total = n - 1 + epochs
    d = sum(whitened[:, n - 1 - a : n - 1 - a + total] @ b[a].T for a in range(n))
    statistic = np.einsum("nki,ij,nkj->nk", d, weight, d)
    statistic = statistic[(statistic[:, : n - 1] <= found.threshold).all(axis=1), n - 1 :]
    over = statistic > found.threshold
    alarmed = over.any(axis=1)
    at_risk = np.where(alarmed, over.argmax(axis=1) + 1, epochs).sum()
    # 6 deviations of two independent counts (2e-9), and 3 % for the gains, which are not quite steady
    bound = 6.0 * np.sqrt(1 / alarmed.sum() + 1 / found.first_alarms) + 0.03
    assert abs(np.log(at_risk / alarmed.sum() / arl0)) < bound


def test_a_ramp_that_is_longer_than_the_window_hides_in_its_own_reference():
    """Without noise: a short window has its peak early and then forgets, a long one goes on seeing the ramp."""
    flight = make_scenario("liu-flight:horizon=60,imu=tactical")

    def caused(attack):
        simulation = Simulation(flight, attack, num_runs=1, seed=5)
        whitened = [simulation.reset().innovation.whitened.copy()]
        for _ in range(60):
            simulation.resolve()
            whitened.append(simulation.observe().innovation.whitened.copy())
        return np.array(whitened)

    mean = caused(make_attack("ramp:1")) - caused(None)
    short = run(SolutionSeparation(10, threshold=1.0), mean, scenario=flight)[:, 0]
    long = run(SolutionSeparation(60, threshold=1.0), mean, scenario=flight)[:, 0]
    assert short[-1] < 0.2 * short.max()
    assert short.argmax() < 40
    assert long[-1] > 10.0 * short[-1]


def test_it_is_bit_identical_for_any_number_of_runs():
    whitened = np.random.default_rng(3).standard_normal((40, 67, 6))
    whole = run(SolutionSeparation(13, threshold=1.0), whitened, scenario=SCENARIOS[6])
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(
            run(SolutionSeparation(13, threshold=1.0), whitened[:, part], scenario=SCENARIOS[6]), whole[:, part]
        )


@pytest.mark.parametrize(
    "specification",
    [
        "solution-separation",
        "solution-separation:n=10",
        "solution-separation:threshold=30",
        "solution-separation:n=5,arl0=1000",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, SolutionSeparation)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.memory == detector.n - 1
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("solution-separation:0", "n must be a whole number, 1 or more, got 0"),
        ("solution-separation:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("solution-separation:threshold=9,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
