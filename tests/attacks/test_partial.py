"""Signals of a part of the satellites: which are moved, and what refuses or contradicts them."""

import numpy as np
import pytest

from spoofgym.attacks import Partial, make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(start=20.0, interval=0.5, num_epochs=40)
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=20")
SATELLITES = np.array([[4, -1, 17, 2, 9], [-1, -1, 9, 3, 17]])


def captured(specification, satellites=SATELLITES):
    attack = make_attack(specification)
    attack.bind(TIMELINE, len(satellites))
    index = np.full(len(satellites), 3)
    return attack.captured(Clock(index, index * 1.0), satellites)


def test_the_first_slots_that_hold_a_satellite_are_captured():
    assert captured("partial:ramp:1").tolist() == [[True] + [False] * 4, [False, False, True, False, False]]
    both = captured("partial:ramp:1,satellites=3")
    assert both.tolist() == [[True, False, True, True, False], [False, False, True, True, True]]
    np.testing.assert_array_equal(captured("partial:ramp:1,satellites=9"), SATELLITES >= 0)


def test_satellites_are_captured_by_their_number_wherever_they_are():
    np.testing.assert_array_equal(captured("partial:ramp:1,numbers=9+17"), np.isin(SATELLITES, [9, 17]))
    np.testing.assert_array_equal(captured("partial:ramp:1,numbers=4"), SATELLITES == 4)
    assert not captured("partial:ramp:1,numbers=30").any()


def test_other_attacks_capture_all():
    for specification in ("ramp:1", "liu-spoofer:1", "tracking-error:ramp:1"):
        assert captured(specification) is None


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_only_their_ranges_move(fidelity):
    """A spoofed and a clean game on common noise: code and carrier of two satellites differ, by those of the place."""
    residuals = []
    for attack in (make_attack("partial:liu-spoofer:0/jump=20/direction=0/clock_jump=30,satellites=2"), None):
        simulation = Simulation(FLIGHT, attack, num_runs=3, seed=3, fidelity=fidelity)
        simulation.reset()
        simulation.resolve()
        residuals.append(simulation.observe().innovation.residual.copy())
    difference = (residuals[0] - residuals[1]).reshape(3, 2, FLIGHT.slots)
    assert not np.any(difference[:, :, 2:])
    north = FLIGHT.tight_model().dynamics.line_of_sight[1, :2, 1]
    np.testing.assert_allclose(difference[:, :, :2], np.broadcast_to(20.0 * north - 30.0, (3, 2, 2)), atol=1e-3)


def test_all_satellites_are_the_attack_inside():
    errors = []
    for specification in (f"partial:ramp:2,satellites={FLIGHT.slots}", "ramp:2"):
        simulation = Simulation(FLIGHT, make_attack(specification), num_runs=2, seed=3)
        simulation.reset()
        for _ in range(20):
            simulation.resolve()
            simulation.observe()
        errors.append(simulation.error)
    np.testing.assert_array_equal(*errors)


def test_the_filter_follows_a_part_of_the_satellites_less():
    """On common noise; one satellite of eight pulls the position by less than half of what all of them do."""
    ends = []
    for specification in ("none", "partial:ramp:2", "ramp:2"):
        simulation = Simulation(FLIGHT, make_attack(specification), num_runs=2, seed=3)
        simulation.reset()
        for _ in range(20):
            simulation.resolve()
            simulation.observe()
        simulation.resolve()
        ends.append(simulation.error)
    part, whole = ends[1] - ends[0], ends[2] - ends[0]
    assert np.all(whole[:, 0] > 15.0)
    assert np.all(np.linalg.norm(part, axis=1) < 0.5 * np.linalg.norm(whole, axis=1))
    assert np.all(np.linalg.norm(part, axis=1) > 0.01)


@pytest.mark.parametrize("specification", ["partial:ramp:1,numbers=10+99", "tracking-error:partial:ramp:1/numbers=99"])
def test_a_satellite_that_is_not_in_the_game_is_refused(specification):
    attack = make_attack(specification)
    for given in (attack, AttackPool([(attack, 1.0)])):
        with pytest.raises(ValueError, match=r"numbers must be those of satellites in the game, 1\+10\+.*, got 99"):
            Simulation(FLIGHT, given)


def test_it_can_be_a_member_of_a_pool_and_have_a_tracking_error():
    names = ("partial:ramp:2,numbers=10", "tracking-error:partial:ramp:1,sigma=0.5", "ramp:2")
    pool = AttackPool([(make_attack(name), 1.0) for name in names], clean=0.3)
    assert pool.needs_ranges
    simulation = Simulation(FLIGHT, pool, num_runs=60, seed=0)
    simulation.reset()
    satellites = FLIGHT.family.satellites(np.full(60, 5), 0)
    taken = pool.captured(Clock(np.full(60, 5), np.full(60, 62.5)), satellites)
    assert set(pool.member.tolist()) == {-1, 0, 1, 2}
    np.testing.assert_array_equal(taken[pool.member == 0], satellites[pool.member == 0] == 10)
    assert np.all(taken[pool.member == 1].sum(axis=1) == 1)
    assert np.all(taken[(pool.member == 2) | (pool.member == -1)])


@pytest.mark.parametrize(
    "scenario", ["liu-flight:horizon=10", "kujur-flight:coupling=loose,onset=60,horizon=10"]
)
@pytest.mark.parametrize("specification", ["partial:ramp:1", "tracking-error:partial:ramp:1"])
def test_fixes_have_no_parts(scenario, specification):
    with pytest.raises(ValueError, match=rf"attack '{specification}' needs ranges to satellites, which scenario"):
        Simulation(make_scenario(scenario), make_attack(specification))


def test_ranges_have_no_velocity():
    message = "attack 'position-only:ramp:1' needs fixes with velocity .m = 6., scenario '.*' has ranges"
    with pytest.raises(ValueError, match=message):
        Simulation(FLIGHT, make_attack("position-only:ramp:1"))


@pytest.mark.parametrize(
    "specification",
    [
        "partial:ramp:0.5/direction=135",
        "partial:none,satellites=3",
        "partial:liu-spoofer:1,numbers=3",
        "partial:foi-3,numbers=3+17",
    ],
)
def test_the_name_builds_the_same_attack(specification):
    attack = make_attack(specification)
    assert isinstance(attack, Partial)
    assert make_attack(attack.name).name == attack.name == specification


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("partial", "needs 'attack'"),
        ("partial:drift", "unknown attack 'drift'"),
        ("partial:ramp:1,satellites=0", "partial: satellites must be a whole number, 1 or more, got 0"),
        ("partial:ramp:1,satellites=1.5", "satellites must be a whole number, got '1.5'"),
        ("partial:ramp:1,numbers=3+3", r"partial: numbers must be those of satellites, each once.*got '3\+3'"),
        ("partial:ramp:1,numbers=G07", "partial: numbers must be those of satellites, each once.*got 'G07'"),
        ("partial:ramp:1,satellites=2,numbers=3", "at most one of satellites, numbers"),
        ("partial:partial:ramp:1", "partial: attack must not be partial itself"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)
