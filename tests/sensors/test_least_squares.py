"""Fixes from ranges and range rates, against SciPy, RTKLIB, finite differences and a real drive."""

import csv
import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize
from scipy.constants import speed_of_light

from spoofgym.geodesy import ecef_to_enu_rotation, geodetic_to_ecef, position_difference
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.ephemeris import read_csv
from spoofgym.sensors.geometry import lines_of_sight, received_states, view
from spoofgym.sensors.least_squares import fix, projection, velocity_fix

RECORDED = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw"
CHICAGO = np.array([math.radians(41.836), math.radians(-87.625), 12_192.0])
ANTIPODE = np.array([math.radians(-41.836), math.radians(92.375), 0.0])
TIME = np.arange(0.0, 40_000.0, 500.0)
GEOMETRY = view(gps_24(), CHICAGO, TIME)
CLOCK = 3.0e5 + 12.0 * TIME


def ranges(seed=0, noise=5.0):
    """Pseudoranges (E, S) whose sigmas differ, and the sigmas."""
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(0.5, 1.5, GEOMETRY.present.shape) * max(noise, 1.0)
    distance = np.linalg.norm(GEOMETRY.position - geodetic_to_ecef(CHICAGO), axis=2)
    error = noise and sigma * rng.standard_normal(sigma.shape)
    return np.where(GEOMETRY.present, distance + CLOCK[:, None] + error, 0.0), sigma


@pytest.mark.parametrize("start", [CHICAGO, ANTIPODE])
def test_exact_ranges_give_the_place_from_anywhere(start):
    measured, sigma = ranges(noise=0.0)
    found = fix(GEOMETRY.position, measured, GEOMETRY.present, sigma, start)
    assert found.solved.all()
    np.testing.assert_allclose(position_difference(found.position, CHICAGO), 0.0, atol=1e-6)
    np.testing.assert_allclose(found.clock, CLOCK, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-6)
    assert not found.residual[~GEOMETRY.present].any()


