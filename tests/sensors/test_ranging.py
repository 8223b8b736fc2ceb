"""Errors of ranges: mappings against geometry, processes against closed forms, rates against derivatives."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2, norm

from spoofgym.scenarios.kujur_flight import START
from spoofgym.scenarios.liu_flight import liu_trajectory
from spoofgym.sensors import ranging
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.geometry import SatelliteGeometry, view
from spoofgym.sensors.ranging import (
    KUJUR,
    LIU,
    RangeErrors,
    clock_noise,
    code_variance,
    draw_clock,
    draw_range_errors,
    gauss_markov,
    obliquity,
    pseudoranges,
    troposphere_mapping,
)

FALSE_FAILURE = 1e-9
SPEED_OF_LIGHT = 299_792_458.0
CALM = RangeErrors(code_noise=0.0, carrier_noise=0.0, rate_noise=0.0)
ELEVATIONS = np.radians([5.0, 10.0, 30.0, 60.0, 90.0])


def sky(epochs, elevation, satellite=None, interval=0.5):
    """Satellites that stand still, one per slot."""
    slots = len(elevation)
    numbers = np.tile(np.arange(slots), (epochs, 1)) if satellite is None else satellite
    zero = np.zeros((epochs, slots, 3))
    still = np.where(numbers >= 0, np.broadcast_to(elevation, numbers.shape), 0.0)
    return SatelliteGeometry(interval * np.arange(epochs), numbers, zero, zero, zero, still, np.zeros_like(still))


def band(degrees):
    return chi2.ppf([FALSE_FAILURE / 2, 1 - FALSE_FAILURE / 2], degrees) / degrees


def fisher_band(pairs):
    """Of the correlation of independent pairs of uncorrelated normals."""
    return np.tanh(norm.isf(FALSE_FAILURE / 2) / np.sqrt(pairs - 3))


# ---- mappings


@pytest.mark.parametrize("elevation", ELEVATIONS)
def test_obliquity_is_the_way_through_a_thin_shell(elevation):
    """The ray from the receiver meets the shell at an angle to its normal, whose secant is the factor."""
    earth, height = ranging.EARTH_RADIUS, ranging.SHELL_HEIGHT
    ray = np.array([np.cos(elevation), np.sin(elevation)])
    half = earth * ray[1]
    way = -half + np.sqrt(half**2 + (earth + height) ** 2 - earth**2)
    pierce = np.array([0.0, earth]) + way * ray
    np.testing.assert_allclose(obliquity(elevation), np.linalg.norm(pierce) / (pierce @ ray), rtol=1e-12)


def test_mappings_have_the_published_values():
    """At the zenith 1; at 5 degrees the 10.2 of DO-229's mapping and the factor 3 of its obliquity."""
    np.testing.assert_allclose(troposphere_mapping(np.pi / 2), 1.0, atol=1e-6)
    np.testing.assert_allclose(troposphere_mapping(np.radians(5.0)), 10.218, atol=0.001)
    np.testing.assert_allclose(troposphere_mapping(np.radians(30.0)), 1.001 / math.sqrt(0.252001), rtol=1e-12)
    assert obliquity(np.pi / 2) == 1.0
    np.testing.assert_allclose(obliquity(np.radians(5.0)), 3.04, atol=0.01)


def geomagnetic_latitude(latitude: float, longitude: float) -> float:
    """By the dipole of the Klobuchar model, rad (IS-GPS-200, 20.3.3.5.2.5).

    Args:
        latitude: geodetic, rad.
        longitude: rad.
    """
    return latitude + 0.064 * math.pi * math.cos(longitude - 1.617 * math.pi)


def vertical_ionosphere_sigma(magnetic_latitude: float) -> float:
    """What the Klobuchar model leaves of the vertical delay, one sigma, m (DO-229, J.2.3).

    Args:
        magnetic_latitude: geomagnetic, rad.
    """
    degrees = abs(math.degrees(magnetic_latitude))
    if degrees <= 20.0:
        return 9.0
    return 4.5 if degrees <= 55.0 else 6.0


