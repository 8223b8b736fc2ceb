import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import Cpi, Windowed, cpi_theory, make_detector
from spoofgym.detectors.cpi import kappa, projected, unit_vector
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.navigation.tight.tracking_response import projected_response, tracking_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-7
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=40")
UP = np.array([0.0, 0.0, 1.0])


def innovations(seed, runs, m=7, clean=True):
    """Made-up ranges: S, H and z of each run, whitened by its own S."""
    generator = np.random.default_rng(seed)
    root = generator.standard_normal((runs, m, m)) + 3.0 * np.eye(m)
    covariance = root @ root.transpose(0, 2, 1)
    factor = np.linalg.cholesky(covariance)
    design = generator.standard_normal((runs, m, 3))
    whitened = generator.standard_normal((runs, m))
    residual = np.einsum("nij,nj->ni", factor, whitened)
    response = np.linalg.solve(factor, design)
    innovation = Innovation(residual, covariance, whitened, (whitened**2).sum(axis=1), response, np.ones((runs, m)) > 0)
    return innovation, design


def epoch_of(innovation, k=0, available=None):
    n = len(innovation.nis)
    return Epoch(np.full(n, k), np.full(n, float(k)), innovation, available=available)


@pytest.mark.parametrize("direction", ["east", "north", "up", 30.0, -100.0])
def test_the_projection_is_that_of_the_paper(direction):
    """u'H'S⁻¹z and u'H'S⁻¹Hu with a general solver."""
    innovation, design = innovations(0, 20)
    axes = {"east": [1, 0, 0], "north": [0, 1, 0], "up": [0, 0, 1]}
    angle = np.radians(direction) if not isinstance(direction, str) else 0.0
    u = np.array(axes.get(direction, [np.sin(angle), np.cos(angle), 0.0]))
    s, information = projected(innovation, unit_vector("test", direction))
    along = design @ u
    solved = np.linalg.solve(innovation.covariance, along[..., None])[..., 0]
    np.testing.assert_allclose(s, (solved * innovation.residual).sum(axis=1), rtol=1e-9, atol=1e-12)
    expected = (solved * along).sum(axis=1)
    np.testing.assert_allclose(information, expected, rtol=1e-9)
    np.testing.assert_allclose(kappa(innovation, 0.5, direction), 0.25 * expected, rtol=1e-9)


def test_a_fix_of_position_is_projected_by_its_own_covariance():
    covariance = np.array([[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 9.0]])
    residual = np.array([[1.0, -2.0, 5.0]])
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), residual[0])[None]
    innovation = Innovation(residual, covariance[None], whitened, (whitened**2).sum(axis=1))
    s, information = projected(innovation, UP)
    inverse = np.linalg.inv(covariance)
    assert s[0] == pytest.approx(inverse[2] @ residual[0], rel=1e-12)
    assert information[0] == pytest.approx(inverse[2, 2], rel=1e-12)


def test_metres_of_noise_leave_a_fix_no_power():
    """Sigma of 3 m per axis and a tracking error of 1 m: about 0.1."""
    innovation = Innovation(np.zeros((1, 3)), 9.0 * np.eye(3)[None], np.zeros((1, 3)), np.zeros(1))
    assert kappa(innovation, 1.0)[0] == pytest.approx(1.0 / 9.0, rel=1e-12)


def test_the_sum_since_the_reset_of_each_run():
    detector, resets = Cpi(5, "north"), {9: [1], 14: [0, 2]}
    detector.bind(3, 7)
    rows, since = [], np.zeros(3, dtype=int)
    for k in range(20):
        if k in resets:
            detector.reset(np.array(resets[k]))
            since[resets[k]] = k
        innovation, _ = innovations(k, 3)
        given = np.array([True, k % 4 != 2, True])
        innovation.whitened[~given] = 0.0
        statistic = detector.update(epoch_of(innovation, k, given))
        s, information = projected(innovation, np.array([0.0, 1.0, 0.0]))
        rows.append(s**2 / information)
        expected = [sum(rows[j][i] for j in range(max(since[i], k - 4), k + 1)) for i in range(3)]
        np.testing.assert_allclose(statistic, expected, rtol=1e-12, atol=1e-13)


def test_nothing_is_known_where_no_range_is_there():
    detector = Cpi(3)
    detector.bind(1, 4)
    zeros = np.zeros((1, 4))
    nothing = Innovation(zeros, np.eye(4)[None], zeros, np.zeros(1), np.zeros((1, 4, 3)), zeros > 0)
    assert detector.update(epoch_of(nothing))[0] == 0.0


def game(attack, detectors, runs, seed=0, scenario=FLIGHT):
    """Statistics of every epoch after the first, (K, N), by name."""
    simulation = Simulation(scenario, attack, detectors, None, runs, seed)
    simulation.reset()
    rows = []
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        rows.append(dict(simulation.observe().statistics))
    return {detector.name: np.array([row[detector.name] for row in rows]) for detector in detectors}


