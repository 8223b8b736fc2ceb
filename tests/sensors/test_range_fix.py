"""Noise of fixes made from ranges: against nonlinear least squares of raw pseudoranges, and its covariance."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.geodesy import position_difference
from spoofgym.scenarios.kujur_flight import kujur_trajectory
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.geometry import view
from spoofgym.sensors.least_squares import fix
from spoofgym.sensors.range_fix import RangeFix, draw_fix_noise, range_fix, range_fix_along
from spoofgym.sensors.ranging import KUJUR, LIU, RangeErrors, code_variance, draw_range_errors, pseudoranges

FALSE_FAILURE = 1e-9
EPOCHS = 60
PLACE = np.array([math.radians(41.8), math.radians(-87.6), 12_192.0])
CLOCK = RangeErrors(code_noise=0.0, clock_h0=KUJUR.clock_h0, clock_h2=KUJUR.clock_h2)


@pytest.fixture(scope="module")
def geometry():
    return view(gps_24(), PLACE, 0.5 * np.arange(1, EPOCHS + 1))


@pytest.fixture(scope="module")
def noise(geometry):
    return range_fix(KUJUR, geometry)


def solve(geometry, drawn):
    """Errors of nonlinear fixes, (E, 3), from raw pseudoranges, weighted as `range_fix` does it."""
    path, still = np.tile(PLACE, (EPOCHS, 1)), np.zeros((EPOCHS, 3))
    sigma = np.sqrt(code_variance(KUJUR, geometry.elevation))
    code = pseudoranges(geometry, path, still, drawn).code
    result = fix(geometry.position, code, geometry.present, sigma, PLACE)
    assert result.solved.all()
    return position_difference(result.position, PLACE)


@pytest.mark.parametrize("name", ["ephemeris_sigma", "ionosphere_sigma", "code_multipath_sigma", "troposphere_sigma"])
def test_each_state_does_to_the_fix_what_it_does_to_the_ranges(geometry, noise, name):
    """In raw pseudoranges with a clock that drifts; what is of second order stays below 0.1 mm."""
    slots = geometry.num_slots
    elevation = geometry.elevation[0]
    place, slant = {
        "ephemeris_sigma": (slice(0, slots), 1.0),
        "ionosphere_sigma": (
            slice(slots, 2 * slots),
            1.0 / np.sqrt(1.0 - (6378136.3 / 6728136.3 * np.cos(elevation)) ** 2),
        ),
        "code_multipath_sigma": (slice(2 * slots, 3 * slots), 1.0),
        "troposphere_sigma": (slice(3 * slots, 3 * slots + 1), 1.001 / np.sqrt(0.002001 + np.sin(elevation) ** 2)),
    }[name]
    errors = dataclasses.replace(CLOCK, **{name: getattr(KUJUR, name)})
    drawn = draw_range_errors(errors, geometry, np.random.default_rng(3), clock=(3e4, 100.0))
    states = (drawn.code[0] / slant)[: place.stop - place.start]
    expected = noise.mapping[0][:, place] @ states
    np.testing.assert_allclose(solve(geometry, drawn)[0], expected, atol=1e-4)
    assert np.abs(expected).max() > 0.01


def test_the_white_part_is_that_of_the_ranges(geometry, noise):
    drawn = draw_range_errors(RangeErrors(code_noise=0.36), geometry, np.random.default_rng(3))
    expected = np.einsum("eis,es->ei", noise.white, drawn.code / 0.36)
    np.testing.assert_allclose(solve(geometry, drawn), expected, atol=1e-4)


def test_raw_ranges_and_fix_noise_have_the_same_covariance(geometry, noise):
    """2000 runs each: variances at the last epoch, and of the change in 20 s; chi-square, 1e-9 each of twelve."""
    runs = 2000
    states = np.random.default_rng(0).standard_normal((runs, noise.num_states)) * noise.sigma
    from_fix = np.array([draw_fix_noise(noise, 0, EPOCHS, np.random.default_rng(i), states[i]) for i in range(runs)])
    projection = noise.white / KUJUR.code_noise
    raw = np.array([draw_range_errors(KUJUR, geometry, np.random.default_rng(i)).code for i in range(runs)])
    from_ranges = np.einsum("eis,nes->nei", projection, raw)
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], runs) / runs
    decayed = noise.mapping[-1] * noise.sigma * noise.decay**40
    first = noise.mapping[-41] * noise.sigma
    change = noise.covariance(EPOCHS - 1) + noise.covariance(EPOCHS - 41) - decayed @ first.T - first @ decayed.T
    for values in (from_fix, from_ranges):
        ratio = np.mean(values[:, -1] ** 2, axis=0) / np.diag(noise.covariance(EPOCHS - 1))
        assert np.all((low < ratio) & (ratio < high))
        ratio = np.mean((values[:, -1] - values[:, -41]) ** 2, axis=0) / np.diag(change)
        assert np.all((low < ratio) & (ratio < high))


def test_a_part_of_the_epochs_goes_on_where_the_former_ended(noise):
    """The same slow states, without white noise, whether drawn at once or in two parts."""
    calm = dataclasses.replace(noise, white=0.0 * noise.white, started=np.zeros_like(noise.started))
    still = dataclasses.replace(calm, decay=np.ones(noise.num_states))
    before = np.arange(noise.num_states, dtype=float)
    drawn = draw_fix_noise(still, 20, 30, np.random.default_rng(1), before)
    np.testing.assert_allclose(drawn, noise.mapping[20:30] @ before, rtol=1e-12)


def test_a_satellite_that_rises_begins_anew(noise):
    """Its states forget what they were, the others do not."""
    started = np.zeros_like(noise.started)
    started[5, :2] = True
    still = RangeFix(noise.sigma, np.ones(noise.num_states), started, noise.mapping, 0.0 * noise.white)
    runs = 4000
    drawn = np.array(
        [draw_fix_noise(still, 4, 6, np.random.default_rng(i), np.full(noise.num_states, 3.0)) for i in range(runs)]
    )
    kept = noise.mapping[:, :, 2:].sum(axis=2) * 3.0
    np.testing.assert_allclose(drawn[:, 0], np.tile(noise.mapping[4].sum(axis=1) * 3.0, (runs, 1)), rtol=1e-12)
    variance = np.sum((noise.mapping[5, :, :2] * noise.sigma[:2]) ** 2, axis=1)
    low, high = chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], runs) / runs
    ratio = np.mean((drawn[:, 1] - kept[5]) ** 2, axis=0) / variance
    assert np.all((low < ratio) & (ratio < high))


def test_equal_ranges_make_an_unweighted_fix(geometry):
    """Liu's ranges have one variance: the ordinary least-squares solution, by numpy's."""
    noise = range_fix(LIU, geometry)
    rows = np.concatenate([-geometry.line_of_sight[7], np.ones((geometry.num_slots, 1))], axis=1)
    errors = np.random.default_rng(0).standard_normal(geometry.num_slots)
    np.testing.assert_allclose(
        noise.mapping[7] @ errors, np.linalg.lstsq(rows, errors, rcond=None)[0][:3], rtol=1e-9, atol=1e-12
    )
    assert noise.num_states == geometry.num_slots


def test_errors_that_are_zero_leave_white_noise_alone(geometry):
    noise = range_fix(RangeErrors(code_noise=1.0), geometry)
    assert noise.num_states == 0
    drawn = draw_fix_noise(noise, 0, EPOCHS, np.random.default_rng(0), np.zeros(0))
    assert drawn.shape == (EPOCHS, 3)
    np.testing.assert_allclose(noise.covariance(3), noise.white_covariance(3), rtol=1e-12)


def test_epochs_along_a_trajectory_follow_the_receiver():
    """At 2 Hz from half a second on; other satellites six hours later."""
    trajectory = kujur_trajectory(20.0)
    early = range_fix_along(KUJUR, gps_24(), trajectory, 2.0)
    later = range_fix_along(KUJUR, gps_24(), trajectory, 2.0, start_time=6 * 3600.0)
    assert early.num_epochs == later.num_epochs == 40
    assert np.abs(early.mapping[0, :, :4] - later.mapping[0, :, :4]).max() > 0.1
    pair = view(gps_24(), trajectory.position[[1000, 1050]], np.array([10.0, 10.5]))
    np.testing.assert_allclose(early.mapping[19], range_fix(KUJUR, pair).mapping[0], rtol=1e-12, atol=1e-12)


def test_too_few_satellites_are_refused():
    few = view(gps_24(), PLACE, 0.5 * np.arange(1, 5), slots=3)
    with pytest.raises(ValueError, match=r"4 epochs have no fix, the first at 0\.5 s with 3 satellites in view"):
        range_fix(KUJUR, few)
