"""Noises that are known are found again, within the interval that is stated; bounds are told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2, multivariate_normal

from spoofgym.evaluation.noise.estimate import Estimate, clean_stretch, estimate_noise, estimate_on, log_of_fixes
from spoofgym.evaluation.noise.innovations import Innovations, believing, innovations, until
from spoofgym.evaluation.noise.parameters import MOST, Parameter, first_guess, noise_of, parameters
from spoofgym.evaluation.noise.scoring import minus_log_likelihood, slope_and_information
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from tests.logs.known_noise import TRUE, write

CHANCE = 1e-7


def test_known_noises_are_recovered(known: Scenario, estimate: Estimate) -> None:
    """Twice the likelihood over that of the truth is chi-square of 13 degrees (Wilks): inside with 1 - 2e-7.

    Of 13 nearly normal variables none is beyond 7 standard errors; the intervals are short enough to tell.
    """
    assert estimate.converged
    truth = np.array([each.of(TRUE) for each in estimate.asked])
    free = np.isfinite(estimate.error)
    assert len(truth) == 13
    assert np.median(estimate.error[free]) < 0.3
    off = (np.log(estimate.value) - np.log(truth))[free] / estimate.error[free]
    assert np.abs(off).max() < 7.0
    log = log_of_fixes(known)
    stretch = clean_stretch(log)
    found = innovations(believing(log, TRUE))
    assert found is not None
    at_truth = minus_log_likelihood(Innovations(*(values[stretch] for values in vars(found).values())))
    before = innovations(believing(log, None))
    assert before is not None
    at_start = minus_log_likelihood(Innovations(*(values[stretch] for values in vars(before).values())))
    gained = 2.0 * (estimate.gain - (at_start - at_truth))
    assert 0.0 < gained < chi2.isf(CHANCE, 13)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:reference. the fixes lie")  # the slow error of some drives
def test_intervals_hold_what_they_say(tmp_path: Path) -> None:
    """95 % of the intervals of six drives hold the truth; of 78, fewer than 61 do so with a probability of 1e-7."""
    held, all_of = 0, 0
    for seed in range(20, 26):
        found = estimate_noise(make_scenario(f"recorded:{write(tmp_path / str(seed), seed)}"))
        truth = np.array([each.of(TRUE) for each in found.asked])
        free = np.isfinite(found.error)
        off = (np.log(found.value) - np.log(truth))[free] / found.error[free]
        held, all_of = held + int(np.sum(np.abs(off) < 1.96)), all_of + len(off)
    assert all_of > 70
    assert held >= binom.ppf(CHANCE, all_of, 0.95)


def test_the_filter_that_believes_them_is_consistent(known: Scenario, estimate: Estimate) -> None:
    """Σ NIS of the true noises is chi-square of 6 n degrees; that of the estimate hardly differs."""
    log = log_of_fixes(known)
    stretch = clean_stretch(log)
    for noise in (TRUE, estimate.noise):
        found = innovations(believing(log, noise))
        assert found is not None
        nis = found.nis[stretch]
        low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], 6 * len(nis))
        assert low < nis.sum() < high
    cautious = innovations(believing(log, None))
    assert cautious is not None
    assert cautious.nis[stretch].sum() < low  # what the estimate is for


def test_the_likelihood_is_that_of_normal_innovations(known: Scenario, estimate: Estimate) -> None:
    log = log_of_fixes(known)
    stretch = clean_stretch(log)

    def likelihood(noise) -> float:
        found = innovations(until(believing(log, noise), stretch.stop))
        assert found is not None
        return sum(
            multivariate_normal(np.zeros(6), found.covariance[k]).logpdf(found.residual[k])
            for k in range(stretch.start, stretch.stop)
        )

    assert likelihood(estimate.noise) - likelihood(None) == pytest.approx(estimate.gain, abs=1e-6)


def test_slope_and_information(known: Scenario, estimate: Estimate) -> None:
    """The slope against central differences; at the maximum it is zero within what the tolerance allows."""
    log = log_of_fixes(known)
    stretch, asked = clean_stretch(log), list(estimate.asked)

    def run(logarithms: np.ndarray) -> Innovations | None:
        found = innovations(until(believing(log, noise_of(log, asked, logarithms)), stretch.stop))
        assert found is not None
        return Innovations(*(values[stretch] for values in vars(found).values()))

    at = np.log(estimate.value) + 0.1
    here = run(at)
    assert here is not None
    slope, information = slope_and_information(run, at, here)
    steps = 1e-3 * np.eye(len(at))
    central = [(minus_log_likelihood(run(at + d)) - minus_log_likelihood(run(at - d))) / 2e-3 for d in steps]
    np.testing.assert_allclose(slope, central, rtol=2e-3, atol=2e-3 * np.abs(central).max())
    assert np.linalg.eigvalsh(information).min() > -1e-6 * np.trace(information)
    np.testing.assert_array_equal(information, information.T)
    best = run(np.log(estimate.value))
    assert best is not None
    slope, information = slope_and_information(run, np.log(estimate.value), best)
    free = np.isfinite(estimate.error)
    assert slope[free] @ np.linalg.solve(information[np.ix_(free, free)], slope[free]) < 0.02  # twice what is promised


def test_bounds_are_told(known: Scenario) -> None:
    """A grade that is much too bad, or much too good: its data sheet is the least noise, 1000 times that the most."""
    log = log_of_fixes(known)
    coarse = replace(log.grade, gyro_random_walk=60.0, name="coarse")
    stretch = clean_stretch(log, end=100.0)
    found = estimate_on(replace(log, grade=coarse), stretch)
    gyro = found.asked.index(next(each for each in found.asked if each.field == "gyro_noise"))
    assert found.bound[gyro] == "least"
    assert np.isnan(found.error[gyro])
    assert found.value[gyro] == pytest.approx(coarse.noise_density[0], rel=0.02)
    assert found.asked[gyro].most == pytest.approx(MOST * coarse.noise_density[0])


def test_what_is_estimated_depends_on_the_log(known_log: Path, known: Scenario) -> None:
    log = log_of_fixes(known)
    everything = slice(0, len(log.epoch_time))
    names = [each.field for each in parameters(log, everything)]
    assert names.count("velocity_scale") == 3
    assert "position_floor" not in names  # the stated sigmas do not vary
    positions = log_of_fixes(make_scenario(f"recorded:{known_log},velocity=false"))
    assert "velocity_scale" not in [each.field for each in parameters(positions, everything)]
    steady = replace(log, grade=replace(log.grade, gyro_instability=0.0, name="steady"))
    assert "gyro_walk" not in [each.field for each in parameters(steady, everything)]
    varied = replace(log, log=replace(log.log, fixes=_varied(log.log.fixes)))
    assert [each.field for each in parameters(varied, everything)].count("position_floor") == 3


def _varied(fixes):
    factor = np.where(np.arange(len(fixes.time)) % 2, 5.0, 1.0)
    return replace(fixes, position_sigma=fixes.position_sigma * factor[:, None])


def test_the_search_begins_at_what_the_filter_believes(known: Scenario) -> None:
    log = log_of_fixes(known)
    asked = [Parameter("gyro_noise", None, 1e-9, 1.0), Parameter("position_scale", 1, 0.02, 50.0)]
    np.testing.assert_allclose(np.exp(first_guess(log, asked)), [np.sqrt(log.model.filter_density[0]), 1.0])
    np.testing.assert_array_equal(
        innovations(believing(log, None)).nis,  # type: ignore[union-attr]
        log.clean.nis,
    )


def test_what_cannot_be_estimated_is_refused(known: Scenario) -> None:
    with pytest.raises(ValueError, match="a stretch needs 60 fixes, there are 11 between 50 s and 60 s"):
        estimate_noise(known, 50.0, 60.0)
    with pytest.raises(ValueError, match="is no recorded log"):
        estimate_noise(make_scenario("foi-drive"))
