"""Liu's spoofer at the level of measurements: what the ranges become, and what a filter makes of them."""

import numpy as np
import pytest

from spoofgym.attacks import LiuSpoofer, make_attack
from spoofgym.attacks.range_attack import SPEED_OF_LIGHT, control_delay
from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(start=20.0, interval=0.5, num_epochs=120)
CARRIER = make_scenario("kujur-flight:onset=60,horizon=40")
RATE = make_scenario("liu-flight:coupling=tight,onset=200,horizon=40")


def episode(specification):
    """Offset (K+1, 3) and clock (K+1,) of an episode, and the time since the onset."""
    attack = make_attack(specification)
    attack.bind(TIMELINE, 1)
    clocks = [Clock(np.array([k]), np.array([time])) for k, time in enumerate(TIMELINE.times)]
    offset = np.array([attack.offset(clock)[0] for clock in clocks])
    return offset, np.array([attack.clock_offset(clock)[0] for clock in clocks])


def test_position_and_clock_move_as_the_equations_say():
    """s = α t h + b h and c δt' = (1 - advance) (c τ + r) + b_t + α_t t, t since the onset at 40 s."""
    offset, clock = episode(
        "liu-spoofer:0.5,direction=30,jump=4,clock_jump=-7,clock_rate=0.2,processing=2e-6,distance=300,advance=0.25,"
        "onset=40"
    )
    t = np.maximum(TIMELINE.times - 40.0, 0.0)
    after = TIMELINE.times > 40.0
    along = np.where(after, 0.5 * t + 4.0, 0.0)
    np.testing.assert_allclose(offset, along[:, None] * [0.5, np.sqrt(0.75), 0.0], atol=1e-12)
    delay = 299_792_458.0 * 2e-6 + 300.0
    np.testing.assert_allclose(clock, np.where(after, 0.75 * delay - 7.0 + 0.2 * t, 0.0), atol=1e-9)


def test_a_synchronised_spoofer_does_not_move_the_clock():
    offset, clock = episode("liu-spoofer:1")
    assert not np.any(clock)
    np.testing.assert_array_equal(offset, episode_of_ramp())


def episode_of_ramp():
    attack = make_attack("ramp:1")
    attack.bind(TIMELINE, 1)
    return np.array([attack.offset(Clock(np.array([k]), np.array([t])))[0] for k, t in enumerate(TIMELINE.times)])


@pytest.mark.parametrize("advance", [0.0, 0.6])
def test_the_control_delay_makes_the_ranges_of_the_wanted_place(advance):
    """Ranges sent through the spoofer, by exact distances, against those of a receiver at s with its clock at c δt'.

    First order in an offset of 40 m and a spoofer 500 m away, with satellites 2e7 m away: a few centimetres.
    """
    geometry = CARRIER.family.geometry
    place = CARRIER.truth.trajectory.position[[round(CARRIER.truth.onset * CARRIER.truth.trajectory.rate)]]
    epoch = round(CARRIER.truth.onset * CARRIER.truth.rate) - 1
    satellites, sight = geometry.position[epoch], geometry.line_of_sight[epoch]
    offset, spoofer, processing = np.array([30.0, -20.0, 15.0]), np.array([300.0, 380.0, -120.0]), 1e-6

    def distances(displacement):
        return np.linalg.norm(satellites - geodetic_to_ecef(displace(place, displacement[None])), axis=1)

    nothing = np.zeros(3)
    common = SPEED_OF_LIGHT * processing + np.linalg.norm(spoofer)
    clock = (1.0 - advance) * common
    control = control_delay(offset, clock, spoofer, processing, sight)
    # eq 13: authentic range, processing, the way to the receiver, the longer way to the spoofer, and the control
    sent = distances(nothing) + common + (distances(spoofer) - distances(nothing)) + control
    np.testing.assert_allclose(sent, distances(offset) + clock, atol=0.05)
    # the bits must be predicted where nothing else hides the way
    assert np.all(control < 0.0) == (advance > 0.5)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_the_ranges_are_those_of_the_spoofed_place_and_clock(fidelity):
    """Innovations of a spoofed and a clean game on common noise differ by G (s, c δt') at the first epoch."""
    attack = make_attack("liu-spoofer:0,jump=25,direction=70,clock_jump=90")
    differences = []
    for spoofed in (attack, None):
        simulation = Simulation(CARRIER, spoofed, num_runs=2, seed=3, fidelity=fidelity)
        simulation.reset()
        simulation.resolve()
        differences.append(simulation.observe().innovation.residual.copy())
    direction = CARRIER.tight_model().dynamics.line_of_sight[1]
    angle = np.radians(70.0)
    moved = -direction @ (25.0 * np.array([np.sin(angle), np.cos(angle), 0.0])) + 90.0
    # predicted minus measured; a square of 25 m over twice the distance is below 0.1 mm
    expected = -np.tile(moved, 2)
    np.testing.assert_allclose(differences[0] - differences[1], np.tile(expected, (2, 1)), atol=1e-3)


