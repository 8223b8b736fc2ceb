import numpy as np
import pytest
from scipy import stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import WindowBank, make_detector

FALSE_FAILURE = 1e-7


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_largest_sum_over_its_quantile_since_the_reset_of_each_run(white, dimension):
    whitened = np.random.default_rng(1).standard_normal((60, 4, dimension))
    whitened[20:24, 1] = 0.0  # no fix
    resets = {0: [0, 1, 2, 3], 13: [2], 40: [0, 2]}
    statistic = white.run(WindowBank("2+7+30", 1e-4, threshold=1.0), whitened, resets=resets)
    since = white.since(60, 4, resets)
    nis = (whitened**2).sum(axis=2)
    for k in range(60):
        for i in range(4):
            sums = {n: nis[max(since[k, i], k - n + 1) : k + 1, i].sum() for n in (2, 7, 30)}
            expected = max(total / stats.chi2.isf(1e-4 / 3, n * dimension) for n, total in sums.items())
            assert statistic[k, i] == pytest.approx(expected, rel=1e-9)


def test_a_bank_of_one_is_the_windowed_test(white):
    whitened = np.random.default_rng(2).standard_normal((30, 5, 3))
    windowed = white.run(make_detector("windowed:n=7,threshold=1"), whitened)
    bank = white.run(make_detector("window-bank:lengths=7,budget=0.001,threshold=1"), whitened)
    np.testing.assert_allclose(bank, windowed / stats.chi2.isf(0.001, 21), rtol=1e-9)


def test_the_bounds_keep_the_budget_of_an_epoch(white):
    """Each window exceeds its bound with a third of the budget; the union is between one share and the budget."""
    whitened = np.random.default_rng(3).standard_normal((20, 40_000, 3))
    alarms = np.count_nonzero(white.run(WindowBank("1+5+20", 0.03, threshold=1.0), whitened)[-1] > 1.0)
    assert stats.binom.ppf(FALSE_FAILURE, 40_000, 0.01) < alarms < stats.binom.isf(FALSE_FAILURE, 40_000, 0.03)


def test_short_windows_see_what_is_fast_and_long_ones_what_is_slow(white):
    """Deterministic innovations: the sum of every window is known, and so is which of them decides."""
    jump = np.zeros((60, 1, 3))
    jump[-1, 0, 0] = 6.0
    slow = np.full((60, 1, 3), 1.5)
    bank = WindowBank("1+60", 1e-5, threshold=1.0)
    assert white.run(bank, jump)[-1] == pytest.approx(36.0 / stats.chi2.isf(5e-6, 3))
    assert white.run(bank, slow)[-1] == pytest.approx(60 * 6.75 / stats.chi2.isf(5e-6, 180))
    assert white.run(WindowBank("1", threshold=1.0), slow)[-1] < 1.0 < white.run(bank, slow)[-1]
    assert white.run(WindowBank("60", threshold=1.0), jump)[-1] < 1.0 < white.run(bank, jump)[-1]


def test_the_calibrated_arl0_in_an_independent_simulation():
    """Cumulative sums of chi-square numbers, without the package's code; 4000 first alarms decide the threshold."""
    arl0 = 200.0
    bank = WindowBank("1+5", 1e-3)
    found = calibrate(bank, white_statistics(np.eye(3), 200), arl0, first_alarms=4000, seed=1)
    rng = np.random.default_rng(77)
    alarms = at_risk = 0
    for _ in range(4):
        nis = rng.chisquare(3, (5000, 204))
        total = np.cumsum(nis, axis=1)
        total[:, 5:] -= total[:, :-5].copy()
        statistic = np.maximum(nis / stats.chi2.isf(5e-4, 3), total / stats.chi2.isf(5e-4, 15))
        statistic = statistic[(statistic[:, :4] <= found.threshold).all(axis=1), 4:]
        over = statistic > found.threshold
        alarmed = over.any(axis=1)
        alarms += int(alarmed.sum())
        at_risk += int(np.where(alarmed, over.argmax(axis=1) + 1, 200).sum())
    # 6 deviations of two independent counts: 2e-9
    assert abs(np.log(at_risk / alarms / arl0)) < 6.0 * np.sqrt(1 / alarms + 1 / found.first_alarms)


def test_runs_are_independent(white):
    whitened = np.random.default_rng(4).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: WindowBank("2+9", threshold=1.0), whitened)


def test_names_and_defaults():
    for text in ("window-bank", "window-bank:lengths=3+30,budget=0.001,arl0=1000", "window-bank:threshold=1.2"):
        assert make_detector(text).name == text
    detector = make_detector("window-bank")
    assert (detector.lengths, detector.memory, detector.target_arl0) == ((5, 10, 20, 60), 59, 1e5)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("window-bank:5+5", r"lengths must be whole numbers, 1 or more and increasing, .* got '5\+5'"),
        ("window-bank:0+5", r"lengths must be whole numbers, 1 or more and increasing, .* got '0\+5'"),
        ("window-bank:5+x", r"lengths must be whole numbers, 1 or more and increasing, .* got '5\+x'"),
        ("window-bank:budget=1", "budget must be greater than 0 and less than 1, got 1"),
        ("window-bank:threshold=1,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
