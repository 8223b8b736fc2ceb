"""Thresholds of re-acquisition, set where they are used: while the filter coasts.

A receiver whose R is over-stated has a small NIS as long as its fixes are used. When the filter coasts, its own
covariance comes to dominate S, and the NIS grows to what chi-square says. A threshold measured in use would then keep
honest fixes out.
"""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.calibration.cache import identity
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses.base import Response
from spoofgym.responses.excluding import ExcludingResponse
from spoofgym.responses.reuse import DEFAULT_P, Consistent
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

SHORTEST, LONGEST = 10, 60
"""Fixes in a row that have been left out."""
RUNS = 5000


def coasting_nis(scenario: Scenario, fidelity: str = "linear", runs: int = RUNS, seed: int = 0) -> Floats:
    """NIS of clean fixes after 10, 11, ..., 60 in a row have been left out.

    Each run uses its fixes up to an epoch of its own, spread evenly over the game, and coasts from there.

    Args:
        scenario: what is simulated.
        fidelity: of the simulation.
        runs: how many.
        seed: of run 0.

    Returns:
        (runs, lengths); fewer lengths where the game is shorter.

    Raises:
        ValueError: the scenario has no randomness, or its game is too short to coast in.
    """
    runs, seed = validation.runs("reuse", "runs", runs), validation.whole("reuse", "seed", seed, 0)
    if not scenario.random:
        raise ValueError(
            f"scenario {scenario.name!r} has one realisation, nothing can be calibrated in it: give a reuse_threshold"
        )
    epochs = scenario.timeline.num_epochs
    longest = min(LONGEST, epochs - 1)
    if longest < SHORTEST:
        raise ValueError(f"scenario {scenario.name!r}: a game of {epochs} epochs is too short to coast for {SHORTEST}")
    last_used = np.arange(runs) * (epochs - longest) // runs
    simulation = Simulation(scenario, num_runs=runs, seed=seed, fidelity=fidelity, demands=Demands(excludes=True))
    simulation.reset()
    nis = np.empty((runs, longest - SHORTEST + 1))
    for k in range(1, int(last_used.max()) + longest + 2):
        simulation.resolve(Decision(last_used >= k - 1))
        simulation.observe()
        left_out = k - 1 - last_used
        wanted = np.flatnonzero((left_out >= SHORTEST) & (left_out <= longest))
        nis[wanted, left_out[wanted] - SHORTEST] = simulation.epoch.innovation.nis[wanted]
    return nis


_KNOWN: dict[tuple[object, str, float], float] = {}


def calibrated_reuse(
    response: Response, scenario: Scenario, fidelity: str = "linear", p: float = DEFAULT_P
) -> Response:
    """The response with the threshold of its re-use set for a scenario, in a copy.

    A response that uses GNSS again by another rule, or whose threshold was given, stays as it is. The threshold is
    measured once per program for each scenario, always with the same noise.

    Args:
        response: whose threshold.
        scenario: where it is used.
        fidelity: of the clean runs.
        p: probability that the NIS of a clean fix exceeds the threshold after 10 to 60 fixes have been left out.

    Raises:
        ValueError: the probability is out of range, or what `coasting_nis` refuses.
    """
    p = validation.probability("reuse", "p", p)
    if not isinstance(response, ExcludingResponse) or not isinstance(response.reuse, Consistent):
        return response
    if response.reuse.threshold is not None:
        return response
    key = (identity(scenario), fidelity, p)
    if key not in _KNOWN:
        _KNOWN[key] = float(np.quantile(coasting_nis(scenario, fidelity), 1.0 - p, method="higher"))
    return response.with_reuse_threshold(_KNOWN[key])
