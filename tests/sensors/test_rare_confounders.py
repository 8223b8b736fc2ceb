"""Confounders that come only where they are asked for: a drifting frame, a second jamming, a clock that is set."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from spoofgym.navigation.interface import Demands
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import MILLISECOND, Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

RUNS = 600
CHANCE = 1e-8


def only(**options) -> Disturbances:
    return Disturbances(outage_share=0.0, multipath_share=0.0, **options)


def drawn(given: Disturbances, runs: int = RUNS, epochs: int = 230, interval: float = 1.0) -> Confounders:
    confounders = Confounders(given)
    confounders.bind(Timeline.steady(0.0, interval, epochs), runs)
    confounders.reset(np.arange(runs), RunStreams.from_seed(3, runs))
    return confounders


@pytest.mark.parametrize("kind", ["drift", "jamming", "clock_step"])
def test_they_come_in_their_share_and_never_by_default(kind: str) -> None:
    def happens(confounders: Confounders) -> np.ndarray:
        what = {"drift": confounders.drifting, "jamming": ~confounders.available, "clock_step": confounders.clock}
        return np.asarray(what[kind].any(axis=1))

    assert not happens(drawn(only())).any()
    count = int(happens(drawn(only(**{f"{kind}_share": 0.3}))).sum())
    assert binom.ppf(CHANCE, RUNS, 0.3) < count < binom.isf(CHANCE, RUNS, 0.3)


def test_what_was_there_before_is_as_it_was() -> None:
    """Rare events have a stream of their own: outages and multipath do not change beside them."""
    plain = Disturbances(outage_share=0.5, multipath_share=0.5)
    more = Disturbances(outage_share=0.5, multipath_share=0.5, clock_step_share=1.0, drift_share=0.5)
    one, other = drawn(plain), drawn(more)
    np.testing.assert_array_equal(one.available, other.available)
    np.testing.assert_array_equal(one.noise[~other.drifting], other.noise[~other.drifting])


def test_a_frame_drifts_and_stays() -> None:
    """5 to 6.8 m/s for 34 s: 170 to 231 m in any direction, then nothing moves; the height never does."""
    confounders = drawn(only(drift_share=1.0), epochs=400)
    assert not confounders.noise[~confounders.drifting].any()
    assert not confounders.noise[:, :, 2].any()
    away = np.linalg.norm(confounders.noise, axis=2)
    first = confounders.drifting.argmax(axis=1)
    whole = np.flatnonzero(first + 34 < 401)
    reached = away[whole, first[whole] + 33]
    np.testing.assert_allclose(away[whole, -1], reached)
    assert 170.0 <= reached.min() < 176.0
    assert 225.0 < reached.max() <= 231.2
    np.testing.assert_allclose(away[whole, first[whole]], reached / 34.0)
    angle = np.arctan2(confounders.noise[whole, -1, 0], confounders.noise[whole, -1, 1])
    assert np.abs(np.exp(1j * angle).mean()) < np.sqrt(-np.log(CHANCE) / len(whole))  # Rayleigh's test


def test_a_jammer_comes_twice() -> None:
    confounders = drawn(only(jamming_share=1.0, jamming_duration=(5.0, 20.0), jamming_gap=(3.0, 15.0)), epochs=400)
    assert confounders.available[:, 0].all()
    for available in confounders.available:
        changes = np.flatnonzero(np.diff(available.astype(int)))
        lengths = np.diff(changes)
        if len(changes) == 4:
            assert 5 <= lengths[0] <= 20
            assert 3 <= lengths[1] <= 15
            assert 5 <= lengths[2] <= 20
    twice = sum(len(np.flatnonzero(np.diff(row.astype(int)))) == 4 for row in confounders.available)
    assert twice > 0.8 * RUNS  # the others begin too late for both


def test_a_clock_is_set_by_a_millisecond() -> None:
    clock = drawn(only(clock_step_share=1.0)).clock
    steps = np.diff(clock, axis=1)
    assert (np.count_nonzero(steps, axis=1) == 1).all()
    assert set(np.round(np.unique(steps), 3)) == {-299792.458, 0.0, 299792.458}
    ahead = int((clock[:, -1] > 0.0).sum())
    assert binom.ppf(CHANCE, RUNS, 0.5) < ahead < binom.isf(CHANCE, RUNS, 0.5)


def play(text: str, given: Disturbances, epochs: int) -> tuple[Simulation, np.ndarray]:
    simulation = Simulation(
        make_scenario(text), num_runs=3, seed=4, confounders=Confounders(given), demands=Demands(excludes=True)
    )
    simulation.reset()
    residuals = []
    for _ in range(epochs):
        simulation.resolve()
        residuals.append(simulation.observe().innovation.residual.copy())
    simulation.resolve()
    return simulation, np.array(residuals)


def test_a_filter_on_fixes_follows_the_drift() -> None:
    drifting, _ = play("foi-drive:horizon=60", only(drift_share=1.0), 60)
    plain, _ = play("foi-drive:horizon=60", only(), 60)
    drift, moved = drifting.confounders.noise[:, 60], drifting.error - plain.error
    assert np.linalg.norm(drift, axis=1).max() > 100.0
    assert np.linalg.norm(moved, axis=1).max() > 50.0
    assert not drifting.attacked.any()


def test_a_filter_on_ranges_sees_the_step_of_all_codes_alike() -> None:
    """Code minus prediction moves by minus a millisecond of every satellite, the second observable by nothing."""
    text = "kujur-flight:horizon=20,onset=120"
    stepped, residuals = play(text, only(clock_step_share=1.0), 20)
    _, plain = play(text, only(), 20)
    for run in range(3):
        first = int(np.flatnonzero(stepped.confounders.clock[run])[0])
        moved = (residuals - plain)[first - 1, run]
        slots = len(moved) // 2
        there = np.abs(moved[:slots]) > 1.0
        assert there.sum() >= 4
        np.testing.assert_allclose(np.abs(moved[:slots][there]), MILLISECOND, rtol=1e-9)
        np.testing.assert_allclose(moved[slots:], 0.0, atol=1e-6)
        assert not (residuals - plain)[: first - 1, run].any()


def test_a_filter_on_fixes_does_not_see_the_clock() -> None:
    _, stepped = play("foi-drive:horizon=20", only(clock_step_share=1.0), 20)
    _, plain = play("foi-drive:horizon=20", only(), 20)
    np.testing.assert_array_equal(stepped, plain)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drift_share": 1.5}, "disturbances: drift_share must be"),
        ({"drift_rate": (6.0, 5.0)}, "disturbances: drift_rate must be"),
        ({"jamming_gap": (-1.0, 5.0)}, "disturbances: jamming_gap must be"),
        ({"clock_step_share": -0.1}, "disturbances: clock_step_share must be"),
    ],
)
def test_bad_numbers(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Disturbances(**options)
