from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import ATTACKS, Jump, JumpRamp, Ramp, make_attack
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(start=800.0, interval=1.0, num_epochs=120)
RANDOM = ["jump", "slow-change"]


def clock_at(index, timeline=TIMELINE):
    index = np.asarray(index)
    return Clock(index, timeline.start + timeline.interval * index)


def bound(specification, num_runs=1, timeline=TIMELINE, seed=0):
    attack = make_attack(specification)
    attack.bind(timeline, num_runs)
    attack.reset(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))
    return attack


def offsets_of(attack, num_runs=1, timeline=TIMELINE):
    """Offsets of the whole game, (K + 1, N, 3)."""
    return np.array([attack.offset(clock_at(np.full(num_runs, k), timeline)) for k in range(timeline.num_epochs + 1)])


def test_no_attack_adds_nothing():
    np.testing.assert_array_equal(offsets_of(bound("none", 3), 3), np.zeros((121, 3, 3)))


def test_ramp_grows_east_from_the_first_spoofed_epoch():
    offsets = offsets_of(bound("ramp:0.5"))[:, 0]
    assert offsets[:4].tolist() == [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [1.5, 0.0, 0.0]]
    assert offsets[120, 0] == 60.0


@pytest.mark.parametrize(
    ("direction", "east", "north"),
    [
        (0, 0, 1),
        (90, 1, 0),
        (135, 0.5**0.5, -(0.5**0.5)),
        (180, 0, -1),
        (270, -1, 0),
        (-90, -1, 0),
        (390, 0.5, 0.75**0.5),
    ],
)
def test_direction_is_an_azimuth_clockwise_from_north(direction, east, north):
    for specification in (f"ramp:2,direction={direction}", f"jump-ramp:1.5,jump=0.5,direction={direction}"):
        first = offsets_of(bound(specification))[1, 0]
        np.testing.assert_allclose(first, [2 * east, 2 * north, 0.0], atol=1e-15)


def test_ramp_starts_at_its_onset():
    east = offsets_of(bound("ramp:0.5,onset=810"))[:, 0, 0]
    np.testing.assert_array_equal(east[:11], 0.0)
    np.testing.assert_allclose(east[11:], 0.5 * np.arange(1, 111))


def test_ramp_counts_time_not_epochs():
    timeline = Timeline.steady(20.0, 0.1, 50)
    np.testing.assert_allclose(offsets_of(bound("ramp:2", timeline=timeline), timeline=timeline)[5, 0, 0], 1.0)


def test_unsynchronised_ramp_jumps_first():
    east = offsets_of(bound("jump-ramp:0.5,jump=7,onset=802"))[:, 0, 0]
    assert east[:5].tolist() == [0.0, 0.0, 0.0, 7.5, 8.0]


def test_runs_stand_at_epochs_of_their_own():
    attack = bound("ramp:1", 3)
    assert attack.offset(clock_at([0, 5, 100]))[:, 0].tolist() == [0.0, 5.0, 100.0]
    attack = bound("jump", 3)
    whole = offsets_of(attack, 3)
    np.testing.assert_array_equal(attack.offset(clock_at([0, 5, 100])), whole[[0, 5, 100], [0, 1, 2]])


@pytest.mark.parametrize(("start", "interval", "epoch"), [(20.0, 0.1, 3), (0.3, 0.1, 6), (100.0, 1 / 3, 50)])
def test_rounding_of_time_does_not_move_a_jump(start, interval, epoch):
    timeline = Timeline.steady(start, interval, 100)
    exact = start + interval * epoch
    for onset in (exact, np.nextafter(exact, 0.0), np.nextafter(exact, 1e9)):
        for attack in (Jump(onset=onset), JumpRamp(rate=0.0, jump=1.0, onset=onset)):
            attack.bind(timeline, 1)
            attack.reset(np.array([0]), RunStreams.from_seed(0, 1))
            east = offsets_of(attack, timeline=timeline)[:, 0, 0]
            assert np.flatnonzero(east)[0] == epoch + 1


