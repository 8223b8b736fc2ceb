"""The rule that gives verdicts, at its edges."""

import math

import numpy as np
import pytest

from spoofgym.studies.reproduce.verdict import (
    NEVER,
    Published,
    event_verdict,
    number_verdict,
    probability_verdict,
    rounded,
    statement_verdict,
)

AT_LEAST = Published("> 0.3", 0.3, math.inf)


@pytest.mark.parametrize(
    ("published", "ours", "verdict"),
    [
        (rounded(100), (50.0, 119.0, 150.0), "reproduced"),
        (rounded(100), (50.0, 121.0, 150.0), "compatible"),  # inside the range, and 20 % away
        (rounded(100), (50.0, 79.0, 150.0), "compatible"),
        (rounded(100), (101.0, 119.0, 150.0), "partly"),  # a wide range that does not hold it
        (rounded(100), (110.0, 115.0, 120.0), "reproduced"),  # a range narrower than 20 % need not hold it
        (rounded(100), (110.0, 115.0, 131.0), "partly"),
        (rounded(100), (120.0, 199.0, 300.0), "partly"),
        (rounded(100), (120.0, 202.0, 300.0), "not reproduced"),
        (rounded(100), (40.0, 49.0, 60.0), "not reproduced"),
        (rounded(100), (40.0, 50.5, 60.0), "partly"),
        (rounded(5), (4.6, 4.6, 4.6), "reproduced"),  # printed as 5
        (rounded(1), (0.5, 0.5, 0.5), "reproduced"),  # printed as 1
        (rounded(1), (0.2, 0.45, 0.6), "compatible"),  # rounding and 20 % do not add up
        (rounded(1), (0.45, 0.45, 0.45), "not reproduced"),
        (rounded(0.0, 0.0), (0.0, 0.0, 0.0), "reproduced"),
        (rounded(0.0, 0.0), (0.0, 0.1, 0.2), "compatible"),
        (rounded(0.0, 0.0), (0.1, 0.1, 0.2), "not reproduced"),
        (rounded(-4.0, 1.0), (-4.2, -4.1, -4.0), "reproduced"),
        (rounded(-4.0, 1.0), (-7.9, -7.9, -7.9), "partly"),
        (rounded(-4.0, 1.0), (4.0, 4.0, 4.0), "not reproduced"),
        (AT_LEAST, (0.2, 0.25, 0.31), "reproduced"),
        (AT_LEAST, (0.2, 0.23, 0.31), "compatible"),
        (AT_LEAST, (0.1, 0.151, 0.2), "partly"),
        (AT_LEAST, (0.1, 0.149, 0.2), "not reproduced"),
        (AT_LEAST, (9.0, 10.0, 11.0), "reproduced"),
    ],
)
def test_a_number(published, ours, verdict):
    assert number_verdict(published, *ours) == verdict


@pytest.mark.parametrize(
    ("published", "ours", "verdict"),
    [
        (1e-6, (1e-8, 1.9e-6, 1e-4), "reproduced"),
        (1e-6, (1e-8, 2.1e-6, 1e-4), "compatible"),
        (1e-6, (1.9e-6, 1.9e-6, 1.9e-6), "reproduced"),
        (1e-6, (3.9e-6, 3.9e-6, 3.9e-6), "partly"),
        (1e-6, (4.1e-6, 4.1e-6, 4.1e-6), "not reproduced"),
        (1e-6, (2.6e-7, 2.6e-7, 2.6e-7), "partly"),
        (1e-6, (0.0, 1.5e-6, 4e-6), "reproduced"),
        (1e-6, (0.0, 0.0, 0.0), "not reproduced"),
        (1e-6, (0.0, 0.0, 0.1), "compatible"),  # none of few games
        (0.0, (0.0, 0.0, 0.0), "reproduced"),
    ],
)
def test_a_probability(published, ours, verdict):
    assert probability_verdict(published, *ours) == verdict


@pytest.mark.parametrize(
    ("published", "seen", "verdict"),
    [
        (Published(NEVER), 2, "reproduced"),
        (Published(NEVER), 3, "partly"),
        (Published(NEVER), 5, "partly"),
        (Published(NEVER), 6, "not reproduced"),
        (rounded(10), 8, "reproduced"),
        (rounded(10), 7, "partly"),
        (rounded(10), 5, "partly"),
        (rounded(10), 4, "not reproduced"),
        (rounded(17), 10, "partly"),
        (rounded(30), 10, "not reproduced"),
        (rounded(30), 7, "not reproduced"),
    ],
)
def test_an_event_needs_four_of_five_runs(published, seen, verdict):
    """Ten runs, of which some see it after 9 to 11 s."""
    times = np.concatenate([np.linspace(9.0, 11.0, seen), np.full(10 - seen, math.inf)])
    assert event_verdict(published, times) == verdict


@pytest.mark.parametrize(("holding", "verdict"), [(4, "reproduced"), (3, "partly"), (2, "not reproduced")])
def test_words(holding, verdict):
    assert statement_verdict(np.arange(4) < holding) == verdict
