from __future__ import annotations

import numpy as np
import pytest

from spoofgym.detectors import Acna, make_detector
from spoofgym.detectors.acna import horizontal_drift
from spoofgym.navigation.facts import ODOMETER, FilterFacts
from spoofgym.navigation.interface import Epoch, Innovation


def epoch_of(drift, height=0.0, k=0):
    """Innovations whose horizontal norm is ``drift`` (N,), in directions that differ from run to run."""
    drift = np.asarray(drift, dtype=float)
    n = len(drift)
    angle = 0.7 * np.arange(n) + 0.1 * k
    residual = np.stack([drift * np.cos(angle), -drift * np.sin(angle), np.full(n, height)], axis=1)
    return Epoch(np.full(n, k), np.full(n, float(k)), Innovation(residual, np.zeros((n, 3, 3)), residual, np.zeros(n)))


def run(detector, drifts):
    """Statistics (K, N) of drifts (K, N)."""
    detector.bind(drifts.shape[1], 3)
    return np.array([detector.update(epoch_of(drift, k=k)) for k, drift in enumerate(drifts)])


class SongSteps:
    """Steps 1 to 8 of Song 2021 for one run, flags and all, as the paper prints them."""

    def __init__(self, n_j, th_j, n_s, th_s):
        self.n_j, self.th_j, self.n_s, self.th_s = n_j, th_j, n_s, th_s
        self.flag_j = 0
        self.drifts = []

    def step(self, drift):
        self.drifts.append(drift)
        if drift > self.th_j:
            self.flag_j += 1
            if self.flag_j >= self.n_j:
                return True
        else:
            self.flag_j = 0
        flag_s = sum(self.drifts[-self.n_s :]) / self.n_s
        return flag_s >= self.th_s


def test_hand_computed_sequence():
    """Th_j = 1.5 m over 2 epochs, Th_s = 1.28 m as the mean of 5."""
    drifts = np.array([[0.5], [0.5], [0.5], [0.5], [0.5], [2.0], [1.8], [0.0], [3.0], [0.0], [0.64]])
    expected = [
        0.1 / 1.28,  # mean 0.5 / 5
        0.5 / 1.5,  # two drifts of 0.5: the jump test leads until the mean is full
        0.5 / 1.5,
        0.5 / 1.5,
        0.5 / 1.28,
        0.8 / 1.28,  # mean (4 x 0.5 + 2) / 5; a single false point is no jump
        1.8 / 1.5,  # two consecutive drifts of at least 1.8: jump
        0.96 / 1.28,  # mean (0.5 + 0.5 + 2 + 1.8 + 0) / 5
        1.46 / 1.28,  # mean (0.5 + 2 + 1.8 + 0 + 3) / 5: slow change by one large sample
        1.36 / 1.28,  # mean (2 + 1.8 + 0 + 3 + 0) / 5
        1.088 / 1.28,  # mean (1.8 + 0 + 3 + 0 + 0.64) / 5
    ]
    statistics = run(Acna(preset="song"), drifts)[:, 0]
    np.testing.assert_allclose(statistics, expected, rtol=1e-12)
    np.testing.assert_array_equal(np.flatnonzero(statistics > 1.0), [6, 8, 9])


@pytest.mark.parametrize(("n_j", "n_s"), [(2, 5), (3, 4), (4, 12)])
def test_alarms_are_those_of_the_papers_steps(n_j, n_s):
    generator = np.random.default_rng(n_j)
    level = np.repeat(generator.uniform(0.3, 2.0, (60, 8)), 10, axis=0)
    drifts = generator.rayleigh(level)
    resets = {0: range(8), 100: [3], 101: [3, 5], 333: [0, 7]}
    detector = make_detector(f"acna:{n_j},slow_epochs={n_s},jump_threshold=1.5,slow_threshold=1.28")
    detector.bind(8, 3)
    steps = {}
    alarms = 0
    for k, drift in enumerate(drifts):
        for i in resets.get(k, ()):
            detector.reset(np.array([i]))
            steps[i] = SongSteps(n_j, 1.5, n_s, 1.28)
        alarm = detector.update(epoch_of(drift, k=k)) > detector.threshold
        np.testing.assert_array_equal(alarm, [steps[i].step(drift[i]) for i in range(8)])
        alarms += alarm.sum()
    assert 0.05 < alarms / drifts.size < 0.95


