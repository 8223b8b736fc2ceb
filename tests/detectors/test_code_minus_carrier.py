"""Codes against carriers: the variance of clean runs in closed form, and which attacks show."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.ranging import KUJUR, LIU, obliquity
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-7
N = 4
RATES = make_scenario("liu-flight:coupling=tight,horizon=30")
CARRIERS = make_scenario("kujur-flight:onset=60,horizon=30")
NAME = make_detector(f"code-minus-carrier:n={N},threshold=1e9").name


def statistics(scenario, attack="none", runs=300, fidelity="linear", epochs=None):
    """Of every epoch from 0 on, (K+1, N), m."""
    simulation = Simulation(scenario, make_attack(attack), [make_detector(NAME)], None, runs, 5, fidelity=fidelity)
    rows = [simulation.reset().statistics[NAME].copy()]
    for _ in range(epochs or scenario.timeline.num_epochs):
        simulation.resolve()
        rows.append(simulation.observe().statistics[NAME].copy())
    return np.array(rows)


def weights():
    """Of the 2 N levels, and of the increments that lead from one to the next."""
    levels = np.concatenate([np.full(N, -1.0 / N), np.full(N, 1.0 / N)])
    return levels, np.cumsum(levels[::-1])[::-1][1:]


def mean_square_is(values, expected, independent):
    """Whether the mean of squares fits, of so many independent normal numbers of one run and epoch."""
    count = values.size * independent
    low, high = stats.chi2.ppf([FALSE_FAILURE, 1.0 - FALSE_FAILURE], count) / count
    assert low < np.mean(values**2) / expected < high


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_white_noise_of_code_and_range_rate(fidelity):
    """D = Σ a c - Δt Σ b (r + r') / 2: both noises are white, and the levels share the rates between them."""
    levels, increments = weights()
    rate = np.zeros(2 * N)
    rate[1:] += 0.5 * increments
    rate[:-1] += 0.5 * increments
    interval = RATES.timeline.interval
    expected = LIU.code_noise**2 * np.sum(levels**2) + (interval * LIU.rate_noise) ** 2 * np.sum(rate**2)
    runs, at = (300, 2 * N + 2) if fidelity == "linear" else (60, 2 * N + 2)
    rows = statistics(RATES, runs=runs, fidelity=fidelity, epochs=at)
    satellites = int((RATES.family.satellites(np.zeros(1, dtype=np.int64), 0) >= 0).sum())
    mean_square_is(rows[at], expected, satellites)


def test_multipath_and_the_ionosphere_part_code_and_carrier():
    """Processes of 25 s that are stationary from the first epoch on, and twice a random walk of 40 hours."""
    scenario, interval = CARRIERS, CARRIERS.timeline.interval
    levels, _ = weights()
    lag = np.abs(np.subtract.outer(np.arange(2 * N), np.arange(2 * N))) * interval
    geometry = scenario.family.geometry
    slant = obliquity(geometry.elevation[geometry.satellite >= 0]).max()

    def process(sigma, time):
        return sigma**2 * np.exp(-lag / time)

    noise = (KUJUR.code_noise**2 + KUJUR.carrier_noise**2) * np.eye(2 * N)
    covariance = process(KUJUR.code_multipath_sigma, 25.0) + process(KUJUR.carrier_multipath_sigma, 25.0) + noise
    least = levels @ covariance @ levels
    most = least + levels @ process(2.0 * slant * KUJUR.ionosphere_sigma, 40.0 * 3600.0) @ levels
    assert most / least < 1.01
    rows = statistics(scenario, runs=400, epochs=2 * N + 2)
    satellites = int((scenario.family.satellites(np.zeros(1, dtype=np.int64), 0) >= 0).sum())
    mean_square_is(rows[2 * N + 2], least, satellites)


def test_nothing_counts_before_both_windows_are_full():
    rows = statistics(RATES, runs=3)
    assert not rows[: 2 * N - 1].any()
    assert rows[2 * N :].all()


@pytest.mark.parametrize("scenario", [RATES, CARRIERS], ids=["rate", "carrier"])
def test_codes_that_move_alone_part_and_others_do_not(scenario):
    """A clock that is pulled by v parts by v N Δt; where the carrier follows, at most half a step of the rate is left,
    for the trapezium does not know when within a step a rate began."""
    pull, interval = "liu-spoofer:0,clock_rate=3", scenario.timeline.interval
    clean = statistics(scenario, runs=2)
    follows = statistics(scenario, pull, runs=2)
    alone = statistics(scenario, f"code-only:{pull.replace(',', '/')}", runs=2)
    assert np.abs(follows - clean).max() <= 0.5 * 3.0 * interval + 1e-9
    late = slice(2 * N + 2, None)
    assert np.abs(follows - clean)[late].max() < 1e-6
    parted = 3.0 * N * interval
    assert (np.abs(alone - parted) <= clean.max() + 1e-6)[late].all()


def test_a_shaded_receiver_begins_anew():
    """Satellites that are lost lose their windows: without ranges in between nothing is compared across the gap."""
    detector = make_detector(NAME)
    simulation = Simulation(RATES, None, [detector], None, 2, 5)
    simulation.reset()
    for _ in range(2 * N + 1):
        simulation.resolve()
        simulation.observe()
    epoch = simulation.epoch
    assert detector._age.max() > 2 * N
    epoch.available[:] = False
    assert not detector.update(epoch).any()
    assert not detector._age.any()
