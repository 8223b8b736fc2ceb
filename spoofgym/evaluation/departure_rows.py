"""What reports say of vehicles that leave their paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from spoofgym.evaluation.departures import Departures
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.metrics import mean_interval


def departure_entry(departures: Departures | None) -> dict[str, Any]:
    """The entry ``deviation`` of a row; nothing where the vehicles keep their paths.

    It holds the means over the games of the largest deviation and of the time outside the corridor, and the share of
    games that left it, with 95 % intervals.
    """
    if departures is None:
        return {}
    games, left = len(departures.largest), int(np.count_nonzero(departures.left))
    return {
        "deviation": {
            "corridor_m": departures.corridor,
            "largest_m": float(departures.largest.mean()),
            "largest_ci95_m": list(mean_interval(departures.largest)),
            "time_outside_s": float(departures.time_outside.mean()),
            "left_corridor": left / games,
            "left_corridor_ci95": exact_interval(left, games),
        }
    }


def departure_figures(departures: Departures | None) -> dict[str, Any]:
    """What a file of single games keeps of the vehicles, (n,) each; nothing where they keep their paths."""
    if departures is None:
        return {}
    return {"largest_deviation_m": departures.largest, "time_outside_s": departures.time_outside}