def test_drift_is_horizontal():
    assert horizontal_drift(np.array([[3.0, -4.0, 100.0], [0.0, 0.0, 7.0]])).tolist() == [5.0, 0.0]
    np.testing.assert_array_equal(
        horizontal_drift(np.array([[3.0, -4.0, 1.0, 9.0, 9.0, 9.0]])), horizontal_drift(np.array([[3.0, -4.0, 0.0]]))
    )


def test_bit_identical_for_any_number_of_runs():
    residual = np.random.default_rng(0).standard_normal((40, 1024, 3))

    def statistics(first, last):
        detector = Acna(jump_epochs=3, slow_epochs=11)
        detector.bind(last - first, 3)
        return np.array(
            [
                detector.update(Epoch(None, None, Innovation(values[first:last].copy(), None, None, None)))
                for values in residual
            ]
        )

    whole = statistics(0, 1024)
    for first, last in ((0, 1), (9, 10), (3, 10), (700, 777)):
        np.testing.assert_array_equal(statistics(first, last), whole[:, first:last])


def test_take_brings_the_memory_of_fewer_runs():
    drifts = np.random.default_rng(0).rayleigh(1.0, (20, 5))
    runs = np.array([3, 0])
    whole, part = Acna(), Acna()
    run(whole, drifts[:13] + 50.0)
    run(part, drifts[6:13][:, runs])
    whole.take(runs, part)
    for drift in drifts[13:]:
        np.testing.assert_allclose(whole.update(epoch_of(drift))[runs], part.update(epoch_of(drift[runs])), rtol=1e-12)


def test_song_needs_no_calibration_and_the_default_does():
    song, default = make_detector("acna:preset=song"), make_detector("acna")
    assert (song.threshold, song.jump_threshold, song.slow_threshold, song.target_arl0) == (1.0, 1.5, 1.28, None)
    assert (default.jump_epochs, default.slow_epochs, default.memory) == (2, 5, 4)
    assert default.threshold is None
    assert default.target_arl0 == 1e5
    assert default.jump_threshold / default.slow_threshold == pytest.approx(1.5 / 1.28)


def test_one_factor_scales_both_thresholds():
    drifts = np.random.default_rng(3).rayleigh(1.0, (300, 4))
    scaled, explicit = Acna(), Acna(jump_threshold=1.7 * 1.5, slow_threshold=1.7 * 1.28)
    scaled.set_threshold(1.7, 1e5)
    np.testing.assert_array_equal(run(scaled, drifts) > scaled.threshold, run(explicit, drifts) > explicit.threshold)


