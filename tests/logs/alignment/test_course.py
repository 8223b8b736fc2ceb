"""Where the filter of a log starts: at a speed that its receiver knows, and with the cause named where it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.logs.alignment.course import by_course as align
from spoofgym.logs.log import Log, read_log
from tests.scenarios.test_recorded import write_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return read_log(write_log(tmp_path_factory.mktemp("log")))


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """1 m/s."""
    return read_log(write_log(tmp_path_factory.mktemp("slow"), slow=True))


def with_sigmas(log: Log, position: float | None, velocity: float | None) -> Log:
    size = log.fixes.position.shape
    sigmas = [None if sigma is None else np.full(size, sigma) for sigma in (position, velocity)]
    return replace(log, fixes=replace(log.fixes, position_sigma=sigmas[0], velocity_sigma=sigmas[1]))


@pytest.mark.parametrize(("position", "velocity"), [(None, 0.05), (0.02, None), (2.0, 0.05)])
def test_a_slow_vehicle_is_aligned_on_good_fixes(slow: Log, position: float | None, velocity: float | None) -> None:
    alignment = align(with_sigmas(slow, position, velocity))
    assert slow.fixes.time[alignment.fix] == 5.0
    course = np.arctan2(alignment.attitude[0, 1], alignment.attitude[1, 1])
    assert course == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("position", "velocity"), [(None, None), (2.0, None), (0.02, 0.3), (None, 1000.0)])
def test_but_not_on_others(slow: Log, position: float | None, velocity: float | None) -> None:
    with pytest.raises(ValueError, match=r"must move at 5 m/s or more .* 16 times the sigma .*; it reaches"):
        align(with_sigmas(slow, position, velocity))


def test_a_fix_of_unknown_velocity_gives_no_course(log: Log) -> None:
    sigma = np.full(log.fixes.position.shape, 0.1)
    sigma[4:9] = 1000.0
    assert log.fixes.time[align(log).fix] == 5.0
    assert log.fixes.time[align(replace(log, fixes=replace(log.fixes, velocity_sigma=sigma))).fix] == 10.0


def test_no_alignment_over_a_hole_with_a_turn_in_it(log: Log) -> None:
    keep = (log.fixes.time < 25.0) | (log.fixes.time > 34.0)
    fixes = replace(log.fixes, time=log.fixes.time[keep], position=log.fixes.position[keep], lines=None)
    assert log.fixes.velocity is not None
    fixes = replace(fixes, velocity=log.fixes.velocity[keep], position_sigma=None)
    alignment = align(replace(log, fixes=fixes, start=24.0))
    assert fixes.time[alignment.fix] == 36.0


def test_a_wrong_velocity_is_named_and_not_the_mounting(log: Log) -> None:
    assert log.fixes.velocity is not None
    velocity = log.fixes.velocity.copy()
    velocity[5] += 30.0
    with pytest.raises(ValueError, match=r"at 5 s, line 6 of gnss\.csv, the fixes show an acceleration of") as caught:
        align(replace(log, fixes=replace(log.fixes, velocity=velocity)))
    assert "imu_to_body_frd" not in str(caught.value)
