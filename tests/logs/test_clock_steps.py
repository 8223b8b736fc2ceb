"""Clocks of receivers that step: the filter on ranges must go where it goes on the same drive with a steady clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

from spoofgym.geodesy import position_difference
from spoofgym.logs.clock_steps import MILLISECOND, _spikes, find_steps, without_steps
from spoofgym.logs.range_fixes import solve_ranges
from spoofgym.logs.ranges_log import read_ranges
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.simulation import Simulation
from tests.logs.range_drive import Clock, write_drive
from tests.logs.test_ranges_log import FIRST, START

TURNS = 4
OUTAGE = (70, 90)


def tight(folder: Path, **options: object) -> Scenario:
    scenario = recorded(str(folder), coupling="tight", **options)
    assert isinstance(scenario.family, RecordedRanges)
    return scenario


def written(folder: Path, clock: Clock, silent: tuple[int, int] = (0, 0)) -> Path:
    write_drive(folder, turns=TURNS, clock=clock, silent=silent)
    return folder


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[int, int], RecordedRanges]:
    """The drive with a steady clock, without and with an outage."""
    folder = tmp_path_factory.mktemp("drives")
    return {silent: tight(written(folder / f"silent-{silent[0]}", Clock(), silent)) for silent in ((0, 0), OUTAGE)}


def largest_difference(one: RecordedRanges, other: RecordedRanges) -> float:
    """Of the filters' positions at the epochs of two drives, m."""
    return float(np.abs(position_difference(one.family.clean.position, other.family.clean.position)).max())


MILLISECONDS = [
    Clock(steps=((60, 1e-3),)),
    Clock(steps=((1, -1e-3),)),
    Clock(steps=((60, 0.2),)),
    Clock(steps=((30, 1e-3), (60, -1e-3), (61, 2e-3), (62, 1e-3))),
    Clock(offset=-3.0 * speed_of_light),
    Clock(drift=3000.0),
    Clock(drift=-9000.0, steps=((20, 1e-3), (53, 1e-3), (86, 1e-3), (119, 1e-3))),
]


@pytest.mark.parametrize("clock", MILLISECONDS)
def test_whole_milliseconds_do_not_move_the_filter(clock: Clock, tmp_path: Path, steady) -> None:
    """The size of such a step is known. Tags are written to a nanosecond, in which satellites move by a micrometre."""
    scenario = tight(written(tmp_path / "log", clock))
    assert largest_difference(scenario, steady[0, 0]) < 0.01
    assert not scenario.family.epochs.clock_jump.any()


OTHERS = [
    Clock(steps=((60, 1e-4),)),
    Clock(steps=((60, -3.73e-5),)),
    Clock(steps=((60, 1e-6),)),
    Clock(steps=((60, 1e-3),), in_rates=True),
    Clock(steps=((2, 1e-3), (40, 1e-4)), in_rates=True),
    Clock(steps=tuple((k, (-1) ** k * 3e-6) for k in range(40, 60))),
]


@pytest.mark.parametrize("clock", OTHERS)
def test_other_steps_cost_what_is_known_of_the_clock(clock: Clock, tmp_path: Path, steady) -> None:
    """The clock begins anew, as in a fix, or the rate of an epoch does: decimetres beside the noise of metres."""
    assert largest_difference(tight(written(tmp_path / "log", clock)), steady[0, 0]) < 0.3


@pytest.mark.parametrize("step", [(75, 1e-3), (90, 1e-3), (70, 1e-4), (90, -1e-4)])
def test_a_step_in_an_outage_or_at_its_ends(step: tuple[int, float], tmp_path: Path, steady) -> None:
    scenario = tight(written(tmp_path / "log", Clock(steps=(step,)), OUTAGE))
    assert largest_difference(scenario, steady[OUTAGE]) < 0.3


@pytest.mark.parametrize("size", [1e-3, 1e-4])
def test_a_step_of_the_ranges_that_the_tags_do_not_show(size: float, tmp_path: Path, steady) -> None:
    """The satellites are then sought at a wrong moment: range rates differ by up to 1.6 km/s, or 1.6 m in 1 ms."""
    scenario = tight(written(tmp_path / "log", Clock(steps=((60, size),), in_tags=False)))
    assert largest_difference(scenario, steady[0, 0]) < 1600.0 * size + 0.1


def test_a_steady_clock_has_no_steps(steady) -> None:
    """140 steps of standard normal noise at 8 sigma, 140 rates at 12: false failure below 1e-12."""
    ranges = read_ranges(steady[0, 0].family.log.folder)
    steps = find_steps(solve_ranges(ranges, START))
    assert not any(values.any() for values in (steps.offset, steps.rate, steps.variance))
    again = without_steps(ranges, START)
    np.testing.assert_array_equal(again.pseudorange, ranges.pseudorange)
    np.testing.assert_array_equal(again.time, ranges.time)


