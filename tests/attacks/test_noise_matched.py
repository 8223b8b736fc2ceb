"""Noise-matched attacks: what they provoke in the filter, and whom they refuse."""

from dataclasses import fields, replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation

SHORT = "liu-flight:horizon=20"


def innovations(attack, scenario=SHORT, seed=3):
    """Residuals and whitened innovations of one run, epoch by epoch, (K, 3) each."""
    simulation = Simulation(make_scenario(scenario), make_attack(attack), seed=seed)
    simulation.reset()
    residuals, whitened = [], []
    for _ in range(simulation.scenario.timeline.num_epochs):
        simulation.resolve()
        innovation = simulation.observe().innovation
        residuals.append(innovation.residual[0].copy())
        whitened.append(innovation.whitened[0].copy())
    return np.array(residuals), np.array(whitened)


@pytest.mark.parametrize("level", [1.0, 2.5])
def test_every_innovation_has_a_mean_of_this_level_along_the_heading(level):
    """On the same noise the linear fidelity's innovation differs by its mean, exactly."""
    spoofed, clean = innovations(f"noise-matched:{level},direction=120"), innovations("none")
    residual, whitened = spoofed[0] - clean[0], spoofed[1] - clean[1]
    np.testing.assert_allclose(np.linalg.norm(whitened, axis=1), level, rtol=1e-9)
    # INS minus fix: the fix lies on azimuth 120 deg of where the filter expects it
    np.testing.assert_allclose(np.degrees(np.arctan2(-residual[:, 0], -residual[:, 1])), 120.0, atol=1e-6)
    np.testing.assert_allclose(residual[:, 2], 0.0, atol=1e-9)


def test_nothing_is_provoked_before_the_onset():
    spoofed, clean = innovations("noise-matched:onset=808"), innovations("none")
    np.testing.assert_array_equal(spoofed[1][:8], clean[1][:8])
    np.testing.assert_allclose(np.linalg.norm((spoofed[1] - clean[1])[8:], axis=1), 1.0, rtol=1e-9)


def test_the_offset_grows_as_the_filter_gives_way():
    simulation = Simulation(make_scenario("liu-flight"), make_attack("noise-matched"))
    offsets = simulation.attack.episode(np.array([0]), simulation.streams)[0]
    np.testing.assert_array_equal(offsets[0], 0.0)
    assert np.all(np.diff(offsets[:, 0]) > 0.0)
    # the first offset is the innovation itself: one standard deviation of its east component, correlations apart
    sigma = np.sqrt(simulation.scenario.linear_model().innovation_covariance[1, 0, 0])
    assert offsets[1, 0] == pytest.approx(sigma, rel=1e-2)


def test_a_pool_shows_its_members_the_model():
    pool = AttackPool([(make_attack("noise-matched:direction=0"), 1.0), (make_attack("ramp:1"), 1.0)], clean=0.0)
    assert pool.needs_model
    assert not AttackPool([(make_attack("ramp:1"), 1.0)]).needs_model
    simulation = Simulation(make_scenario(SHORT), pool, num_runs=20, seed=0)
    simulation.reset()
    alone = Simulation(make_scenario(SHORT), make_attack("noise-matched:direction=0"))
    expected = alone.attack.episode(np.array([0]), alone.streams)[0]
    assert set(pool.member) == {0, 1}
    for run in np.flatnonzero(pool.member == 0):
        np.testing.assert_array_equal(pool.offsets[run], expected)


class WithoutModel(LooseFamily):
    """As a recorded log: no linear model."""

    offers = ()


@pytest.mark.parametrize("name", ["noise-matched", "tracking-error:noise-matched"])
def test_a_scenario_without_a_linear_model_is_refused(name):
    flight = make_scenario(SHORT)
    given = {field.name: getattr(flight.family, field.name) for field in fields(LooseFamily)}
    with pytest.raises(ValueError, match=f"attack '{name}' needs linear model, which scenario 'liu-flight:horizon=20'"):
        Simulation(replace(flight, family=WithoutModel(**given)), make_attack(name))


def test_fixes_with_a_velocity_are_refused():
    flight = make_scenario(SHORT)
    sigmas = (*flight.family.tuning.measurement_sigma, 0.1, 0.1, 0.1)
    receiver = Receiver(rate=1.0, white_sigma=sigmas[:3], velocity_sigma=(0.1, 0.1, 0.1))
    six = flight.changed(receiver=receiver, tuning=replace(flight.family.tuning, measurement_sigma=sigmas))
    with pytest.raises(ValueError, match=r"'noise-matched' exists only for position fixes \(m = 3\).* m = 6"):
        Simulation(six, make_attack("noise-matched"))


@pytest.mark.parametrize("specification", ["noise-matched", "noise-matched:0.5,direction=0,onset=850"])
def test_the_name_builds_the_same_attack(specification):
    assert make_attack(specification).name == specification


def test_bad_values_and_onsets_are_refused():
    with pytest.raises(ValueError, match=r"level must be a finite number, 0 or more, got -1.0"):
        make_attack("noise-matched:-1")
    with pytest.raises(ValueError, match="onset 920 s lies outside the game"):
        Simulation(make_scenario("liu-flight"), make_attack("noise-matched:onset=920"))


def test_it_is_active_from_the_onset_on():
    simulation = Simulation(make_scenario(SHORT), make_attack("noise-matched:0,onset=805"))
    active = [simulation.attack.active(Clock(np.array([k]), np.array([800.0 + k])))[0] for k in range(21)]
    assert active == [False] * 6 + [True] * 15
