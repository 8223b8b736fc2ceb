"""Exponential ramp, circle, FusionRipper and meaconing: their formulas at epochs computed by hand."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.meaconing import path
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline
from spoofgym.travel import lateral

TIMELINE = Timeline.steady(start=800.0, interval=1.0, num_epochs=120)
NORTH = np.broadcast_to([0.0, 10.0, 0.0], (121, 3))
TIMES = np.arange(121.0)
LATE = [
    "exponential:0.5,onset=850",
    "circle:20,onset=850",
    "fusion-ripper:2,onset=850",
    "meaconing:0.5,onset=850",
]


def bound(specification, velocity=NORTH, timeline=TIMELINE, num_runs=1):
    attack = make_attack(specification)
    attack.bind(timeline, num_runs)
    attack.follow(velocity)
    return attack


def offsets_of(attack, timeline=TIMELINE):
    """Offsets of the whole game of one run, (K + 1, 3)."""
    clocks = [Clock(np.array([k]), np.array([time])) for k, time in enumerate(timeline.times)]
    return np.array([attack.offset(clock)[0] for clock in clocks])


def test_exponential_ramp_is_the_integral_of_a_growing_rate():
    east = offsets_of(bound("exponential:0.5"))[:, 0]
    assert east[0] == 0.0
    np.testing.assert_allclose(east[[1, 30, 60]], [0.5 * 30 * (np.e ** (t / 30) - 1) for t in (1, 30, 60)])
    fine = np.linspace(0.0, 120.0, 120_001)
    rate = 0.5 * np.exp(fine / 30)
    np.testing.assert_allclose(east[120], np.sum(0.5 * (rate[1:] + rate[:-1])) * 1e-3, rtol=1e-8)


def test_exponential_ramp_begins_as_a_ramp():
    slow, ramp = (
        offsets_of(bound("exponential:0.5,time=1e6,direction=135")),
        offsets_of(bound("ramp:0.5,direction=135")),
    )
    np.testing.assert_allclose(slow, ramp, rtol=1e-4, atol=1e-12)


def test_circle_leaves_along_the_tangent_and_comes_back():
    offsets = offsets_of(bound("circle:20"))
    np.testing.assert_allclose(offsets[0], 0.0, atol=1e-13)
    np.testing.assert_allclose(offsets[15], [20.0, 20.0, 0.0], atol=1e-12)  # the centre lies east, north first
    np.testing.assert_allclose(offsets[30], [40.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(offsets[45], [20.0, -20.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(offsets[60], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.hypot(offsets[:, 0] - 20.0, offsets[:, 1]), 20.0)
    assert np.hypot(*offsets[1, :2]) == pytest.approx(2 * 20 * np.sin(np.pi / 60))


def test_circle_turns_with_its_direction_and_period():
    offsets = offsets_of(bound("circle:20,period=40,direction=0"))
    np.testing.assert_allclose(offsets[10], [-20.0, 20.0, 0.0], atol=1e-12)  # the centre lies north, west first
    np.testing.assert_allclose(offsets[20], [0.0, 40.0, 0.0], atol=1e-12)


def test_fusion_ripper_waits_at_d_then_grows_by_f_per_second():
    offsets = offsets_of(bound("fusion-ripper:2,f=1.5,wait=3"))
    np.testing.assert_allclose(offsets[:7, 0], [0.0, 2.0, 2.0, 2.0, 3.0, 4.5, 6.75])
    np.testing.assert_array_equal(offsets[:, 1:], 0.0)  # the vehicle goes north: east is its right
    np.testing.assert_allclose(offsets_of(bound("fusion-ripper:2,f=1.5,wait=3,side=left")), -offsets)


def test_fusion_ripper_stays_at_its_limit():
    east = offsets_of(bound("fusion-ripper:2,f=2,wait=0,limit=100"))[:, 0]
    np.testing.assert_allclose(east[1:8], [4.0, 8.0, 16.0, 32.0, 64.0, 100.0, 100.0])
    assert offsets_of(bound("fusion-ripper:2,f=1e300"))[:, 0].max() == pytest.approx(1000.0)


def test_fusion_ripper_counts_seconds_not_fixes():
    fast = Timeline.steady(800.0, 0.1, 1200)
    fine = offsets_of(bound("fusion-ripper:2", np.broadcast_to([0.0, 10.0, 0.0], (1201, 3)), fast), fast)
    np.testing.assert_allclose(fine[::10], offsets_of(bound("fusion-ripper:2")))


def test_fusion_ripper_turns_with_the_vehicle():
    angle = np.radians(np.linspace(0.0, 180.0, 121))
    velocity = np.stack([10.0 * np.sin(angle), 10.0 * np.cos(angle), np.ones(121)], axis=1)
    offsets = offsets_of(bound("fusion-ripper:2,wait=200", velocity))
    np.testing.assert_allclose(offsets[60], [0.0, -2.0, 0.0], atol=1e-12)  # east by then: south is its right
    np.testing.assert_allclose(np.sum(offsets * velocity, axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(offsets[1:], axis=1), 2.0)


def test_a_vehicle_that_stands_keeps_its_direction_of_travel():
    east, north, still = [5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.01, 0.0, 0.0]
    velocity = np.array([still, still, north, still, east, still])
    sides = lateral(velocity, "right")
    np.testing.assert_allclose(sides[:4], np.tile([1.0, 0.0, 0.0], (4, 1)))
    np.testing.assert_allclose(sides[4:], np.tile([0.0, -1.0, 0.0], (2, 1)))
    with pytest.raises(ValueError, match=r"never moves faster than 0.1 m/s"):
        lateral(np.array([still, still]), "left")


def test_meaconing_shows_an_even_motion_by_its_distance():
    velocity = np.broadcast_to([3.0, -4.0, 0.5], (121, 3))
    offsets = offsets_of(bound("meaconing:2.5", velocity))
    np.testing.assert_array_equal(offsets[0], 0.0)
    np.testing.assert_allclose(offsets[1:], np.tile([-7.5, 10.0, -1.25], (120, 1)))  # before the game it came so, too


def test_meaconing_follows_the_track_back():
    """An even acceleration, whose track is a parabola; before the game the vehicle came at the speed of epoch 0."""
    velocity = np.stack([2.0 + 0.3 * TIMES, np.zeros(121), 0.1 * TIMES], axis=1)

    def east(t):
        return 2.0 * t + 0.15 * max(t, 0.0) ** 2

    offsets = offsets_of(bound("meaconing:2.4", velocity))
    for k in (1, 2, 3, 50, 120):
        np.testing.assert_allclose(offsets[k, 0], east(k - 2.4) - east(k))
        np.testing.assert_allclose(offsets[k, 2], 0.05 * (max(k - 2.4, 0.0) ** 2 - k**2))


def test_meaconing_is_the_track_itself_at_whole_delays():
    scenario = make_scenario("foi-drive")
    attack = bound("meaconing:20", scenario.velocity(), scenario.timeline)
    offsets, track = offsets_of(attack, scenario.timeline), scenario.track()
    # velocities of 1 Hz cut the corners of turns, by less than half a metre
    np.testing.assert_allclose(offsets[20:, :2], track[:-20, :2] - track[20:, :2], atol=0.5)
    assert np.abs(offsets[20:, :2]).max() > 100.0


def test_the_path_hits_its_epochs_at_any_interval():
    timeline = Timeline.steady(3.0, 0.1, 50)
    velocity = np.random.default_rng(0).normal(size=(51, 3))
    positions = path(velocity, timeline, timeline.times)
    expected = np.cumsum(0.05 * (velocity[1:] + velocity[:-1]), axis=0)
    np.testing.assert_allclose(positions[0], 0.0, atol=1e-13)
    np.testing.assert_allclose(positions[1:], expected, atol=1e-12)


def test_meaconing_can_begin_without_a_jump():
    velocity = np.broadcast_to([0.0, 10.0, 0.0], (121, 3))
    north = offsets_of(bound("meaconing:2,ramp_up=40,onset=810", velocity))[:, 1]
    np.testing.assert_array_equal(north[:11], 0.0)
    np.testing.assert_allclose(north[11:51], -20.0 * np.arange(1, 41) / 40)
    np.testing.assert_allclose(north[50:], -20.0)


@pytest.mark.parametrize("specification", LATE)
def test_nothing_is_sent_before_the_onset(specification):
    attack = bound(specification)
    offsets = offsets_of(attack)
    np.testing.assert_array_equal(offsets[:51], 0.0)
    assert np.all(np.any(offsets[51:70] != 0.0, axis=1))
    clocks = [Clock(np.array([k]), np.array([800.0 + k])) for k in (50, 51)]
    assert [attack.active(clock).tolist() for clock in clocks] == [[False], [True]]
    early = offsets_of(bound(specification.replace(",onset=850", "")))
    np.testing.assert_allclose(offsets[51:], early[1:71], atol=1e-9)


@pytest.mark.parametrize("specification", LATE)
def test_an_episode_is_the_offset_at_each_clock(specification):
    attack = bound(specification, num_runs=3)
    episode = attack.episode(np.array([2, 0]), RunStreams.from_seed(0, 3))
    np.testing.assert_array_equal(episode, np.stack([offsets_of(attack)] * 2))


@pytest.mark.parametrize("onset", [799.0, 920.0])
@pytest.mark.parametrize("specification", LATE)
def test_an_onset_outside_the_game_is_refused(specification, onset):
    with pytest.raises(ValueError, match="lies outside the game, which runs from 800 s to 920 s"):
        bound(specification.replace("850", str(onset)))


@pytest.mark.parametrize(
    "specification",
    [
        *LATE,
        "exponential:0.1,time=20,direction=0,onset=810",
        "circle:50,period=90,direction=-45",
        "fusion-ripper:0.5,f=1.3,wait=20,side=left,limit=50",
        "meaconing:0.1,ramp_up=30",
    ],
)
def test_the_name_builds_the_same_attack(specification):
    assert make_attack(specification).name == specification


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("exponential:-1", "rate must be a finite number, 0 or more, got -1.0"),
        ("exponential:1,time=0", "time must be a finite number greater than 0, got 0.0"),
        ("circle:-1", "radius must be a finite number, 0 or more, got -1.0"),
        ("circle:1,period=-60", "period must be a finite number greater than 0, got -60.0"),
        ("fusion-ripper", "needs 'd'"),
        ("fusion-ripper:1,f=0.9", "f must be 1 or more, got 0.9"),
        ("fusion-ripper:1,wait=-1", "wait must be a finite number, 0 or more, got -1.0"),
        ("fusion-ripper:1,side=up", "side must be one of left, right, got 'up'"),
        ("fusion-ripper:9,limit=5", "limit must be d = 9 m or more, got 5.0"),
        ("meaconing:-1", "delay must be a finite number, 0 or more, got -1.0"),
        ("meaconing:1,ramp_up=nan", "ramp_up must be a finite number, 0 or more, got nan"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)


def test_an_exponential_that_leaves_every_bound_in_the_game_is_refused():
    with pytest.raises(ValueError, match=r"time must be 1.2 s or more in a game that goes on for 120 s, got 1.0"):
        bound("exponential:1,time=1")