def moved(scenario, specification, seed=0):
    """What an attack changes of the final error of position, (2, 3), and clock, (2,), on common noise."""
    ends = []
    for attack in (make_attack(specification), None):
        simulation = Simulation(scenario, attack, num_runs=2, seed=seed)
        simulation.reset()
        for _ in range(scenario.timeline.num_epochs):
            simulation.resolve()
            simulation.observe()
        simulation.resolve()
        ends.append((simulation.error, simulation.navigator.clock_error))
    return ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]


@pytest.mark.parametrize("scenario", [CARRIER, RATE], ids=["carrier", "rate"])
def test_an_unsynchronised_delay_is_seen_on_the_clock_alone(scenario):
    """500 m and a microsecond: the clock of the filter moves by 800 m, its position by a thousandth of that."""
    position, clock = moved(scenario, "liu-spoofer:0,advance=0")
    delay = SPEED_OF_LIGHT * 1e-6 + 500.0
    np.testing.assert_allclose(clock, delay, rtol=0.01)
    assert np.abs(position).max() < 1e-3 * delay


@pytest.mark.parametrize("scenario", [CARRIER, RATE], ids=["carrier", "rate"])
def test_position_and_time_are_pulled_apart(scenario):
    """Superposition in the linear fidelity: a drag-off and a clock rate together do what each does alone."""
    both = moved(scenario, "liu-spoofer:2,direction=0,clock_rate=1.5")
    place, time = moved(scenario, "liu-spoofer:2,direction=0"), moved(scenario, "liu-spoofer:0,clock_rate=1.5")
    for together, one, other in zip(both, place, time, strict=True):
        np.testing.assert_allclose(together, one + other, atol=1e-6)
    seconds = scenario.timeline.num_epochs * scenario.timeline.interval
    assert np.all(place[0][:, 1] > 0.5 * 2.0 * seconds)
    np.testing.assert_allclose(time[1], 1.5 * seconds, rtol=0.05)
    assert np.abs(time[0]).max() < 0.02 * 1.5 * seconds


def test_a_filter_of_fixes_does_not_see_the_clock():
    scenario = make_scenario("liu-flight:horizon=10")
    errors = []
    for specification in ("liu-spoofer:1,advance=0,clock_rate=50", "ramp:1"):
        simulation = Simulation(scenario, make_attack(specification), num_runs=2, seed=1)
        simulation.reset()
        for _ in range(10):
            simulation.resolve()
            simulation.observe()
        errors.append(simulation.error)
    np.testing.assert_array_equal(*errors)


@pytest.mark.parametrize(
    "specification",
    [
        "liu-spoofer:0.5",
        "liu-spoofer:1,direction=45,jump=3,clock_jump=-2,clock_rate=0.1,processing=2e-06,distance=100,advance=0,"
        "onset=40",
    ],
)
def test_the_name_builds_the_same_attack(specification):
    attack = make_attack(specification)
    assert isinstance(attack, LiuSpoofer)
    assert make_attack(attack.name).name == attack.name == specification
    np.testing.assert_array_equal(*(np.column_stack(episode(name)) for name in (attack.name, specification)))


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("liu-spoofer", "needs 'rate'"),
        ("liu-spoofer:-1", "liu-spoofer: rate must be a finite number, 0 or more, got -1"),
        ("liu-spoofer:1,jump=-1", "liu-spoofer: jump must be a finite number, 0 or more, got -1"),
        ("liu-spoofer:1,advance=1.5", "liu-spoofer: advance must be a share from 0 to 1, got 1.5"),
        ("liu-spoofer:1,distance=-5", "liu-spoofer: distance must be a finite number, 0 or more, got -5"),
        ("liu-spoofer:1,processing=nan", "liu-spoofer: processing must be a finite number, 0 or more, got nan"),
        ("liu-spoofer:1,clock_rate=inf", "liu-spoofer: clock_rate must be a finite number, got inf"),
        ("liu-spoofer:1,bias=3", "no option 'bias'; valid options: rate, direction, jump"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)
