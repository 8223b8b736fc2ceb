"""A vehicle that is steered by its estimate: its deviation against closed forms and an integrator, and all else."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spoofgym.attacks import make_attack
from spoofgym.calibration.cache import identity
from spoofgym.guidance import FirstOrder, SecondOrder, Steering, make_guidance
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.timeline import Timeline
from tests.golden.parts import ready

UNEVEN = Timeline(np.array([0.0, 1.0, 1.5, 5.0, 6.0]), 1.0)
NORTH = np.broadcast_to([0.0, 10.0, 0.0], (20, 3))
ROUNDING = 1e-12
"""A few dozen operations on numbers of the order of one."""
INTEGRATION = 1e-8
"""Of an integrator that is asked for 1e-10."""


def steer(guidance, timeline, velocity, before, after):
    """The deviation of one vehicle at every epoch from the errors that an epoch leaves and finds, (K+1, 3)."""
    steering = Steering(guidance, timeline, velocity, 1)
    seen = [steering.deviation[0]]
    for k in range(timeline.num_epochs):
        steering.leave(before[k : k + 1])
        steering.arrive(np.array([k + 1]), after[k : k + 1])
        seen.append(steering.deviation[0])
    return np.array(seen), steering


def first_order(time, interval, start, end, deviation):
    """d' = -(d + e) / T for an error that runs along a straight line, solved by hand."""
    decay, rate = math.exp(-interval / time), (end - start) / interval
    return decay * deviation - (1.0 - decay) * start - rate * (interval - time * (1.0 - decay))


def test_first_order_is_the_closed_form() -> None:
    rng = np.random.default_rng(1)
    before, after = rng.normal(size=(2, 4, 3))
    guidance = FirstOrder(2.0, "horizontal", 10.0)
    seen, _ = steer(guidance, UNEVEN, NORTH, before, after)
    expected = np.zeros(2)
    for k, interval in enumerate(np.diff(UNEVEN.times)):
        for axis in range(2):
            expected[axis] = first_order(2.0, interval, before[k, axis], after[k, axis], expected[axis])
        assert seen[k + 1, :2] == pytest.approx(expected, abs=ROUNDING)
    assert not seen[:, 2].any()


@pytest.mark.parametrize("damping", [0.2, 1.0, 3.0])
def test_second_order_is_an_oscillator(damping: float) -> None:
    rng = np.random.default_rng(2)
    before, after = rng.normal(size=(2, 4, 3))
    seen, _ = steer(SecondOrder(1.5, "horizontal", 10.0, damping), UNEVEN, NORTH, before, after)
    state = np.zeros(2)
    for k, interval in enumerate(np.diff(UNEVEN.times)):

        def rate(t, x, k=k, interval=interval):
            error = before[k, 0] + (after[k, 0] - before[k, 0]) * t / interval
            return [x[1], -(x[0] + error) / 1.5**2 - 2.0 * damping * x[1] / 1.5]

        state = solve_ivp(rate, (0.0, interval), state, rtol=1e-10, atol=1e-10).y[:, -1]
        assert seen[k + 1, 0] == pytest.approx(state[0], abs=INTEGRATION)


def test_a_lasting_error_moves_the_vehicle_by_minus_itself() -> None:
    timeline = Timeline.steady(0.0, 1.0, 60)
    error = np.broadcast_to([3.0, -4.0, 9.0], (60, 3))
    for guidance in (FirstOrder(2.0, "horizontal", 8.0), SecondOrder(2.0, "horizontal", 8.0)):
        seen, steering = steer(guidance, timeline, np.broadcast_to(NORTH[0], (61, 3)), error, error)
        assert seen[-1] == pytest.approx([-3.0, 4.0, 0.0], abs=1e-8)  # exp(-60 / 2), with an oscillation's 1 / 2 T
        assert steering.distance == pytest.approx([5.0], abs=1e-8)


