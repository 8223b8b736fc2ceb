"""Every registered detector on a filter that takes ranges: what it sees, and what it says of clean ranges."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrated_all
from spoofgym.calibration import thresholds as calibration
from spoofgym.calibration.clean_statistics import joint_statistics, white_statistics
from spoofgym.calibration.thresholds import measure_together
from spoofgym.detectors import DETECTORS, Ensemble, Snapshot, Windowed, make_detector
from spoofgym.detectors.base import seen
from spoofgym.detectors.chi_square import quantile_ratios
from spoofgym.navigation.facts import LINEAR_MODEL
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-7
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=20")
RISING = make_scenario("kujur-flight:onset=60,horizon=20,hour=0.25")
"""A satellite rises into an empty slot within the game."""
IN_POSITION = {
    *("signed-mean", "mean-innovation", "relative-motion", "growing-window", "acceleration", "acna", "rio"),
    *("signed-cusum", "ewma", "px4-gate", "ardupilot-gate"),
}
CALIBRATED = [
    *("snapshot", "windowed:n=4", "acna", "signed-mean:n=4", "mean-innovation:n=4", "window-bank:lengths=2+4"),
    *("aime:windows=2+4", "cusum", "signed-cusum:k=1", "ewma:weight=0.5", "mewma:weight=0.5", "fma:n=4"),
    *("whiteness:n=6/lags=2", "separation-bank:n=4", "px4-gate", "ardupilot-gate", "rio", "ci:n=4", "cpi:n=4", "raim"),
    "clock-drift:n=4",
]
"""Every family that is calibrated on white innovations, each with a short memory."""


def patient(specification):
    """The detector with a threshold that nothing reaches."""
    detector = make_detector(specification)
    if detector.lacks_slope:
        detector.set_slope(0.0)
    for member in detector.members:
        member.set_threshold(10.0)
    detector.set_threshold(1e6)
    return detector


def play(scenario, detectors, runs, seed=0):
    """Statistics of every epoch by name, (K+1, N)."""
    simulation = Simulation(scenario, None, detectors, None, runs, seed)
    rows = [dict(simulation.reset().statistics)]
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        rows.append(dict(simulation.observe().statistics))
    return {detector.name: np.array([row[detector.name] for row in rows]) for detector in detectors}


def test_which_detectors_see_a_position():
    assert {name for name in DETECTORS if make_detector(name).in_position} == IN_POSITION


@pytest.mark.parametrize("name", list(DETECTORS))
def test_every_detector_runs_on_ranges_or_is_refused(name):
    detector = patient(name)
    if detector.memory > 100 and not detector.needs:
        detector = patient(f"{name}:{'weight=0.1' if 'ewma' in name else 'windows=5+10'}")
    if name == "code-minus-carrier":
        detector = patient(f"{name}:n=5")  # both windows fill within the game
    if name == "aid-innovation":
        with pytest.raises(ValueError, match=rf"detector '{name}' needs .*, which scenario 'kujur-flight"):
            Simulation(FLIGHT, None, [detector])
        return
    if LINEAR_MODEL in detector.needs:
        with pytest.raises(ValueError, match=rf"detector '{name}.*' needs linear model, which scenario 'kujur-flight"):
            Simulation(FLIGHT, None, [detector])
        return
    statistic = play(FLIGHT, [detector], 5)[detector.name]
    assert np.all(np.isfinite(statistic))
    assert np.any(statistic > 0.0) or name in ("acceleration", "receiver-flag")
    # run i depends on nothing but itself
    np.testing.assert_array_equal(play(FLIGHT, [patient(detector.name)], 2)[detector.name], statistic[:, :2])


@pytest.mark.parametrize(
    "specification",
    ["signed-mean:n=10", "signed-cusum", "ewma:weight=0.2", "ardupilot-gate:arl0=1000", "mean-innovation:n=5"],
)
def test_ranges_turned_into_a_position_are_as_fixes_of_that_covariance(specification):
    """Two samples of 2000 at the last epoch: ranges in the game, and white fixes of the covariance that they make."""
    detector = patient(specification)
    ours = play(FLIGHT, [detector], 2000)[detector.name][-1]
    simulation = Simulation(FLIGHT, None, [], None, 1, 0)
    covariance = simulation.reset().innovation.in_position.covariance[0]
    clean = white_statistics(np.linalg.cholesky(covariance), 21)
    fixes = clean(patient(specification), 2000, np.random.default_rng(5))[1][:, -1]
    assert stats.ks_2samp(ours, fixes).pvalue > FALSE_FAILURE


def test_each_member_of_an_ensemble_sees_what_it_sees_by_itself():
    names = ["snapshot:threshold=40", "signed-mean:n=3,threshold=10", "mean-innovation:n=4,threshold=4", "cpi:n=5"]
    apart = play(FLIGHT, [make_detector(name) for name in names], 30)
    union = Ensemble([make_detector(name) for name in names], threshold=1.0)
    together = play(FLIGHT, [union], 30)[union.name]
    thresholds = [make_detector(name).threshold for name in names]
    expected = np.max([apart[name] / threshold for name, threshold in zip(names, thresholds, strict=True)], axis=0)
    np.testing.assert_array_equal(together[2:], expected[2:])


def test_an_ensemble_is_calibrated_on_ranges():
    ensemble = calibrated_all([make_detector("ensemble:snapshot+signed-mean:n=3,arl0=100")], FLIGHT)[0]
    alarms = play(FLIGHT, [ensemble], 3000, seed=9)[ensemble.name] > ensemble.threshold
    first = np.where(alarms.any(axis=0), alarms.argmax(axis=0) + 1, len(alarms))
    low, high = ensemble.arl0_interval
    rate = alarms.any(axis=0).sum() / first.sum()
    # 6 deviations of both counts, of more than 200 and about 500 alarms: 2e-9
    assert abs(np.log(rate * ensemble.arl0)) < 6.0 * np.sqrt(1.0 / 200.0 + 1.0 / 500.0)
    assert low < 100.0 < high


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """By family: what 1500 common clean games of 20 epochs say of its threshold, calibrated at an ARL0 of 50."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPOOFGYM_CACHE", str(tmp_path_factory.mktemp("thresholds")))
        patch.setattr(calibration, "_KNOWN", {})
        patch.setattr(calibration, "RUNS", 1500)
        detectors = calibrated_all([asked_for(specification) for specification in CALIBRATED], FLIGHT)
        thresholds = [detector.threshold for detector in detectors]
        found = measure_together(detectors, joint_statistics(FLIGHT, "linear"), thresholds, min_epochs=1.0, seed=8)
    return dict(zip(CALIBRATED, found, strict=True))