def test_the_fix_is_that_of_scipy():
    measured, sigma = ranges()
    found = fix(GEOMETRY.position, measured, GEOMETRY.present, sigma, CHICAGO)
    origin = geodetic_to_ecef(CHICAGO)
    for k in (0, 31, 79):
        seen = GEOMETRY.present[k]

        def misfit(state, k=k, seen=seen):
            distance = np.linalg.norm(GEOMETRY.position[k, seen] - origin - state[:3], axis=1)
            return (measured[k, seen] - distance - CLOCK[k] - state[3]) / sigma[k, seen]

        def jacobian(state, k=k, seen=seen):
            away = GEOMETRY.position[k, seen] - origin - state[:3]
            sight = away / np.linalg.norm(away, axis=1, keepdims=True)
            return np.column_stack([sight, -np.ones(len(sight))]) / sigma[k, seen, None]

        best = optimize.least_squares(misfit, np.zeros(4), jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        np.testing.assert_allclose(geodetic_to_ecef(found.position[k]), origin + best.x[:3], rtol=0.0, atol=1e-4)
        assert found.clock[k] - CLOCK[k] == pytest.approx(best.x[3], abs=1e-4)
        np.testing.assert_allclose(found.residual[k, seen], misfit(best.x) * sigma[k, seen], atol=1e-4)
        turn = np.eye(4)
        turn[:3, :3] = ecef_to_enu_rotation(found.position[k])
        covariance = turn @ np.linalg.inv(best.jac.T @ best.jac) @ turn.T
        np.testing.assert_allclose(found.covariance[k], covariance, rtol=1e-4, atol=1e-6 * np.trace(covariance))


def test_the_projection_is_that_of_rtklib():
    rtklib = pytest.importorskip("pyrtklib")
    sigma = ranges()[1]
    matrix = projection(GEOMETRY.line_of_sight, GEOMETRY.present, 1.0 / sigma**2)
    for k in (0, 31, 79):
        seen = np.flatnonzero(GEOMETRY.present[k])
        rows = np.column_stack([-GEOMETRY.line_of_sight[k, seen], np.ones(len(seen))]) / sigma[k, seen, None]
        design, wanted = rtklib.Arr1Ddouble(4 * len(seen)), rtklib.Arr1Ddouble(len(seen))
        solution, cofactors = rtklib.Arr1Ddouble(4), rtklib.Arr1Ddouble(16)
        for i, value in enumerate(rows.ravel()):
            design[i] = value
        error = np.random.default_rng(k).standard_normal(len(seen))
        for i, value in enumerate(error / sigma[k, seen]):
            wanted[i] = value
        assert rtklib.lsq(design, wanted, 4, len(seen), solution, cofactors) == 0
        np.testing.assert_allclose(matrix[k][:, seen] @ error, [solution[i] for i in range(4)], rtol=1e-9, atol=1e-12)
        assert not matrix[k][:, ~GEOMETRY.present[k]].any()


def test_an_error_of_a_range_moves_the_fix_by_the_projection():
    """The fix of 1 m longer and of 1 m shorter ranges; one satellite after the other."""
    measured, sigma = ranges(noise=0.0)
    matrix = projection(GEOMETRY.line_of_sight, GEOMETRY.present, 1.0 / sigma**2)
    for slot in range(GEOMETRY.num_slots):
        step = np.zeros(GEOMETRY.num_slots)
        step[slot] = 1.0
        longer, shorter = (
            fix(GEOMETRY.position, measured + sign * step, GEOMETRY.present, sigma, CHICAGO) for sign in (1.0, -1.0)
        )
        moved = 0.5 * position_difference(longer.position, shorter.position)
        np.testing.assert_allclose(moved, matrix[:, :3, slot], rtol=0.0, atol=1e-4)
        np.testing.assert_allclose(0.5 * (longer.clock - shorter.clock), matrix[:, 3, slot], rtol=0.0, atol=1e-4)


def test_a_common_error_is_one_of_the_clock_and_a_displacement_one_of_the_place():
    matrix = projection(GEOMETRY.line_of_sight, GEOMETRY.present, np.ones(GEOMETRY.present.shape))
    np.testing.assert_allclose(matrix.sum(axis=2), np.tile([0.0, 0.0, 0.0, 1.0], (len(TIME), 1)), atol=1e-12)
    offset = np.array([30.0, -20.0, 50.0])
    moved = np.einsum("eis,es->ei", matrix, -GEOMETRY.line_of_sight @ offset)
    np.testing.assert_allclose(moved, np.tile([*offset, 0.0], (len(TIME), 1)), atol=1e-10)


def test_exact_range_rates_give_the_velocity():
    velocity, drift = np.array([120.0, -190.0, 3.0]), 12.0
    receiver = np.broadcast_to(CHICAGO, (len(TIME), 3))
    sigma = ranges()[1]
    earth_fixed = np.einsum("eji,j->ei", ecef_to_enu_rotation(receiver), velocity)
    away = GEOMETRY.position - geodetic_to_ecef(receiver)[:, None]
    with np.errstate(invalid="ignore"):
        sight = away / np.linalg.norm(away, axis=2, keepdims=True)
    rate = np.sum(sight * (GEOMETRY.velocity - earth_fixed[:, None]), axis=2) + drift
    arguments = (GEOMETRY.position, GEOMETRY.velocity, rate, GEOMETRY.present, sigma, receiver)
    found = velocity_fix(*arguments)
    np.testing.assert_allclose(found.velocity, np.tile(velocity, (len(TIME), 1)), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.clock_drift, drift, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)
    # an error of a rate acts as one of a range does
    error = np.random.default_rng(2).standard_normal(rate.shape)
    pulled = velocity_fix(*arguments[:2], rate + error, *arguments[3:])
    matrix = projection(GEOMETRY.line_of_sight, GEOMETRY.present, 1.0 / sigma**2)
    expected = np.einsum("eis,es->ei", matrix, error)
    np.testing.assert_allclose(pulled.velocity - velocity, expected[:, :3], rtol=0.0, atol=1e-8)
    left = error - expected[:, 3:] + np.einsum("esi,ei->es", GEOMETRY.line_of_sight, expected[:, :3])
    np.testing.assert_allclose(pulled.residual, np.where(GEOMETRY.present, left, 0.0), rtol=0.0, atol=1e-8)


def test_a_receiver_at_rest_has_no_velocity():
    """Differences of the way of light over 1 s; the turn of the Earth alone would make 0.02 m/s and more."""
    receiver = np.broadcast_to(CHICAGO, (len(TIME), 3))
    origin = geodetic_to_ecef(CHICAGO)
    later, earlier = (received_states(gps_24(), receiver, TIME + h)[0] for h in (0.5, -0.5))
    rate = np.linalg.norm(later - origin, axis=2) - np.linalg.norm(earlier - origin, axis=2)
    position, velocity, _ = received_states(gps_24(), receiver, TIME)
    present = lines_of_sight(position, receiver)[..., 2] > 0.1
    found = velocity_fix(position, velocity, rate, present, np.ones(rate.shape), receiver)
    np.testing.assert_allclose(found.velocity, 0.0, atol=1e-4)


def test_an_epoch_does_not_depend_on_the_others():
    measured, sigma = ranges()
    rate = np.random.default_rng(3).uniform(-800.0, 800.0, sigma.shape)
    receiver = np.broadcast_to(CHICAGO, (len(TIME), 3))

    def solve(part):
        chosen = (values[part] for values in (GEOMETRY.position, measured, GEOMETRY.present, sigma))
        moving = (
            values[part] for values in (GEOMETRY.position, GEOMETRY.velocity, rate, GEOMETRY.present, sigma, receiver)
        )
        matrix = projection(GEOMETRY.line_of_sight[part], GEOMETRY.present[part], sigma[part])
        return [*vars(fix(*chosen, CHICAGO)).values(), *vars(velocity_fix(*moving)).values(), matrix]

    whole = solve(slice(None))
    for k in (0, 1, 40, 79):
        for every, one in zip(whole, solve(slice(k, k + 1)), strict=True):
            np.testing.assert_array_equal(every[k], one[0])


def test_without_a_fix_all_is_nan():
    measured, sigma = ranges()
    present = GEOMETRY.present.copy()
    present[5, np.flatnonzero(present[5])[3:]] = False
    present[6] = False
    nothing = np.where(present, measured, np.nan)
    found = fix(GEOMETRY.position, nothing, present, sigma, CHICAGO)
    moving = velocity_fix(
        GEOMETRY.position, GEOMETRY.velocity, nothing, present, sigma, np.broadcast_to(CHICAGO, (len(TIME), 3))
    )
    matrix = projection(GEOMETRY.line_of_sight, present, 1.0 / sigma**2)
    expected = ~np.isin(np.arange(len(TIME)), [5, 6])
    np.testing.assert_array_equal(found.solved, expected)
    np.testing.assert_array_equal(moving.solved, expected)
    for result in (found, moving):
        for name, values in vars(result).items():
            if name != "solved":
                assert np.isnan(values[~expected]).all(), name
                assert np.isfinite(values[expected]).all(), name
    assert np.isnan(matrix[~expected]).all()
    assert np.isfinite(matrix[expected]).all()


def test_refusals_name_the_value():
    measured, sigma = ranges()
    arguments = {
        "position": GEOMETRY.position,
        "pseudorange": measured,
        "present": GEOMETRY.present,
        "sigma": sigma,
        "start": CHICAGO,
    }
    with pytest.raises(ValueError, match=r"fix: sigma must be greater than 0 where a range is present, got 0\.0"):
        fix(**{**arguments, "sigma": np.zeros_like(sigma)})
    for name in ("position", "present", "sigma"):
        with pytest.raises(ValueError, match=f"fix: {name} must have the shape"):
            fix(**{**arguments, name: arguments[name][1:]})
    with pytest.raises(ValueError, match="projection: line_of_sight must have the shape"):
        projection(GEOMETRY.line_of_sight[1:], GEOMETRY.present, sigma)
    with pytest.raises(ValueError, match="velocity fix: velocity must have the shape"):
        velocity_fix(
            GEOMETRY.position,
            GEOMETRY.velocity[1:],
            measured,
            GEOMETRY.present,
            sigma,
            np.tile(CHICAGO, (len(TIME), 1)),
        )


def read_log(name):
    with gzip.open(RECORDED / name, "rt") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


@pytest.mark.skipif(not RECORDED.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_a_drive_through_a_city_is_where_the_phone_says():
    """The phone's own fixes as a reference: a horizontal median below 8 m, a median velocity error below 1 m/s."""
    ephemeris, log, phone = read_csv(RECORDED / "ephemeris.csv"), read_log("ranges.csv.gz"), read_log("gnss.csv.gz")
    times, epoch = np.unique(log["t_s"], return_inverse=True)
    known = np.isin(log["svid"], ephemeris.satellites)
    epoch, column = epoch[known], np.searchsorted(ephemeris.satellites, log["svid"][known])

    def spread(name, empty):
        table = np.full((len(times), len(ephemeris.satellites)), empty)
        table[epoch, column] = log[name][known]
        return table

    measured, rate, sigma = spread("pseudorange_m", 0.0), spread("range_rate_mps", 0.0), spread("pr_std_raw", -1.0)
    at = {name: np.interp(times, phone["t_s"], phone[name]) for name in phone}
    reference = np.column_stack([np.deg2rad(at["lat_deg"]), np.deg2rad(at["lon_deg"]), at["h_m"]])
    place, clock = np.tile(reference[0], (len(times), 1)), np.zeros(len(times))
    for _ in range(4):
        moment = times - clock / speed_of_light
        position, velocity, flight_time = received_states(ephemeris, place, moment)
        offset = ephemeris.clock(moment[:, None] - flight_time) - ephemeris.tgd
        troposphere = 2.4 / np.maximum(lines_of_sight(position, place)[..., 2], 0.1)
        found = fix(position, measured + speed_of_light * offset - troposphere, sigma > 0.0, sigma, reference[0])
        place = np.where(found.solved[:, None], found.position, place)
        clock = np.where(found.solved, found.clock, clock)
    moving = velocity_fix(position, velocity, rate, sigma > 0.0, np.ones(rate.shape), place)
    solved = found.solved
    assert solved.mean() > 0.95
    error = position_difference(found.position[solved], reference[solved])
    assert np.median(np.hypot(error[:, 0], error[:, 1])) < 8.0
    speed_error = moving.velocity[solved, :2] - np.column_stack([at["ve_mps"], at["vn_mps"]])[solved]
    assert np.median(np.hypot(*speed_error.T)) < 1.0
