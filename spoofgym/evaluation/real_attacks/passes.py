"""One pass over a record: the clean run and any number of attacked ones, side by side and with the same noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.staggered import Staggered, Stretch
from spoofgym.detectors.base import Detector
from spoofgym.geodesy import horizontal
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded_family import recorded_family
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

FIDELITY = "strapdown"
UNREACHED = 1e9
"""A threshold that nothing reaches, while statistics are looked at."""


@dataclass(frozen=True)
class Pass:
    """N runs over epochs 1..K of a record, every fix used.

    Attributes:
        time: of the epochs, (K,), s.
        statistic: of each detector, (D, K, N).
        error: horizontal, after the fix was used, (K, N), m; NaN where the truth is not known.
        solution: estimate minus truth, or minus what stands in its place, (K, N, 3), m ENU.
        active: whether each run is attacked, (K, N).
        offset: horizontal size of what the spoofer adds, (K, N), m.
    """

    time: Floats
    statistic: Floats
    error: Floats
    solution: Floats
    active: Flags
    offset: Floats


def play(scenario: Scenario, detectors: Sequence[Detector], stretches: Sequence[Stretch], seed: int) -> Pass:
    """Play all attacks, one a run, over the game of a scenario.

    All runs have the noise of the same seed: a simulated IMU, where there is one, is the same in each.

    Args:
        scenario: a recorded log.
        detectors: with thresholds that nothing reaches; they are left as the game leaves them.
        stretches: attacks, one for each run.
        seed: of a simulated IMU, and of what attacks draw.

    Raises:
        ValueError: what `Simulation` refuses.
    """
    attack, runs = Staggered(stretches), len(stretches)
    streams = RunStreams([np.random.default_rng(seed)] * runs)
    simulation = Simulation(scenario, attack, list(detectors), num_runs=runs, streams=streams, fidelity=FIDELITY)
    family = recorded_family(scenario)
    known = family.compared[family.first + 1 : family.last + 1]
    statistics, errors, active, offsets = [], [], [], []
    simulation.reset()
    simulation.resolve()
    for _ in range(scenario.timeline.num_epochs):
        epoch = simulation.observe()
        statistics.append([values.copy() for values in epoch.statistics.values()])
        active.append(attack.active(epoch))
        offsets.append(horizontal(simulation.offset))
        simulation.resolve()
        errors.append(simulation.error.copy())
    solution = np.array(errors)
    return Pass(
        time=scenario.timeline.times[1:],
        statistic=np.moveaxis(np.array(statistics).reshape(len(solution), len(detectors), runs), 1, 0),
        error=np.where(known[:, None], horizontal(solution), np.nan),
        solution=solution,
        active=np.array(active),
        offset=np.array(offsets),
    )
