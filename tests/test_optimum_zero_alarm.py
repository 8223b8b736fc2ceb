"""The zero-alarm attack: linear programmes against closed forms, enumerated corners and another formulation."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from scipy.optimize import linprog

from spoofgym.optimum import LinearTest, ewma, expected_play, gate, window_mean, zero_alarm
from spoofgym.optimum.response import error_response, horizontal_unit, increment_maps
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.receiver import Receiver

ENSEMBLE = (
    *gate(3.91),
    *window_mean(10, 3.6),
    *window_mean(30, 3.58),
    *window_mean(60, 3.5),
    *ewma(0.02, 3.5),
    *ewma(0.05, 3.6),
    *ewma(0.1, 3.7),
)


@pytest.fixture(scope="module")
def flight():
    return make_scenario("liu-flight:imu=tactical,horizon=60")


@pytest.fixture(scope="module")
def model(flight):
    return flight.linear_model()


@pytest.fixture(scope="module")
def ensemble(model):
    return zero_alarm(model, ENSEMBLE)


def test_statistics_are_those_of_the_recursions():
    innovations = np.random.default_rng(0).normal(size=(40, 3))
    flat = innovations.reshape(-1)
    for axis, (mean, smooth) in enumerate(zip(window_mean(7, 1.0), ewma(0.2, 1.0), strict=True)):
        recursion, means, value = [], [], 0.0
        for k in range(40):
            value = 0.8 * value + 0.2 * innovations[k, axis]
            recursion.append(value / np.sqrt(0.2 / 1.8))
            means.append(np.sum(innovations[max(k - 6, 0) : k + 1, axis]) / np.sqrt(7))
        np.testing.assert_allclose(smooth.rows(40, 3) @ flat, recursion, atol=1e-10)
        np.testing.assert_allclose(mean.rows(40, 3) @ flat, means, atol=1e-12)
        np.testing.assert_array_equal(gate(1.0)[axis].rows(40, 3) @ flat, innovations[:, axis])


@pytest.mark.parametrize("test", [*gate(2.0), *window_mean(30, 2.0), *ewma(0.05, 2.0), *ewma(1.0, 2.0)])
def test_statistics_have_variance_one_when_their_memory_is_full(test):
    rows = test.rows(600, 3).toarray()
    assert np.sum(rows[-1] ** 2) == pytest.approx(1.0, abs=1e-9)


def test_against_a_gate_every_innovation_goes_to_its_limit(model):
    """In a direction d the largest error is share · limit · Σ |d' G_k|; the largest of all lies on a fine grid."""
    attack = zero_alarm(model, gate(4.0), share=0.25)
    azimuths = np.linspace(0.0, 180.0, 3600, endpoint=False)
    largest = np.abs(horizontal_unit(azimuths) @ error_response(model, 60).reshape(2, -1)).sum(axis=1).max()
    assert largest * (1.0 - 1e-4) <= attack.final_error <= largest / np.cos(np.radians(0.025))
    assert attack.final_error <= attack.bound <= attack.final_error * (1.0 + 1e-4)
    np.testing.assert_allclose(np.abs(attack.whitened[:, :2]), 1.0)
    np.testing.assert_array_equal(attack.binding["gate e"], np.arange(1, 61))


def corners(rows):
    """All corners of |rows · u| <= 1, by solving every choice of as many rows as unknowns."""
    found = []
    for chosen in combinations(range(len(rows)), rows.shape[1]):
        part = rows[list(chosen)]
        if abs(np.linalg.det(part)) > 1e-9:
            for signs in product((-1.0, 1.0), repeat=rows.shape[1]):
                corner = np.linalg.solve(part, signs)
                if np.all(np.abs(rows @ corner) <= 1.0 + 1e-9):
                    found.append(corner)
    return np.unique(np.round(found, 9), axis=0)


def test_three_epochs_agree_with_the_enumeration_of_all_corners():
    short = make_scenario("liu-flight:imu=tactical,horizon=3").linear_model()
    tests = [*gate(2.0), *window_mean(2, 1.3), *ewma(0.5, 1.5)]
    per_axis = np.vstack([test.rows(3, 3).toarray()[:, ::3] / test.limit for test in tests if test.name.endswith("e")])
    gain = error_response(short, 3)
    errors = [corners(per_axis) @ gain[:, :, axis].T for axis in range(3)]
    total = errors[0][:, None, None] + errors[1][None, :, None] + errors[2][None, None, :]
    attack = zero_alarm(short, tests, share=1.0)
    assert attack.final_error == pytest.approx(np.linalg.norm(total, axis=-1).max(), rel=1e-4)


