"""What all families on fixes have in common: a measurement is a position, or a position and a velocity."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.immutable import Immutable
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.interface import Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean import LooseMeanFilter
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.parallel import RunSlices


class FixFamily(Immutable, ABC):
    """A family whose measurement is a fix, m = 3 (position) or 6 (position and velocity)."""

    coupling = "loose"
    slots = 0
    num_states = NUM_INERTIAL

    @property
    @abstractmethod
    def dimension(self) -> int:
        """m, of the fix."""

    @abstractmethod
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity from epoch -burn_in on, every fix used."""

    @property
    def measurement(self) -> str:
        """What is measured, for messages."""
        return "fixes with velocity (m = 6)" if self.measures_velocity else "fixes of position alone (m = 3)"

    @property
    def measures_velocity(self) -> bool:
        """Whether a fix comes with a velocity."""
        return self.dimension == 6

    def white_innovations(self) -> WhiteInnovations:
        """What clean innovations at epochs 0..K are made of, where the filter is matched."""
        return WhiteInnovations(self.linear_model().innovation_factor)

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation, every fix used."""
        return LooseMeanFilter(self.linear_model(), num_runs, slices)

    def blank_innovation(self, num_runs: int) -> Innovation:
        """An innovation of zeros, before there is any."""
        n, m = num_runs, self.dimension
        return Innovation(np.zeros((n, m)), np.zeros((n, m, m)), np.zeros((n, m)), np.zeros(n))

    def seen_dimension(self, in_position: bool) -> int:
        """That of the fix, whatever the detector."""
        return self.dimension

    def spoofed(self, fidelity: str, index: Runs, burn_in: int, spoof: Spoof) -> Floats:
        """What a spoofer adds to the fixes of runs, (k, m), m and m/s: its offset, and the rate."""
        if not self.measures_velocity:
            return spoof.offset
        return np.concatenate([spoof.offset, spoof.rate], axis=1)

    def disturbed(self, multipath: Floats, burn_in: int, clock: Floats | None = None) -> Floats:
        """What disturbances add to the fixes at epochs 0..K, (k, K+1, m), m: nothing to velocities, and no clock."""
        added = np.zeros((*multipath.shape[:2], self.dimension))
        added[:, :, :3] = multipath
        return added

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """There are no slots, (k, 0)."""
        return np.full((len(index), self.slots), -1)