def test_ionosphere_over_chicago_is_that_of_middle_latitudes():
    """The dipole stands at 78.3 N, 291 E, so that geomagnetic latitude is highest there and 11.52 degrees more."""
    magnetic = geomagnetic_latitude(*START[:2])
    assert 52.0 < np.degrees(magnetic) < 54.0
    assert vertical_ionosphere_sigma(magnetic) == KUJUR.ionosphere_sigma
    pole = geomagnetic_latitude(0.3, np.radians(291.06))
    np.testing.assert_allclose(np.degrees(pole - 0.3), 0.064 * 180.0, rtol=1e-9)
    sigmas = [vertical_ionosphere_sigma(np.radians(d)) for d in (-60, -30, -20, 0, 20, 21, 55, 56)]
    assert sigmas == [6.0, 4.5, 9.0, 9.0, 9.0, 4.5, 4.5, 6.0]


# ---- clock


@pytest.mark.parametrize("interval", [0.5, 1.0, 30.0])
def test_clock_noise_is_the_integral_of_its_two_white_noises(interval):
    """Van Loan's matrix exponential for x' = y + white, y' = white."""
    h0, h2 = 2e-19, 2e-20
    flow = np.array([[0.0, 1.0], [0.0, 0.0]])
    density = np.diag([h0 / 2.0, 2.0 * np.pi**2 * h2])
    block = expm(np.block([[-flow, density], [np.zeros((2, 2)), flow.T]]) * interval)
    expected = block[2:, 2:].T @ block[:2, 2:] * SPEED_OF_LIGHT**2
    np.testing.assert_allclose(clock_noise(h0, h2, interval), expected, rtol=1e-9)


@pytest.mark.parametrize("interval", [0.1, 10.0])
def test_drawn_clock_has_the_allan_variance_of_its_coefficients(interval):
    """Of h0 / (2 τ) + 2 π² / 3 h₋₂ τ, from second differences of independent runs; chi-square, 1e-9 each."""
    rng, runs = np.random.default_rng(11), 20_000
    offset = np.array([draw_clock(KUJUR, interval, n, (7.0, 0.3))[:, 0] for n in rng.standard_normal((runs, 3, 2))])
    second = (offset[:, 2] - 2.0 * offset[:, 1] + offset[:, 0]) / SPEED_OF_LIGHT
    expected = KUJUR.clock_h0 / (2.0 * interval) + 2.0 * np.pi**2 / 3.0 * KUJUR.clock_h2 * interval
    low, high = band(runs)
    assert low < np.mean(second**2) / (2.0 * interval**2) / expected < high


def test_a_perfect_clock_drifts_as_it_began():
    clock = draw_clock(CALM, 0.5, np.ones((5, 2)), (3.0, 2.0))
    np.testing.assert_allclose(clock, np.column_stack([3.0 + np.arange(5), np.full(5, 2.0)]), rtol=1e-12)


# ---- processes

PROCESSES = {
    "ephemeris": ("code", {"ephemeris_sigma": 1.8, "ephemeris_time": 20.0}, 1.8, 20.0),
    "code multipath": ("code", {"code_multipath_sigma": 5.0, "code_multipath_time": 5.0}, 5.0, 5.0),
    "carrier multipath": ("carrier", {"carrier_multipath_sigma": 0.02, "carrier_multipath_time": 5.0}, 0.02, 5.0),
    "ionosphere": (
        "code",
        {"ionosphere_sigma": 4.5, "ionosphere_time": 9.0},
        4.5 / np.sqrt(1.0 - (6378136.3 * np.cos(0.5) / 6728136.3) ** 2),
        9.0,
    ),
}


@pytest.mark.parametrize("name", PROCESSES)
def test_processes_are_stationary_and_decay_exponentially(name):
    """5000 satellites; chi-square of values and of what a prediction leaves, Fisher's z; 1e-9 each of 12."""
    part, changes, sigma, time = PROCESSES[name]
    geometry = sky(41, np.full(5000, 0.5))
    drawn = draw_range_errors(dataclasses.replace(CALM, **changes), geometry, np.random.default_rng(2))
    values = getattr(drawn, part) / sigma
    low, high = band(5000)
    for epoch in (0, 1, 10, 40):
        assert low < np.mean(values[epoch] ** 2) < high
    for lag in (1, 4, 16, 40):
        decay = np.exp(-lag * 0.5 / time)
        left = (values[lag] - decay * values[0]) / np.sqrt(1.0 - decay**2)
        assert low < np.mean(left**2) < high
        assert abs(np.corrcoef(left, values[0])[0, 1]) < fisher_band(5000)