def test_steps_are_found_where_they_are_and_as_large(tmp_path: Path) -> None:
    """The clock of a fix is known to 10 m; a step of whole milliseconds, exactly."""
    clock = Clock(steps=((30, 1e-3), (60, 1e-4), (80, -2e-3)), in_rates=True)
    steps = find_steps(solve_ranges(read_ranges(written(tmp_path / "log", clock)), START))
    size = np.diff(steps.offset, prepend=0.0)
    np.testing.assert_array_equal(np.flatnonzero(size), [30, 60, 80])
    np.testing.assert_array_equal(size[[30, 80]], [MILLISECOND, -2.0 * MILLISECOND])
    assert size[60] == pytest.approx(0.1 * MILLISECOND, abs=60.0)
    np.testing.assert_array_equal(np.flatnonzero(steps.variance), [60])
    np.testing.assert_allclose(steps.rate[[30, 60, 80]], [MILLISECOND, 0.1 * MILLISECOND, -2.0 * MILLISECOND], atol=3.0)


@pytest.mark.parametrize("at", [(0,), (1,), (137,), (138,), (0, 1, 2), (134, 136, 138), (135, 136, 137, 138)])
def test_a_step_near_an_end_of_the_log(at: tuple[int, ...], tmp_path: Path, steady) -> None:
    """The last of 139 epochs is 138; at an end the rate is that of the neighbours on one side."""
    clock = Clock(steps=tuple((epoch, 1e-3) for epoch in at), in_rates=True)
    assert largest_difference(tight(written(tmp_path / "log", clock)), steady[0, 0]) < 0.3


@pytest.mark.parametrize("epochs", [3, 4, 5, 10, 11, 12, 20, 21, 22, 40])
def test_a_step_anywhere_in_a_short_log_is_found_in_its_rates(epochs: int) -> None:
    time, steady, sigma = np.arange(epochs, dtype=float), np.full(epochs, 150.0), np.full(epochs, 0.1)
    for at in range(epochs):
        step = np.where(np.arange(epochs) == at, MILLISECOND, 0.0)
        np.testing.assert_array_equal(_spikes(time, steady + step, sigma), step)


@pytest.mark.parametrize("epochs", [0, 1, 2])
def test_of_two_rates_neither_lies_beyond_the_other(epochs: int) -> None:
    values = np.linspace(0.0, MILLISECOND, epochs)
    np.testing.assert_array_equal(_spikes(values, values, np.ones(epochs)), np.zeros(epochs))


def test_a_rate_that_changes_steadily_has_no_steps_at_the_ends_of_the_log() -> None:
    """By 0.9 m/s in a second, below what a clock may do; the neighbours at an end are 5 s away in the median."""
    time = np.arange(50.0)
    assert not _spikes(time, 0.9 * time, np.full(50, 0.1)).any()


def test_where_satellites_are_too_few_for_a_fix_their_ranges_show_the_step(tmp_path: Path) -> None:
    """Three satellites are left from epoch 70 on: there the step comes while there is no fix."""
    folder = written(tmp_path / "log", Clock(steps=((75, 1e-3),)))
    lines = folder.joinpath("ranges.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    times = sorted({float(row[1]) for row in rows})
    seen = sorted({row[0] for row in rows})[:3]
    kept = [
        ",".join(row) for row in rows if not times[70] <= float(row[1]) < times[80] or row[0] in seen
    ]
    folder.joinpath("ranges.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    steps = find_steps(solve_ranges(read_ranges(folder), START))
    np.testing.assert_array_equal(np.flatnonzero(np.diff(steps.offset)) + 1, [75])
    assert steps.offset[-1] == MILLISECOND


def test_a_clock_that_begins_anew_is_in_the_model_of_the_game_too(tmp_path: Path) -> None:
    scenario = tight(written(tmp_path / "log", Clock(steps=((60, 1e-4),))), onset=FIRST + 50.0, horizon=30)
    model = scenario.tight_model()
    after = model.covariance - np.swapaxes(model.whitened_gain, 1, 2) @ model.whitened_gain
    navigated = scenario.family.clean.covariance[scenario.family.first + 1 : scenario.family.last + 2]
    np.testing.assert_allclose(after, navigated, rtol=1e-5, atol=1e-8 * navigated.max())


def test_a_step_by_a_spoofer_stays(tmp_path: Path) -> None:
    """Only the log's own steps are taken away: 100 m more are forty times the filter's sigma of the clock."""
    scenario = tight(written(tmp_path / "log", Clock(steps=((60, 1e-3),))), onset=FIRST + 80.0)
    simulation = Simulation(scenario, num_runs=2, seed=0, fidelity="strapdown")
    simulation.reset()
    simulation.resolve()
    epoch = simulation.observe(np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 100.0]]))
    assert epoch.innovation.nis[0] < 60.0
    assert epoch.innovation.nis[1] > 1000.0
