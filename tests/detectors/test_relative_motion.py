import copy

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.calibration import thresholds as calibration
from spoofgym.detectors import RelativeMotion, make_detector
from spoofgym.navigation.interface import Decision, Demands, Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.one_detector import simulated_statistics

SCENARIO = "liu-flight:horizon=40"


def by_the_report(gnss, ins, i, k, lag):
    """The sums of FOI-R-5687 for one run, (K, 3) each; tests (1) and (2) where the lag is k and 1."""
    return sum(np.linalg.norm((gnss[j] - gnss[j - lag]) - (ins[j] - ins[j - lag])) for j in range(i - k + lag, i + 1))


@pytest.mark.parametrize(("k", "lag"), [(5, 5), (5, 1), (5, 3), (1, 1), (20, 20), (20, 7)])
def test_the_sums_of_the_report(motion, k, lag):
    """The position of the filter drops out; before k epochs of the game have come there is nothing."""
    world = motion(k + lag, 45, 3)
    statistics = world.run(RelativeMotion(k, lag, slope=0.02, threshold=1.0))
    for i in range(45):
        for run in range(3):
            gnss, ins = world.gnss[:, run], world.ins[:, run]
            expected = by_the_report(gnss, ins, i, k, lag) - 0.02 * 0.5 * i if i >= k else 0.0
            assert statistics[i, run] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_window_is_silent_while_an_end_of_its_terms_has_no_fix(motion):
    world = motion(3, 40, 2)
    world.available[15:17, 1] = False
    whole = motion(3, 40, 2)
    for k, lag in ((6, 6), (6, 1), (6, 4)):
        detector = RelativeMotion(k, lag, slope=0.0, threshold=1.0)
        statistics, undisturbed = world.run(copy.copy(detector)), whole.run(detector)
        ends = [{j for term in range(i - k + lag, i + 1) for j in (term, term - lag)} for i in range(40)]
        touched = np.array([bool(ends[i] & {15, 16}) for i in range(40)])
        np.testing.assert_array_equal(statistics[touched, 1], 0.0)
        np.testing.assert_array_equal(statistics[~touched, 1], undisturbed[~touched, 1])
        np.testing.assert_array_equal(statistics[:, 0], undisturbed[:, 0])
        assert touched.sum() == {6: 4, 1: 8, 4: 8}[lag]


def test_epochs_before_the_game_do_not_count(motion):
    """With a filter or without one; the growth counts from epoch 0."""
    world = motion(4, 30, 2)
    world.index -= 9
    later = motion(4, 30, 2)
    for name in ("gnss", "ins", "filter"):
        setattr(later, name, getattr(world, name)[9:])
    detector = RelativeMotion(5, slope=0.1, threshold=1.0)
    np.testing.assert_array_equal(world.run(copy.copy(detector))[:14], 0.0)
    after = motion(4, 21, 2)
    after.gnss, after.ins, after.filter = world.gnss[9:], world.ins[9:], world.filter[9:]
    np.testing.assert_array_equal(world.run(copy.copy(detector))[9:], after.run(detector))
    detector.bind(2, 3)
    blank = Innovation(np.ones((2, 3)), np.zeros((2, 3, 3)), np.ones((2, 3)), np.ones(2))
    assert detector.update(Epoch(np.array([-1, -1]), np.zeros(2), blank)).tolist() == [0.0, 0.0]


def test_resets_of_some_runs_and_any_number_of_runs(motion):
    world = motion(5, 50, 70)
    detector = RelativeMotion(8, 3, slope=0.05, threshold=1.0)
    whole = world.run(copy.copy(detector))
    for part in (slice(0, 1), slice(3, 10), slice(2, 66)):
        np.testing.assert_array_equal(world.run(copy.copy(detector), part), whole[:, part])
    detector.bind(70, 3)
    for k in range(20):
        detector.update(world.epoch(k))
    detector.reset(np.array([4, 9]))
    for k in range(20, 28):
        statistic = detector.update(world.epoch(k))
        assert statistic[[4, 9]].tolist() == [0.0, 0.0]
        np.testing.assert_array_equal(np.delete(statistic, [4, 9]), np.delete(whole[k], [4, 9]))
    again = detector.update(world.epoch(28))  # its growth counts from epoch 20
    assert again[4] == pytest.approx(whole[28, 4] + 0.05 * 0.5 * 20, rel=1e-12)


