"""Random attacks: each shape against its closed form, onset and length against their distributions."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import RandomJump, make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline, manoeuvre_times

TIMELINE = Timeline.steady(20.0, 1.0, 230)
TRAINING = ["random-ramp", "random-jump", "random-growth"]
HELD_OUT = ["two-stage-ramp", "sign-changing-ramp", "decaying-jump", "climbing-spiral"]
FAMILIES = [*TRAINING, *HELD_OUT]
FALSE_FAILURE = 1e-8
STAY = np.broadcast_to([20.0, 0.0, 0.0], (231, 3))
TURNING = STAY.copy()
TURNING[91:101, 1] = np.arange(1, 11)
TURNING[101:146, 1] = 10.0
TURNING[146:, 1] = 20.0
"""Speeds up to the north from 110 s to 120 s and at once after 165 s."""


def bound(specification, num_runs=1, velocity=STAY):
    attack = make_attack(specification)
    attack.bind(TIMELINE, num_runs)
    attack.follow(velocity)
    return attack


def episodes(specification, num_runs, seed=0, velocity=STAY):
    return bound(specification, num_runs, velocity).episode(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))


def drawn(specification, *shape):
    """Offsets of an attack to the east that begins with the game and lasts to its end; uniforms of its shape."""
    draws = np.zeros((1, 12))
    draws[0, 2], draws[0, 5] = 0.9, 0.25
    draws[0, 6 : 6 + len(shape)] = shape
    return bound(specification).drawn(draws)[0]


@pytest.fixture(scope="module")
def jumps():
    """Onset and last epoch of 4000 jumps, which show both: the offset is nowhere zero between."""
    pool = AttackPool([(RandomJump(manoeuvre=0.0), 1.0)], clean=0.0)
    pool.bind(TIMELINE, 4000)
    pool.follow(TURNING)
    pool.reset(np.arange(4000), RunStreams.from_seed(3, 4000))
    return pool.first - 1, pool.last, pool.offsets[np.arange(4000), pool.first]


def test_shapes_have_their_closed_forms():
    """At uniform numbers whose meaning is worked out by hand."""
    t = np.arange(231.0)
    np.testing.assert_allclose(drawn("random-ramp", 0.5)[:, 0], np.sqrt(0.2 * 5.0) * t)
    np.testing.assert_allclose(drawn("random-jump", 0.2)[1:, 0], 14.0)
    growth = drawn("random-growth", 0.5, 0.0)[:, 0]
    size = np.sqrt(10.0 * 200.0)
    np.testing.assert_allclose(growth[[0, 2, 5, 8, 10, 100]], size * np.array([0.0, 0.08, 0.5, 0.92, 1.0, 1.0]))
    two = drawn("two-stage-ramp", 0.0, 1.0, 0.0)[:, 0]
    np.testing.assert_allclose(two[[1, 15, 16, 20]], [0.1, 1.5, 7.5, 31.5])
    back = drawn("sign-changing-ramp", 0.0, 0.0)[:, 0]
    np.testing.assert_allclose(back[[10, 20, 30]], [3.0, 0.0, -3.0], atol=1e-12)
    decay = drawn("decaying-jump", 0.0, 0.0)[:, 0]
    np.testing.assert_allclose(decay[[1, 10, 20]], 10.0 * np.exp([-0.1, -1.0, -2.0]))


def test_the_spiral_turns_and_climbs():
    """Against a sum of small steps; to the east with a turn to the right means to the south."""
    offsets = drawn("climbing-spiral", 1.0, 1.0, 0.75)
    time = np.arange(0.005, 100.0, 0.01)
    azimuth = np.pi / 2 + np.radians(3.0) * time
    steps = 3.0 * 0.01 * np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
    np.testing.assert_allclose(offsets[100, :2], steps.sum(axis=0), atol=1e-3)
    np.testing.assert_allclose(offsets[:, 2], 0.5 * np.arange(231.0))
    straight = drawn("climbing-spiral", 0.0, 0.5, 0.5)
    np.testing.assert_allclose(straight[:, :2], np.outer(np.arange(231.0), [0.3, 0.0]), atol=0.01)


def parameters(name, offsets):
    """The numbers an episode was drawn with, read off its offsets from the onset on, mapped to (0, 1) by their laws.

    Args:
        name: of the family.
        offsets: of one run, from the last true fix to the last spoofed one, (n, 3), m.
    """
    plane = offsets[:, 0] + 1j * offsets[:, 1]
    towards = plane / (plane[1] / abs(plane[1]))
    first, length = abs(plane[1]), len(offsets) - 1

    def even(value, low, high):
        return (value - low) / (high - low)

    def logarithmic(value, low, high):
        return np.log(value / low) / np.log(high / low)

    if name == "random-ramp":
        return {"rate": logarithmic(first, 0.2, 5.0)}
    if name == "random-jump":
        return {"size": even(first, 5.0, 50.0)}
    if name == "random-growth" and length >= 80:
        size = abs(plane[-1])
        return {"size": logarithmic(size, 10.0, 200.0), "growth": even(np.sqrt(2.0 * size / first), 10.0, 80.0)}
    if name == "two-stage-ramp" and length >= 52:
        fast = abs(plane[-1] - plane[-2])
        change = (fast * length - abs(plane[-1])) / (fast - first)
        return {"slow": even(first, 0.1, 0.8), "fast": even(fast, 1.0, 6.0), "change": even(change, 15.0, 50.0)}
    if name == "sign-changing-ramp" and length >= 42:
        turn = (towards[-1].real / first + length) / 2.0
        return {"rate": even(first, 0.3, 3.0), "turn": even(turn, 10.0, 40.0)}
    if name == "decaying-jump":
        time = 1.0 / np.log(first / abs(plane[2]))
        return {"size": even(first * np.exp(1.0 / time), 10.0, 80.0), "time": even(time, 10.0, 40.0)}
    if name == "climbing-spiral":
        turn = -np.angle((plane[2] - plane[1]) / plane[1])
        rate = first * (turn / 2.0) / np.sin(turn / 2.0)
        return {
            "rate": logarithmic(rate, 0.3, 3.0),
            "turn": even(np.degrees(turn), -3.0, 3.0),
            "climb": even(offsets[1, 2], -1.0, 1.0),
        }
    return None


@pytest.mark.parametrize("name", FAMILIES)
def test_parameters_fill_their_ranges_and_know_nothing_of_each_other(name):
    """Dvoretzky-Kiefer-Wolfowitz, and correlations (normal with 1 / √n) of all and the heading: 1e-8 each."""
    rows = []
    for offsets in episodes(f"{name}:manoeuvre=0", 2500, seed=100):
        spoofed = np.flatnonzero(np.any(offsets != 0.0, axis=1))
        part = offsets[spoofed[0] - 1 : spoofed[-1] + 1]
        read = parameters(name, part)
        if read is not None:
            rows.append([*read.values(), np.angle(part[1, 0] + 1j * part[1, 1]) / (2.0 * np.pi) % 1.0])
    values = np.array(rows)
    assert len(values) > 700
    assert np.all((values > -1e-6) & (values < 1.0 + 1e-6))
    band = np.sqrt(np.log(2.0 / FALSE_FAILURE) / (2.0 * len(values)))
    for column in values.T:
        assert stats.kstest(column, "uniform").statistic < band
    limit = stats.norm.isf(FALSE_FAILURE / 2) / np.sqrt(len(values))
    assert np.all(np.abs(np.corrcoef(values, rowvar=False)[np.triu_indices(values.shape[1], 1)]) < limit)


def test_the_onset_waits_geometrically(jumps):
    """Truncated at 20 s before the end; chi-square over classes of ten epochs, false-failure probability 1e-8."""
    onset, _, _ = jumps
    weight = (1.0 - 1.0 / 60.0) ** np.arange(211)
    classes = np.arange(211) // 10
    expected = len(onset) * np.bincount(classes, weight) / weight.sum()
    counted = np.bincount(onset // 10, minlength=len(expected))
    assert onset.min() >= 0
    assert onset.max() <= 210
    assert np.sum((counted - expected) ** 2 / expected) < stats.chi2.isf(FALSE_FAILURE, len(expected) - 1)


def test_attacks_last_20_to_100_seconds_or_to_the_end(jumps):
    """Of the attacks with 100 s left before them 30 % reach the end; binomial, false-failure probability 1e-8."""
    onset, last, _ = jumps
    length = last - onset
    early = onset < 130
    to_the_end = last[early] == 230
    low, high = stats.binom.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], early.sum(), 0.3)
    assert low <= to_the_end.sum() <= high
    ended = length[early][~to_the_end]
    assert ended.min() >= 20
    assert ended.max() <= 100
    assert stats.kstest(ended + 0.5, stats.uniform(20, 80).cdf).statistic < 0.0063 + 3.1 / np.sqrt(len(ended))


def test_headings_are_uniform(jumps):
    """Rayleigh: N R² is exponential; false-failure probability 1e-8."""
    first = jumps[2]
    size = np.hypot(first[:, 0], first[:, 1])
    mean = (first[:, :2] / size[:, None]).mean(axis=0)
    assert len(first) * mean @ mean < -np.log(FALSE_FAILURE)
    assert 5.0 <= size.min() < 5.2
    assert 49.8 < size.max() <= 50.0


def test_manoeuvres_are_found():
    assert manoeuvre_times(TURNING, TIMELINE) == (110.0, 165.0)
    assert manoeuvre_times(STAY, TIMELINE) == ()
    assert manoeuvre_times(TURNING[95:], Timeline.steady(115.0, 1.0, 135)) == (165.0,)


@pytest.mark.parametrize(("interval", "pause", "times"), [(1.0, 1, 1), (1.0, 2, 2), (0.5, 3, 1), (0.5, 4, 2)])
def test_a_manoeuvre_is_a_new_one_after_two_quiet_seconds(interval, pause, times):
    """Four steps of acceleration, a pause, four more; 0.29 m/s² is no acceleration, and one upward does not count."""
    gains = interval * np.array([0.29] * 5 + [0.31] * 4 + [0.29] * pause + [0.31] * 4 + [0.0] * 5)
    speed = np.concatenate([[20.0], 20.0 + np.cumsum(gains)])
    velocity = np.stack([np.zeros_like(speed), speed, 10.0 * speed], axis=1)
    expected = 100.0 + interval * np.array([5.0, 9.0 + pause])
    assert manoeuvre_times(velocity, Timeline.steady(100.0, interval, len(gains))) == tuple(expected[:times])


def test_a_share_begins_in_view_of_a_manoeuvre():
    """All, none, and 15 % by default; at most 10 s before the speed changes."""
    pool = AttackPool([(RandomJump(manoeuvre=1.0), 1.0)], clean=0.0)
    pool.bind(TIMELINE, 1000)
    pool.follow(TURNING)
    pool.reset(np.arange(1000), RunStreams.from_seed(0, 1000))
    before = np.array([[110.0], [165.0]]) - (TIMELINE.start + pool.first - 1)
    near = (before >= 0.0) & (before <= 10.0)
    assert np.all(near.any(axis=0))
    low, high = stats.binom.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], 1000, 0.5)
    assert low <= near[0].sum() <= high

    draws = np.random.default_rng(1).random((4000, 12))
    geometric = bound("random-jump:manoeuvre=0", velocity=TURNING).drawn(draws)
    default = bound("random-jump", velocity=TURNING).drawn(draws)
    moved = np.any(geometric != default, axis=(1, 2)).sum()
    # less than one onset in fifty would have been the same
    low = stats.binom.ppf(FALSE_FAILURE / 2, 4000, 0.15 * 0.98)
    assert low <= moved <= stats.binom.isf(FALSE_FAILURE / 2, 4000, 0.15)
    np.testing.assert_array_equal(bound("random-jump:manoeuvre=1").drawn(draws), bound("random-jump").drawn(draws))


@pytest.mark.parametrize("name", FAMILIES)
def test_every_attack_begins_true_and_most_end_true(name):
    offsets = episodes(name, 300)
    spoofed = np.any(offsets != 0.0, axis=2)
    assert np.all(np.any(spoofed, axis=1))
    assert not np.any(spoofed[:, 0])
    first, last = spoofed.argmax(axis=1), 230 - spoofed[:, ::-1].argmax(axis=1)
    assert np.all(np.minimum(first + 19, 230) <= last)
    assert 0.3 < np.mean(last < 230) < 0.9
    assert np.all(np.isfinite(offsets))
    assert np.any(offsets[:, :, 2]) == (name == "climbing-spiral")


@pytest.mark.parametrize("name", FAMILIES)
def test_run_i_is_the_same_for_any_number_of_runs_and_in_a_reset(name):
    whole = episodes(name, 32)
    np.testing.assert_array_equal(episodes(name, 5), whole[:5])
    np.testing.assert_array_equal(episodes(name, 1, seed=20), whole[20:21])
    attack = bound(name, 32)
    attack.reset(np.array([20]), RunStreams.from_seed(0, 32))
    clock = Clock(np.full(32, 200), np.full(32, 220.0))
    np.testing.assert_array_equal(attack.offset(clock)[20], whole[20, 200])


@pytest.mark.parametrize("name", FAMILIES)
def test_the_name_builds_the_same_family(name):
    assert make_attack(name).name == name
    assert make_attack(f"{name}:manoeuvre=0.5").name == f"{name}:manoeuvre=0.5"
    with pytest.raises(ValueError, match=r"manoeuvre must be a share from 0 to 1, got 1\.5"):
        make_attack(f"{name}:manoeuvre=1.5")


def test_a_game_of_twenty_seconds_is_too_short():
    with pytest.raises(ValueError, match="needs a game of more than 20 s"):
        make_attack("random-ramp").bind(Timeline.steady(0.0, 1.0, 20), 1)
