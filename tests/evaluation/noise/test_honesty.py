"""Blind figures of a filter: each against a closed form, a Monte Carlo, or a filter whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2

from spoofgym.evaluation.noise.estimate import Estimate, clean_stretch, log_of_fixes
from spoofgym.evaluation.noise.honesty import EXPECTED, _jump_seen, _poisson, _whiteness, honesty, slow_variance
from spoofgym.evaluation.noise.report import blind_reports, estimate_report
from spoofgym.scenario import Scenario
from tests.logs.known_noise import TRUE

CHANCE = 1e-7


def test_expected_shares() -> None:
    np.testing.assert_allclose(EXPECTED, [0.6827, 0.9545, 0.9973], atol=5e-5)


def test_white_innovations_pass_and_coloured_ones_do_not() -> None:
    generator = np.random.default_rng(1)
    white = generator.standard_normal((400, 3))
    coloured = white.copy()
    for k in range(1, 400):
        coloured[k] = 0.5 * coloured[k - 1] + white[k]
    correlations, p_values = _whiteness(white)
    assert np.abs(correlations).max() < 5.5 / np.sqrt(400)  # 3 normal variables: 1e-7
    assert min(p_values) > 1e-7
    correlations, p_values = _whiteness(coloured)
    np.testing.assert_allclose(correlations, 0.5, atol=0.25)
    assert max(p_values) < 1e-6


def test_the_jump_that_is_seen_half_the_time() -> None:
    generator = np.random.default_rng(2)
    root = generator.standard_normal((3, 3)) + 3.0 * np.eye(3)
    covariance = root @ root.T
    jump = _jump_seen(np.array([covariance]), np.array([3]))
    horizontal = []
    for axis in (0, 1):
        shift = np.eye(3)[axis] * np.sqrt(_needed() / np.linalg.inv(covariance)[axis, axis])
        horizontal.append(shift[axis])
        draws = generator.standard_normal((20_000, 3)) @ root.T + shift
        nis = np.einsum("ka,ab,kb->k", draws, np.linalg.inv(covariance), draws)
        seen = int(np.sum(nis > chi2.isf(1e-5, 3)))
        assert binom.ppf(CHANCE, 20_000, 0.5) < seen < binom.isf(CHANCE, 20_000, 0.5)
    assert jump == pytest.approx(np.median(horizontal))


def _needed() -> float:
    """Noncentrality with which the test at 1e-5 of three numbers alarms half the time."""
    unit = _jump_seen(np.eye(3)[None], np.array([3]))
    return unit**2


def test_interval_of_a_count() -> None:
    assert _poisson(0, 0.025) == 0.0
    assert _poisson(0, 0.975) == pytest.approx(-np.log(0.025))
    assert _poisson(10, 0.025) == pytest.approx(4.795, abs=1e-3)  # Garwood 1936
    assert _poisson(10, 0.975) == pytest.approx(18.39, abs=1e-2)


def test_the_slow_error_is_what_innovations_do_not_show(known: Scenario) -> None:
    """The log states 1 m; the white part is 0.4, 0.4 and 0.7 m. Without an estimate all of it counts as white."""
    log = log_of_fixes(known)
    np.testing.assert_allclose(slow_variance(log, TRUE)[5], [0.84, 0.84, 0.51])
    np.testing.assert_allclose(slow_variance(log, None), 0.0)


def test_figures_of_a_drive(known: Scenario, estimate: Estimate) -> None:
    log = log_of_fixes(known)
    stretch = clean_stretch(log)
    before, after = (honesty(log, noise, stretch) for noise in (None, estimate.noise))
    assert before["epochs"] == after["epochs"] == stretch.stop - stretch.start
    assert before["nis_per_degree"] < 0.8 < after["nis_per_degree"] < 1.2
    assert after["jump_seen_m"] < before["jump_seen_m"]
    assert [row["p_fa"] for row in after["false_alarms"]] == [1e-3, 1e-5]
    expected = after["false_alarms"][0]["expected_per_hour"]
    assert expected == pytest.approx(3.6, rel=0.02)  # a fix a second
    for axes in ("horizontal", "up"):
        alone, whole = after["coverage"][axes]["filter"], after["coverage"][axes]["whole"]
        assert alone == sorted(alone)
        assert all(a <= b for a, b in zip(alone, whole, strict=True))


def test_reports(known: Scenario, estimate: Estimate) -> None:
    log = log_of_fixes(known)
    rows = estimate_report(log, estimate)["noises"]
    assert [row["name"] for row in rows][:2] == ["gyro noise", "accelerometer noise"]
    for row in rows:
        assert (row["interval"] is None) == (row["note"] in ("least", "most"))
    (report,) = blind_reports([known], known)
    assert [row["noise"] for row in report["rows"]] == ["as it is", "known"]
    assert report["rows"][1]["nis_per_degree"] == pytest.approx(
        honesty(log, estimate.noise, clean_stretch(log))["nis_per_degree"], rel=1e-9
    )