def test_the_offsets_provoke_what_the_programme_planned(model, ensemble):
    played = expected_play(model, ensemble.offsets, 25.9)
    np.testing.assert_allclose(played.whitened, ensemble.whitened, atol=1e-8)
    assert np.hypot(*played.final_error) == pytest.approx(ensemble.final_error)
    assert np.degrees(np.arctan2(*played.final_error)) == pytest.approx(ensemble.azimuth)
    assert 0.0 <= ensemble.azimuth < 180.0


def test_no_test_exceeds_its_share_and_those_that_reach_it_are_named(model, ensemble):
    flat, reached = ensemble.whitened.reshape(-1), {}
    for test in ENSEMBLE:
        statistic = np.abs(test.rows(60, 3) @ flat) / (0.3 * test.limit)
        assert statistic.max() < 1.0 + 1e-6
        epochs = 1 + np.flatnonzero(statistic > 1.0 - 1e-7)
        if len(epochs):
            reached[test.name] = epochs.tolist()
    assert {name: epochs.tolist() for name, epochs in ensemble.binding.items()} == reached


def test_signed_memory_takes_most_of_what_a_gate_leaves(model, ensemble):
    """Field figures for one channel of this grade and 60 s: 38.6 m against the gate, 6.2 m against the ensemble."""
    ratio = zero_alarm(model, gate(3.91)).final_error / ensemble.final_error
    assert 4.0 < ratio < 9.0


def test_the_error_is_linear_in_the_share(model):
    one, two = (zero_alarm(model, window_mean(5, 3.5), share=share).final_error for share in (0.2, 0.4))
    assert two == pytest.approx(2.0 * one, rel=1e-4)


def test_a_rate_limit_binds_and_agrees_with_a_programme_of_increments(model):
    limit, tests = np.array([0.2, 0.4, 10.0]), [*gate(3.91), *window_mean(10, 3.6)]
    attack = zero_alarm(model, tests, drag_off_rate=limit)
    increments = np.diff(attack.offsets, axis=0, prepend=np.zeros((1, 3)))
    assert np.all(np.abs(increments) <= limit + 1e-6)
    assert "drag-off rate" in attack.binding
    assert attack.final_error < 0.9 * zero_alarm(model, tests).final_error
    innovations, error = increment_maps(model)
    rows = np.vstack([test.rows(60, 3) @ innovations / (0.3 * test.limit) for test in tests])
    step = np.tile(limit, 60)
    other = linprog(
        -horizontal_unit(np.array(attack.azimuth)) @ error,
        A_ub=np.vstack([rows, -rows]),
        b_ub=np.ones(2 * len(rows)),
        bounds=np.stack([-step, step], axis=1),
    )
    # in the direction of the error found, nothing else goes further than the tolerance of the search
    assert attack.final_error == pytest.approx(-other.fun, rel=2e-4)
    assert -other.fun <= attack.bound * (1.0 + 1e-9)


def test_a_rate_limit_that_is_never_reached_changes_nothing(model):
    tests = window_mean(5, 3.5)
    free, loose = zero_alarm(model, tests), zero_alarm(model, tests, drag_off_rate=1e4)
    assert loose.final_error == pytest.approx(free.final_error, rel=2e-4)
    assert "drag-off rate" not in loose.binding


def test_what_cannot_be_is_refused(flight, model):
    with pytest.raises(ValueError, match="needs at least one test"):
        zero_alarm(model, [])
    with pytest.raises(ValueError, match="do not bound the error"):
        zero_alarm(model, gate(3.0)[2:])
    with pytest.raises(ValueError, match=r"share must be a finite number greater than 0, got 0.0"):
        zero_alarm(model, gate(3.0), share=0.0)
    with pytest.raises(ValueError, match="drag_off_rate must be one positive number or three"):
        zero_alarm(model, gate(3.0), drag_off_rate=-1.0)
    with pytest.raises(ValueError, match="weights for m = 6, the fixes have m = 3"):
        zero_alarm(model, [LinearTest("six", np.ones((1, 6)), 3.0)])
    with pytest.raises(ValueError, match=r"limit must be a finite number greater than 0, got 0.0"):
        gate(0.0)
    with pytest.raises(ValueError, match=r"weights must be finite and of shape \(n, m\)"):
        LinearTest("flat", np.ones(3), 1.0)
    with pytest.raises(ValueError, match=r"weight must be at most 1, got 1.5"):
        ewma(1.5, 3.0)
    with pytest.raises(ValueError, match="n must be a whole number, 1 or more, got 0"):
        window_mean(0, 3.0)
    sigmas = (*flight.family.tuning.measurement_sigma, 0.1, 0.1, 0.1)
    receiver = Receiver(rate=1.0, white_sigma=sigmas[:3], velocity_sigma=sigmas[3:])
    six = flight.changed(receiver=receiver, tuning=replace(flight.family.tuning, measurement_sigma=sigmas))
    with pytest.raises(ValueError, match=r"a zero-alarm attack exists only for position fixes \(m = 3\).* m = 6"):
        zero_alarm(six.linear_model(), gate(3.0))
