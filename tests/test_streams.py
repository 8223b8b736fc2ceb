from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from spoofgym.streams import PURPOSES, RunStreams


class Forgetful(np.random.Generator):
    """A generator whose copies have lost its seed sequence."""

    def __reduce__(self):
        return Forgetful, (np.random.PCG64(),)


def draw(streams, run, purpose, size=8):
    return streams(run, purpose).standard_normal(size)


def test_children_are_numpys_own_spawn_of_the_seed_plus_the_run():
    streams = RunStreams.from_seed(7, 3)
    for run in range(3):
        for place, purpose in enumerate(PURPOSES):
            child = np.random.SeedSequence(7 + run).spawn(len(PURPOSES))[place]
            expected = np.random.Generator(np.random.SFC64(child)).standard_normal(8)
            np.testing.assert_array_equal(draw(streams, run, purpose), expected)


def test_children_do_not_depend_on_the_order_of_asking_or_on_other_draws():
    forward, backward = RunStreams.from_seed(1, 2), RunStreams.from_seed(1, 2)
    first = {purpose: draw(forward, 1, purpose) for purpose in PURPOSES}
    draw(backward, 0, "imu", 1000)
    second = {purpose: draw(backward, 1, purpose) for purpose in reversed(PURPOSES)}
    for purpose in PURPOSES:
        np.testing.assert_array_equal(first[purpose], second[purpose])


def test_run_i_of_a_seed_is_the_same_for_any_number_of_runs():
    small, large = RunStreams.from_seed(3, 2), RunStreams.from_seed(3, 100)
    assert (len(small), len(large)) == (2, 100)
    np.testing.assert_array_equal(draw(small, 1, "receiver"), draw(large, 1, "receiver"))
    np.testing.assert_array_equal(draw(large, 60, "receiver"), draw(RunStreams.from_seed(63, 1), 0, "receiver"))


def test_purposes_and_runs_draw_different_numbers():
    streams = RunStreams.from_seed(3, 20)
    drawn = np.array([draw(streams, run, purpose, 1) for run in range(20) for purpose in PURPOSES])
    assert len(np.unique(drawn)) == 20 * len(PURPOSES)


def test_a_child_goes_on_where_it_was():
    whole, parts = RunStreams.from_seed(5, 1), RunStreams.from_seed(5, 1)
    np.testing.assert_array_equal(
        draw(whole, 0, "opponent", 6), np.concatenate([draw(parts, 0, "opponent", 3) for _ in range(2)])
    )


def test_a_gymnasium_generator_gives_the_streams_of_its_seed():
    from gymnasium.utils import seeding

    generator, _ = seeding.np_random(11)
    generator.standard_normal(5)
    np.testing.assert_array_equal(
        draw(RunStreams([generator]), 0, "initial"), draw(RunStreams.from_seed(11, 1), 0, "initial")
    )


def test_spawned_generators_are_numpys_own_and_other_ones_at_each_call():
    streams = RunStreams.from_seed(5, 2)
    expected = np.random.Generator(np.random.SFC64(np.random.SeedSequence(6, spawn_key=(1,)))).spawn(2)
    for generator in expected:
        np.testing.assert_array_equal(streams.spawn(1, "imu").standard_normal(8), generator.standard_normal(8))


@pytest.mark.parametrize("make_copy", [copy.deepcopy, lambda streams: pickle.loads(pickle.dumps(streams))])
def test_a_copy_goes_on_and_spawns_as_the_original(make_copy):
    """Whatever NumPy copies of a generator: here it forgets the seed sequence, as NumPy did before 2.0."""
    generator = Forgetful(np.random.PCG64(np.random.SeedSequence(5)))
    streams = RunStreams([generator])
    draw(streams, 0, "imu", 3)
    streams.spawn(0, "imu")
    other = make_copy(streams)
    for purpose in PURPOSES:
        np.testing.assert_array_equal(draw(other, 0, purpose), draw(streams, 0, purpose))
    np.testing.assert_array_equal(other.spawn(0, "imu").standard_normal(8), streams.spawn(0, "imu").standard_normal(8))


def test_replace_starts_the_children_of_one_run_anew():
    streams = RunStreams.from_seed(0, 2)
    first = draw(streams, 0, "imu")
    other = draw(streams, 1, "imu")
    streams.replace(0, np.random.Generator(np.random.PCG64(np.random.SeedSequence(0))))
    np.testing.assert_array_equal(draw(streams, 0, "imu"), first)
    assert not np.array_equal(draw(streams, 1, "imu"), other)


def test_without_a_seed_every_batch_is_new():
    assert not np.array_equal(
        draw(RunStreams.from_seed(None, 1), 0, "imu"), draw(RunStreams.from_seed(None, 1), 0, "imu")
    )


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="non-negative integer or None, got -1"):
        RunStreams.from_seed(-1, 2)
    with pytest.raises(ValueError, match="num_runs must be a whole number, 1 or more, got 0"):
        RunStreams.from_seed(0, 0)
    with pytest.raises(ValueError, match="unknown purpose 'weather' of a random stream; valid purposes: initial, imu"):
        RunStreams.from_seed(0, 1)(0, "weather")