def play(decide, detector, fidelity="linear"):
    """Statistics of every epoch of a spoofed flight."""
    demands = Demands(excludes=True, history=10)
    simulation = Simulation(
        make_scenario(SCENARIO),
        make_attack("ramp:2,onset=815"),
        [detector],
        None,
        4,
        3,
        fidelity=fidelity,
        demands=demands,
    )
    rows = [simulation.reset().statistics[detector.name].copy()]
    for k in range(40):
        simulation.resolve(decide(k))
        rows.append(simulation.observe().statistics[detector.name].copy())
    return np.array(rows)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_what_the_filter_does_with_the_fixes_does_not_matter(fidelity):
    everywhere = np.ones(4, dtype=bool)
    plans = [
        lambda k: Decision(everywhere),
        lambda k: Decision(~everywhere),
        lambda k: Decision(everywhere, backtrack=np.array([0, 3, 7, 10]) if k == 25 else None),
    ]
    used, left_out, taken_back = (play(plan, RelativeMotion(10, slope=0.0, threshold=20.0), fidelity) for plan in plans)
    tolerance = 1e-6 if fidelity == "linear" else 0.02  # the unaided solution is carried to first order
    np.testing.assert_allclose(left_out, used, atol=tolerance)
    np.testing.assert_allclose(taken_back, used, atol=tolerance)
    assert used[10:15].max() < 40.0
    # 10 epochs of a ramp of 2 m/s, beside two fixes of 3.7, 3.7 and 6 m and the drift
    assert 0.0 < np.median(used[30:]) < 60.0


def test_the_slope_is_the_least_squares_line_of_clean_runs(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 2000)
    scenario = make_scenario(SCENARIO)
    detector = calibrated(make_detector("relative-motion:k=10,arl0=500"), scenario)
    assert detector.calibrated
    assert not detector.lacks_slope
    raw = RelativeMotion(10, slope=0.0, threshold=1.0)
    _, statistics = simulated_statistics(scenario, "linear")(raw, 1000, np.random.default_rng(1))
    expected = np.polyfit(scenario.timeline.times[10:], statistics[:, 10:].mean(axis=0), 1)[0]
    assert detector.slope == pytest.approx(expected, rel=1e-9)
    # the threshold on runs of their own, counted by hand; 6 deviations of two independent counts
    raw = RelativeMotion(10, slope=detector.slope, threshold=1.0)
    _, statistics = simulated_statistics(scenario, "linear")(raw, 3500, np.random.default_rng(123))
    over = statistics > detector.threshold
    alarmed = over.any(axis=1)
    at_risk = np.where(alarmed, over.argmax(axis=1) + 1, 41).sum()
    assert alarmed.sum() > 150
    assert abs(np.log(at_risk / alarmed.sum() / 500.0)) < 6.0 * np.sqrt(1 / alarmed.sum() + 1 / 100)


def test_a_published_threshold_takes_its_slope_from_clean_runs(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    scenario = make_scenario(SCENARIO)
    with pytest.raises(ValueError, match="has no threshold yet: calibrate it first"):
        Simulation(scenario, None, [make_detector("relative-motion:k=5,preset=foi")])
    ready = calibrated(make_detector("relative-motion:k=5,preset=foi"), scenario)
    assert (ready.threshold, ready.arl0, ready.lacks_slope) == (1.9, None, False)
    assert ready.slope > 0.0
    given = calibrated(make_detector("relative-motion:k=5,slope=0.01,preset=foi"), scenario)
    assert (given.threshold, given.slope) == (1.9, 0.01)
    by_hand = calibrated(make_detector("relative-motion:threshold=7"), scenario)
    assert (by_hand.threshold, by_hand.slope, by_hand.arl0) == (7.0, 0.0, None)


def test_a_game_shorter_than_the_window_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    monkeypatch.setattr(calibration, "RUNS", 500)
    scenario = make_scenario("liu-flight:horizon=8")
    with pytest.raises(ValueError, match="the game is too short for its window"):
        calibrated(make_detector("relative-motion:k=8"), scenario)
    with pytest.raises(ValueError, match="the statistic is 0 in all clean runs"):
        calibrated(make_detector("relative-motion:k=9,slope=0"), scenario)


@pytest.mark.parametrize(
    "specification",
    [
        "relative-motion",
        "relative-motion:k=5",
        "relative-motion:k=5,lag=1",
        "relative-motion:k=5,lag=3,slope=0.01,threshold=2.5",
        "relative-motion:slope=0",
        "relative-motion:k=5,preset=foi",
        "relative-motion:lag=1,preset=foi",
        "relative-motion:arl0=10000",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert detector.name == specification
    assert detector.demands.auxiliary
    assert detector.memory == 0


def test_the_default_is_test_one_with_the_arl0_of_the_house():
    detector = make_detector("relative-motion")
    assert (detector.k, detector.lag, detector.target_arl0, detector.threshold) == (20, 20, 1e5, None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("relative-motion:0", "k must be a whole number, 1 or more, got 0"),
        ("relative-motion:k=5,lag=6", "lag must be a whole number from 1 to k = 5, got 6"),
        ("relative-motion:k=5,lag=0", "lag must be a whole number, 1 or more, got 0"),
        ("relative-motion:slope=nan", "slope must be a finite number, got nan"),
        ("relative-motion:threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("relative-motion:k=7,preset=foi", "preset foi is for k=5 with lag=5, .*got k=7 with lag=7"),
        ("relative-motion:preset=song", "preset must be one of foi, got 'song'"),
        ("relative-motion:threshold=3,arl0=10", "at most one of threshold, preset, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
