import numpy as np
import pytest

from spoofgym.evaluation.credibility import credibility, decision_rates, deterioration, deviation


def test_deviation_does_not_see_a_constant_error():
    error = np.array([[3.0, 5.0, 3.0, 5.0], [7.0, 7.0, 7.0, 7.0]])
    np.testing.assert_allclose(deviation(error), [1.0, 0.0])


def test_table_6_of_the_paper_follows_from_its_deviations():
    """Published σ and σ̃; γ and ζ as printed, within what the rounding of the former makes (0.005 in 0.53)."""
    clean, attacked = np.array([0.59, 0.53, 0.53, 0.54]), np.array([11.80, 10.65, 6.75, 0.81])
    gamma = deterioration(attacked, clean)
    np.testing.assert_allclose(gamma, [20.01, 20.16, 12.77, 1.49], rtol=0.01)
    np.testing.assert_allclose(credibility(gamma[0], gamma[1:]), [-0.0074, 0.3619, 0.9253], atol=0.012)


def test_rates_count_alarms_on_clean_and_spoofed_fixes():
    alarm = np.array([[True, False, False, False, True], [False, False, True, True, True]])
    rates = decision_rates(alarm, np.array([False, False, True, True, True]))
    np.testing.assert_allclose(rates.false_alarm, [0.5, 0.0])
    np.testing.assert_allclose(rates.missed, [2.0 / 3.0, 0.0])
    np.testing.assert_allclose(rates.accuracy, [0.4, 1.0])


def test_rates_without_any_fix_of_a_kind_are_zero():
    rates = decision_rates(np.ones((1, 3), dtype=bool), np.ones((1, 3), dtype=bool))
    assert (rates.false_alarm[0], rates.missed[0], rates.accuracy[0]) == pytest.approx((0.0, 0.0, 1.0))
