"""The filter of a recorded log on its unspoofed fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.loose import StrapdownNavigator
from spoofgym.navigation.strapdown_model import StrapdownModel
from spoofgym.navigation.warm_start import NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


@dataclass(frozen=True, eq=False)
class CleanRun:
    """The filter's states on unspoofed fixes; row 0 is the alignment, row k + 1 the state after epoch k was used.

    Attributes:
        attitude: body to ENU, (E + 1, 3, 3).
        velocity: ENU, (E + 1, 3), m/s.
        position: latitude rad, longitude rad, height m, (E + 1, 3).
        bias: estimated, (E + 1, 6), rad/s and m/s².
        covariance: P, (E + 1, 15, 15).
    """

    attitude: Floats
    velocity: Floats
    position: Floats
    bias: Floats
    covariance: Floats


def clean_run(model: StrapdownModel) -> CleanRun:
    """Run the filter over all epochs of a model, every fix used."""
    navigator = StrapdownNavigator(model, 1, RunSlices(1))
    navigator.reset(np.array([0]), np.zeros((1, NUM_JOINT)), RunStreams.from_seed(0, 1))
    use = Decision(np.ones(1, dtype=bool))
    states: list[tuple[Floats, ...]] = []

    def keep() -> None:
        parts = (navigator.attitude, navigator.velocity, navigator.position, navigator.bias, navigator.covariance)
        states.append(tuple(part[0].copy() for part in parts))

    keep()
    for _ in range(len(model.time)):
        navigator.propagate()
        navigator.innovate(np.zeros((1, model.dimension)))
        navigator.resolve(use)
        keep()
    return CleanRun(*(np.stack(part) for part in zip(*states, strict=True)))
