import copy
import json

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration import cache as calibration_cache
from spoofgym.calibration import calibrate, calibrated
from spoofgym.calibration import thresholds as calibration
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import Ensemble, SignedMean, Snapshot, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.navigation.interface import Demands, Epoch, Innovation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FLIGHT = make_scenario("liu-flight:horizon=60")


def epoch_of(whitened, k=0):
    n, m = whitened.shape
    nis = np.add.reduce(whitened**2, axis=1)
    return Epoch(np.full(n, k), np.full(n, float(k)), Innovation(whitened, np.zeros((n, m, m)), whitened, nis))


def members(first=10.0, second=4.0):
    return [Snapshot(threshold=first), SignedMean(3, threshold=second)]


def run(detector, whitened):
    """Statistics (K, N) of whitened innovations (K, N, m)."""
    detector.bind(whitened.shape[1], whitened.shape[2])
    return np.array([detector.update(epoch_of(values, k)) for k, values in enumerate(whitened)])


def test_the_statistic_is_the_largest_of_the_members_over_their_thresholds():
    whitened = np.random.default_rng(0).standard_normal((20, 30, 3))
    apart = [run(member, whitened) / member.threshold for member in members()]
    together = run(Ensemble(members(), threshold=1.0), whitened)
    np.testing.assert_array_equal(together, np.maximum(*apart))
    assert np.any(apart[0] > apart[1])
    assert np.any(apart[0] < apart[1])


def test_a_reset_of_some_runs_reaches_every_member():
    whitened = np.random.default_rng(1).standard_normal((20, 3, 3))
    detector, new = (Ensemble([SignedMean(n, threshold=4.0) for n in (3, 4)], threshold=1.0) for _ in range(2))
    run(detector, whitened[:10])
    detector.reset(np.array([1]))
    new.bind(3, 3)
    for k in range(10, 20):
        got, fresh = detector.update(epoch_of(whitened[k], k)), new.update(epoch_of(whitened[k], k))
        assert got[1] == fresh[1]
        if k == 10:
            assert np.all(got[[0, 2]] != fresh[[0, 2]])


def test_take_reaches_every_member():
    whitened = np.random.default_rng(2).standard_normal((20, 4, 3))
    whole, small = Ensemble(members(), threshold=1.0), Ensemble(members(), threshold=1.0)
    run(whole, whitened[:8])
    run(small, whitened[:8, :2] + 3.0)
    runs = np.array([3, 0])
    whole.take(runs, small)
    for k in range(8, 12):
        got = whole.update(epoch_of(whitened[k], k))
        np.testing.assert_array_equal(got[runs], small.update(epoch_of(whitened[k, runs], k)))


def test_two_that_are_bound_share_no_memory():
    whitened = np.random.default_rng(3).standard_normal((10, 2, 3))
    given = members()
    one, other = Ensemble(given, threshold=1.0), Ensemble(given, threshold=1.0)
    third = copy.copy(one)
    for detector in (one, other, third):
        detector.bind(2, 3)
    for k in range(5):
        one.update(epoch_of(100.0 + whitened[k], k))
    expected = run(Ensemble(members(), threshold=1.0), whitened)
    for detector in (other, third):
        np.testing.assert_array_equal([detector.update(epoch_of(whitened[k], k)) for k in range(10)], expected)


def test_it_is_bit_identical_for_any_number_of_runs():
    whitened = np.random.default_rng(3).standard_normal((20, 67, 3))
    whole = run(Ensemble(members(), threshold=1.0), whitened)
    for part in (slice(0, 1), slice(3, 10), slice(10, 42)):
        np.testing.assert_array_equal(run(Ensemble(members(), threshold=1.0), whitened[:, part]), whole[:, part])


# --- calibration ------------------------------------------------------------------------------------------------------


def independent_arl0(limits, factor, runs, epochs, seed):
    """ARL0 of the union of snapshot and signed-mean:n=5 on white noise, and its first alarms, in plain NumPy."""
    whitened = np.random.default_rng(seed).standard_normal((runs, 4 + epochs, 3))
    total = np.cumsum(whitened[:, :, :2], axis=1)
    total[:, 5:] -= total[:, :-5].copy()
    statistics = (whitened**2).sum(axis=2), (total**2).sum(axis=2) / 5
    over = np.logical_or(*(s > factor * limit for s, limit in zip(statistics, limits, strict=True)))
    over = over[~over[:, :4].any(axis=1), 4:]
    alarmed = over.any(axis=1)
    at_risk = np.where(alarmed, over.argmax(axis=1) + 1, epochs).sum()
    return at_risk / alarmed.sum(), int(alarmed.sum())


