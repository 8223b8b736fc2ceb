"""Short flights on ranges under other skies: few satellites, one that sets, one that rises."""

import math
from collections.abc import Callable
from functools import lru_cache

import pytest

from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario

FLIGHT = "kujur-flight:horizon=40,onset=60,drag_off_rate=4"


@lru_cache(maxsize=8)
def flight_under(hour: float, mask: float) -> Scenario:
    """The short Kujur flight at an hour of the constellation's day, with an elevation mask in degrees."""
    name = f"flight at {hour:g} h above {mask:g} degrees"
    return make_scenario(FLIGHT).changed(name=name, mask=math.radians(mask), start_time=3600.0 * hour)


@pytest.fixture
def under() -> Callable[[float, float], Scenario]:
    """The flight under a sky.

    (4.0, 5.0): eight satellites; (8.5, 15.0): seven, of which one sets; (9.5, 25.0): five, of which one sets; (10.7,
    20.0): four, to which one rises; (5.64236, 5.0): ten, of which one sets and another rises into its slot.
    """
    return flight_under