def test_jump_is_normal_with_variance_a_tenth():
    """Song 2021, eq 28, on 300 runs x 120 epochs x 2 axes; false-failure probability 1e-7 per figure."""
    offsets = offsets_of(bound("jump", 300), 300)[1:]
    sample = offsets[..., :2].ravel()
    assert abs(sample.mean() - 20.0) < stats.norm.isf(5e-8) * np.sqrt(0.1 / sample.size)
    scaled = sample.size * sample.var() / 0.1
    assert stats.chi2.ppf(5e-8, sample.size - 1) < scaled < stats.chi2.isf(5e-8, sample.size - 1)
    assert abs(np.corrcoef(offsets[..., 0].ravel(), offsets[..., 1].ravel())[0, 1]) < 5.4 / np.sqrt(36_000)
    np.testing.assert_array_equal(offsets[..., 2], 0.0)


def test_slow_change_adds_a_disturbance_every_second():
    """Song 2021, eq 29; false-failure probability 1e-7 per figure."""
    offsets = offsets_of(bound("slow-change", 300), 300)
    np.testing.assert_array_equal(offsets[0], 0.0)
    steps = np.diff(offsets, axis=0)[..., :2]
    sample = steps.ravel()
    assert abs(sample.mean() - 0.5) < stats.norm.isf(5e-8) * np.sqrt(0.05 / sample.size)
    scaled = sample.size * sample.var() / 0.05
    assert stats.chi2.ppf(5e-8, sample.size - 1) < scaled < stats.chi2.isf(5e-8, sample.size - 1)
    assert abs(np.corrcoef(steps[:-1].ravel(), steps[1:].ravel())[0, 1]) < 5.4 / np.sqrt(steps[1:].size)
    end = offsets[-1, :, :2].ravel()
    assert abs(end.mean() - 60.0) < stats.norm.isf(5e-8) * np.sqrt(120 * 0.05 / end.size)


def test_slow_change_at_ten_hertz_is_that_of_one_hertz_with_straight_seconds():
    fast = Timeline.steady(800.0, 0.1, 1200)
    coarse = offsets_of(bound("slow-change"))[:, 0]
    fine = offsets_of(bound("slow-change", timeline=fast), timeline=fast)[:, 0]
    for axis in range(3):
        expected = np.interp(np.arange(1201) / 10, np.arange(121), coarse[:, axis])
        np.testing.assert_allclose(fine[:, axis], expected, atol=1e-9)


@pytest.mark.parametrize("name", RANDOM)
def test_random_attacks_wait_for_their_onset(name):
    offsets = offsets_of(bound(f"{name}:onset=850", 4), 4)
    np.testing.assert_array_equal(offsets[:51], 0.0)
    assert np.all(offsets[51, :, :2] != 0.0)


@pytest.mark.parametrize("name", RANDOM)
def test_axes_and_moments_are_options(name):
    offsets = offsets_of(bound(f"{name}:mean=-3,variance=0,axes=u"))[:, 0]
    expected = np.full(120, -3.0) if name == "jump" else -3.0 * np.arange(1, 121)
    np.testing.assert_allclose(offsets[1:, 2], expected)
    np.testing.assert_array_equal(offsets[:, :2], 0.0)


@pytest.mark.parametrize("name", RANDOM)
def test_after_the_end_fixes_are_clean(name):
    whole, ending = (bound(specification, 4) for specification in (name, f"{name}:end=850"))
    offsets = offsets_of(ending, 4)
    np.testing.assert_array_equal(offsets[:51], offsets_of(whole, 4)[:51])
    np.testing.assert_array_equal(offsets[51:], 0.0)
    active = [ending.active(clock_at([k] * 4)).all() for k in range(121)]
    assert np.flatnonzero(active).tolist() == list(range(1, 51))


@pytest.mark.parametrize("end", [800.0, 700.0])
def test_an_end_before_the_onset_is_refused(end):
    with pytest.raises(ValueError, match="must be after the onset, 800 s"):
        make_attack(f"jump:end={end}").bind(TIMELINE, 1)


@pytest.mark.parametrize(("start", "interval"), [(20.0, 0.1), (0.3, 0.1), (100.0, 1 / 3)])
def test_rounding_of_time_does_not_move_an_end(start, interval):
    timeline = Timeline.steady(start, interval, 100)
    exact = start + interval * 6
    for end in (exact, np.nextafter(exact, 0.0), np.nextafter(exact, 1e9)):
        attack = Jump(end=end)
        attack.bind(timeline, 1)
        attack.reset(np.array([0]), RunStreams.from_seed(0, 1))
        assert np.flatnonzero(offsets_of(attack, timeline=timeline)[:, 0, 0])[-1] == 6