def test_the_union_has_the_arl0_that_was_asked_for():
    """Members at an ARL0 of 200 each, then one factor for both; 6 deviations of two independent counts (2e-9)."""
    arl0, factor = 200.0, np.diag([4.0, 3.0, 6.0])
    alone = [Snapshot(arl0=arl0), SignedMean(5, arl0=arl0)]
    for member in alone:
        found = calibrate(member, white_statistics(factor, 100), arl0, first_alarms=2000, seed=1)
        member.set_threshold(found.threshold, found.arl0)
    limits = [member.threshold for member in alone]
    union = calibrate(Ensemble(alone), white_statistics(factor, 100), arl0, first_alarms=4000, seed=2)
    measured, alarms = independent_arl0(limits, union.threshold, 20_000, 100, 7)
    assert abs(np.log(measured / arl0)) < 6.0 * np.sqrt(1 / alarms + 1 / union.first_alarms)
    # without the factor two tests that see little of each other alarm nearly twice as often
    plain, alarms = independent_arl0(limits, 1.0, 20_000, 100, 8)
    assert arl0 / 2.0 < plain * (1.0 + 6.0 / np.sqrt(alarms) + 6.0 / np.sqrt(2000))
    assert plain < 0.75 * arl0


def test_calibration_sets_every_member_first_and_then_their_union():
    made = make_detector("ensemble:snapshot+signed-mean:n=5,arl0=200")
    ready = calibrated(made, FLIGHT)
    assert [member.name for member in ready.members] == ["snapshot:arl0=200", "signed-mean:arl0=200"]
    for member in ready.members:
        alone = calibrated(make_detector(member.name), FLIGHT)
        assert (member.threshold, member.arl0) == (alone.threshold, alone.arl0)
        assert member.target_arl0 == 200.0
    assert ready.calibrated
    assert 1.0 < ready.threshold < 1.5
    low, high = ready.arl0_interval
    assert low < 200.0 < high
    measured, alarms = independent_arl0([member.threshold for member in ready.members], ready.threshold, 20_000, 60, 9)
    # 200 first alarms decide: 6 deviations (2e-9)
    assert abs(np.log(measured / 200.0)) < 6.0 * np.sqrt(1 / alarms + 1 / 200)
    assert made.threshold is None  # the one that was given stays as it is
    assert all(member.threshold is None for member in made.members if member.name != "snapshot:arl0=200")


def test_it_is_kept_on_disk_with_its_members(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(tmp_path))
    monkeypatch.setattr(calibration, "_KNOWN", {})
    name = "ensemble:windowed:n=2+signed-mean:n=2,arl0=50"
    assert calibration_cache.spelled_out(make_detector(name))
    first = calibrated(make_detector(name), FLIGHT)
    remarks = [json.loads(path.read_text())["what"] for path in tmp_path.iterdir()]
    assert sum(remark.startswith("ensemble:") for remark in remarks) == 1
    assert len(remarks) == 3
    monkeypatch.setattr(calibration, "_KNOWN", {})
    for function in ("calibrate", "calibrate_together"):
        monkeypatch.setattr(calibration, function, lambda *_, **__: pytest.fail("calibrated again"))
    again = calibrated(make_detector(name), FLIGHT)
    assert (again.threshold, again.arl0, again.arl0_interval) == (first.threshold, first.arl0, first.arl0_interval)
    assert [member.threshold for member in again.members] == [member.threshold for member in first.members]


class Own(Detector):
    """A user's detector, which no name builds."""

    name = "own"
    threshold = 50.0

    def update(self, epoch):
        return epoch.innovation.nis


def test_one_with_a_users_detector_is_not_kept_on_disk():
    assert not calibration_cache.spelled_out(Ensemble([Own(), SignedMean()]))