def test_white_noises_have_their_sigma_and_no_memory():
    """5000 satellites at two epochs; chi-square and Fisher's z, 1e-9 each of nine."""
    errors = dataclasses.replace(CALM, code_noise=0.36, carrier_noise=0.003, rate_noise=0.05)
    drawn = draw_range_errors(errors, sky(2, np.full(5000, 1.0)), np.random.default_rng(3))
    low, high = band(5000)
    for values, sigma in ((drawn.code, 0.36), (drawn.carrier, 0.003), (drawn.rate, 0.05)):
        assert np.all((low < np.mean((values / sigma) ** 2, axis=1)) & (np.mean((values / sigma) ** 2, axis=1) < high))
        assert abs(np.corrcoef(values)[0, 1]) < fisher_band(5000)


def test_the_ionosphere_advances_the_carrier_and_the_rest_delays_both():
    geometry = sky(30, ELEVATIONS)
    ionosphere = draw_range_errors(
        dataclasses.replace(CALM, ionosphere_sigma=4.5, ionosphere_time=9.0), geometry, np.random.default_rng(1)
    )
    np.testing.assert_array_equal(ionosphere.code, -ionosphere.carrier)
    assert np.abs(ionosphere.code).min() > 0.0
    changes = {"ephemeris_sigma": 1.8, "troposphere_sigma": 0.09, "troposphere_time": 50.0}
    common = draw_range_errors(dataclasses.replace(CALM, **changes), geometry, np.random.default_rng(1))
    np.testing.assert_array_equal(common.code, common.carrier)


def test_one_zenith_troposphere_for_all_satellites():
    """Its sigma over 2000 runs: chi-square, 1e-9."""
    errors, geometry = dataclasses.replace(CALM, troposphere_sigma=0.09, troposphere_time=50.0), sky(3, ELEVATIONS)
    zenith = np.empty(2000)
    for run in range(len(zenith)):
        drawn = draw_range_errors(errors, geometry, np.random.default_rng(run))
        scaled = drawn.code / troposphere_mapping(ELEVATIONS)
        np.testing.assert_allclose(scaled, scaled[:, :1] * np.ones(len(ELEVATIONS)), rtol=1e-12)
        zenith[run] = scaled[2, 0]
    low, high = band(len(zenith))
    assert low < np.mean((zenith / 0.09) ** 2) < high


def test_a_new_satellite_brings_new_errors_and_an_empty_slot_has_none():
    """4000 slots change their satellite at epoch 10, after five empty epochs in half of them; 1e-9 each of three."""
    slots = 4000
    number = np.tile(np.arange(slots), (20, 1))
    number[5:10, ::2] = -1
    number[10:] += slots
    errors = dataclasses.replace(CALM, ephemeris_sigma=2.0, ephemeris_time=1e6, ambiguity_sigma=10.0)
    geometry = sky(20, np.full(slots, 1.0), number)
    drawn = draw_range_errors(errors, geometry, np.random.default_rng(5))
    assert not drawn.code[5:10, ::2].any()
    assert not drawn.carrier[5:10, ::2].any()
    before, after = drawn.code[4], drawn.code[10]
    low, high = band(slots)
    assert low < np.mean((after / 2.0) ** 2) < high
    assert abs(np.corrcoef(before, after)[0, 1]) < fisher_band(slots)
    ambiguity = drawn.carrier - drawn.code
    np.testing.assert_allclose(ambiguity[:5], np.tile(ambiguity[0], (5, 1)), atol=1e-12)
    np.testing.assert_allclose(ambiguity[10:], np.tile(ambiguity[10], (10, 1)), atol=1e-12)
    assert abs(np.corrcoef(ambiguity[0], ambiguity[10])[0, 1]) < fisher_band(slots)


def test_code_variance_is_that_of_what_is_drawn():
    """4000 runs of five elevations, all errors at once; chi-square, 1e-9 each of ten."""
    for errors in (KUJUR, LIU):
        codes = np.array(
            [draw_range_errors(errors, sky(1, ELEVATIONS), np.random.default_rng(i)).code[0] for i in range(4000)]
        )
        low, high = band(len(codes))
        ratio = np.mean(codes**2, axis=0) / code_variance(errors, ELEVATIONS)
        assert np.all((low < ratio) & (ratio < high))


