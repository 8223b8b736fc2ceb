"""False-failure probabilities of the random tests are below 1e-7 each."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.matrix import detection_curve, detection_curves, exact_interval, matrix_report, matrix_rows
from spoofgym.evaluation.metrics import attacker_score
from spoofgym.evaluation.monte_carlo import NEVER, watch_attack
from spoofgym.scenarios import make_scenario

UNLIKELY = 1e-8
SCENARIO = "liu-flight:horizon=30"
DETECTORS = ("snapshot:threshold=12", "snapshot:threshold=20", "rio:threshold=9")


@pytest.fixture(scope="module")
def games():
    scenario = make_scenario(SCENARIO)
    detectors = [make_detector(name) for name in DETECTORS]
    return scenario, detectors, watch_attack(scenario, make_attack("ramp:0.8"), detectors, 300, 5)


def test_each_detector_sees_what_it_would_see_alone(games):
    scenario, _, watched = games
    for place, name in enumerate(DETECTORS):
        alone = watch_attack(scenario, make_attack("ramp:0.8"), [make_detector(name)], 300, 5).together()
        seen = watched.of(place)
        np.testing.assert_array_equal(seen.alarm_epoch, alone.alarm_epoch)
        np.testing.assert_array_equal(seen.final_error, alone.final_error)
        np.testing.assert_array_equal(seen.alarm_error[seen.detected], alone.alarm_error[alone.detected])


def test_together_the_first_alarm_of_any_counts(games):
    watched = games[2]
    together = watched.together()
    epochs = np.where(watched.alarm_epoch == NEVER, 10**6, watched.alarm_epoch).min(axis=0)
    np.testing.assert_array_equal(together.alarm_epoch, np.where(epochs == 10**6, NEVER, epochs))
    assert 0 < np.count_nonzero(together.detected) < 300 or together.detected.all()
    first = np.argmax(together.detected)
    holder = np.flatnonzero(watched.alarm_epoch[:, first] == together.alarm_epoch[first])[0]
    assert together.alarm_error[first] == watched.alarm_error[holder, first]


def test_a_peak_above_one_is_an_alarm(games):
    watched = games[2]
    np.testing.assert_array_equal(watched.peak > 1.0, watched.alarm_epoch != NEVER)


class Counting(Detector):
    """Its statistic is the epoch, so that it alarms from the first one on."""

    name, threshold = "counting", 0.5

    def update(self, epoch):
        return epoch.index.astype(float)


def test_delay_counts_from_the_onset_and_alarms_before_it_do_not_count():
    scenario = make_scenario(SCENARIO)
    late = watch_attack(scenario, make_attack("ramp:5,onset=812"), [Counting()], 10, 0)
    assert set(late.onset_epoch) == {12}
    assert set(late.alarm_epoch[0]) == {13}
    assert attacker_score(late.of(0)).median_time_to_detect == 1.0
    clean = watch_attack(scenario, make_attack("none"), [Counting()], 10, 0)
    assert set(clean.onset_epoch) == {0}
    assert set(clean.alarm_epoch[0]) == {1}
    assert late.peak[0, 0] == clean.peak[0, 0] == 60.0


def test_rows_have_the_figures_of_each_detector(games):
    _, detectors, watched = games
    rows = matrix_rows(detectors, "ramp:0.8", watched)
    assert [row["detector"] for row in rows] == list(DETECTORS)
    for place, row in enumerate(rows):
        assert set(row) == {
            "detector",
            "attack",
            "detection_probability",
            "ci95",
            "median_time_to_detect_s",
            "error_at_detection_m",
            "mean_undetected_error_m",
        }
        score = attacker_score(watched.of(place))
        assert row["attack"] == "ramp:0.8"
        assert row["detection_probability"] == score.detection_probability
        assert row["mean_undetected_error_m"] == score.mean_undetected_error
        assert row["ci95"][0] <= row["detection_probability"] <= row["ci95"][1]
    assert rows[0]["detection_probability"] > rows[1]["detection_probability"]


@pytest.mark.parametrize("trials", [1, 30, 5000])
def test_the_exact_interval_without_and_with_every_event(trials):
    """Closed form of Clopper and Pearson at the ends."""
    edge = 0.025 ** (1.0 / trials)
    assert exact_interval(0, trials) == pytest.approx([0.0, 1.0 - edge], abs=1e-12)
    assert exact_interval(trials, trials) == pytest.approx([edge, 1.0], abs=1e-12)


def test_the_curve_of_shifted_normal_peaks():
    """Detection at a false-alarm probability p is Φ(shift + Φ⁻¹(p)); both ends of the comparison are random."""
    rng, n, shift = np.random.default_rng(1), 40_000, 2.0
    points = detection_curve(rng.standard_normal(n), shift + rng.standard_normal(n))
    probabilities = [point["false_alarm_probability"] for point in points]
    assert probabilities == sorted(probabilities)
    assert points[0]["false_alarm_probability"] == pytest.approx(1.0 / n)
    for point in points:
        alarms = round(point["false_alarm_probability"] * n)
        low = stats.beta.ppf(UNLIKELY, alarms, n - alarms + 1)
        high = stats.beta.isf(UNLIKELY, alarms + 1, n - alarms)
        bounds = stats.norm.cdf(shift + stats.norm.ppf([low, high]))
        least = stats.binom.ppf(UNLIKELY, n, bounds[0]) / n
        most = stats.binom.isf(UNLIKELY, n, bounds[1]) / n
        assert least <= point["detection_probability"] <= most
        assert point["detection_ci95"][0] <= point["detection_probability"] <= point["detection_ci95"][1]


def test_a_statistic_that_clean_games_never_tell_apart_has_no_points():
    assert detection_curve(np.zeros(50), np.ones(50)) == []


def test_the_report_names_scenario_detectors_and_their_rate(games):
    scenario, detectors, watched = games
    clean = watch_attack(scenario, make_attack("none"), detectors, 300, 5)
    rows = matrix_rows(detectors, "none", clean) + matrix_rows(detectors, "ramp:0.8", watched)
    curves = detection_curves(detectors, clean, "ramp:0.8", watched)
    report = matrix_report(scenario, "linear", 100.0, 300, detectors, rows, curves)
    assert report["kind"] == "matrix"
    assert report["schema_version"] == 1
    assert report["scenario"] == scenario.name
    assert len(report["rows"]) == 6
    assert [item["name"] for item in report["detectors"]] == list(DETECTORS)
    assert report["detectors"][0]["arl0"] == pytest.approx(1.0 / stats.chi2(3).sf(12.0))
    assert {curve["attack"] for curve in curves} == {"ramp:0.8"}