def asked_for(specification):
    name, _, options = specification.partition(":")
    return make_detector(f"{name}:{options.replace('/', ',') + ',' if options else ''}arl0=50")


@pytest.mark.parametrize("specification", CALIBRATED)
def test_every_family_has_the_false_alarms_that_were_asked_for(specification, measured):
    """First alarms with memories warm."""
    found = measured[specification]
    # 6 deviations of both counts, of the calibration's 200 alarms and of these: 2e-9
    assert abs(np.log(found.arl0 / 50.0)) < 6.0 * np.sqrt(1.0 / 200.0 + 1.0 / found.first_alarms)


def ranges(nis, present):
    """An epoch of which a sum of squares reads something: nis (N,), and which measurements are there (N, m)."""
    n, m = present.shape
    innovation = Innovation(np.zeros((n, m)), np.zeros((n, m, m)), np.zeros((n, m)), nis, np.zeros((n, m, 3)), present)
    return Epoch(np.zeros(n, dtype=int), np.zeros(n), innovation)


def test_a_snapshot_alarms_where_the_quantile_of_what_is_there_is_exceeded():
    generator = np.random.default_rng(1)
    present = generator.random((4000, 12)) < 0.7
    nis = stats.chi2.rvs(np.maximum(present.sum(axis=1), 1), random_state=generator) * (present.sum(axis=1) > 0) * 1.5
    detector = Snapshot(p_fa=0.02)
    detector.bind(4000, 12)
    expected = nis > stats.chi2.isf(0.02, np.maximum(present.sum(axis=1), 1))
    np.testing.assert_array_equal(detector.update(ranges(nis, present)) > detector.threshold, expected)
    assert 200 < expected.sum() < 3800
    whole = np.ones((4000, 12), dtype=bool)
    np.testing.assert_array_equal(detector.update(ranges(nis, whole)), nis)


