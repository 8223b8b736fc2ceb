"""Outages and multipath: how often, how long and how strong they are, and what a simulation makes of them."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(20.0, 1.0, 230)
FALSE_FAILURE = 1e-8
RUNS = 4000
OUTAGES = Disturbances(outage_share=1.0, multipath_share=0.0)
BURSTS = Disturbances(outage_share=0.0, multipath_share=1.0)
NONE = Disturbances(outage_share=0.0, multipath_share=0.0)


def drawn(disturbances, num_runs=RUNS, seed=0, timeline=TIMELINE):
    confounders = Confounders(disturbances)
    confounders.bind(timeline, num_runs)
    confounders.reset(np.arange(num_runs), RunStreams.from_seed(seed, num_runs))
    return confounders


def stretches(flags):
    """First epoch and length of the only stretch of each run, (N,) each; fails where a run has none or several."""
    assert np.all(np.sum(np.diff(flags.astype(int), axis=1, prepend=0) == 1, axis=1) == 1)
    return flags.argmax(axis=1), flags.sum(axis=1)


def binomial(number, share):
    return stats.binom.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], number, share)


def chi_square(counted, weight):
    """Whether counts fit weights; false-failure probability 1e-8."""
    expected = counted.sum() * weight / weight.sum()
    return np.sum((counted - expected) ** 2 / expected) < stats.chi2.isf(FALSE_FAILURE, len(counted) - 1)


@pytest.mark.parametrize(("outage", "multipath"), [(0.15, 0.15), (0.6, 0.3)])
def test_shares_are_as_stated_and_independent(outage, multipath):
    """Binomial, false-failure probability 1e-8 per figure."""
    confounders = drawn(Disturbances(outage_share=outage, multipath_share=multipath))
    out, disturbed = ~confounders.available.all(axis=1), confounders.multipath.any(axis=1)
    for flags, share in ((out, outage), (disturbed, multipath), (out & disturbed, outage * multipath)):
        low, high = binomial(RUNS, share)
        assert low <= flags.sum() <= high
    np.testing.assert_array_equal(confounders.noise.any(axis=(1, 2)), disturbed)


def test_the_default_disturbs_15_percent_each():
    assert (Disturbances().outage_share, Disturbances().multipath_share) == (0.15, 0.15)


@pytest.mark.parametrize(
    ("disturbances", "shortest", "longest"), [(OUTAGES, 10, 40), (BURSTS, 10, 20)], ids=["outage", "multipath"]
)
def test_place_and_length_are_uniform(disturbances, shortest, longest):
    """Chi-square of the first epoch (1 to 230, in tens) and of the length in whole seconds, 1e-8 each."""
    confounders = drawn(disturbances)
    flags = ~confounders.available if disturbances is OUTAGES else confounders.multipath
    first, length = stretches(flags)
    assert first.min() == 1
    assert first.max() == 230
    assert chi_square(np.bincount((first - 1) // 10, minlength=23), np.ones(23))
    whole = first + longest <= 231
    assert np.all((first + length == 231) | (length >= shortest))
    assert np.any(length[~whole] < shortest)
    counted = np.bincount(length[whole] - shortest, minlength=longest - shortest + 1)
    # a uniform length that is rounded: the ends have half a second only
    assert chi_square(counted, np.array([0.5, *[1.0] * (longest - shortest - 1), 0.5]))


@pytest.mark.parametrize(("interval", "epochs"), [(0.2, 60), (1.0, 12), (5.0, 2), (60.0, 1)])
def test_a_length_in_seconds_becomes_epochs(interval, epochs):
    """Rounded to whole epochs, at least one."""
    given = Disturbances(outage_share=1.0, outage_duration=(12.0, 12.0), multipath_share=0.0)
    first, length = stretches(~drawn(given, 300, timeline=Timeline.steady(0.0, interval, 300)).available)
    np.testing.assert_array_equal(length, np.minimum(epochs, 301 - first))


def test_a_disturbance_lasts_so_many_seconds_where_epochs_are_missing():
    """12 s from any epoch on, of which a hole of 30 s after epoch 99 may swallow a part."""
    times = np.concatenate([np.arange(100.0), 130.0 + np.arange(100.0)])
    given = Disturbances(outage_share=1.0, outage_duration=(12.0, 12.0), multipath_share=0.0)
    first, length = stretches(~drawn(given, 300, timeline=Timeline(times, 1.0)).available)
    expected = [np.count_nonzero((times >= times[k]) & (times < times[k] + 11.5)) for k in first]
    np.testing.assert_array_equal(length, expected)
    assert set(np.unique(length)) >= {3, 7, 12}


def test_multipath_is_white_noise_of_its_sigma():
    """Chi-square with one degree per epoch, axis by axis; nothing outside the burst."""
    given = Disturbances(outage_share=0.0, multipath_share=1.0, multipath_sigma=(5.0, 5.0))
    confounders = drawn(given, 1000)
    assert confounders.noise.shape == (1000, 231, 3)
    assert not np.any(confounders.noise[~confounders.multipath])
    samples = confounders.noise[confounders.multipath] / 5.0
    low, high = stats.chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], len(samples))
    squares = np.sum(samples**2, axis=0)
    assert np.all((low < squares) & (squares < high))
    limit = np.tanh(stats.norm.isf(FALSE_FAILURE / 2) / np.sqrt(len(samples) - 3))
    assert np.abs(np.corrcoef(samples, rowvar=False)[np.triu_indices(3, 1)]).max() < limit
    even, odd = samples[: len(samples) // 2 * 2 : 2], samples[1::2]
    limit = np.tanh(stats.norm.isf(FALSE_FAILURE / 2) / np.sqrt(len(even) - 3))
    assert all(abs(np.corrcoef(even[:, axis], odd[:, axis])[0, 1]) < limit for axis in range(3))


def test_the_sigma_of_a_burst_is_uniform():
    """Over the noise that the same numbers make with 1 m; Dvoretzky-Kiefer-Wolfowitz, and correlations with place and
    length (normal with 1 / √n), false-failure probability 1e-8 each.
    """
    unit = Disturbances(outage_share=0.0, multipath_share=1.0, multipath_sigma=(1.0, 1.0))
    confounders, ones = drawn(BURSTS), drawn(unit).noise
    noise = confounders.noise
    sigma = np.linalg.norm(noise, axis=(1, 2)) / np.linalg.norm(ones, axis=(1, 2))
    np.testing.assert_allclose(noise, sigma[:, None, None] * ones, rtol=1e-12)
    band = np.sqrt(np.log(2.0 / FALSE_FAILURE) / (2.0 * RUNS))
    assert stats.kstest(sigma, stats.uniform(3.0, 5.0).cdf).statistic < band
    first, length = stretches(confounders.multipath)
    whole = first + 20 <= 231
    correlation = np.corrcoef([sigma[whole], first[whole], length[whole]])[np.triu_indices(3, 1)]
    assert np.abs(correlation).max() < stats.norm.isf(FALSE_FAILURE / 2) / np.sqrt(whole.sum())


def test_there_is_always_a_fix_at_epoch_0():
    given = Disturbances(outage_share=1.0, multipath_share=1.0)
    confounders = drawn(given, timeline=Timeline.steady(0.0, 1.0, 3))
    assert confounders.available[:, 0].all()
    assert not confounders.multipath[:, 0].any()
    assert not np.any(confounders.noise[:, 0])
    assert confounders.available[:, 1:].any(axis=0).tolist() == [True, True, False]


@pytest.mark.parametrize("given", [NONE, OUTAGES, BURSTS, Disturbances(), Disturbances(outage_duration=(1.0, 2.0))])
def test_an_episode_takes_the_same_block_of_draws_whatever_comes_of_it(given):
    """Eight uniform and 3 (K + 1) normal numbers, so that the stream then stands where it does for anyone else."""
    streams, other = RunStreams.from_seed(0, 3), RunStreams.from_seed(0, 3)
    confounders = Confounders(given)
    confounders.bind(TIMELINE, 3)
    confounders.reset(np.arange(3), streams)
    for run in range(3):
        other(run, "confounders").random(8)
        other(run, "confounders").standard_normal((231, 3))
        assert streams(run, "confounders").random() == other(run, "confounders").random()
        for purpose in ("initial", "imu", "receiver", "opponent", "memory"):
            assert streams(run, purpose).random() == other(run, purpose).random()


def test_run_i_is_the_same_for_any_number_of_runs():
    whole = drawn(Disturbances(outage_share=0.5, multipath_share=0.5), 40)
    for part, runs in ((drawn(whole.disturbances, 7), slice(0, 7)), (drawn(whole.disturbances, 1, 30), slice(30, 31))):
        np.testing.assert_array_equal(part.available, whole.available[runs])
        np.testing.assert_array_equal(part.multipath, whole.multipath[runs])
        np.testing.assert_array_equal(part.noise, whole.noise[runs])


def test_a_staggered_reset_draws_the_next_episode_of_that_run_alone():
    given = Disturbances(outage_share=0.5, multipath_share=0.5)
    streams = RunStreams.from_seed(0, 40)
    confounders = Confounders(given)
    confounders.bind(TIMELINE, 40)
    confounders.reset(np.arange(40), streams)
    available, noise = confounders.available.copy(), confounders.noise.copy()
    again = np.arange(39, 0, -2)
    confounders.reset(again, streams)
    np.testing.assert_array_equal(confounders.available[::2], available[::2])
    np.testing.assert_array_equal(confounders.noise[::2], noise[::2])
    for run in again:
        alone, lane = Confounders(given), RunStreams.from_seed(int(run), 1)
        alone.bind(TIMELINE, 1)
        for _ in range(2):
            alone.reset(np.array([0]), lane)
        np.testing.assert_array_equal(alone.available[0], confounders.available[run])
        np.testing.assert_array_equal(alone.multipath[0], confounders.multipath[run])
        np.testing.assert_array_equal(alone.noise[0], confounders.noise[run])
    # what an episode had is forgotten in the next
    assert np.any(~available[again].all(axis=1) & confounders.available[again].all(axis=1))


def simulation(disturbances, num_runs=12, fidelity="linear", detectors=()):
    """Clean runs of 40 s on the drive; None = without confounders, each run with a covariance of its own."""
    confounders = None if disturbances is None else Confounders(disturbances)
    playing = Simulation(
        make_scenario("foi-drive:horizon=40"),
        None,
        detectors,
        num_runs=num_runs,
        seed=5,
        fidelity=fidelity,
        demands=Demands(excludes=True),
        confounders=confounders,
    )
    playing.reset()
    return playing


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_a_fix_that_is_not_there_is_neither_seen_nor_used(fidelity):
    """The same as leaving it out by hand without confounders, and no offset of a spoofer matters in an outage."""
    playing = simulation(OUTAGES, fidelity=fidelity, detectors=[make_detector("snapshot")])
    by_hand = simulation(None, fidelity=fidelity)
    available = playing.confounders.available
    assert 0 < np.sum(~available[:, :40]) < available[:, :40].size
    everyone = np.ones(12, dtype=bool)
    for k in range(40):
        np.testing.assert_array_equal(playing.epoch.available, available[:, k])
        innovation, out = playing.epoch.innovation, ~available[:, k]
        for part in (innovation.residual, innovation.whitened, innovation.nis, playing.epoch.statistics["snapshot"]):
            assert not np.any(part[out])
            np.testing.assert_array_equal(part.reshape(12, -1).any(axis=1), available[:, k])
        np.testing.assert_array_equal(innovation.residual[~out], by_hand.epoch.innovation.residual[~out])
        assert not playing.alarm[out].any()
        playing.resolve(Decision(everyone) if k % 2 else None)
        by_hand.resolve(Decision(available[:, k]))
        np.testing.assert_array_equal(playing.used, available[:, k])
        np.testing.assert_array_equal(playing.error, by_hand.error)
        np.testing.assert_array_equal(playing.navigator.position_covariance, by_hand.navigator.position_covariance)
        playing.observe(np.where(available[:, k + 1], 0.0, 1e6)[:, None] * np.ones(3))
        by_hand.observe(np.zeros((12, 3)))


def test_a_reset_of_the_filter_needs_a_fix():
    """A decision to jump to the fix does nothing in an outage."""
    playing, by_hand = simulation(OUTAGES), simulation(None)
    for k in range(40):
        available = playing.confounders.available[:, k]
        playing.resolve(Decision(np.ones(12, dtype=bool), reset=np.where(available, 0.0, 25.0)))
        by_hand.resolve(Decision(available))
        np.testing.assert_array_equal(playing.error, by_hand.error)
        playing.observe()
        by_hand.observe()


def test_every_epoch_has_a_fix_without_confounders():
    playing = simulation(None, 3)
    for _ in range(3):
        assert playing.epoch.available.all()
        playing.resolve()
        playing.observe()


def test_multipath_is_added_to_the_fix():
    """z = p_INS - p_GNSS: minus the noise at the first epoch of the burst; the same innovations before it."""
    playing, clean = simulation(BURSTS, 40), simulation(NONE, 40)
    first = playing.confounders.multipath.argmax(axis=1)
    compared = 0
    for k in range(41):
        ours, theirs = (part.epoch.innovation.residual for part in (playing, clean))
        np.testing.assert_array_equal(ours[k < first], theirs[k < first])
        now = first == k
        compared += now.sum()
        np.testing.assert_allclose(ours[now] - theirs[now], -playing.confounders.noise[now, k], rtol=1e-12, atol=1e-9)
        if k < 40:
            for part in (playing, clean):
                part.resolve()
                part.observe()
    assert compared == 40


def test_a_staggered_reset_begins_with_a_fix():
    playing = simulation(OUTAGES)
    while playing.epoch.available.all():
        playing.resolve()
        playing.observe()
    out = np.flatnonzero(~playing.epoch.available)
    epoch = playing.reset(out)
    np.testing.assert_array_equal(epoch.index[out], 0)
    assert epoch.available.all()
    assert np.all(epoch.innovation.nis > 0.0)
    assert np.all(np.diff(playing.confounders.available[out].astype(int)).min(axis=1) == -1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"outage_share": 1.5}, r"outage_share must be .*from 0 to 1, got 1\.5"),
        ({"multipath_share": -0.1}, r"multipath_share must be .*, got -0\.1"),
        ({"outage_share": float("nan")}, "outage_share must be .*, got nan"),
        ({"outage_duration": (0.0, 10.0)}, r"outage_duration must be a finite number greater than 0, got 0\.0"),
        ({"multipath_duration": (20.0, 10.0)}, r"multipath_duration must be .*, got \(20\.0, 10\.0\)"),
        ({"multipath_sigma": (3.0, float("inf"))}, "multipath_sigma must be a finite number greater than 0, got inf"),
        ({"multipath_sigma": (3.0, float("nan"))}, "multipath_sigma must be a finite number greater than 0, got nan"),
    ],
)
def test_bad_disturbances_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Disturbances(**options)
