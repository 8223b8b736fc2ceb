"""The bank of windows beside windows that are filters of their own, and its origin, which moves on."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import SeparationBank
from spoofgym.detectors.separation_bank import DIRECTIONS
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.separation import coasting
from spoofgym.navigation.separation.coasting import coasting_tables
from spoofgym.navigation.tight.states import CLOCK, DRIFT, slot_states
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.detectors.test_separation_bank import FLIGHT, OWN, SHARED, ready, simulate


class Naive:
    """Every window a filter of its own, with all states, that is carried on without ranges."""

    def __init__(self, navigator, detector):
        self.navigator, self.detector, self.windows, self.known = navigator, detector, [], []
        self.dynamics = navigator.model.dynamics
        self.axes = [6 + axis for axis in DIRECTIONS[detector.direction]]

    def open(self, k, covariance):
        runs, n = self.navigator.state.shape
        self.windows = [(np.zeros((runs, n)), covariance.copy()), *self.windows[: self.detector.n - 1]]
        self.known = [np.full(runs, k - 1), *self.known[: self.detector.n - 1]]

    def take_back(self, k, depth):
        """Epochs k - 1 - depth..k - 2 are given back: no window may know one of them."""
        for run in np.flatnonzero(depth):
            first = k - 1 - depth[run]
            clean = [place for place, known in enumerate(self.known) if known[run] < first]
            source = clean[0] if clean else 0
            for place, known in enumerate(self.known):
                if first <= known[run] < k - 1:
                    known[run] = self.known[source][run]
                    for part in (0, 1):
                        self.windows[place][part][run] = self.windows[source][part][run]

    def predict(self, k):
        d = self.dynamics
        transition = np.diag(d.decay)
        transition[:9, :15] = d.transition[k]
        transition[CLOCK, DRIFT] = d.interval
        noise = np.diag(d.variance)
        noise[:9, :9] = d.process_noise[k]
        noise[CLOCK : DRIFT + 1, CLOCK : DRIFT + 1] += d.clock_noise
        renewed = slot_states(d.num_slots)[d.started[k]].ravel()
        for place, (separation, covariance) in enumerate(self.windows):
            separation, covariance = separation @ transition.T, transition @ covariance @ transition.T + noise
            separation[:, renewed] = 0.0
            covariance[:, renewed], covariance[:, :, renewed] = 0.0, 0.0
            self.windows[place] = separation, covariance

    def move(self, moved):
        self.windows = [(separation + moved, covariance) for separation, covariance in self.windows]

    def expect(self, whitened, used):
        """What the bank should say of the present epoch, as if the ranges were used: pairs of value and rounding, (N,).

        σ_ss² is the difference of two variances. Each has been carried over up to n epochs by two products of sums of
        as many terms as there are states, and every term rounds by ε, so that of the difference at most
        δ = 2 n states ε P_coast is rounding. Where a window has seen ranges, δ is far below σ_ss². A window that has
        seen none has σ_ss = 0; one unit in the last place of P_coast = 45 m² then makes 8e-8 m of it, on one processor
        and not on another, and δ allows √δ. Its |d| / σ_ss is a rounding error over √δ: within √ε, times a few.
        """
        gain = self.navigator._filters.gain * used[:, None, None]
        corrected = np.einsum("rmn,rm->rn", gain, whitened)
        after = self.navigator.covariance - np.einsum("rmi,rmj->rij", gain, gain)
        rounding = 2.0 * self.detector.n * after.shape[1] * np.finfo(float).eps
        statistic, levels, sigmas, seen = [], [], [], np.zeros(len(used), dtype=bool)
        for separation, covariance in self.windows:
            d = (separation - corrected)[:, self.axes]
            coasting = np.array([covariance[:, a, a] for a in self.axes]).T
            variance = coasting - np.array([after[:, a, a] for a in self.axes]).T
            delta = rounding * coasting
            known = variance > delta
            seen |= known.any(axis=1)
            ratio = np.where(known, np.abs(d) / np.sqrt(np.where(known, variance, 1.0)), 0.0)
            statistic.append(ratio.max(axis=1) / self.detector.multiplier)
            levels.append([self._level(variance + shift, coasting) for shift in (-delta, 0.0, delta)])
            sigmas.append(np.linalg.norm(np.sqrt(coasting), axis=1))
        low, level, high = np.max(levels, axis=0)
        return (
            (np.max(statistic, axis=0), np.where(seen, 0.0, 1e-6)),
            (level, high - low),
            (np.max(sigmas, axis=0), np.zeros(len(used))),
        )

    def _level(self, variance, coasting):
        threshold = self.detector.multiplier * np.sqrt(np.maximum(variance, 0.0))
        return np.linalg.norm(threshold + stats.norm.isf(self.detector.p_md) * np.sqrt(coasting), axis=1)


def follow(detector, scenario, decide, first=0, runs=3, last=None):
    """The bank beside the naive windows, which are opened from epoch ``first`` - 1 on; what both say from there on."""
    simulation, epoch = simulate(runs, OWN, scenario)
    navigator = simulation.navigator
    naive, said = Naive(navigator, ready(detector, runs, scenario)), []
    # no window from before the naive ones
    covariance = np.broadcast_to(navigator.model.prior_covariance, navigator.covariance.shape)
    for k in range(scenario.timeline.num_epochs + 1 if last is None else last):
        decision, given = decide(k, runs)
        if k == first:
            detector.reset(np.arange(runs))
        if k >= first:
            naive.open(k, covariance)
            naive.take_back(k, navigator.backtracked)
            naive.predict(k)
        innovation = epoch.innovation
        innovation.whitened[~given] = 0.0
        statistic = detector.update(dataclasses.replace(epoch, available=given))
        if k >= first:
            levels = detector.protection_level.copy(), detector.coasting_sigma.copy()
            said.append(((statistic, *levels), naive.expect(innovation.whitened, given)))
        before = navigator.state.copy()
        simulation.resolve(decision)
        naive.move(navigator.state - before)
        covariance = navigator.covariance.copy()
        if k < scenario.timeline.num_epochs:
            epoch = simulation.observe(np.full((runs, 3), 0.02 * k))
    return said


def assert_alike(said, rtol):
    """The bank and the naive windows say the same, to ``rtol`` beyond what rounding takes from the naive ones."""
    for mine, expected in said:
        for one, (other, rounding) in zip(mine, expected, strict=True):
            assert (np.abs(one - other) <= rtol * np.abs(other) + rounding).all(), (one, other, rounding)


def always(k, runs):
    return Decision(np.ones(runs, dtype=bool)), np.ones(runs, dtype=bool)


def sometimes(k, runs):
    """Outages, exclusions, single satellites left out, and ranges taken back, each run at its own epochs."""
    generator = np.random.default_rng(k)
    given = generator.random(runs) < 0.9
    backtrack = np.where(generator.random(runs) < 0.1, generator.integers(1, 11, runs), 0)
    satellites = generator.random((runs, FLIGHT.slots)) < 0.8
    return Decision((generator.random(runs) < 0.7) & given, backtrack=backtrack, satellites=satellites), given


@pytest.mark.parametrize("direction", ["up", "horizontal"])
@pytest.mark.parametrize("decide", [always, sometimes])
def test_every_window_is_a_filter_that_coasts(decide, direction):
    assert_alike(follow(SeparationBank(9, direction), FLIGHT, decide), rtol=1e-9)


def test_twenty_minutes_after_their_common_origin():
    flight = make_scenario("kujur-flight:onset=60,horizon=2400")
    assert_alike(follow(SeparationBank(9), flight, always, first=2385, runs=1), rtol=1e-7)


@pytest.mark.parametrize("decide", [always, sometimes])
def test_the_common_origin_moves_on_unseen(decide, monkeypatch):
    """Every five seconds, three times within the game, with windows that are open across."""
    monkeypatch.setattr(coasting, "ORIGIN_LIFE", 5.0)
    tables = coasting_tables(FLIGHT.tight_model(), (2,), 9)
    assert (tables.origin_rows, len(tables.moved)) == (10, 5)
    assert_alike(follow(SeparationBank(9, "horizontal"), FLIGHT, decide), rtol=1e-9)


@pytest.mark.parametrize("direction", ["up", "horizontal"])
def test_moved_origins_leave_the_tables_as_they_are(direction, monkeypatch):
    plain = coasting_tables(FLIGHT.tight_model(), DIRECTIONS[direction], 15)
    monkeypatch.setattr(coasting, "ORIGIN_LIFE", 1.0)
    moved = coasting_tables(FLIGHT.tight_model(), DIRECTIONS[direction], 15)
    assert len(moved.moved) > len(plain.moved) == 1
    np.testing.assert_allclose(moved.variance, plain.variance, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(moved.filtered, plain.filtered)


def test_twenty_minutes_with_a_poor_imu_cost_no_digits():
    """Own covariances against shared gains, over two moves of the origin.

    About one origin rounding would make 4e-6 of the statistic and 6e-8 of the level; moved, 1e-11 and 2e-14.
    """
    flight = make_scenario("kujur-flight:onset=60,horizon=2400,imu=kujur-automotive")
    detectors = [SeparationBank(9), SeparationBank(9)]
    simulations = [
        Simulation(flight, None, [detector], None, 1, 5, demands=demands)
        for detector, demands in zip(detectors, (SHARED, OWN), strict=True)
    ]
    for simulation in simulations:
        simulation.reset()
    for _ in range(2400):
        for simulation in simulations:
            simulation.resolve()
            simulation.observe()
    one, other = (simulation.epoch.statistics[SeparationBank(9).name][0] for simulation in simulations)
    assert one == pytest.approx(other, rel=1e-8)
    assert detectors[0].protection_level[0] == pytest.approx(detectors[1].protection_level[0], rel=1e-10)