@pytest.mark.parametrize("name", RANDOM)
def test_run_i_is_the_same_for_any_number_of_runs(name):
    whole = offsets_of(bound(name, 64), 64)
    np.testing.assert_array_equal(offsets_of(bound(name, 5), 5), whole[:, :5])
    np.testing.assert_array_equal(offsets_of(bound(name, 1, seed=40), 1), whole[:, 40:41])


@pytest.mark.parametrize("name", RANDOM)
def test_a_staggered_reset_draws_the_next_episode_of_that_run_alone(name):
    streams = RunStreams.from_seed(0, 4)
    attack = make_attack(name)
    attack.bind(TIMELINE, 4)
    attack.reset(np.arange(4), streams)
    first = offsets_of(attack, 4)
    attack.reset(np.array([2]), streams)
    second = offsets_of(attack, 4)
    np.testing.assert_array_equal(second[:, [0, 1, 3]], first[:, [0, 1, 3]])
    assert not np.any(second[1:, 2, :2] == first[1:, 2, :2])

    alone, lane = make_attack(name), RunStreams.from_seed(2, 1)
    alone.bind(TIMELINE, 1)
    for _ in range(2):
        alone.reset(np.array([0]), lane)
    np.testing.assert_array_equal(offsets_of(alone), second[:, 2:3])


@pytest.mark.parametrize("name", RANDOM)
def test_the_block_of_an_episode_does_not_depend_on_the_onset(name):
    def second_episode(specification):
        streams = RunStreams.from_seed(0, 1)
        attack = make_attack(specification)
        attack.bind(TIMELINE, 1)
        attack.reset(np.array([0]), streams)
        attack.reset(np.array([0]), streams)
        return streams(0, "opponent").standard_normal()

    assert second_episode(name) == second_episode(f"{name}:onset=900")


@pytest.mark.parametrize(
    "specification",
    [
        "none",
        "jump",
        "jump:mean=5,variance=0,onset=810,axes=n",
        "slow-change",
        "slow-change:mean=1",
        "jump:onset=810,end=830",
        "slow-change:end=830",
        "ramp:0.5",
        "ramp:0.5,direction=135,onset=810",
        "jump-ramp:0.5,jump=7",
        "jump-ramp:0.5,jump=7,direction=0,onset=801.5",
    ],
)
def test_the_name_builds_the_same_attack(specification):
    assert make_attack(specification).name == specification


def test_make_attack_takes_objects():
    attack = Ramp(0.5)
    assert make_attack(attack) is attack
    assert {"none", "jump", "ramp", "jump-ramp", "slow-change"} < set(ATTACKS)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("drift", "unknown attack 'drift'; valid names: azimuth, .*, jump, jump-ramp, .*, none, .*, slow-change, "),
        ("ramp", "needs 'rate'"),
        ("ramp:-0.5", "rate must be a finite number, 0 or more, got -0.5"),
        ("ramp:nan", "rate must be a finite number, 0 or more, got nan"),
        ("ramp:fast", "rate must be a number, got 'fast'"),
        ("ramp:1,direction=inf", "direction must be a finite number, got inf"),
        ("ramp:1,onset=nan", "onset must be a finite number, got nan"),
        ("ramp:1,jump=2", "no option 'jump'; valid options: rate, direction, onset"),
        ("jump-ramp:1", "needs 'jump'"),
        ("jump-ramp:-1,jump=2", "rate must be a finite number, 0 or more, got -1.0"),
        ("jump-ramp:1,jump=-2", "jump must be a finite number, 0 or more, got -2.0"),
        ("jump:variance=-0.1", "variance must be a finite number, 0 or more, got -0.1"),
        ("jump:mean=inf", "mean must be a finite number, got inf"),
        ("jump:axes=x", "axes must be letters of 'enu', each at most once, got 'x'"),
        ("slow-change:axes=ee", "axes must be letters of 'enu', each at most once, got 'ee'"),
        ("none:1", "takes no value"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_attack(specification)


@pytest.mark.parametrize("onset", [799.0, 920.0, 1000.0])
@pytest.mark.parametrize("specification", ["ramp:1,onset={}", "jump:onset={}"])
def test_an_onset_outside_the_game_is_refused(specification, onset):
    with pytest.raises(ValueError, match="lies outside the game, which runs from 800 s to 920 s"):
        make_attack(specification.format(onset)).bind(TIMELINE, 1)


def test_make_attack_refuses_other_things():
    with pytest.raises(TypeError, match="attack must be a specification"):
        make_attack(0.5)