def test_it_plays_in_a_simulation():
    """Its alarms are those of its members at their thresholds times the factor."""
    ensemble = calibrated(make_detector("ensemble:snapshot+solution-separation:n=5,arl0=200"), FLIGHT)
    beside = [copy.copy(member) for member in ensemble.members]
    simulation = Simulation(FLIGHT, make_attack("ramp:2"), [ensemble, *beside], num_runs=50, seed=4)
    epoch = simulation.reset()
    alarms = 0
    for _ in range(60):
        together = epoch.statistics[ensemble.name] > ensemble.threshold
        apart = [epoch.statistics[member.name] / member.threshold > ensemble.threshold for member in beside]
        np.testing.assert_array_equal(together, np.logical_or(*apart))
        alarms += together.sum()
        simulation.resolve()
        epoch = simulation.observe()
    assert alarms > 100


# --- names and what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "specification",
    [
        "ensemble:snapshot+windowed",
        "ensemble:snapshot+signed-mean:arl0=100000,threshold=1.2",
        "ensemble:windowed:n=5/arl0=1000+signed-mean:n=10,arl0=1000",
        "ensemble:windowed:n=5/threshold=50+acna:preset=song+px4-gate,arl0=2000",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, Ensemble)
    again = make_detector(detector.name)
    assert again.name == detector.name
    assert [member.name for member in again.members] == [member.name for member in detector.members]
    assert (again.threshold, again.target_arl0) == (detector.threshold, detector.target_arl0)


def test_a_member_whose_options_hold_a_plus_is_spelled_with_a_tilde():
    detector = make_detector("ensemble:snapshot+window-bank:lengths=5~20/budget=1e-4,arl0=300")
    assert detector.members[1].name == "window-bank:lengths=5+20,budget=0.0001,arl0=300"
    assert make_detector(detector.name).name == detector.name
    assert "lengths=5~20" in detector.name


def test_members_are_nested_with_slash_and_plus_and_take_its_arl0():
    detector = make_detector("ensemble:windowed:n=5/threshold=50+signed-mean:n=10+px4-gate:gate=7,arl0=2000")
    names = ["windowed:n=5,threshold=50", "signed-mean:n=10,arl0=2000", "px4-gate:gate=7"]
    assert [member.name for member in detector.members] == names
    assert detector.name == "ensemble:windowed:n=5/threshold=50+signed-mean:n=10/arl0=2000+px4-gate:gate=7,arl0=2000"


def test_it_has_the_memory_and_the_demands_of_its_members():
    detector = make_detector("ensemble:windowed:n=7+acceleration+signed-mean:n=9")
    assert detector.memory == 8
    assert detector.needs_view
    assert detector.demands == Demands(auxiliary=True)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("ensemble:snapshot", r"members must be two or more detectors, all different, got \['snapshot:arl0=100000'\]"),
        ("ensemble:snapshot+snapshot", "members must be two or more detectors, all different"),
        ("ensemble:snapshot+other", "unknown detector 'other'"),
        ("ensemble:snapshot+windowed:n=x", "members: 'windowed:n=x': .*n must be a whole .*'/' stands for ',' and '~'"),
        ("ensemble:snapshot+window-bank:lengths=5+20", "ensemble: members: '20': unknown detector '20'.*'~' for"),
        ("ensemble:snapshot+windowed:m=5", "has no option 'm'; valid options: "),
        ("ensemble:snapshot+windowed,threshold=0", "threshold must be a finite number greater than 0, got 0"),
        ("ensemble:snapshot+windowed,threshold=1,arl0=9", "at most one of threshold, arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)


@pytest.mark.parametrize("number", ["1e+04", "1E+4", "1e4", "10000"])
def test_the_plus_of_an_exponent_parts_no_members(number):
    made = make_detector(f"ensemble:snapshot:arl0={number}+windowed:n=5/threshold=45+mewma")
    assert [member.name for member in made.members] == [
        "snapshot:arl0=10000",
        "windowed:n=5,threshold=45",
        "mewma",
    ]


def test_an_ensemble_within_one_and_a_member_without_a_threshold_are_refused():
    with pytest.raises(ValueError, match="a member must not be an ensemble itself"):
        Ensemble([Ensemble(members(), threshold=1.0), Snapshot()])
    with pytest.raises(RuntimeError, match="member 'signed-mean' has no threshold yet: calibrate it"):
        run(Ensemble([Snapshot(), SignedMean()], threshold=1.0), np.zeros((1, 1, 3)))
