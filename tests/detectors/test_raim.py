"""The residual of the code ranges: against least squares by hand, and what it sees of a spoofer."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.detectors import Raim, make_detector
from spoofgym.detectors.raim import residual_squares
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-8
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=30")


def line_of_sights(generator, slots):
    vectors = generator.standard_normal((slots, 3))
    vectors[:, 2] = np.abs(vectors[:, 2]) + 0.1
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def ranges(seed, runs, present):
    """Code and carrier of a filter: S, z and G of each run."""
    generator = np.random.default_rng(seed)
    slots = len(present)
    design = np.hstack([-line_of_sights(generator, slots), np.ones((slots, 1))]) * present[:, None]
    geometry = np.vstack([design, design])
    everything = np.tile(present, 2)
    innovations, covariances = [], []
    for _ in range(runs):
        root = generator.standard_normal((2 * slots, 2 * slots))
        covariance = root @ root.T + np.eye(2 * slots)
        covariance = np.where(np.outer(everything, everything), covariance, np.eye(2 * slots))
        covariances.append(covariance)
        innovations.append(np.linalg.cholesky(covariance) @ generator.standard_normal(2 * slots) * everything)
    covariance, residual = np.array(covariances), np.array(innovations)
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, residual[..., None])[..., 0]
    response = np.linalg.solve(factor, np.broadcast_to(geometry[:, :3], (runs, 2 * slots, 3)))
    there = np.broadcast_to(everything, residual.shape).copy()
    innovation = Innovation(residual, covariance, whitened, (whitened**2).sum(axis=1), response, there)
    return innovation, design


def epoch_of(innovation, k=0, available=None):
    n = len(innovation.nis)
    return Epoch(np.full(n, k), np.full(n, float(k)), innovation, available=available)


PRESENT = [np.ones(7, dtype=bool), np.array([True, True, False, True, True, True, False, True])]


@pytest.mark.parametrize("present", PRESENT, ids=["all", "gaps"])
def test_the_statistic_is_the_residual_of_least_squares(present):
    innovation, design = ranges(0, 6, present)
    squares, degrees = residual_squares(innovation)
    assert degrees.tolist() == [present.sum() - 4] * 6
    rows = np.flatnonzero(present)
    for run in range(6):
        covariance, z = innovation.covariance[run][np.ix_(rows, rows)], innovation.residual[run, rows]
        g, weight = design[rows], np.linalg.inv(covariance)
        r = z - g @ np.linalg.solve(g.T @ weight @ g, g.T @ weight @ z)
        assert squares[run] == pytest.approx(r @ weight @ r, rel=1e-8)


def test_what_the_filter_believes_of_position_and_clock_drops_out():
    """The same z, and S with and without what P says of them and of their ties to the other errors."""
    present = np.ones(7, dtype=bool)
    bare, design = ranges(1, 5, present)
    generator = np.random.default_rng(9)
    squares = residual_squares(bare)[0]
    geometry = np.vstack([design, design])
    root = generator.standard_normal((4, 4))
    cross = 0.1 * geometry @ generator.standard_normal((4, 14))
    covariance = bare.covariance + geometry @ (9.0 * root @ root.T + 4.0 * np.eye(4)) @ geometry.T + cross + cross.T
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, bare.residual[..., None])[..., 0]
    response = np.linalg.solve(factor, np.broadcast_to(geometry[:, :3], (5, 14, 3)))
    known = Innovation(bare.residual, covariance, whitened, bare.nis, response, bare.present)
    np.testing.assert_allclose(residual_squares(known)[0], squares, rtol=1e-7)


def test_a_position_and_a_clock_leave_no_residual():
    innovation, design = ranges(2, 3, np.ones(6, dtype=bool))
    before = residual_squares(innovation)[0]
    moved = design @ np.array([300.0, -200.0, 50.0, 1e4])
    added = np.linalg.solve(np.linalg.cholesky(innovation.covariance), np.tile(moved, (3, 2))[..., None])[..., 0]
    spoofed = Innovation(
        innovation.residual,
        innovation.covariance,
        innovation.whitened + added,
        innovation.nis,
        innovation.range_response,
        innovation.present,
    )
    np.testing.assert_allclose(residual_squares(spoofed)[0], before, rtol=1e-5)


@pytest.mark.parametrize("count", [3, 4])
def test_four_satellites_and_fewer_say_nothing(count):
    present = np.arange(6) < count
    innovation, _ = ranges(4, 5, present)
    squares, degrees = residual_squares(innovation)
    assert squares.tolist() == [0.0] * 5
    assert degrees.tolist() == [0] * 5
    detector = Raim()
    detector.bind(5, 12)
    assert detector.update(epoch_of(innovation)).tolist() == [0.0] * 5


def test_fewer_satellites_are_judged_by_the_quantile_of_their_own_degrees():
    detector = Raim(p_fa=0.01)
    detector.bind(400, 16)
    innovation, _ = ranges(5, 400, PRESENT[1])
    squares, _ = residual_squares(innovation)
    np.testing.assert_array_equal(
        detector.update(epoch_of(innovation)) > detector.threshold, squares > stats.chi2.isf(0.01, 2)
    )
    assert detector.threshold == pytest.approx(stats.chi2.isf(0.01, 4), rel=1e-12)


def test_an_epoch_without_ranges_counts_as_zero():
    detector = Raim()
    detector.bind(2, 14)
    innovation, _ = ranges(6, 2, PRESENT[0])
    statistic = detector.update(epoch_of(innovation, available=np.array([False, True])))
    assert statistic[0] == 0.0
    assert statistic[1] > 0.0


def play(attack, detectors, runs, seed=0, scenario=FLIGHT):
    """Statistics of every epoch after the first, (K, N), by name."""
    simulation = Simulation(scenario, attack, detectors, None, runs, seed)
    simulation.reset()
    rows = []
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        rows.append(dict(simulation.observe().statistics))
    return {detector.name: np.array([row[detector.name] for row in rows]) for detector in detectors}


def test_clean_ranges_are_chi_square_and_independent():
    """500 runs of 30 epochs: distribution, false alarms, and correlation of neighbours, 1e-8 each."""
    detector = make_detector("raim:p_fa=0.01")
    statistic = play(None, [detector], 500)[detector.name]
    degrees = FLIGHT.slots - 4
    assert stats.kstest(statistic.ravel(), stats.chi2(degrees).cdf).pvalue > FALSE_FAILURE
    alarms = int((statistic > detector.threshold).sum())
    low, high = stats.binom.ppf(FALSE_FAILURE / 2, 15_000, 0.01), stats.binom.isf(FALSE_FAILURE / 2, 15_000, 0.01)
    assert low <= alarms <= high
    assert detector.arl0 == pytest.approx(100.0, rel=1e-9)
    pairs = (statistic[1:] - degrees) * (statistic[:-1] - degrees) / (2.0 * degrees)
    assert abs(pairs.mean()) < 6.0 / np.sqrt(pairs.size)


@pytest.mark.parametrize("observable", ["carrier", "rate"])
def test_it_is_blind_to_a_spoofer_of_a_position_and_a_clock(observable):
    """Ten metres a second and a clock besides: no residual at first, and next to none later.

    The norm of the residual changes by no more than that of what is added: of the noise of four degrees of freedom a
    tenth or two, from what the filter takes for errors of the satellites.
    """
    scenario = FLIGHT if observable == "carrier" else make_scenario("liu-flight:coupling=tight,onset=200,horizon=30")
    attack = make_attack("liu-spoofer:10,direction=30,clock_jump=-300,clock_rate=7")
    detectors = [make_detector("raim"), make_detector("snapshot")]
    spoofed, clean = play(attack, detectors, 20, 1, scenario), play(None, detectors, 20, 1, scenario)
    np.testing.assert_allclose(spoofed["raim"][0], clean["raim"][0], rtol=1e-6)
    assert np.abs(np.sqrt(spoofed["raim"]) - np.sqrt(clean["raim"])).max() < 0.25
    assert (spoofed["snapshot"] > detectors[1].threshold).any(axis=0).all()


def test_one_captured_satellite_is_seen():
    """A jump of 200 m in one range of eight, whose innovation has a deviation of a few metres: in every run at once."""
    attack = make_attack("partial:jump-ramp:0/jump=200/direction=40")
    detectors = [make_detector("raim")]
    statistic = play(attack, detectors, 200, 2)["raim"]
    assert np.all(statistic[0] > detectors[0].threshold)


def test_the_noncentrality_is_that_of_the_captured_range():
    """The mean of the statistic of the first spoofed epoch over 2000 runs, 1e-8: degrees + offset' (f'Mf) offset."""
    attack = make_attack("partial:jump-ramp:0/jump=15/direction=40")
    detector = make_detector("raim")
    statistic = play(attack, [detector], 2000, 3)["raim"][0]
    model = FLIGHT.tight_model()
    slots, direction = FLIGHT.slots, model.dynamics.line_of_sight[1]
    covariance = model.innovation_covariance[1, :slots, :slots]
    design = np.hstack([-direction, np.ones((slots, 1))])
    weight = np.linalg.inv(covariance)
    unexplained = weight - weight @ design @ np.linalg.solve(design.T @ weight @ design, design.T @ weight)
    angle = np.radians(40.0)
    moved = -15.0 * direction[0] @ np.array([np.sin(angle), np.cos(angle), 0.0])
    noncentrality = moved**2 * unexplained[0, 0]
    assert noncentrality > 1.0
    sample = stats.ncx2(slots - 4, noncentrality)
    assert abs(statistic.mean() - sample.mean()) < stats.norm.isf(FALSE_FAILURE / 2) * sample.std() / np.sqrt(2000)


def test_it_needs_ranges_to_more_than_four_satellites():
    with pytest.raises(ValueError, match=r"detector 'raim' needs ranges to satellites, which scenario 'liu-flight'"):
        Simulation(make_scenario("liu-flight"), None, [make_detector("raim")])
    detector = make_detector("raim")
    detector.bind(1, 8)
    with pytest.raises(ValueError, match=r"needs five satellites or more, scenario 'kujur-flight.*' has 4"):
        detector.know(FLIGHT.facts)


def test_a_run_is_the_same_in_any_batch():
    attack = make_attack("partial:ramp:3")
    whole = play(attack, [make_detector("raim")], 9, 5)["raim"]
    np.testing.assert_array_equal(play(attack, [make_detector("raim")], 2, 5)["raim"], whole[:, :2])


@pytest.mark.parametrize("specification", ["raim", "raim:p_fa=0.001", "raim:threshold=30", "raim:arl0=1000"])
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, Raim)
    assert detector.name == specification


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("raim:threshold=0", "raim: threshold must be a finite number greater than 0, got 0"),
        ("raim:p_fa=2", "raim: p_fa must be greater than 0 and less than 1, got 2"),
        ("raim:arl0=0.5", "raim: arl0 must be a finite number greater than 1, got 0.5"),
        ("raim:p_fa=0.1,threshold=9", "at most one of threshold, p_fa, arl0; got threshold and p_fa"),
        ("raim:n=3", "no option 'n'; valid options: threshold, p_fa, arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
