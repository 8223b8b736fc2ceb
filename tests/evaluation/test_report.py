"""Rows of a report."""

import pytest

from spoofgym.evaluation.report import attacker_row


@pytest.mark.parametrize(("optimum", "fraction"), [(10.0, 0.5), (0.0, None), (None, None)])
def test_a_fraction_of_the_optimum_where_there_is_one(optimum, fraction):
    """A threshold that nothing passes leaves an optimum of zero."""
    assert attacker_row("one", "blind", None, 5.0, optimum)["fraction_of_optimum"] == fraction
