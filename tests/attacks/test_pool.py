"""Populations: shares, weights, and that a run's opponent is its own."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import ATTACKS, make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import spoofer_pool
from spoofgym.navigation.interface import Clock
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(20.0, 1.0, 60)
FALSE_FAILURE = 1e-8
MEMBERS = {
    "training": ("random-ramp", "random-jump", "random-growth"),
    "held-out": ("two-stage-ramp", "sign-changing-ramp", "decaying-jump", "climbing-spiral"),
}


def drawn(pool, num_runs, seed=0):
    pool = make_attack(pool) if isinstance(pool, str) else pool
    pool.bind(TIMELINE, num_runs)
    pool.follow(np.zeros((61, 3)))
    pool.reset(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))
    return pool


def binomial(number, share):
    return stats.binom.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], number, share)


@pytest.mark.parametrize(("name", "clean"), [("training", 0.5), ("training:clean=0.1", 0.1), ("held-out", 0.5)])
def test_shares_are_as_stated(name, clean):
    """Binomial, false-failure probability 1e-8 per figure."""
    pool = drawn(name, 3000)
    assert pool.names == MEMBERS[name.partition(":")[0]]
    low, high = binomial(3000, clean)
    assert low <= np.sum(pool.member == -1) <= high
    for member in range(len(pool.names)):
        low, high = binomial(3000, (1.0 - clean) / len(pool.names))
        assert low <= np.sum(pool.member == member) <= high


def test_weights_count():
    members = [(make_attack("ramp:1"), 3.0), (make_attack("ramp:2"), 1.0)]
    pool = drawn(AttackPool(members, clean=0.0), 2000)
    low, high = binomial(2000, 0.75)
    assert low <= np.sum(pool.member == 0) <= high
    assert pool.name == "ramp:1 + ramp:2"
    np.testing.assert_array_equal(pool.offsets[:, 10, 0], np.where(pool.member == 0, 10.0, 20.0))


@pytest.mark.parametrize("clean", [0.0, 1.0])
def test_all_or_none_are_clean(clean):
    pool = drawn(f"training:clean={clean}", 200)
    assert np.all((pool.member == -1) == (clean == 1.0))
    assert np.any(pool.offsets) == (clean == 0.0)


def test_first_and_last_enclose_the_offsets():
    pool = drawn("held-out", 200)
    for run in range(200):
        spoofed = np.flatnonzero(np.any(pool.offsets[run] != 0.0, axis=1))
        if pool.member[run] == -1:
            assert (len(spoofed), pool.first[run], pool.last[run]) == (0, 61, 0)
        else:
            assert (spoofed[0], spoofed[-1]) == (pool.first[run], pool.last[run])


def test_a_run_that_draws_no_opponent_forgets_the_last_one():
    pool, streams = drawn("training", 60), RunStreams.from_seed(1, 60)
    before = pool.member.copy()
    pool.reset(np.arange(60), streams)
    freed = (before >= 0) & (pool.member == -1)
    assert np.any(freed)
    assert not np.any(pool.offsets[freed])
    assert np.all((pool.first[freed] == 61) & (pool.last[freed] == 0))


def test_a_run_has_its_own_opponent_for_any_number_of_runs():
    whole = drawn("training", 40)
    for part, runs in ((drawn("training", 7), slice(0, 7)), (drawn("training", 1, seed=30), slice(30, 31))):
        np.testing.assert_array_equal(part.offsets, whole.offsets[runs])
        np.testing.assert_array_equal(part.member, whole.member[runs])
    assert len(np.unique(whole.offsets[whole.member >= 0][:, -1, 0])) > 5


def test_a_staggered_reset_draws_the_next_opponent_of_that_run_alone():
    streams = RunStreams.from_seed(0, 8)
    pool = make_attack("training:clean=0")
    pool.bind(TIMELINE, 8)
    pool.reset(np.arange(8), streams)
    first = pool.offsets.copy()
    pool.reset(np.array([5, 2]), streams)
    others = [0, 1, 3, 4, 6, 7]
    np.testing.assert_array_equal(pool.offsets[others], first[others])
    alone, lane = make_attack("training:clean=0"), RunStreams.from_seed(5, 1)
    alone.bind(TIMELINE, 1)
    for _ in range(2):
        alone.reset(np.array([0]), lane)
    np.testing.assert_array_equal(alone.offsets[0], pool.offsets[5])
    assert np.any(alone.offsets[0] != first[5])


@pytest.mark.parametrize("specification", ["jump", "slow-change:axes=u", "ramp:0.5,direction=135,onset=30", "none"])
def test_any_attack_can_be_a_member(specification):
    """Its offsets in the pool are those that it would send itself on the same stream."""
    pool = AttackPool([(make_attack(specification), 1.0)], clean=0.0)
    pool.bind(TIMELINE, 3)
    streams, alone = RunStreams.from_seed(0, 3), RunStreams.from_seed(0, 3)
    pool.reset(np.arange(3), streams)
    for run in range(3):
        alone(run, "opponent").random(2)
    attack = make_attack(specification)
    attack.bind(TIMELINE, 3)
    attack.reset(np.arange(3), alone)
    for k, time in enumerate(TIMELINE.times):
        expected = attack.offset(Clock(np.full(3, k), np.full(3, time)))
        np.testing.assert_array_equal(pool.offsets[:, k], expected)
        np.testing.assert_array_equal(pool.offset(Clock(np.full(3, k), np.full(3, time))), expected)


def test_members_know_which_run_they_play_in():
    """Each run of a mixed pool is that of a pool of one run on the same seed."""
    members = ["jump", "slow-change", "ramp:2,onset=40", "random-jump", "none"]
    whole = drawn(AttackPool([(make_attack(name), 1.0) for name in members], clean=0.2), 30, seed=7)
    assert set(whole.member) == {-1, 0, 1, 2, 3, 4}
    for run in range(30):
        alone = drawn(AttackPool([(make_attack(name), 1.0) for name in members], clean=0.2), 1, seed=7 + run)
        assert alone.member[0] == whole.member[run]
        np.testing.assert_array_equal(alone.offsets[0], whole.offsets[run])


REQUIRED = {
    "ramp": ":1",
    "jump-ramp": ":1,jump=5",
    "azimuth": ":5",
    "exponential": ":0.5",
    "circle": ":10",
    "meaconing": ":2",
    "fusion-ripper": ":1",
    "tracking-error": ":ramp:1/direction=0",
    "position-only": ":ramp:1/direction=0",
    "velocity-only": ":ramp:1/direction=0",
    "liu-spoofer": ":1",
    "partial": ":ramp:1/direction=0",
    "code-only": ":ramp:1/direction=0",
}


@pytest.mark.parametrize("name", ATTACKS)
def test_every_attack_builds_from_its_name_and_is_the_same(name):
    scenario = make_scenario("foi-drive")
    original = make_attack(name + REQUIRED.get(name, ""))
    assert original.name == name + REQUIRED.get(name, "")
    offsets = []
    for attack in (original, make_attack(original.name)):
        attack.bind(scenario.timeline, 4)
        attack.follow(scenario.velocity())
        attack.study(scenario.linear_model())
        offsets.append(np.array(attack.episode(np.arange(4), RunStreams.from_seed(3, 4))))
    np.testing.assert_array_equal(*offsets)
    assert offsets[0].shape == (4, 231, 3)
    assert not np.any(offsets[0][:, 0])
    assert np.any(offsets[0]) == (name != "none" and original.moves_position)


@pytest.mark.parametrize("specification", ["ramp:0.5,direction=135,onset=30", "jump:axes=enu", "slow-change"])
def test_an_episode_is_a_reset_and_the_offset_at_each_clock(specification):
    """Of the runs asked for, in their order; the others go on with theirs."""
    whole, clocked = make_attack(specification), make_attack(specification)
    for attack in (whole, clocked):
        attack.bind(TIMELINE, 5)
    streams, others = RunStreams.from_seed(0, 5), RunStreams.from_seed(0, 5)
    for runs in (np.arange(5), np.array([4, 1])):
        offsets = whole.episode(runs, streams)
        clocked.reset(runs, others)
        for k, time in enumerate(TIMELINE.times):
            expected = clocked.offset(Clock(np.full(5, k), np.full(5, time)))
            np.testing.assert_array_equal(offsets[:, k], expected[runs])
            np.testing.assert_array_equal(whole.offset(Clock(np.full(5, k), np.full(5, time))), expected)


def test_foi_scenarios_in_a_pool_follow_the_vehicle():
    scenario = make_scenario("foi-drive")
    pool = spoofer_pool("foi-3", clean=0.5)
    simulation = Simulation(scenario, pool, num_runs=30, seed=1)
    simulation.reset()
    spoofed = pool.member == 0
    assert 0 < spoofed.sum() < 30
    largest = np.hypot(*pool.offsets[:, :, :2].max(axis=1).T)
    assert np.all(largest[~spoofed] == 0.0)
    assert np.ptp(np.abs(pool.offsets[spoofed]).max(axis=(1, 2))) == 0.0
    assert np.all((pool.first[spoofed], pool.last[spoofed]) == np.array([[76], [170]]))


def test_the_simulation_sends_the_offsets_of_the_pool_and_another_defender_meets_the_same():
    def play(detectors):
        simulation = Simulation(make_scenario("foi-drive:horizon=40"), make_attack("training"), detectors, None, 6, 4)
        simulation.reset()
        sent = [simulation.offset.copy()]
        for _ in range(40):
            simulation.resolve()
            simulation.observe()
            sent.append(simulation.offset.copy())
        return np.stack(sent, axis=1), simulation.attack.offsets

    sent, offsets = play([])
    np.testing.assert_array_equal(sent, offsets)
    np.testing.assert_array_equal(play([make_detector("snapshot")])[0], sent)
    assert np.any(sent)


def test_later_episodes_have_the_same_opponents_whatever_the_defender_drew():
    """A detector that alarms in many a burn-in draws its runs anew, from streams of their own."""

    def third(detectors, num_runs):
        simulation = Simulation(make_scenario("foi-drive"), make_attack("training"), detectors, None, num_runs, 4)
        for _ in range(3):
            simulation.reset()
        return simulation.attack.offsets.copy(), simulation.error

    offsets, error = third([], 12)
    again, other = third([make_detector("windowed:n=20,threshold=60")], 5)
    np.testing.assert_array_equal(again, offsets[:5])
    assert np.any(offsets[:5])
    assert np.any(other != error[:5])


def test_objects_are_copied_so_that_two_games_do_not_share_them():
    """Members of two copies live in games of their own: four runs and one."""
    for given in (AttackPool([(make_attack("jump"), 1.0)], clean=0.0), [make_attack("jump")], make_attack("jump")):
        first, second = (drawn(spoofer_pool(given, 0.0), number, seed) for number, seed in ((4, 0), (1, 9)))
        kept = first.offsets.copy()
        second.reset(np.arange(1), RunStreams.from_seed(10, 1))
        first.reset(np.array([3]), RunStreams.from_seed(0, 4))
        np.testing.assert_array_equal(first.offsets, kept)
        assert (len(first.offsets), len(second.offsets)) == (4, 1)


def test_opponents_are_made_of_names_objects_and_lists():
    assert spoofer_pool("training", 0.1).name == "training:clean=0.1"
    assert spoofer_pool("held-out:manoeuvre=0", 0.5).name == "held-out:manoeuvre=0"
    assert spoofer_pool(["ramp:1", make_attack("jump")], 0.25).names == ("ramp:1", "jump")
    pool = AttackPool([(make_attack("ramp:1"), 1.0)], clean=0.75)
    copied = spoofer_pool(pool, 0.1)
    assert copied is not pool
    assert copied.clean == 0.75
    with pytest.raises(ValueError, match=r"the share of clean games is given by clean=0.5"):
        spoofer_pool("training:clean=0.1", 0.5)


def test_the_share_of_clean_games_can_be_any_number():
    assert spoofer_pool("training", np.float64(0.25)).name == "training:clean=0.25"
    assert spoofer_pool("training", 0).clean == 0.0
    assert spoofer_pool("training", 1.0 / 3.0).clean == 1.0 / 3.0


@pytest.mark.parametrize(
    ("attacks", "clean", "message"),
    [
        ("trainings", 0.5, "unknown attack 'trainings'.* valid names: .*training"),
        (["ramp:1", "rmp:1"], 0.5, "unknown attack 'rmp'"),
        (["ramp:1", "ramp:1"], 0.5, "once only"),
        ([], 0.5, "at least one member"),
        ("training", 1.5, r"clean must be a share from 0 to 1, got 1\.5"),
        ("ramp:1", -0.5, "clean must be a share from 0 to 1"),
        ("training:0.1", 0.5, "'clean' is given twice"),
        ("held-out:manoeuvre=2", 0.5, "manoeuvre must be a share from 0 to 1"),
        ("ramp", 0.5, "'ramp' needs 'rate'"),
    ],
)
def test_bad_opponents_are_refused(attacks, clean, message):
    with pytest.raises(ValueError, match=message):
        spoofer_pool(attacks, clean)


@pytest.mark.parametrize("name", ["training", "training:clean=0.1,manoeuvre=0", "held-out", "held-out:manoeuvre=0.3"])
def test_the_name_builds_the_same_population(name):
    assert make_attack(name).name == name


@pytest.mark.parametrize(
    ("members", "clean", "message"),
    [
        ([], 0.5, "needs at least one member"),
        ([("ramp:1", 1.0), ("ramp:1", 2.0)], 0.5, "once only, got ramp:1, ramp:1"),
        ([("ramp:1", 0.0)], 0.5, "weight must be a finite number greater than 0, got 0.0"),
        ([("ramp:1", 1.0)], 1.5, "clean must be a share from 0 to 1, got 1.5"),
    ],
)
def test_bad_pools_are_refused(members, clean, message):
    with pytest.raises(ValueError, match=message):
        AttackPool([(make_attack(attack), weight) for attack, weight in members], clean)