@pytest.mark.parametrize(
    "specification",
    [
        "acna",
        "acna:preset=song",
        "acna:arl0=10000",
        "acna:jump_epochs=3,slow_epochs=7",
        "acna:jump_threshold=2,slow_threshold=1.5",
        "acna:preset=song,position=auxiliary",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    assert make_detector(specification).name == specification


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("acna:jump_epochs=1", "jump_epochs must be a whole number, 2 or more, got 1"),
        ("acna:slow_epochs=2", "slow_epochs must be a whole number, 3 or more, got 2"),
        ("acna:jump_epochs=5", "slow_epochs must be a whole number, 6 or more, got 5"),
        ("acna:jump_threshold=1.5", "jump_threshold needs slow_threshold"),
        ("acna:slow_threshold=1.5", "slow_threshold needs jump_threshold"),
        ("acna:jump_threshold=0,slow_threshold=1", "jump_threshold must be a finite number greater than 0, got 0.0"),
        ("acna:jump_threshold=1,slow_threshold=-1", "slow_threshold must be a finite number greater than 0, got -1.0"),
        ("acna:jump_threshold=nan,slow_threshold=1", "jump_threshold must be a finite number greater than 0, got nan"),
        ("acna:preset=liu", "preset must be one of song, got 'liu'"),
        ("acna:preset=song,arl0=100", "got preset and arl0"),
        ("acna:jump_threshold=1,slow_threshold=1,preset=song", "got jump_threshold and preset"),
        ("acna:arl0=1", "arl0 must be a finite number greater than 1, got 1.0"),
        ("acna:position=odometer", "position must be one of innovation, auxiliary, got 'odometer'"),
        ("acna:window=3", "no option 'window'; valid options: jump_epochs"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)


class View:
    """What a navigator with an odometer would tell."""

    def __init__(self, auxiliary_offset):
        self.auxiliary_offset = auxiliary_offset


def test_the_auxiliary_drift_is_that_of_fix_and_dead_reckoning():
    """Whatever the filter believes."""
    rng = np.random.default_rng(0)
    fix, dead_reckoned = rng.normal(0.0, 3.0, (2, 6, 50, 3))
    statistics = []
    for spread in (1.0, 100.0):
        detector = Acna(preset="song", position="auxiliary")
        detector.bind(50, 3)
        believed = rng.normal(0.0, spread, (6, 50, 3))
        for k in range(6):
            innovation = Innovation(believed[k] - fix[k], None, None, None)
            epoch = Epoch(None, None, innovation, view=View(dead_reckoned[k] - believed[k]))
            statistics.append(detector.update(epoch))
    drift = np.hypot(*(fix - dead_reckoned)[..., :2].transpose(2, 0, 1))
    slow = drift[1:].mean(axis=0) / 1.28
    expected = np.maximum(drift[4:].min(axis=0) / 1.5, slow)
    np.testing.assert_allclose(statistics[5], expected, rtol=1e-9)
    np.testing.assert_allclose(statistics[11], expected, rtol=1e-9)


def test_the_auxiliary_position_needs_a_navigator():
    detector = Acna(preset="song", position="auxiliary")
    assert (detector.needs, detector.needs_view, detector.demands.auxiliary) == ((ODOMETER,), True, True)
    assert (Acna().needs, Acna().needs_view) == ((), False)
    detector.bind(1, 3)
    with pytest.raises(RuntimeError, match="known to a navigator only"):
        detector.update(epoch_of([1.0]))


def test_an_interruption_neither_counts_nor_forgets():
    """Step 3: back to step 3. Two drifts of 2 m with an outage between them are a jump."""
    detector = Acna(preset="song")
    detector.bind(2, 3)
    detector.update(epoch_of([2.0, 2.0], k=0))
    outage = epoch_of([0.0, 0.3], k=1)
    outage = Epoch(outage.index, outage.time, outage.innovation, available=np.array([False, True]))
    statistic = detector.update(outage)
    assert statistic[0] == 0.0
    assert statistic[1] == pytest.approx(2.3 / 5 / 1.28)
    statistic = detector.update(epoch_of([2.0, 2.0], k=2))
    assert statistic[0] == pytest.approx(2.0 / 1.5)
    assert statistic[1] == pytest.approx(4.3 / 5 / 1.28)


def facts(sigma, drift):
    return FilterFacts("made up", 1.0, np.ones(6), (ODOMETER,), lambda burn_in: None, sigma, drift)


@pytest.mark.parametrize(
    ("specification", "sigma", "drift", "message"),
    [
        ("acna:preset=song,position=auxiliary", 0.59, 0.2, None),
        ("acna:preset=song,position=auxiliary", 0.4, 0.2, r"Th_j = 1.5 m .* from 0.4 to 1.2 m"),
        ("acna:preset=song,position=auxiliary", 1.4, 0.2, r"Th_s = 1.28 m .* from 1.4 to 4.2 m"),
        ("acna:preset=song,position=auxiliary", 0.59, 1.3, r"at least what dead reckoning .* 1.3 m .*eq 21"),
        ("acna:preset=song", 0.4, 5.0, None),
        ("acna:position=auxiliary", 0.01, 5.0, None),
        ("acna:preset=song,position=auxiliary", None, None, None),
    ],
)
def test_the_constraints_of_the_paper(specification, sigma, drift, message):
    """Eqs 17 to 21, where the receiver's sigma is known and the thresholds are given."""
    detector = make_detector(specification)
    if message is None:
        detector.know(facts(sigma, drift))
    else:
        with pytest.raises(ValueError, match=message):
            detector.know(facts(sigma, drift))
