"""Entries of docs/results/errata.md that a short calculation decides."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.studies.reproduce.foi_azimuth import DEGREES, largest_offset
from spoofgym.studies.reproduce.foi_tables import ATTACKS

HEADINGS = np.radians(np.arange(0.0, 360.0, 45.0))


def time_constant(autocorrelation: list[float], interval: float) -> float:
    """Where an autocorrelation, interpolated between its lags, falls to 1/e, s."""
    lags = interval * np.arange(len(autocorrelation))
    return float(np.interp(-np.exp(-1.0), -np.array(autocorrelation), lags))


def test_shadmehri_the_threshold_belongs_to_one_epoch():
    assert stats.chi2.isf(1e-5, 3) == pytest.approx(25.9, abs=0.05)
    for terms in (2, 5, 10):
        mean_of = stats.chi2.isf(1e-5, 3 * terms) / terms
        assert mean_of < 20.0, "a mean of several has another quantile"


def test_kujur_a_time_constant_of_0_21_s_is_a_negative_correlation():
    """Two epochs a second: white noise has 0.32 s, and 0.21 s needs -0.5 from one epoch to the next."""
    assert time_constant([1.0, 0.0], 0.5) == pytest.approx(0.316, abs=1e-3)
    assert time_constant([1.0, -0.5], 0.5) == pytest.approx(0.21, abs=2e-3)


def test_foi_degrees_do_not_reach_the_printed_errors():
    for scenario, printed in ((3, 178.0), (4, 369.0)):
        reached = max(largest_offset(ATTACKS[scenario], DEGREES, heading) for heading in HEADINGS)
        assert reached < 0.7 * printed


def test_song_the_names_of_the_decision_rates_are_swapped():
    """FP / (FP + TN) with normal as positive: spoofed fixes that pass, of all spoofed ones."""
    spoofed = np.array([True, True, True, False, False])
    alarm = np.array([True, True, False, True, False])
    said_normal = ~alarm
    false_positive, true_negative = np.sum(said_normal & spoofed), np.sum(~said_normal & spoofed)
    assert false_positive / (false_positive + true_negative) == np.mean(~alarm[spoofed])
