"""What all families on ranges have in common: a measurement is the code and a second observable of every slot."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.immutable import Immutable
from spoofgym.navigation.facts import COASTING, INERTIAL_SOLUTION, RANGES
from spoofgym.navigation.interface import Innovation
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.tight.mean import TightMeanFilter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import num_states
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.parallel import RunSlices


class RangeFamily(Immutable, ABC):
    """A family whose filter takes the ranges themselves, m = 2 S."""

    coupling = "tight"
    offers: tuple[str, ...] = (INERTIAL_SOLUTION, RANGES, COASTING)
    measurement = "ranges"
    measures_velocity = False

    @property
    @abstractmethod
    def slots(self) -> int:
        """S, satellites that are tracked at most."""

    @abstractmethod
    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The game from epoch -burn_in on, every range used."""

    @property
    def num_states(self) -> int:
        """n, of the error state."""
        return num_states(self.slots)

    @property
    def dimension(self) -> int:
        """m, of the ranges of all slots."""
        return 2 * self.slots

    def white_innovations(self) -> WhiteInnovations:
        """What clean innovations at epochs 0..K are made of, where the filter is matched."""
        model = self.tight_model()
        return WhiteInnovations(model.innovation_factor, model.position_response, np.tile(model.dynamics.present, 2))

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation, every range used."""
        return TightMeanFilter(self.tight_model(), num_runs, slices)

    def blank_innovation(self, num_runs: int) -> Innovation:
        """An innovation of zeros and of no satellites, before there is any."""
        n, m = num_runs, self.dimension
        return Innovation(
            np.zeros((n, m)),
            np.zeros((n, m, m)),
            np.zeros((n, m)),
            np.zeros(n),
            range_response=np.zeros((n, m, 3)),
            present=np.zeros((n, m), dtype=np.bool_),
        )

    def seen_dimension(self, in_position: bool) -> int:
        """Three for a detector that sees what the ranges say about the position."""
        return 3 if in_position else self.dimension


def captured_ranges(present: Flags, spoof: Spoof, code: Floats, second: Floats) -> Floats:
    """What a spoofer adds to code and second observable of the satellites that there are and that it captures, (k, m).

    Args:
        present: slots that hold a satellite, (k, S).
        spoof: tells which are captured.
        code: what it adds to each, (k, S), m.
        second: what it adds to each second observable, (k, S), m or m/s.
    """
    captured = present if spoof.satellites is None else present & spoof.satellites
    followed = captured if spoof.carrier is None else captured & spoof.carrier[:, None]
    added = np.concatenate([code * captured, second * followed], axis=1)
    return added if spoof.ranges is None else added + spoof.ranges


def disturbed_ranges(direction: Floats, multipath: Floats, present: Flags, clock: Floats | None = None) -> Floats:
    """What disturbances add to the code, (k, K+1, m), so that a fix would err by ``multipath``, (k, K+1, 3), m.

    Args:
        direction: unit vectors to the satellites at epochs 0..K, (K+1, S, 3), ENU.
        multipath: their effect on fixes.
        present: slots that hold a satellite at these epochs, (K+1, S).
        clock: by how much the receiver has set its clock, (k, K+1), m; None = it has not.
    """
    slots = direction.shape[1]
    added = np.zeros((*multipath.shape[:2], 2 * slots))
    for epoch in np.flatnonzero(multipath.any(axis=(0, 2))):
        added[:, epoch, :slots] = -along(direction[epoch][None], multipath[:, epoch])
    if clock is not None and clock.any():
        added[:, :, :slots] += clock[:, :, None] * present
    return added


def along(direction: Floats, vector: Floats) -> Floats:
    """Components of vectors (k, 3) along unit vectors (k, S, 3), (k, S)."""
    return (
        direction[..., 0] * vector[:, None, 0]
        + direction[..., 1] * vector[:, None, 1]
        + direction[..., 2] * vector[:, None, 2]
    )
