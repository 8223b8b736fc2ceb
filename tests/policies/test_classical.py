"""Classical defenders: what is listed can be built, spellings are read, and the grid is the whole grid."""

import pytest

from spoofgym.detectors import make_detector
from spoofgym.policies import classical as defenders
from spoofgym.policies.classical import (
    GRID_DEPTHS,
    GRID_DETECTORS,
    GRID_REUSES,
    PUBLISHED,
    SEPARATOR,
    TUNED,
    WORLD_DETECTORS,
    ClassicalDefender,
    grid,
    parse,
    tuned_for,
    with_depth,
)
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario

LISTED = [*PUBLISHED, *(item for tuned in TUNED.values() for item in tuned), *grid()]


@pytest.mark.parametrize("defender", LISTED, ids=lambda item: item.name)
def test_what_is_listed_can_be_built(defender):
    """By their canonical spellings, and the responses within the history that every scenario keeps."""
    response = make_response(defender.response)
    assert response.name in (defender.response, defender.response.replace(":20", ""))
    assert response.demands.history <= make_scenario("foi-drive").history
    assert make_detector(defender.detector).name in {make_detector(name).name for name in WORLD_DETECTORS}


def test_names_are_unique():
    named = [item.name for item in PUBLISHED] + ["never", "always", "random", "oracle-onset", "oracle-depth"]
    for tuned in TUNED.values():
        every = named + [item.name for item in tuned]
        assert len(set(every)) == len(every)


def test_who_is_tuned():
    assert not any(item.tuned for item in PUBLISHED)
    assert all(item.tuned for tuned in TUNED.values() for item in tuned)
    assert all(item.tuned for item in grid())


def test_the_grid_is_every_combination():
    cells = grid()
    assert len(cells) == len(GRID_DETECTORS) * len(GRID_REUSES) * (len(GRID_DEPTHS) + 1)
    pairs = {(item.detector, make_response(item.response).name) for item in cells}
    assert len(pairs) == len(cells)
    assert {item.name for item in cells} == {f"{item.detector}{SEPARATOR}{item.response}" for item in cells}
    for detector in GRID_DETECTORS:
        responses = {item.response for item in cells if item.detector == detector}
        assert {"exclude", "exclude:reuse=5", "exclude-and-backtrack:50", "onset-depth"} <= responses
        assert {"exclude-and-backtrack:10,reuse=5", "onset-depth:reuse=5"} <= responses


@pytest.mark.parametrize("scenario", TUNED)
def test_tuned_defenders_are_of_the_grid(scenario):
    """A fixed depth first, then the estimated onset."""
    cells = {(item.detector, item.response) for item in grid()}
    tuned = tuned_for(scenario)
    assert all((item.detector, item.response) in cells for item in tuned)
    assert ["onset" in item.response for item in tuned] == [False, True]


def test_a_scenario_that_nobody_tuned_on_has_those_of_the_drive():
    assert tuned_for("moon") == TUNED["foi-drive"]


@pytest.mark.parametrize(
    ("depth", "options", "expected"),
    [
        (0, "", "exclude"),
        (0, "reuse=5", "exclude:reuse=5"),
        (20, "", "exclude-and-backtrack:20"),
        (20, "reuse=5,reuse_threshold=9", "exclude-and-backtrack:20,reuse=5,reuse_threshold=9"),
    ],
)
def test_responses_of_a_depth(depth, options, expected):
    assert with_depth(depth, options) == expected
    make_response(expected)


@pytest.mark.parametrize(
    "text", ["snapshot > exclude:reuse=3", "snapshot>exclude:reuse=3", " snapshot >exclude:reuse=3 "]
)
def test_spelling(text):
    assert parse(text) == ClassicalDefender("snapshot > exclude:reuse=3", "snapshot", "exclude:reuse=3")


@pytest.mark.parametrize("text", ["snapshot", "", ">", "snapshot >", "> exclude"])
def test_other_texts_are_told_how_to_spell(text):
    with pytest.raises(ValueError, match=r"spelled detector/response, e\.g\. snapshot/exclude, got"):
        parse(text)


def test_every_name_of_the_grid_is_a_spelling():
    for item in defenders.grid():
        parsed = parse(item.name)
        assert (parsed.name, parsed.detector, parsed.response) == (item.name, item.detector, item.response)