def test_the_value_before_carries_on():
    normals = np.random.default_rng(4).standard_normal((30, 3))
    sigma, decay, before = np.array([1.0, 2.0, 3.0]), np.array([0.9, 0.5, 1.0]), np.array([1.0, -2.0, 3.0])
    started = np.zeros((30, 3), dtype=bool)
    whole = gauss_markov(normals, sigma, decay, started, before)
    first = gauss_markov(normals[:12], sigma, decay, started[:12], before)
    rest = gauss_markov(normals[12:], sigma, decay, started[12:], first[-1])
    np.testing.assert_array_equal(np.vstack([first, rest]), whole)
    np.testing.assert_array_equal(whole[:, 2], np.full(30, 3.0))


def test_as_many_numbers_are_drawn_whatever_the_budget():
    used = []
    for errors in (CALM, KUJUR, LIU):
        rng = np.random.default_rng(0)
        draw_range_errors(errors, sky(7, ELEVATIONS), rng)
        used.append(rng.standard_normal())
    assert len(set(used)) == 1


# ---- measurements


@pytest.fixture(scope="module")
def flight():
    trajectory = liu_trajectory()
    samples = np.arange(80_000, 85_000, 10)  # level flight, 10 Hz
    geometry = view(gps_24(), trajectory.position[samples], samples / 100.0)
    return trajectory.position[samples], trajectory.velocity[samples], geometry


def test_the_rate_is_the_derivative_of_the_range(flight):
    """Differences of fourth order over 0.1 s; the receiver's share in the time of flight, 3e-6 of 150 m/s, is left."""
    position, velocity, geometry = flight
    drawn = draw_range_errors(CALM, geometry, np.random.default_rng(0), clock=(100.0, 30.0))
    measured = pseudoranges(geometry, position, velocity, drawn)
    code = measured.code
    slope = (8.0 * (code[3:-1] - code[1:-3]) - (code[4:] - code[:-4])) / (12.0 * 0.1)
    np.testing.assert_allclose(measured.rate[2:-2], slope, atol=1e-3)
    np.testing.assert_array_equal(measured.carrier, code)


def test_errors_and_clock_are_added_to_the_true_range(flight):
    position, velocity, geometry = flight
    clean = pseudoranges(geometry, position, velocity, draw_range_errors(CALM, geometry, np.random.default_rng(0)))
    drawn = draw_range_errors(KUJUR, geometry, np.random.default_rng(1), clock=(1e5, 50.0))
    measured = pseudoranges(geometry, position, velocity, drawn)
    offset, drift = drawn.clock[:, :1], drawn.clock[:, 1:]
    np.testing.assert_allclose(measured.code - clean.code, drawn.code + offset, atol=1e-7)
    np.testing.assert_allclose(measured.carrier - clean.carrier, drawn.carrier + offset, atol=1e-7)
    np.testing.assert_allclose(measured.rate - clean.rate, drawn.rate + drift, atol=1e-9)
    assert 2.0e7 < clean.code.min() < clean.code.max() < 2.7e7


def test_an_empty_slot_measures_nothing(flight):
    position, velocity, geometry = flight
    padded = view(gps_24(), position, geometry.time, slots=geometry.num_slots + 1)
    drawn = draw_range_errors(KUJUR, padded, np.random.default_rng(1), clock=(10.0, 1.0))
    for values in pseudoranges(padded, position, velocity, drawn):
        assert np.isfinite(values).all()
        assert not values[:, -1].any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"code_noise": -1.0}, "range errors: code_noise must be a finite number, 0 or more, got -1.0"),
        ({"ionosphere_sigma": math.nan}, "ionosphere_sigma must be a finite number, 0 or more, got nan"),
        ({"ephemeris_time": 0.0}, "ephemeris_time must be a finite number greater than 0, got 0.0"),
        ({"troposphere_time": -5.0}, "troposphere_time must be a finite number greater than 0, got -5.0"),
    ],
)
def test_bad_values_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(KUJUR, **changes)
