"""A push of the clock alone: its course, and what a filter on ranges makes of it."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.timeline import Timeline


def pushed(attack: str, time: np.ndarray) -> np.ndarray:
    made = make_attack(attack)
    made.bind(Timeline.steady(0.0, 1.0, 400), len(time))
    return made.clock_offset(Clock(np.zeros(len(time), dtype=int), time))


def test_the_course_of_texbat() -> None:
    """Second scenario: 0.1 m/s² up to 5 m/s within 50 s, back within the last 50 s, 614 m in 172.8 s."""
    time = np.linspace(0.0, 400.0, 40_001)
    clock = pushed("time-only", time)
    rate = np.gradient(clock, time)
    assert clock[-1] == pytest.approx(614.0)
    assert rate.max() == pytest.approx(5.0)
    assert np.interp(50.0, time, rate) == pytest.approx(5.0, abs=0.01)
    assert np.interp(25.0, time, rate) == pytest.approx(2.5, abs=0.01)
    assert clock[time >= 172.81] == pytest.approx(614.0)
    assert clock[time < 172.79].max() < 614.0
    assert np.abs(np.gradient(rate, time))[5:-5].max() == pytest.approx(0.1, rel=1e-3)


def test_a_small_push_never_reaches_its_rate() -> None:
    """s = a t² / 4 in all where it rises half of the time: 40 m at 0.1 m/s² take 40 s, at most 2 m/s."""
    time = np.linspace(0.0, 60.0, 6001)
    clock = pushed("time-only:-40", time)
    assert clock[-1] == pytest.approx(-40.0)
    assert np.abs(np.gradient(clock, time)).max() == pytest.approx(2.0, abs=0.01)
    assert clock[np.searchsorted(time, 20.0)] == pytest.approx(-20.0, abs=0.01)
    np.testing.assert_array_equal(pushed("time-only:0", time), 0.0)


def test_the_clock_follows_and_the_position_hardly() -> None:
    scenario = make_scenario("kujur-flight:horizon=60,onset=120")
    errors, clocks = [], []
    for attack in ("none", "time-only:300,rate=20,acceleration=2"):
        simulation = Simulation(scenario, make_attack(attack), num_runs=2, seed=3)
        simulation.reset()
        for _ in range(60):
            simulation.resolve()
            simulation.observe()
        simulation.resolve()
        errors.append(simulation.error.copy())
        clocks.append(simulation.navigator.clock_error.copy())
    assert simulation.attacked.all()
    assert not simulation.offset.any()
    assert np.abs(errors[1] - errors[0]).max() < 1.0
    np.testing.assert_allclose(clocks[1] - clocks[0], 300.0, atol=3.0)


def test_it_needs_ranges() -> None:
    with pytest.raises(ValueError, match="time-only"):
        Simulation(make_scenario("foi-drive"), make_attack("time-only"))


def test_bad_numbers() -> None:
    for text, message in (("rate=0", "rate must be"), ("acceleration=-1", "acceleration must")):
        with pytest.raises(ValueError, match=f"time-only: {message}"):
            make_attack(f"time-only:{text}")
