"""A spoofer's tracking error: when it acts, what it leaves alone, and its spelling."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.attacks.tracking_error import TrackingError
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(start=20.0, interval=1.0, num_epochs=120)
NORTH = np.broadcast_to([0.0, 10.0, 0.0], (121, 3))


def episodes(specification, num_runs=1, seed=0):
    """All offsets, (N, K + 1, 3), and when the attack is active, (N, K + 1)."""
    attack = make_attack(specification)
    attack.bind(TIMELINE, num_runs)
    attack.follow(NORTH)
    attack.reset(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))
    ones = np.ones(num_runs, dtype=np.int64)
    clocks = [Clock(k * ones, time * ones) for k, time in enumerate(TIMELINE.times)]
    offsets = np.stack([attack.offset(clock) for clock in clocks], axis=1)
    return offsets, np.stack([attack.active(clock) for clock in clocks], axis=1)


def test_white_errors_are_normal_and_begin_with_the_attack():
    """300 runs x 70 epochs x 3 axes; false-failure probability 1e-8 per figure."""
    rough, active = episodes("tracking-error:ramp:0.5/direction=135/onset=70,sigma=0.4", 300)
    smooth, _ = episodes("ramp:0.5,direction=135,onset=70", 300)
    error = rough - smooth
    np.testing.assert_array_equal(error[:, :51], 0.0)
    assert active.tolist() == [[False] * 51 + [True] * 70] * 300
    sample = error[:, 51:]
    assert abs(sample.mean()) < stats.norm.isf(5e-9) * 0.4 / np.sqrt(sample.size)
    low, high = stats.chi2.ppf([5e-9, 1 - 5e-9], sample.size)
    assert low < np.sum(sample**2) / 0.4**2 < high
    pairs = sample[:, 1:] * sample[:, :-1] / 0.4**2
    assert abs(pairs.mean()) < stats.norm.isf(5e-9) / np.sqrt(pairs.size)


def test_the_offset_need_not_grow_for_the_error_to_act():
    rough, active = episodes("tracking-error:ramp:0")
    assert active[0].tolist() == [False] + [True] * 120
    assert np.all(rough[0, 1:] != 0.0)


@pytest.mark.parametrize(("axis", "place"), [("east", 0), ("north", 1), ("up", 2)])
def test_on_one_axis_it_errs_as_it_would_beside_the_others(axis, place):
    whole, _ = episodes("tracking-error:ramp:0,sigma=0.1,time=40", 4)
    alone, _ = episodes(f"tracking-error:ramp:0,sigma=0.1,time=40,axis={axis}", 4)
    np.testing.assert_array_equal(alone[:, :, place], whole[:, :, place])
    assert not np.any(np.delete(alone, place, axis=2))


def test_an_attack_that_ends_takes_its_error_with_it():
    rough, active = episodes("tracking-error:azimuth:5/onset=40/end=90/decay=20")
    np.testing.assert_array_equal(active[0], (TIMELINE.times > 40.0) & (TIMELINE.times <= 90.0))
    np.testing.assert_array_equal(np.any(rough[0], axis=1), active[0])


@pytest.mark.parametrize("name", ["random-ramp", "climbing-spiral", "training", "held-out:clean=0.3"])
def test_a_random_attack_has_its_error_from_its_first_offset_to_its_last(name):
    rough, active = episodes(f"tracking-error:{name}", 40)
    smooth, _ = episodes(name, 40)
    spoofed = np.any(smooth, axis=2)
    for run in range(40):
        epochs = np.flatnonzero(spoofed[run])
        expected = np.zeros(121, dtype=bool)
        if len(epochs):
            expected[epochs[0] : epochs[-1] + 1] = True
        np.testing.assert_array_equal(active[run], expected)
    np.testing.assert_array_equal(np.any(rough, axis=2), active)


def test_no_attack_has_no_error():
    rough, active = episodes("tracking-error:none", 3)
    assert not np.any(rough)
    assert not np.any(active)


@pytest.mark.parametrize("time", [0.0, 20.0])
def test_run_i_is_the_same_for_any_number_of_runs(time):
    specification = f"tracking-error:random-jump,time={time}"
    whole = episodes(specification, 64)[0]
    np.testing.assert_array_equal(episodes(specification, 5)[0], whole[:5])
    np.testing.assert_array_equal(episodes(specification, 1, seed=40)[0], whole[40:41])


def test_the_attack_inside_meets_its_own_numbers():
    """The error takes none from the stream of the attack, in later episodes either."""
    inside, alone = make_attack("tracking-error:random-ramp").attack, make_attack("random-ramp")
    wrapped, streams, others = TrackingError(inside), RunStreams.from_seed(4, 3), RunStreams.from_seed(4, 3)
    for attack in (wrapped, alone):
        attack.bind(TIMELINE, 3)
    clock = Clock(np.full(3, 100), np.full(3, 120.0))
    for _ in range(2):
        wrapped.reset(np.arange(3), streams)
        alone.reset(np.arange(3), others)
        np.testing.assert_array_equal(inside.offset(clock), alone.offset(clock))


def test_it_can_be_a_member_of_a_pool_and_follows_the_vehicle():
    pool = AttackPool([(make_attack("tracking-error:meaconing:2"), 1.0), (make_attack("none"), 1.0)], clean=0.0)
    simulation = Simulation(make_scenario("foi-drive"), pool, num_runs=20, seed=0)
    simulation.reset()
    spoofed = pool.member == 0
    assert 0 < spoofed.sum() < 20
    np.testing.assert_array_equal(pool.first[spoofed], 1)
    assert not np.any(pool.offsets[~spoofed])
    delayed = make_attack("meaconing:2")
    delayed.bind(simulation.scenario.timeline, 1)
    delayed.follow(simulation.scenario.velocity())
    expected = delayed.episode(np.array([0]), simulation.streams)[0]
    # 0.3 m: 14,000 normals stay within 7 sigma but for 4e-8
    assert np.abs(pool.offsets[spoofed] - expected).max() < 7.0 * 0.3


def test_the_model_reaches_the_attack_inside():
    rough = Simulation(make_scenario("liu-flight"), make_attack("tracking-error:noise-matched:2,sigma=0"))
    smooth = Simulation(make_scenario("liu-flight"), make_attack("noise-matched:2"))
    runs = np.array([0])
    offsets = [simulation.attack.episode(runs, simulation.streams) for simulation in (rough, smooth)]
    np.testing.assert_array_equal(*offsets)


def test_with_a_correlation_time_the_environments_errors_stay_near_their_neighbours():
    """Mean squares of 357 differences, 2 σ² (1 - exp(-Δt / time)): 2 and 0.04; false-failure probability below 1e-8."""
    lag = []
    for time in (0.0, 50.0):
        env = SpooferEnv(detector="snapshot:threshold=1e6", tracking_sigma=1.0, tracking_time=time, knowledge="blind")
        env.reset(seed=1)
        errors = []
        for _ in range(120):
            env.step(np.zeros(3))
            errors.append(env.game.simulation.offset[0] - env.game.seat.offset[0])
        errors = np.array(errors)
        lag.append(np.mean((errors[1:] - errors[:-1]) ** 2))
    assert lag[0] > 0.8
    assert lag[1] < 0.1


def test_the_environment_refuses_a_negative_time():
    with pytest.raises(ValueError, match="tracking_time must be a finite number, 0 or more, got -1"):
        SpooferEnv(tracking_time=-1.0)


@pytest.mark.parametrize(
    "specification",
    [
        "tracking-error:ramp:0.5/direction=135,sigma=0.5",
        "tracking-error:none",
        "tracking-error:training:clean=0.1,time=20",
        "tracking-error:foi-3",
        "tracking-error:none,sigma=0.1,time=40,axis=up",
    ],
)
def test_the_name_builds_the_same_attack(specification):
    assert make_attack(specification).name == specification


def test_the_onset_is_that_of_the_attack_inside():
    with pytest.raises(ValueError, match="onset 150 s lies outside the game"):
        episodes("tracking-error:ramp:1/onset=150")


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("tracking-error", "needs 'attack'"),
        ("tracking-error:drift", "unknown attack 'drift'"),
        (
            "tracking-error:ramp:0.5,direction=3",
            "no option 'direction'; valid options: attack, sigma, time, axis; .*'/'",
        ),
        ("tracking-error:ramp:1,sigma=-1", "sigma must be a finite number, 0 or more, got -1.0"),
        ("tracking-error:ramp:1,time=inf", "time must be a finite number, 0 or more, got inf"),
        ("tracking-error:ramp:1,axis=down", "axis must be one of east, north, up, got 'down'"),
        ("tracking-error:tracking-error:none", "attack must have no tracking error of its own"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)
