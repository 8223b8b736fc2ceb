"""Slices of runs in threads: every slice is waited for, also where one raises."""

import threading
import time

import numpy as np
import pytest

from spoofgym.parallel import RunSlices

RUNS = np.arange(4)


def test_every_run_is_in_one_slice() -> None:
    seen = np.zeros(5, dtype=int)

    def count(part: np.ndarray) -> None:
        seen[part] += 1

    RunSlices(3).call(count, np.arange(5), 1)
    np.testing.assert_array_equal(seen, 1)


@pytest.mark.parametrize("failing", [0, 1, 3])
def test_where_a_slice_raises_the_others_have_ended_when_the_error_arrives(failing: int) -> None:
    begun, release = threading.Barrier(4), threading.Event()
    ended = []

    def work(part: np.ndarray) -> None:
        begun.wait(timeout=60.0)
        if failing in part:
            release.set()
            raise ArithmeticError(f"run {failing}")
        release.wait(timeout=60.0)
        time.sleep(0.05)
        ended.append(int(part[0]))

    with pytest.raises(ArithmeticError, match=f"run {failing}"):
        RunSlices(4).call(work, RUNS, 1)
    assert sorted(ended) == [run for run in RUNS if run != failing]


def test_the_error_of_the_first_failing_slice_is_raised() -> None:
    begun = threading.Barrier(4)

    def work(part: np.ndarray) -> None:
        begun.wait(timeout=60.0)
        time.sleep(0.01 * (4 - part[0]))
        if part[0] in (1, 2):
            raise ArithmeticError(f"run {part[0]}")

    with pytest.raises(ArithmeticError, match="run 1"):
        RunSlices(4).call(work, RUNS, 1)
