import copy

import numpy as np
import pytest

from spoofgym.detectors import GrowingWindow, RelativeMotion, make_detector


def by_hand(gnss, ins, available, k, threshold, slope, interval):
    """Statistics of one run, written with explicit start times."""
    statistics, start, quiet = [], None, 0
    for i in range(len(gnss)):
        begin = i - k if start is None else start
        given = available[i] and begin >= 0 and available[begin]
        value = 0.0
        if given:
            moved = np.linalg.norm((gnss[i] - gnss[begin]) - (ins[i] - ins[begin]))
            value = moved * k / (i - begin) - slope * interval * i
        statistics.append(value)
        if value > threshold:
            start, quiet = begin, 0
        elif start is not None and available[i]:
            quiet += 1
            if quiet == k:
                start = None
    return np.array(statistics)


def test_against_explicit_windows(motion):
    """Random walks that wander off and come back, with missing fixes."""
    rng = np.random.default_rng(8)
    world = motion(8, 200, 12)
    world.gnss += np.repeat(rng.uniform(-6.0, 6.0, (10, 12, 3)) * rng.integers(0, 2, (10, 12, 1)), 20, axis=0)
    world.available = rng.random((200, 12)) > 0.1
    statistics = world.run(GrowingWindow(6, slope=0.01, threshold=6.0))
    for run in range(12):
        expected = by_hand(world.gnss[:, run], world.ins[:, run], world.available[:, run], 6, 6.0, 0.01, 0.5)
        np.testing.assert_allclose(statistics[:, run], expected, rtol=1e-9, atol=1e-9)
    assert 100 < np.count_nonzero(statistics > 6.0) < 2000


def test_until_the_first_alarm_it_is_the_test_of_fixed_length(motion):
    world = motion(9, 60, 5)
    fixed = world.run(RelativeMotion(10, slope=0.01, threshold=3.8))
    growing = world.run(GrowingWindow(10, slope=0.01, threshold=3.8))
    without = world.run(GrowingWindow(10, slope=0.01))
    np.testing.assert_array_equal(without, fixed)
    over = fixed > 3.8
    assert over.any(axis=0).sum() >= 2
    for run in range(5):
        until = over[:, run].argmax() + 1 if over[:, run].any() else 60
        np.testing.assert_array_equal(growing[:until, run], fixed[:until, run])


def beside_the_track(motion, offset, ends):
    """A receiver that is drawn aside within 4 epochs from epoch 20 on and comes back at ``ends``; no noise."""
    world = motion(1, 120, 1)
    world.ins = world.gnss.copy()
    world.gnss[20:ends, 0, 0] += np.minimum(np.arange(ends - 20) + 1, 4) * offset / 4
    return world


def test_a_run_beside_the_track_is_not_believed_after_k_epochs_and_the_return_does_not_alarm(motion):
    world = beside_the_track(motion, 12.0, 60)
    fixed = world.run(RelativeMotion(5, slope=0.0, threshold=1.5))[:, 0] > 1.5
    growing = world.run(GrowingWindow(5, slope=0.0, threshold=1.5))[:, 0] > 1.5
    # 3 m in the first epoch; the last position of the drag-off leaves the fixed window 4 + 5 epochs later
    assert np.flatnonzero(fixed).tolist() == [*range(20, 28), *range(60, 65)]
    # 5 x 12 m / w > 1.5 m for w < 40, and the window began at epoch 15; what is believed by then makes the return alarm
    assert np.flatnonzero(growing).tolist() == [*range(20, 55), *range(60, 95)]
    shorter = beside_the_track(motion, 12.0, 50).run(GrowingWindow(5, slope=0.0, threshold=1.5))[:, 0]
    assert np.flatnonzero(shorter > 1.5).tolist() == list(range(20, 50))
    np.testing.assert_allclose(shorter[50:], 0.0, atol=1e-9)


def test_take_and_reset(motion):
    world = motion(3, 60, 40)
    world.gnss[30:, :, 0] += 20.0
    detector = GrowingWindow(7, slope=0.02, threshold=8.0)
    whole = world.run(copy.copy(detector))
    for part in (slice(0, 1), slice(5, 12)):
        np.testing.assert_array_equal(world.run(copy.copy(detector), part), whole[:, part])
    large, small = copy.copy(detector), copy.copy(detector)
    large.bind(40, 3)
    small.bind(2, 3)
    runs = np.array([7, 3])
    for k in range(35):
        small.update(world.epoch(k, runs))
    large.take(runs, small)
    for k in range(35, 60):
        np.testing.assert_array_equal(large.update(world.epoch(k))[runs], whole[k, runs])
    large.reset(np.array([7]))
    assert large.update(world.epoch(59))[7] == 0.0


def test_names_and_refusals():
    for text in ("growing-window", "growing-window:k=5,slope=0.01,threshold=2", "growing-window:preset=foi"):
        detector = make_detector(text)
        assert detector.name == text
        assert detector.demands.auxiliary
    with pytest.raises(ValueError, match="no option 'lag'; valid options: k, slope, threshold, preset, arl0"):
        make_detector("growing-window:lag=2")
    with pytest.raises(ValueError, match=r"growing-window: preset foi is for .*got k=6 with lag=6"):
        make_detector("growing-window:k=6,preset=foi")
