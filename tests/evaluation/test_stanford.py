import numpy as np
import pytest

from spoofgym.evaluation.stanford import (
    CELLS_TO_LIMIT,
    HAZARDOUS,
    MISLEADING,
    NOMINAL,
    REACH,
    UNAVAILABLE,
    region,
    stanford_diagram,
)


@pytest.mark.parametrize(
    ("error", "level", "expected"),
    [
        (1.0, 5.0, NOMINAL),
        (5.0, 5.0, NOMINAL),  # not beyond
        (10.0, 10.0, NOMINAL),
        (-6.0, 5.0, MISLEADING),
        (10.0, 5.0, MISLEADING),
        (10.1, 5.0, HAZARDOUS),
        (-11.0, 10.0, HAZARDOUS),
        (1.0, 10.1, UNAVAILABLE),
        (30.0, 10.1, UNAVAILABLE),
        (0.0, np.inf, UNAVAILABLE),
    ],
)
def test_every_region_and_its_border(error, level, expected):
    assert region(np.array(error), np.array(level), 10.0) == expected
    diagram = stanford_diagram(np.array([error]), np.array([level]), 10.0)
    np.testing.assert_array_equal(diagram.regions, np.eye(4, dtype=int)[expected])


def test_regions_of_a_uniform_square_are_their_areas():
    """Error and level from 0 to 2 alert limits: 1/2, 1/2, 1 and 2 unit squares, less or more the diagonal's cells."""
    n = 100
    places = (np.arange(2 * n) + 0.5) / n
    error, level = (part * 7.0 for part in np.meshgrid(places, places, indexing="ij"))
    diagram = stanford_diagram(error, level, 7.0)
    np.testing.assert_array_equal(diagram.regions, [n * (n + 1) // 2, n * (n - 1) // 2, n * n, 2 * n * n])
    # beyond both the limit and the level: the triangle over the limit
    assert diagram.unavailable_misleading == n * (n - 1) // 2
    assert diagram.counts.sum() == 4 * n * n


def test_cells_meet_at_the_limit_and_hold_what_lies_beyond_the_end():
    error = np.array([0.0, 10.0, 10.0001, 1e9, 3.0])
    level = np.array([0.0, 10.0, 10.0001, 10.0, np.inf])
    diagram = stanford_diagram(error, level, 10.0)
    limit, last = CELLS_TO_LIMIT, round(REACH * CELLS_TO_LIMIT) - 1
    assert diagram.edges[limit] == 10.0
    assert diagram.edges[-1] == pytest.approx(15.0)
    expected = np.zeros_like(diagram.counts)
    for cell in ((0, 0), (limit - 1, limit - 1), (limit, limit), (last, limit - 1), (11, last)):
        expected[cell] += 1
    np.testing.assert_array_equal(diagram.counts, expected)


def test_epochs_with_an_alarm_are_left_out():
    error, level = np.array([[1.0, 20.0, 20.0]]), np.full((1, 3), 5.0)
    diagram = stanford_diagram(error, level, 10.0, np.array([[False, True, False]]))
    np.testing.assert_array_equal(diagram.regions, [1, 0, 1, 0])
    assert diagram.counts.sum() == 2


@pytest.mark.parametrize(
    ("error", "level", "limit", "message"),
    [
        (np.ones(3), np.ones(2), 1.0, r"must have one shape and hold something, got \(3,\) and \(2,\)"),
        (np.ones(0), np.ones(0), 1.0, "must have one shape and hold something"),
        (np.array([np.nan]), np.ones(1), 1.0, "error must be finite, got .*nan"),
        (np.ones(1), np.array([np.nan]), 1.0, "protection_level must be 0 or more, got .*nan"),
        (np.ones(1), -np.ones(1), 1.0, "protection_level must be 0 or more, got .*-1.0"),
        (np.ones(1), np.ones(1), 0.0, "alert_limit must be a finite number greater than 0, got 0.0"),
    ],
)
def test_bad_values_are_refused(error, level, limit, message):
    with pytest.raises(ValueError, match=message):
        stanford_diagram(error, level, limit)


def test_an_alarm_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"alarm must have the shape \(2,\), got \(3,\)"):
        stanford_diagram(np.ones(2), np.ones(2), 1.0, np.zeros(3, dtype=bool))