def test_a_road_leaves_the_way_along_it_alone() -> None:
    """Only the part of the error across the road counts, and the vehicle lies across the road that it is on."""
    heading = np.linspace(0.0, 0.5 * math.pi, 31)
    velocity = 10.0 * np.stack([np.sin(heading), np.cos(heading), np.zeros(31)], axis=1)
    along, across = velocity / 10.0, np.stack([np.cos(heading), -np.sin(heading), np.zeros(31)], axis=1)
    timeline, guidance = Timeline.steady(0.0, 1.0, 30), FirstOrder(2.0, "lateral", 3.5)
    seen, _ = steer(guidance, timeline, velocity, 7.0 * along[:-1], 7.0 * along[1:])
    assert seen == pytest.approx(0.0, abs=ROUNDING)
    seen, steering = steer(guidance, timeline, velocity, 2.0 * across[:-1], 2.0 * across[1:])
    expected = -2.0 * (1.0 - np.exp(-timeline.times / 2.0))
    assert seen == pytest.approx(expected[:, None] * across, abs=ROUNDING)
    assert steering.largest == pytest.approx([-expected[-1]])
    assert steering.time_outside == pytest.approx([np.count_nonzero(expected < -1.75)])


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_all_else_is_the_same_game(fidelity: str) -> None:
    """Innovations, statistics, decisions and errors do not know how the vehicle is steered, to the last bit."""
    games = []
    for text in ("foi-drive:horizon=24", "foi-drive:horizon=24,guidance=first-order:2"):
        detectors = [ready("snapshot:threshold=25")]
        response = make_response("exclude-and-backtrack:5")
        attack = make_attack("jump:15,onset=28")
        simulation = Simulation(make_scenario(text), attack, detectors, response, 3, 7, fidelity=fidelity)
        simulation.reset()
        seen = []
        for _ in range(24):
            simulation.resolve()
            epoch = simulation.observe()
            seen.append([*simulation.error.ravel(), *epoch.innovation.nis, *simulation.used, *simulation.alarm])
        games.append(np.array(seen))
    assert np.array_equal(*games)


def test_a_game_steers_by_what_its_output_was() -> None:
    """The deviation of every epoch is that of an integrator on the errors of the real-time output."""
    scenario = make_scenario("foi-drive:horizon=20,guidance=first-order:2/axes=horizontal")
    response = make_response("exclude-and-backtrack:5")
    detectors = [ready("snapshot:threshold=25")]
    simulation = Simulation(scenario, make_attack("jump:15,onset=28"), detectors, response, 2, 7)
    simulation.reset()
    expected = np.zeros((2, 2))
    for _ in range(20):
        simulation.resolve()
        left = simulation.error
        simulation.observe()
        for run, axis in np.ndindex(2, 2):
            found = simulation.error[run, axis]
            expected[run, axis] = first_order(2.0, 1.0, left[run, axis], found, expected[run, axis])
        assert simulation.steering is not None
        assert simulation.steering.deviation[:, :2] == pytest.approx(expected, abs=1e-10)
    assert not simulation.used.all()


def test_runs_are_steered_by_themselves() -> None:
    scenario = make_scenario("foi-drive:horizon=12,guidance=second-order:2")
    one, three = (Simulation(scenario, make_attack("ramp:1"), (), None, n, 3) for n in (1, 3))
    for simulation in (one, three):
        simulation.reset()
        for _ in range(12):
            simulation.resolve()
            simulation.observe()
    assert one.steering is not None
    assert three.steering is not None
    assert np.array_equal(one.steering.deviation[0], three.steering.deviation[0])
    three.reset(np.array([0]))
    assert not three.steering.deviation[0].any()
    assert three.steering.largest[0] == 0.0
    assert three.steering.deviation[1].any()


def test_a_name_builds_the_same_guidance() -> None:
    text = "liu-flight:horizon=24,guidance=second-order:3/damping=0.5"
    scenario = make_scenario(text)
    assert scenario.guidance == SecondOrder(3.0, "horizontal", 1112.0, 0.5)
    assert make_scenario(scenario.name).guidance == scenario.guidance
    assert make_scenario("foi-drive:guidance=first-order:2").guidance == FirstOrder(2.0, "lateral", 3.5)
    wide = make_scenario("foi-drive:guidance=first-order:2/corridor=5/axes=horizontal").guidance
    assert wide == FirstOrder(2.0, "horizontal", 5.0)


def test_thresholds_are_those_of_the_vehicle_that_keeps_its_path() -> None:
    assert identity(make_scenario("foi-drive:guidance=first-order:2")) == identity(make_scenario("foi-drive"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("first", "unknown guidance 'first': did you mean 'first-order'"),
        ("first-order", "needs 'time'"),
        ("first-order:0", "time must be"),
        ("first-order:nan", "time must be"),
        ("second-order:1/damping=0", "damping must be"),
        ("first-order:1/axes=up", "axes must be one of lateral, horizontal, got 'up'"),
        ("first-order:1/corridor=-3", "corridor must be"),
        ("first-order:1/damping=1", "has no option 'damping'"),
    ],
)
def test_what_is_not_valid_is_refused_in_a_line(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told) as caught:
        make_guidance(text, "lateral", {"lateral": 3.5, "horizontal": 100.0})
    assert "\n" not in str(caught.value)


def test_a_vehicle_that_stands_has_no_side() -> None:
    with pytest.raises(ValueError, match="no lateral direction; axes=horizontal needs none"):
        Simulation(make_scenario("song-robot:static,guidance=first-order:1"))
    Simulation(make_scenario("song-robot:static,guidance=first-order:1/axes=horizontal"))
