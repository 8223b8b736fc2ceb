"""False-failure probabilities of the random tests are below 1e-7 each."""

import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.studies.reproduce import shadmehri_2025
from spoofgym.studies.reproduce.papers import reproduce
from spoofgym.studies.reproduce.shadmehri_2025 import COMMON, SELF_TUNING, Flights, Setup, fly, statistic

UNLIKELY = 1e-8
RUNS = 40


def test_latency_is_that_of_the_first_epoch_above_the_threshold():
    spoofed = np.array([[1.0, 30.0, 2.0, 40.0], [1.0, 2.0, 3.0, 4.0]])
    flights = Flights(np.zeros((1, 1)), {3.0: spoofed}, np.array([0.1, 0.2, 0.3, 0.4]))
    np.testing.assert_array_equal(flights.latency(3.0, 25.9), [0.2, math.inf])
    np.testing.assert_array_equal(flights.latency(3.0, 35.0), [0.4, math.inf])


def test_a_matched_threshold_is_exceeded_in_one_of_a_hundred_clean_stretches():
    clean = np.random.default_rng(2).chisquare(3, (500, 203))
    flights = Flights(clean, {}, np.arange(1, 51) / 10.0)
    stretches = clean[:, 3:].reshape(2000, 50)
    assert np.count_nonzero((stretches > flights.matched_threshold()).any(axis=1)) == 20


@pytest.mark.parametrize("rate", [10, 160])
def test_the_common_filter_in_white_noise_has_three_degrees_of_freedom(rate):
    times, nis = statistic(Setup(COMMON, "white", rate), 0.0, 200, 3)
    assert times[-1] == pytest.approx(30.0)
    assert stats.kstest(nis[:, -1], stats.chi2(3).cdf).pvalue > UNLIKELY


def test_common_row_of_table_1_comes_out_at_160_hz_in_white_noise():
    """The median of all runs would lie on one side of the published value by chance with 2^-40."""
    for ramp, published in ((3.0, 3.41), (5.0, 1.91)):
        times, nis = statistic(Setup(COMMON, "white", 160), ramp, RUNS, 0)
        window = times > shadmehri_2025.ONSET
        spoofed = Flights(nis, {ramp: nis[:, window]}, times[window] - shadmehri_2025.ONSET)
        latency = spoofed.latency(ramp, 25.9)
        assert np.min(latency) < published < np.max(latency)
        assert np.mean(latency < 5.0) > 0.7


def test_self_tuning_filter_is_blind_in_white_noise_at_a_matched_rate():
    """Paired shares of 40 runs: 0.1 to 0.3 against 0.8 to 1; a binomial test on the discordant runs."""
    common, tuned = (fly(Setup(kind, "white", 10), RUNS, 0) for kind in (COMMON, SELF_TUNING))
    found = []
    for flights in (common, tuned):
        found.append(np.isfinite(flights.latency(5.0, flights.matched_threshold())))
    only_common, only_tuned = int(np.sum(found[0] & ~found[1])), int(np.sum(found[1] & ~found[0]))
    assert stats.binomtest(only_common, only_common + only_tuned, 0.5, alternative="greater").pvalue < 1e-3


def test_a_moving_sum_has_as_many_terms_as_there_are():
    found = shadmehri_2025.moving_sum(np.array([[1.0, 2.0, 4.0, 8.0]]), 3)
    np.testing.assert_array_equal(found, [[1.0, 3.0, 7.0, 14.0]])


def test_the_sum_of_statistics_is_what_the_windowed_detector_alarms_on():
    """The detector on a flight of its own, against the sums of the statistic that the rows take."""
    _, nis = statistic(Setup(COMMON, "markov", 10), 5.0, 3, 0)
    detector = make_detector("windowed:n=4,threshold=25.9")
    detector.bind(3, 3)
    detector.reset(np.arange(3))
    own = []
    for values in nis.T:
        innovation = Innovation(np.zeros((3, 3)), np.zeros((3, 3, 3)), np.zeros((3, 3)), values)
        own.append(detector.update(Epoch(np.zeros(3, dtype=np.int64), np.zeros(3), innovation)))
    np.testing.assert_allclose(np.array(own).T, shadmehri_2025.moving_sum(nis, 4), rtol=1e-12)


@pytest.mark.parametrize("noise", ["white", "markov"])
def test_the_self_tuning_filter_flies_at_160_hz(noise):
    times, nis = statistic(Setup(SELF_TUNING, noise, 160), 2.0, 2, 0)
    assert nis.shape == (2, len(times))
    assert np.isfinite(nis).all()


@pytest.fixture
def _flown_at_10_hz(monkeypatch):
    """Flights at 160 Hz, sixteen times as long, are those at 10 Hz with every epoch sixteen times."""

    def flown(setup, runs, seed):
        flights = fly(Setup(setup.filter, setup.noise, 10), runs, seed)
        if setup.rate == 10:
            return flights
        clean, *spoofed = (np.repeat(nis, 16, axis=1) for nis in (flights.clean, *flights.spoofed.values()))
        return Flights(clean, dict(zip(flights.spoofed, spoofed, strict=True)), np.arange(1, 801) / 160.0)

    monkeypatch.setattr(shadmehri_2025, "fly", flown)


@pytest.mark.usefixtures("_flown_at_10_hz")
def test_rows_have_every_setup_and_figures_of_the_paper():
    report = reproduce(shadmehri_2025.PAPER, 3, 0, quick=True)
    assert report.paper == "shadmehri-2025"
    titles = [group.title for group in report.groups]
    assert len(titles) == len(set(titles)) == 9
    named = [(row["group"], row["item"]) for row in report.as_json()["rows"]]
    assert len(set(named)) == len(named), "a row is told by its group and its item"
    printed = [row.paper_value for group in report.groups[:4] for row in group.rows]
    assert printed == ["never", 3.41, 1.91, 0.35, 0.22, 0.11] * 4
    costs = [row for row in report.rows if "share of clean runs that alarm within 5 s" in row.item]
    assert [row.paper_value for row in costs] == [5e-4] * 4, "1e-5 in each of 50 epochs"
    assert sum("false alarms per epoch" in row.item for row in report.rows) == len(shadmehri_2025.SETUPS)
    assert all(0.0 <= row.value <= 1.0 for row in report.groups[-1].rows)