@pytest.mark.parametrize("kind", ["windowed:n=4,p_fa=0.01", "window-bank:lengths=4,budget=0.01,threshold=1"])
def test_a_window_counts_the_measurements_in_it(kind):
    generator = np.random.default_rng(2)
    detector = make_detector(kind)
    detector.bind(500, 10)
    threshold = detector.threshold
    sums, counts = [], []
    for k in range(12):
        if k == 7:
            detector.reset(np.arange(100))
            for past in sums + counts:
                past[:100] = 0
        present = generator.random((500, 10)) < 0.6
        nis = generator.chisquare(10.0, 500) * present.any(axis=1)
        sums.append(nis.copy())
        counts.append(present.sum(axis=1))
        statistic = detector.update(ranges(nis, present))
        total, degrees = np.sum(sums[-4:], axis=0), np.maximum(np.sum(counts[-4:], axis=0), 1)
        np.testing.assert_array_equal(statistic > threshold, total > stats.chi2.isf(0.01, degrees))


def test_an_epoch_without_a_fix_has_no_degrees_of_freedom():
    detector = Windowed(2, p_fa=0.01)
    detector.bind(2, 10)
    whole, nis = np.ones((2, 10), dtype=bool), np.array([24.0, 24.0])
    detector.update(ranges(nis, whole))
    epoch = ranges(np.array([0.0, 24.0]), whole)
    missing = Epoch(epoch.index, epoch.time, epoch.innovation, available=np.array([False, True]))
    statistic = detector.update(missing)
    assert statistic[0] == pytest.approx(24.0 * stats.chi2.isf(0.01, 20) / stats.chi2.isf(0.01, 10), rel=1e-12)
    assert statistic[1] == 48.0


def test_the_ratios_of_quantiles():
    ratios = quantile_ratios(1e-5, 14)
    np.testing.assert_allclose(ratios[1:], stats.chi2.isf(1e-5, 14) / stats.chi2.isf(1e-5, np.arange(1, 15)), rtol=1e-9)
    assert ratios[14] == 1.0
    assert ratios[0] == 1.0
    assert np.all(quantile_ratios(0.0, 14) == 1.0)


@pytest.mark.parametrize("specification", ["snapshot:p_fa=0.02", "ci:n=3,p_fa=0.02", "raim:p_fa=0.02"])
def test_false_alarms_while_a_satellite_rises(specification):
    """A binomial count at every epoch, 2000 runs each; the first epochs begin with the memory of the burn-in."""
    detector = make_detector(specification)
    simulation = Simulation(RISING, None, [detector], None, 2000, 4)
    simulation.reset()
    low, high = stats.binom.ppf(FALSE_FAILURE / 40, 2000, 0.02), stats.binom.isf(FALSE_FAILURE / 40, 2000, 0.02)
    degrees = set()
    for k in range(1, 21):
        simulation.resolve()
        epoch = simulation.observe()
        degrees |= set(epoch.innovation.degrees.tolist())
        if k > detector.memory:
            assert low <= simulation.alarm.sum() <= high
    assert degrees == {12, 14}


def test_the_mean_innovation_of_aime_forgets_what_is_not_there():
    """Information of a range that comes and goes against the sums over the epochs in which it is there."""
    generator = np.random.default_rng(6)
    detector = make_detector("aime:windows=6,threshold=1000")
    detector.bind(1, 4)
    factor = np.tril(generator.standard_normal((4, 4))) + 2.0 * np.eye(4)
    rows = []
    for k in range(9):
        present = np.array([[True, k % 3 > 0, True, k > 1]])
        keep = present[0].astype(float)
        covariance = factor @ factor.T * np.outer(keep, keep) + np.diag(1.0 - keep)
        residual = generator.standard_normal(4) * keep
        rows.append((np.linalg.pinv(covariance * np.outer(keep, keep)), residual))
        whitened = np.linalg.solve(np.linalg.cholesky(covariance), residual)[None]
        innovation = Innovation(
            residual[None], covariance[None], whitened, (whitened**2).sum(axis=1), np.zeros((1, 4, 3)), present
        )
        statistic = detector.update(Epoch(np.array([k]), np.array([float(k)]), innovation))
        information = sum(weight for weight, _ in rows[-6:])
        weighted = sum(weight @ residual for weight, residual in rows[-6:])
        assert statistic[0] == pytest.approx(weighted @ np.linalg.pinv(information) @ weighted, rel=1e-6)


def test_a_cumulative_sum_of_squares_has_the_reference_of_what_is_there():
    detector = make_detector("cusum:k=2,threshold=10")
    detector.bind(1, 10)
    present = np.array([[True] * 6 + [False] * 4])
    assert detector.update(ranges(np.array([20.0]), present))[0] == 20.0 - 2.0 * 6


def test_a_fix_of_position_is_seen_as_it_is():
    epoch = Simulation(make_scenario("liu-flight:horizon=5"), num_runs=2, seed=0).reset()
    assert seen(make_detector("signed-mean"), epoch) is epoch