@pytest.mark.parametrize("direction", ["up", "60"])
def test_clean_ranges_are_gamma_distributed(direction):
    """The sum of 20 epochs of the filter itself, 2000 runs: Gamma(10, 2), and P_FA of the threshold."""
    detector = make_detector(f"cpi:n=20,direction={direction},p_fa=0.02")
    statistic = game(None, [detector], 2000)[detector.name][-1]
    assert stats.kstest(statistic, stats.gamma(10.0, scale=2.0).cdf).pvalue > FALSE_FAILURE
    assert detector.threshold == pytest.approx(stats.gamma.isf(0.02, 10.0, scale=2.0), rel=1e-12)
    alarms = np.count_nonzero(statistic > detector.threshold)
    low, high = stats.binom.ppf(FALSE_FAILURE / 2, 2000, 0.02), stats.binom.isf(FALSE_FAILURE / 2, 2000, 0.02)
    assert low <= alarms <= high


@pytest.mark.parametrize(("sigma", "time"), [(0.03, 0), (0.2, 40)], ids=["white", "coloured"])
def test_tracking_error_is_missed_as_often_as_theory_says(sigma, time):
    """A replica for 40 epochs, 1000 games: binomial counts of P_MD with the filter's feedback, 1e-8 each.

    3 cm white: 0.37 for the CPI and 0.99 for the CI; 20 cm with 40 s: 0.49 and 0.93.
    """
    replica = make_attack(f"tracking-error:ramp:0,sigma={sigma},time={time},axis=up")
    cpi, ci = make_detector("cpi:n=40"), make_detector("ci:n=40")
    statistics = game(replica, [cpi, ci], 1000, seed=3)
    model = FLIGHT.tight_model()
    assert model.dynamics.present.all()
    tracking = cpi_theory.gauss_markov_covariance(40, sigma, time, 0.5)
    whole = tracking_response(model, UP).reshape(-1, 40)
    missed = {}
    for detector, response in ((cpi, projected_response(model, UP)), (ci, whole)):
        count = np.count_nonzero(statistics[detector.name][-1] <= detector.threshold)
        missed[detector.name] = cpi_theory.missed_detection(1e-5, response, tracking)
        low, high = stats.binom.ppf([5e-9, 1.0 - 5e-9], 1000, missed[detector.name])
        assert low <= count <= high
    assert missed[cpi.name] < 0.5 < 0.9 < missed[ci.name]


def test_where_kappa_is_small_it_has_no_power():
    """A tracking error of 1 m against fixes with a noise of 6 m: κ of 0.03 adds twice that to each square at most.

    So a sum of 40 exceeds the quantile of 5 % with a probability of chi-square above it over 1.06; 1e-7.
    """
    flight = make_scenario("liu-flight:horizon=40")
    simulation = Simulation(flight, num_runs=1, seed=0)
    assert 0.02 < kappa(simulation.reset().innovation, 1.0)[0] < 0.03
    replica = make_attack("tracking-error:ramp:0,sigma=1,axis=up")
    detector = make_detector("cpi:n=40,p_fa=0.05")
    alarms = np.count_nonzero(game(replica, [detector], 600, 5, flight)[detector.name][-1] > detector.threshold)
    most = stats.chi2.sf(stats.chi2.isf(0.05, 40) / 1.06, 40)
    assert most < 0.1
    assert alarms <= stats.binom.isf(FALSE_FAILURE, 600, most)


def test_the_cumulative_innovation_is_the_windowed_test():
    detector = make_detector("ci:n=30")
    assert isinstance(detector, Windowed)
    assert detector.name == "windowed:n=30,p_fa=1e-05"
    detector.bind(1, 14)
    assert detector.threshold == pytest.approx(cpi_theory.ci_threshold(1e-5, 30, 14), rel=1e-12)
    assert make_detector("ci:n=30,arl0=1000").target_arl0 == 1000.0
    assert make_detector("ci:n=30,threshold=500").threshold == 500.0


def test_it_is_calibrated_on_ranges():
    """One epoch: chi-square with one degree of freedom, and independent epochs, so that ARL0 = 1 / P_FA."""
    detector = calibrated(make_detector("cpi:n=1,arl0=200"), FLIGHT)
    # 200 first alarms: 6 deviations of the rate
    assert abs(np.log(stats.chi2.sf(detector.threshold, 1) * 200.0)) < 6.0 / np.sqrt(200.0)


def test_it_is_bit_identical_for_any_number_of_runs():
    whole = game(None, [make_detector("cpi:n=10")], 33, seed=5)["cpi:n=10"]
    np.testing.assert_array_equal(game(None, [make_detector("cpi:n=10")], 2, seed=20)["cpi:n=10"], whole[:, 15:17])


@pytest.mark.parametrize(
    "specification",
    [
        "cpi",
        "cpi:n=10",
        "cpi:direction=east",
        "cpi:direction=45",
        "cpi:arl0=100000",
        "cpi:threshold=90",
        "cpi:n=360,direction=north,p_fa=0.001",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, Cpi)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.memory == detector.n - 1
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("cpi:0", "n must be a whole number, 1 or more, got 0"),
        ("cpi:direction=down", "direction must be east, north, up or an azimuth in degrees, got 'down'"),
        ("cpi:direction=inf", "direction must be a finite number"),
        ("cpi:p_fa=1", "p_fa must be greater than 0 and less than 1, got 1"),
        ("cpi:threshold=-2", "threshold must be a finite number greater than 0, got -2"),
        ("cpi:arl0=1", "arl0 must be a finite number greater than 1, got 1"),
        ("cpi:p_fa=0.1,arl0=10", "at most one of threshold, p_fa, arl0; got p_fa and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
