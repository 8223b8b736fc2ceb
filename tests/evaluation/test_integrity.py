import numpy as np
import pytest
from scipy import stats

from spoofgym.evaluation.integrity import Proportion, integrity, integrity_failure

LIMIT = 10.0


def silent(values):
    return np.zeros(np.shape(values), dtype=bool)


def test_runs_of_every_kind_are_counted():
    """Eight runs: nominal, misled, hazardously misled, too wide a level, the two together, and three with an alarm."""
    level = np.full((8, 4), 5.0)
    error = np.ones((8, 4))
    alarm = silent(error)
    error[1, 2] = -6.0
    error[2, 1] = 11.0
    level[3, 3] = 11.0
    level[4, 1:], error[4, 3] = 11.0, 12.0
    error[5, 2:], alarm[5, 2:] = 20.0, True
    error[6, 1:], alarm[6, 2:] = 20.0, True
    level[7], alarm[7, 0] = 11.0, True
    found = integrity(error, level, LIMIT, alarm)
    assert found.failed == Proportion(3, 8)  # 2, 4 and 6
    assert found.misled == Proportion(4, 8)  # 1, 2, 4 and 6
    assert found.hazardously_misled == Proportion(2, 8)  # 2 and 6
    assert found.continuous == Proportion(3, 7)  # 0, 1 and 2 of all but 7
    assert found.availability == pytest.approx(1.0 - (1 + 3 + 4) / 32)
    assert found.alarmed == 5
    np.testing.assert_array_equal(found.diagram.regions, [17, 1, 2, 7])
    assert found.diagram.regions.sum() + found.alarmed == error.size
    assert found.diagram.unavailable_misleading == 1
    # an alarm one epoch later comes in time
    assert integrity(error, level, LIMIT, alarm, time_to_alert=1).failed == Proportion(1, 8)


@pytest.mark.parametrize(
    ("alarms", "delay", "failures"),
    [
        ([], 0, [2, 3, 4, 5]),
        ([], 2, [2, 3]),  # at the end the time is not over
        ([], 9, []),
        ([4], 0, [2, 3, 5]),
        ([4], 1, [2]),
        ([4], 2, []),
        ([5], 2, [2]),
        ([5], 3, []),
        ([2], 1, [3, 4]),  # an alarm that does not last does not count for later epochs
        ([1], 0, [2, 3, 4, 5]),
    ],
)
def test_the_time_to_alert(alarms, delay, failures):
    error = np.array([[0.0, 10.0, 11.0, -11.0, 11.0, 11.0]])
    alarm = silent(error)
    alarm[0, alarms] = True
    np.testing.assert_array_equal(np.flatnonzero(integrity_failure(error, LIMIT, alarm, delay)[0]), failures)


def test_a_protection_level_of_so_many_deviations_is_exceeded_as_often_as_it_says():
    """One epoch a run, normal error, 40000 runs: the counts are binomial; each fails by chance once in 1e8."""
    runs = 40_000
    error = 3.0 * np.random.default_rng(0).standard_normal((runs, 1))
    found = integrity(error, np.full((runs, 1), 6.0), 9.0, silent(error))
    for proportion, deviations in ((found.misled, 2.0), (found.hazardously_misled, 3.0), (found.failed, 3.0)):
        assert stats.binomtest(proportion.events, runs, 2.0 * stats.norm.sf(deviations)).pvalue > 1e-8
    assert found.continuous == Proportion(runs, runs)
    assert (found.availability, found.availability_interval) == (1.0, (1.0, 1.0))


def test_intervals_are_exact():
    """Clopper and Pearson by the beta distribution, and in closed form where nothing was seen."""
    low, high = Proportion(3, 50).interval
    assert low == pytest.approx(stats.beta.ppf(0.025, 3, 48))
    assert high == pytest.approx(stats.beta.ppf(0.975, 4, 47))
    assert Proportion(0, 50).interval == pytest.approx((0.0, 1.0 - 0.025 ** (1.0 / 50.0)))


def test_availability_has_the_interval_of_independent_runs():
    level = np.full((4, 10), 5.0)
    level[0] = np.inf
    found = integrity(np.zeros((4, 10)), level, LIMIT, silent(level))
    assert found.availability == pytest.approx(0.75)
    half = stats.norm.ppf(0.975) * np.std([0.0, 1.0, 1.0, 1.0], ddof=1) / 2.0
    assert found.availability_interval == pytest.approx((0.75 - half, 0.75 + half))


def test_the_table():
    level = np.full((2, 3), 5.0)
    error = np.array([[1.0, 2.0, 12.0], [1.0, 7.0, 1.0]])
    lines = integrity(error, level, LIMIT, silent(error), time_to_alert=1).text().splitlines()
    assert lines[0] == "2 runs, alert limit 10 m, time to alert 1 epochs"
    assert lines[1] == "integrity failure                0 of 2 runs  [0, 0.842]"
    assert lines[2] == "misleading information           1 of 2 runs  [0.158, 1]"
    assert lines[3] == "hazardously misleading         0.5 of 2 runs  [0.0126, 0.987]"
    assert lines[4] == "continuous                       1 of 2 runs  [0.158, 1]"
    assert lines[5] == "available                        1 of epochs  [1, 1]"
    assert lines[6] == (
        "epochs                  nominal 4, misleading 1, hazardously misleading 1, unavailable 0, alarm 0"
    )
    never = integrity(error, np.full((2, 3), np.inf), LIMIT, silent(error))
    assert never.continuous is None
    assert never.text().splitlines()[4] == "continuous              no run begins with the service"


def test_alarms_may_be_numbers_or_lists():
    error, alarm = np.full((2, 3), 2.0 * LIMIT), [[0, 1, 1], [0, 0, 0]]
    expected = integrity(error, np.ones_like(error), LIMIT, np.array(alarm, dtype=bool))
    for given in (alarm, np.array(alarm)):
        result = integrity(error, np.ones_like(error), LIMIT, given)
        assert (result.failed, result.misled, result.alarmed) == (expected.failed, expected.misled, expected.alarmed)


@pytest.mark.parametrize(
    ("error", "alarm", "delay", "message"),
    [
        (np.ones(3), silent(np.ones(3)), 0, r"error and alarm must be \(N, K\), got \(3,\) and \(3,\)"),
        (np.ones((2, 3)), silent(np.ones((3, 2))), 0, r"got \(2, 3\) and \(3, 2\)"),
        (np.ones((2, 3)), silent(np.ones((2, 3))), -1, "time_to_alert must be a whole number, 0 or more, got -1"),
    ],
)
def test_bad_values_are_refused(error, alarm, delay, message):
    with pytest.raises(ValueError, match=message):
        integrity(error, np.ones_like(error), LIMIT, alarm, delay)
