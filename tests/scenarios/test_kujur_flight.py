"""Kujur's flight: place, speed and height as printed, and both couplings."""

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.kujur_flight import kujur_trajectory
from spoofgym.sensors.least_squares import projection
from spoofgym.simulation import Simulation

LOOSE = "kujur-flight:coupling=loose,horizon=20,onset=60"


def test_the_flight_is_the_papers():
    """41°50'10" N 87°37'30" W, 40,000 ft, 454 knots, straight and level."""
    flight = kujur_trajectory(30.0)
    np.testing.assert_allclose(np.degrees(flight.position[0, :2]), [41.836111, -87.625], atol=1e-6)
    np.testing.assert_allclose(flight.position[:, 2], 12_192.0, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(flight.velocity, axis=1), 454 * 0.514444, rtol=1e-5)


def test_default_is_tight_and_half_a_second():
    scenario = make_scenario("kujur-flight:horizon=20,onset=60")
    assert scenario.family.coupling == "tight"
    assert scenario.timeline.interval == 0.5
    assert scenario.dimension == 2 * scenario.slots


@pytest.mark.parametrize("coupling", ["loose", "tight"])
def test_alert_limits_are_those_of_the_approach(coupling):
    assert make_scenario(f"kujur-flight:horizon=20,onset=60,coupling={coupling}").alert_limits == (556.0, 50.0)


@pytest.mark.parametrize("coupling", ["loose", "tight"])
def test_alert_limits_may_be_others(coupling):
    scenario = make_scenario(f"kujur-flight:horizon=20,onset=60,coupling={coupling},vertical_alert_limit=35")
    assert scenario.alert_limits == (556.0, 35.0)
    assert "vertical_alert_limit=35" in scenario.name
    with pytest.raises(ValueError, match="horizontal_alert_limit must be a finite number greater than 0, got -1"):
        make_scenario("kujur-flight:horizontal_alert_limit=-1")


def test_loose_coupling_takes_fixes_from_the_same_sky():
    """R by hand: the variances of all errors of a range, from the elevations that the tight filter sees."""
    loose, tight = make_scenario(LOOSE), make_scenario("kujur-flight:horizon=20,onset=60")
    assert loose.name == LOOSE
    assert (loose.family.coupling, loose.dimension, loose.matched) == ("loose", 3, False)
    sky, epoch = tight.family.geometry, 119
    elevation, present = sky.elevation[epoch], sky.present[epoch]
    shell = 1.0 / np.sqrt(1.0 - (6378136.3 / 6728136.3 * np.cos(elevation)) ** 2)
    mapping = 1.001 / np.sqrt(0.002001 + np.sin(elevation) ** 2)
    own = 1.8**2 + (4.5 * shell) ** 2 + 5.0**2 + 0.36**2
    weight = present / (own + (0.09 * mapping) ** 2)
    to_fix = projection(sky.line_of_sight[[epoch]], present[None], weight[None])[0, :3]
    variance = np.sum(to_fix**2 * own, axis=1) + (to_fix @ (0.09 * mapping)) ** 2
    np.testing.assert_allclose(loose.family.tuning.measurement_sigma, np.sqrt(variance), rtol=1e-9)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_errors_of_the_loose_filter_have_the_joint_covariance(fidelity):
    """Before epoch 1 of 1500 (linear) and 300 runs: chi-square of three axes, 1e-8 each."""
    scenario, runs = make_scenario(LOOSE), {"linear": 1500, "strapdown": 300}[fidelity]
    later = make_scenario("kujur-flight:horizon=2,onset=60.5,coupling=loose")
    simulation = Simulation(scenario, num_runs=runs, seed=8, fidelity=fidelity)
    simulation.reset()
    simulation.resolve()
    # R differs by the turn of the sky in half a second
    here, there = (part.family.tuning.measurement_sigma for part in (scenario, later))
    np.testing.assert_allclose(there, here, rtol=1e-3)
    expected = np.diag(later.family.warm_start().joint_covariance)[6:9]
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], runs) / runs
    ratio = np.mean(simulation.error**2, axis=0) / expected
    assert np.all((0.99 * low < ratio) & (ratio < 1.01 * high))


def test_a_run_is_the_same_in_any_batch():
    scenario = make_scenario(LOOSE)
    errors = []
    for runs in (3, 1):
        simulation = Simulation(scenario, num_runs=runs, seed=5)
        simulation.reset()
        for _ in range(5):
            simulation.resolve()
            simulation.observe()
        errors.append(simulation.error[0])
    np.testing.assert_array_equal(*errors)


def test_the_hour_turns_the_sky():
    noon, midnight = (make_scenario(f"{LOOSE},hour={hour}").family.tuning.measurement_sigma for hour in (12, 0))
    assert np.abs(np.subtract(noon, midnight)).max() > 0.1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("coupling=deep", "kujur-flight: coupling must be one of loose, tight, got 'deep'"),
        ("imu=best", "unknown IMU grade 'best'"),
        ("horizon=0", "kujur-flight: horizon must be a whole number, 1 or more, got 0"),
        ("onset=-1", "kujur-flight: onset must be a finite number greater than 0"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(ValueError, match=message):
        make_scenario(f"kujur-flight:{options}")
