"""An attack that leaves the position of the fix true: what the receiver shows, and who refuses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SIGMA = (0.1, 0.1, 0.2)
INSIDE = "ramp:0.5/direction=135"


@pytest.fixture(scope="module")
def flight() -> Scenario:
    """The Liu flight with a receiver that gives velocity, too."""
    plain = make_scenario("liu-flight:horizon=30")
    receiver, tuning = plain.family.receiver, plain.family.tuning
    return plain.changed(
        name="with velocity",
        receiver=replace(receiver, velocity_sigma=SIGMA),
        tuning=replace(tuning, measurement_sigma=(*tuning.measurement_sigma, *SIGMA)),
    )


def play(scenario: Scenario, attack, epochs: int = 25) -> np.ndarray:
    """Innovations (epochs, N, 6) of epochs 1, 2, ..."""
    simulation = Simulation(scenario, make_attack(attack), num_runs=3, seed=5)
    simulation.reset()
    residuals = []
    for _ in range(epochs):
        simulation.resolve()
        residuals.append(simulation.observe().innovation.residual.copy())
    return np.array(residuals)


def test_the_first_spoofed_innovation_has_the_rate_and_no_offset(flight: Scenario) -> None:
    """z = v_INS - v_GNSS, so that a rate enters with a minus."""
    rate = 0.5 * np.array([np.sin(np.radians(135.0)), np.cos(np.radians(135.0)), 0.0])
    moved = play(flight, f"velocity-only:{INSIDE}", 1)[0] - play(flight, "none", 1)[0]
    np.testing.assert_allclose(moved, np.tile([0.0, 0.0, 0.0, *-rate], (3, 1)), atol=1e-9)


@pytest.mark.parametrize("inside", [INSIDE, "circle:30", "jump"])
def test_position_alone_and_velocity_alone_add_up_to_the_consistent_attack(flight: Scenario, inside: str) -> None:
    """The filter is linear: what the two halves of an attack do to the innovations is what the whole does."""
    clean = play(flight, "none")
    parts = sum(play(flight, f"{kind}-only:{inside}") - clean for kind in ("position", "velocity"))
    whole = play(flight, inside.replace("/", ",")) - clean
    assert np.abs(whole).max() > 1.0
    np.testing.assert_allclose(parts, whole, atol=1e-8)


def test_it_counts_as_an_attack_though_the_position_is_true(flight: Scenario) -> None:
    simulation = Simulation(flight, make_attack("velocity-only:ramp:0.5/onset=802"), num_runs=2, seed=1)
    simulation.reset()
    assert not simulation.attacked.any()
    attacked = []
    for _ in range(4):
        simulation.resolve()
        attacked.append((float(simulation.observe().time[0]), bool(simulation.attacked[0])))
        assert not simulation.offset.any()
    onset = 802.0
    assert all(seen == (time > onset) for time, seen in attacked)
    simulation.reset()
    assert not simulation.attacked.any()


def test_in_a_pool_it_knows_when_it_attacks(flight: Scenario) -> None:
    pool = AttackPool([(make_attack("velocity-only:ramp:1"), 1.0), (make_attack("ramp:1"), 1.0)], clean=0.2)
    simulation = Simulation(flight, pool, num_runs=40, seed=2)
    simulation.reset()
    assert set(pool.member.tolist()) == {-1, 0, 1}
    for member, first in ((0, 1), (1, 1), (-1, 31)):
        assert (pool.first[pool.member == member] == first).all()
    simulation.resolve()
    simulation.observe()
    np.testing.assert_array_equal(simulation.attacked, pool.member >= 0)
    np.testing.assert_array_equal(simulation.offset.any(axis=1), pool.member == 1)


@pytest.mark.parametrize("inside", ["velocity-only:ramp:1", "position-only:ramp:1", "time-only"])
def test_what_does_not_move_position_and_velocity_is_refused(inside: str) -> None:
    with pytest.raises(ValueError, match="velocity-only: attack must be one whose offsets are known in advance"):
        make_attack(f"velocity-only:{inside}")


def test_it_needs_a_receiver_that_gives_velocity() -> None:
    with pytest.raises(ValueError, match="needs fixes with velocity"):
        Simulation(make_scenario("liu-flight:horizon=30"), make_attack(f"velocity-only:{INSIDE}"))
