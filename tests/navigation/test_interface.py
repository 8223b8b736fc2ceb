"""The times of the epochs of a game, and manoeuvres between them."""

import numpy as np
import pytest

from spoofgym.navigation.interface import Timeline, manoeuvre_times

GAP = Timeline(np.array([10.0, 11.0, 12.0, 40.0, 41.0, 42.4]), 1.0)


@pytest.mark.parametrize(("start", "interval"), [(20.0, 1.0), (800.0, 0.1), (0.2, 0.2)])
def test_a_receiver_that_misses_nothing_has_multiples_of_its_interval(start, interval):
    """To the last bit: rounding of a sum of times is none of its intervals."""
    timeline = Timeline.steady(start, interval, 50)
    assert (timeline.start, timeline.end, timeline.num_epochs) == (start, start + interval * 50, 50)
    np.testing.assert_array_equal(timeline.times, start + interval * np.arange(51))
    np.testing.assert_array_equal(timeline.intervals, np.full(50, interval))
    np.testing.assert_array_equal(timeline.between(np.array([3, 0]), np.array([10, 50])), interval * np.array([7, 50]))
    moments, lengths, epochs = timeline.steps
    np.testing.assert_array_equal(moments, timeline.times)
    np.testing.assert_array_equal(lengths, timeline.intervals)
    np.testing.assert_array_equal(epochs, np.arange(51))


def test_missing_epochs_leave_the_others_at_their_times():
    assert (GAP.start, GAP.end, GAP.num_epochs) == (10.0, 42.4, 5)
    np.testing.assert_allclose(GAP.intervals, [1.0, 1.0, 28.0, 1.0, 1.4])
    np.testing.assert_allclose(GAP.between(np.array([1, 3]), np.array([4, 5])), [30.0, 2.4])


def test_a_gap_is_gone_through_in_steps():
    moments, lengths, epochs = GAP.steps
    np.testing.assert_array_equal(epochs, [0, 1, 2, 30, 31, 32])
    np.testing.assert_allclose(moments, [*np.arange(10.0, 42.0), 42.4])
    np.testing.assert_allclose(lengths, [1.0] * 31 + [1.4])


def test_a_manoeuvre_in_a_gap_is_where_it_is():
    """0.5 m/s² for four seconds from 20 s on, in the gap; between the epochs alone it would be 0.07 m/s² and none."""
    moments, _, _ = GAP.steps
    speed = 12.0 + 0.5 * np.clip(moments - 20.0, 0.0, 4.0)
    velocity = np.stack([speed, np.zeros_like(speed), np.zeros_like(speed)], axis=1)
    assert manoeuvre_times(velocity, GAP) == (20.0,)
