"""Games on the tightly coupled filter: what a spoofer adds to ranges, burn-ins, partial resets, disturbances."""


import numpy as np
import pytest

from spoofgym.detectors import make_detector
from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.spoof import Spoof
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation

SHORT = "kujur-flight:onset=60,horizon=40"


@pytest.fixture(scope="module")
def scenario():
    return make_scenario(SHORT)


def spoof(offset, clock=0.0, satellites=None):
    offset = np.array([offset], dtype=float)
    return Spoof(offset, np.zeros((1, 3)), np.array([clock]), np.zeros(1), satellites)


@pytest.mark.parametrize(("fidelity", "tolerance"), [("linear", 0.25), ("strapdown", 1e-6)])
def test_spoofed_ranges_are_those_of_a_receiver_elsewhere_with_another_clock(scenario, fidelity, tolerance):
    """To first order in the linear fidelity: 1.2 km leave 4 cm of the range's curvature, and 0.1 m of the Earth's."""
    offset, clock, k = np.array([900.0, -700.0, 300.0]), 55.0, 7
    added = scenario.family.spoofed(fidelity, np.array([k]), 0, spoof(offset, clock))[0]
    time = scenario.times(0)[k]
    truth = scenario.truth.trajectory.position[round(time * scenario.truth.trajectory.rate)]
    place = round(time * scenario.truth.rate) - 1
    satellites, present = scenario.family.geometry.position[place], scenario.family.geometry.present[place]
    places = displace(truth, offset), truth
    distance = [np.linalg.norm(satellites - geodetic_to_ecef(position), axis=1) for position in places]
    expected = np.where(present, distance[0] - distance[1] + clock, 0.0)
    np.testing.assert_allclose(added[: scenario.slots], expected, atol=tolerance)
    np.testing.assert_array_equal(added[scenario.slots :], added[: scenario.slots])


def test_only_captured_satellites_are_spoofed(scenario):
    captured = np.zeros((1, scenario.slots), dtype=bool)
    captured[0, [0, 3]] = True
    added = scenario.family.spoofed("linear", np.array([7]), 0, spoof([10.0, 0.0, 0.0], 3.0, captured))[0]
    assert np.flatnonzero(added).tolist() == [0, 3, scenario.slots, scenario.slots + 3]


def test_offsets_from_outside_may_move_the_clock(scenario):
    runs = 2
    simulation = Simulation(scenario, None, (), None, runs, 0)
    simulation.reset()
    simulation.resolve()
    simulation.observe(np.tile([0.0, 0.0, 0.0, 20.0], (runs, 1)))
    assert simulation.attacked.all()
    assert not simulation.offset.any()
    np.testing.assert_array_equal(simulation.clock_offset, 20.0)
    simulation.resolve()
    simulation.observe(np.zeros((runs, 3)))
    assert not simulation.attacked.any()


def test_a_partial_reset_leaves_the_other_runs_alone(scenario):
    """The epoch of the others, and what their detectors remember, stay as they are, bit for bit."""
    detector = make_detector("windowed:n=5,p_fa=0.001")
    simulation = Simulation(scenario, None, [detector], None, 4, 5)
    simulation.reset()
    for _ in range(6):
        simulation.resolve()
        simulation.observe()
    before = simulation.epoch
    names = ("residual", "covariance", "whitened", "nis")
    kept = [np.array(getattr(before.innovation, name)[[0, 3]]) for name in names]
    response = np.array(before.innovation.response[[0, 3]])
    statistic = before.statistics[detector.name][[0, 3]].copy()
    simulation.reset(np.array([1, 2]))
    after = simulation.epoch
    assert after.index.tolist() == [6, 0, 0, 6]
    for name, values in zip(names, kept, strict=True):
        np.testing.assert_array_equal(getattr(after.innovation, name)[[0, 3]], values)
    np.testing.assert_array_equal(after.innovation.response[[0, 3]], response)
    np.testing.assert_array_equal(after.statistics[detector.name][[0, 3]], statistic)
    np.testing.assert_array_equal(after.innovation.response[1], scenario.tight_model().position_response[0])


def test_clean_memories_of_detectors_come_from_white_innovations(scenario):
    """A window is warm at epoch 0: its statistic has the mean of all its degrees of freedom (6 sigma)."""
    runs, n = 400, 10
    simulation = Simulation(scenario, None, [make_detector(f"windowed:n={n},p_fa=1e-9")], None, runs, 8)
    statistic = next(iter(simulation.reset().statistics.values()))
    degrees = n * scenario.dimension
    assert abs(statistic.mean() - degrees) < 6.0 * np.sqrt(2.0 * degrees / runs)


def test_a_burn_in_that_reaches_before_the_flight_is_refused(scenario):
    with pytest.raises(ValueError, match="reaches before the trajectory"):
        scenario.tight_model(1000)


def test_a_tight_scenario_has_no_model_of_fixes_and_a_loose_one_none_of_ranges(scenario):
    with pytest.raises(ValueError, match="tightly coupled"):
        scenario.linear_model()
    with pytest.raises(ValueError, match="loosely coupled"):
        make_scenario("liu-flight").tight_model()


def test_multipath_disturbs_the_code_alone_and_a_fix_by_as_much(scenario):
    disturbances = Disturbances(outage_share=0.0, multipath_share=1.0)
    confounders = Confounders(disturbances)
    simulation = Simulation(scenario, None, (), None, 2, 3, confounders=confounders, demands=Demands(excludes=True))
    simulation.reset()
    noise = confounders.noise
    added = scenario.family.disturbed(noise, 0)
    assert np.abs(noise).max() > 1.0
    assert not added[..., scenario.slots :].any()
    dynamics = scenario.tight_model().dynamics
    for run, epoch in np.argwhere(noise.any(axis=2))[:20]:
        present = dynamics.present[epoch]
        rows = np.column_stack([-dynamics.line_of_sight[epoch][present], np.ones(present.sum())])
        fix, *_ = np.linalg.lstsq(rows, added[run, epoch, : scenario.slots][present], rcond=None)
        np.testing.assert_allclose(fix[:3], noise[run, epoch], atol=1e-9)


def test_an_outage_hides_the_ranges(scenario):
    confounders = Confounders(Disturbances(outage_share=1.0, multipath_share=0.0))
    simulation = Simulation(scenario, None, (), None, 3, 3, confounders=confounders)
    simulation.reset()
    hidden = 0
    for _ in range(scenario.truth.horizon):
        simulation.resolve()
        epoch = simulation.observe()
        out = ~epoch.available
        hidden += int(out.sum())
        assert not epoch.innovation.whitened[out].any()
        assert not epoch.innovation.in_position.residual[out].any()
    assert hidden > 0


@pytest.mark.parametrize("observable", ["kilometres", ""])
def test_an_unknown_observable_is_refused(scenario, observable):
    with pytest.raises(ValueError, match="observable must be one of carrier, rate"):
        scenario.changed(observable=observable)
