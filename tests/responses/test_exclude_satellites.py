"""Single satellites left out: which, how often by mistake, and what it is worth."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.detectors.raim import inverse_columns
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.responses import ExcludeSatellites, make_response
from spoofgym.responses.exclude_satellites import nuisance_basis, squared_residual
from spoofgym.responses.watching import Watching
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-8
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=40")


def innovation_of(residual, design, present=None):
    """Ranges of one run whose S is 1 for code and carrier, (m,) and G (S, 3)."""
    slots = len(design)
    present = np.ones(slots, dtype=bool) if present is None else present
    there = np.tile(present, 2)
    z = np.where(there, np.concatenate([residual, np.zeros(slots)]), 0.0)[None]
    response = (np.vstack([design, np.zeros((slots, 3))]) * there[:, None])[None]
    return Innovation(z, np.eye(2 * slots)[None], z, (z**2).sum(axis=1), response, there[None])


def epoch_of(innovation, k=0, available=None):
    return Epoch(np.array([k]), np.array([float(k)]), innovation, available=available)


def geometry(slots=8):
    azimuth = 2.3 * np.arange(slots)
    elevation = np.radians(15.0 + 65.0 * np.arange(slots) / slots)
    return -np.column_stack(
        [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
    )


@pytest.mark.parametrize("left_out", [[], [1, 4]], ids=["all", "two left out"])
def test_the_residual_is_what_a_satellite_measures_less_what_the_others_predict(left_out):
    """Best unbiased prediction of code and carrier from those of the others, each with its position and clock."""
    generator, slots = np.random.default_rng(3), 8
    root = generator.standard_normal((16, 16))
    covariance = root @ root.T + np.eye(16)
    factor = np.linalg.cholesky(covariance)
    z = factor @ generator.standard_normal(16)
    drift = np.kron(np.eye(2), np.column_stack([geometry(), np.ones(8)]))
    response = np.linalg.solve(factor, np.vstack([geometry(), geometry()]))
    found, columns, basis = np.empty((16, 16)), np.empty((16, 16)), np.empty((16, 16))
    inverse_columns(covariance, np.ones(16, dtype=bool), found, columns)
    away = np.isin(np.arange(slots), left_out)
    for i in range(slots):
        size = nuisance_basis(response, found, columns, away, i, basis)
        square = squared_residual(basis, size, columns, i, np.linalg.solve(factor, z))
        mine = np.array([i, slots + i])
        others = np.flatnonzero(np.tile(~away & (np.arange(slots) != i), 2))
        inside = np.linalg.inv(covariance[np.ix_(others, others)])
        fit = np.linalg.solve(drift[others].T @ inside @ drift[others], drift[others].T @ inside)
        tie = covariance[np.ix_(mine, others)] @ inside
        contrast = np.zeros((2, 16))
        contrast[:, mine] = np.eye(2)
        contrast[:, others] = -(tie + (drift[mine] - tie @ drift[others]) @ fit)
        assert np.abs(contrast @ drift).max() < 1e-9
        off = contrast @ z
        expected = off @ np.linalg.solve(contrast @ covariance @ contrast.T, off)
        assert square == pytest.approx(expected, rel=1e-7)


def in_use(response, innovation, k=0, available=None):
    """Slots that are used, (S,), and whether the fix is."""
    decision = response.decide(epoch_of(innovation, k, available), np.zeros(1, dtype=bool))
    slots = innovation.present.shape[1] // 2
    return np.ones(slots, dtype=bool) if decision.satellites is None else decision.satellites[0], decision.use[0]


def started(specification="exclude-satellites"):
    response = make_response(specification)
    response.bind(1)
    response.reset(np.array([0]))
    return response


def test_the_satellite_that_contradicts_the_others_is_left_out():
    for off in range(8):
        residual = np.zeros(8)
        residual[off] = 60.0
        used, fix = in_use(started(), innovation_of(residual, geometry()))
        assert np.flatnonzero(~used).tolist() == [off]
        assert fix


def test_a_position_and_a_clock_contradict_nothing():
    used, _ = in_use(started(), innovation_of(geometry() @ [500.0, -300.0, 90.0] + 1e4, geometry()))
    assert used.all()


def test_two_satellites_go_one_after_the_other():
    residual = np.zeros(8)
    residual[[2, 6]] = 90.0, -250.0
    used, _ = in_use(started(), innovation_of(residual, geometry()))
    assert np.flatnonzero(~used).tolist() == [2, 6]


@pytest.mark.parametrize("slots", [5, 6])
def test_among_five_nobody_can_tell_which(slots):
    residual = np.zeros(8)
    residual[1] = 1000.0
    used, _ = in_use(started(), innovation_of(residual, geometry(), np.arange(8) < slots))
    assert used.all() == (slots == 5)


def test_a_satellite_is_used_again_after_as_many_epochs_of_agreement():
    response = started("exclude-satellites:reuse=4")
    good = innovation_of(np.zeros(8), geometry())
    bad = innovation_of(np.eye(8)[3] * 60.0, geometry())
    rows = []
    for k, innovation in enumerate([bad, good, good, bad, good, good, good, good, good]):
        available = np.array([k != 5])
        rows.append(bool(in_use(response, innovation, k, available)[0][3]))
    # the count began anew at 3; epoch 5 has no ranges and does not count, so 4, 6, 7 and 8 do
    assert rows == [False] * 8 + [True]


def test_a_slot_that_empties_forgets():
    response = started()
    in_use(response, innovation_of(np.eye(8)[3] * 60.0, geometry()))
    assert not in_use(response, innovation_of(np.zeros(8), geometry()), 1)[0][3]
    in_use(response, innovation_of(np.zeros(8), geometry(), np.arange(8) != 3), 2)
    assert in_use(response, innovation_of(np.zeros(8), geometry()), 3)[0].all()


def test_an_epoch_without_ranges_is_not_used():
    used, fix = in_use(started(), innovation_of(np.eye(8)[3] * 60.0, geometry()), available=np.array([False]))
    assert not fix
    assert used.all()


def play(attack, response, runs, seed=0, detectors=(), scenario=FLIGHT):
    """Which slots are left out, (K, N, S), and the horizontal error after each epoch, (K, N)."""
    simulation = Simulation(
        scenario, attack, detectors, None if response is None else make_response(response), runs, seed
    )
    simulation.reset()
    left_out, errors = [], []
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        errors.append(np.hypot(*simulation.error[:, :2].T))
        simulation.observe()
        satellites = simulation.decision.satellites
        left_out.append(np.zeros((runs, scenario.slots), dtype=bool) if satellites is None else ~satellites)
    return np.array(left_out), np.array(errors)


def test_few_satellites_are_left_out_by_mistake():
    """A binomial count of runs in the first epoch; in all 40 epochs more than a thousand satellites go."""
    left_out, _ = play(None, "exclude-satellites:p_fa=0.01", 500, 3)
    slots = int(FLIGHT.tight_model().dynamics.present[0].sum())
    first = int(left_out[0].any(axis=1).sum())
    # of which some stay from epoch 0
    assert first <= stats.binom.isf(FALSE_FAILURE, 500, 2 * slots * 0.01)
    assert left_out.any()
    assert not play(None, "exclude-satellites:p_fa=1e-9", 200, 4)[0].any()


def test_those_left_out_by_mistake_come_back():
    """With P_FA of 0.05 satellites go all the time; ten epochs later nearly all are back."""
    left_out, _ = play(None, "exclude-satellites:p_fa=0.05,reuse=1", 200, 3)
    share = left_out.mean(axis=(1, 2))
    assert share.max() < 0.2
    again = left_out[:-1] & ~left_out[1:]
    assert again.sum() > 0.3 * left_out[:-1].sum()


RATE = make_scenario("liu-flight:coupling=tight,onset=200,horizon=40")
JUMP = "partial:jump-ramp:0/jump=100/direction=0,numbers=15"
RAMP = "partial:ramp:10/direction=0,numbers=15"
FEW = "partial:ramp:10/direction=0,satellites=1"


def slot_of(number):
    return FLIGHT.tight_model().dynamics.satellite[1].tolist().index(number)


@pytest.mark.parametrize("attack", [JUMP, RAMP], ids=["jump", "ramp"])
def test_the_captured_satellite_is_found(attack):
    """Code and carrier move by tens of sigmas in an epoch: all of 300 runs leave it out from the first to the last."""
    left_out, _ = play(make_attack(attack), "exclude-satellites", 300, 5)
    captured = slot_of(15)
    assert np.all(left_out[:, :, captured])
    others = np.delete(left_out, captured, axis=2)
    # seven others, 41 epochs, 300 runs at 1e-5: 0.9 are expected
    assert others.any(axis=0).sum() <= stats.poisson.isf(FALSE_FAILURE, 1.0)


@pytest.mark.parametrize("scenario", [FLIGHT, RATE], ids=["carrier", "rate"])
def test_it_bounds_the_error(scenario):
    """Against the same noise without a spoofer, and against a filter that uses everything."""
    attack = make_attack(FEW)
    _, resisted = play(attack, "exclude-satellites", 200, 5, scenario=scenario)
    _, always = play(attack, "always-use", 200, 5, scenario=scenario)
    _, clean = play(None, "always-use", 200, 5, scenario=scenario)
    assert np.median(always[-1]) > 5.0 * np.median(clean[-1])
    # one satellite of eight less: medians of 200, whose relative deviation is below 0.1
    assert np.median(resisted[-1]) < 1.6 * np.median(clean[-1])
    assert np.mean(resisted[-1] < always[-1]) > 0.9


def test_a_spoofer_of_all_satellites_is_not_resisted():
    ends = [play(make_attack("ramp:3"), response, 20, 6)[1][-1] for response in ("exclude-satellites", "always-use")]
    np.testing.assert_allclose(*ends, rtol=0.01)


def test_it_does_not_listen_to_detectors():
    detector = make_detector("snapshot:threshold=1e-6")
    simulation = Simulation(FLIGHT, None, [detector], make_response("exclude-satellites"), 4, 0)
    with pytest.raises(ValueError, match="is far too low"):
        Simulation(FLIGHT, None, [make_detector("cpi:n=2,threshold=1e-9")], None, 1, 0)
    simulation.reset()
    for _ in range(5):
        simulation.resolve()
        simulation.observe()
        assert simulation.alarm.all()
        assert simulation.decision.use.all()


def test_it_can_follow_one_detector_among_several():
    detectors = [make_detector("raim:threshold=25"), make_detector("snapshot:threshold=60")]
    response = Watching(make_response("exclude-satellites"), "raim:threshold=25", detectors)
    simulation = Simulation(FLIGHT, make_attack(JUMP), detectors, response, 5, 0)
    simulation.reset()
    simulation.resolve()
    simulation.observe()
    assert not simulation.decision.satellites[:, slot_of(15)].any()


def test_runs_are_reset_alone():
    simulation = Simulation(FLIGHT, make_attack(JUMP), (), make_response("exclude-satellites"), 5, 2)
    simulation.reset()
    for _ in range(6):
        simulation.resolve()
        simulation.observe()
    simulation.reset(np.array([1, 3]))
    assert simulation.decision.satellites[:, slot_of(15)].tolist() == [False, True, False, True, False]
    simulation.resolve()


def test_a_run_is_the_same_in_any_batch():
    whole, errors = play(make_attack(JUMP), "exclude-satellites", 9, 7)
    part, few = play(make_attack(JUMP), "exclude-satellites", 2, 7)
    np.testing.assert_array_equal(part, whole[:, :2])
    np.testing.assert_array_equal(few, errors[:, :2])


@pytest.mark.parametrize("scenario", ["liu-flight", "kujur-flight:coupling=loose,onset=60,horizon=10"])
def test_it_needs_ranges(scenario):
    message = r"response 'exclude-satellites' needs ranges to satellites, which scenario '.*' does not give"
    with pytest.raises(ValueError, match=message):
        Simulation(make_scenario(scenario), None, (), make_response("exclude-satellites"))


@pytest.mark.parametrize(
    "specification", ["exclude-satellites", "exclude-satellites:p_fa=0.001,reuse=3,reuse_threshold=6"]
)
def test_the_name_builds_the_same_response(specification):
    response = make_response(specification)
    assert isinstance(response, ExcludeSatellites)
    assert response.name == specification


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("exclude-satellites:p_fa=0", "exclude-satellites: p_fa must be greater than 0 and less than 1, got 0"),
        ("exclude-satellites:reuse=0", "exclude-satellites: reuse must be a whole number, 1 or more, got 0"),
        ("exclude-satellites:reuse_threshold=-1", "reuse_threshold must be a finite number greater than 0, got -1"),
        ("exclude-satellites:n=3", "no option 'n'; valid options: p_fa, reuse, reuse_threshold"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_response(specification)
