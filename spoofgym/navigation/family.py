"""A family: all that a scenario needs to know of a kind of filter, on the true motion of a game.

A new filter is a folder with one family. Nothing outside asks which one it is: it asks what the family offers.
"""

from __future__ import annotations

from typing import Protocol

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Demands, Innovation, Navigator
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams
from spoofgym.truth import Truth

FIDELITIES = ("linear", "strapdown")
COUPLINGS = ("loose", "tight")
"""What a user can choose a filter by: one that takes fixes, or one that takes the ranges to satellites."""


class FilterFamily(Protocol):
    """A kind of filter on one true motion. Epochs are counted from the burn-in's first where a method takes an index.

    k or n is a number of runs, m the dimension of a measurement, S the number of slots for satellites.
    """

    @property
    def truth(self) -> Truth:
        """The true motion."""

    @property
    def coupling(self) -> str:
        """One of `COUPLINGS`: how a user asks for filters of this kind. Nothing but spellings and messages reads it."""

    @property
    def fidelities(self) -> tuple[str, ...]:
        """The valid ones, of `FIDELITIES`."""

    @property
    def offers(self) -> tuple[str, ...]:
        """What the filter gives to monitors beside innovations; see `spoofgym.navigation.facts`."""

    @property
    def matched(self) -> bool:
        """Whether the filter's model is the truth, so that clean innovations are white."""

    @property
    def random(self) -> bool:
        """Whether every episode is drawn anew; a recorded log has one realisation."""

    @property
    def num_states(self) -> int:
        """n, states of the filter's error."""

    @property
    def dimension(self) -> int:
        """m, of a measurement."""

    @property
    def slots(self) -> int:
        """S, satellites that are tracked at most; 0 where the filter takes fixes."""

    @property
    def measurement(self) -> str:
        """What is measured, for messages: "ranges", say."""

    @property
    def measures_velocity(self) -> bool:
        """Whether a fix comes with a velocity."""

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, constant and unstable part together, (6,), rad/s and m/s²."""

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""

    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity from epoch -burn_in on, every fix used: what a shadow filter knows.

        Raises:
            ValueError: the family has no such model; the message says what there is.
        """

    def white_innovations(self) -> WhiteInnovations:
        """What clean innovations at epochs 0..K are made of, where the filter is matched."""

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation, which is what a spoofer's shadow filter is.

        Args:
            num_runs: N.
            slices: the threads to use.
        """

    def blank_innovation(self, num_runs: int) -> Innovation:
        """An innovation of zeros, before there is any."""

    def seen_dimension(self, in_position: bool) -> int:
        """The dimension of the innovations that a detector sees.

        Args:
            in_position: whether it sees ranges by what they say about the position.
        """

    def spoofed(self, fidelity: str, index: Runs, burn_in: int, spoof: Spoof) -> Floats:
        """What a spoofer adds to the measurements of runs, (k, m), m and m/s.

        Args:
            fidelity: of the navigator.
            index: epoch of each run, counted from the burn-in's first, (k,).
            burn_in: clean epochs before epoch 0.
            spoof: what the receivers are made to believe.
        """

    def disturbed(self, multipath: Floats, burn_in: int, clock: Floats | None = None) -> Floats:
        """What disturbances add to the measurements at epochs 0..K, (k, K+1, m), m and m/s.

        Args:
            multipath: their effect on fixes of position, (k, K+1, 3), m ENU.
            burn_in: clean epochs before epoch 0.
            clock: by how much the receiver has set its clock, (k, K+1), m; None = it has not.
        """

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """Number of the satellite in each slot at epochs counted from the burn-in's first, (k, S); -1 = none."""

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator of ``num_runs`` runs whose model starts ``burn_in`` epochs before epoch 0.

        Args:
            fidelity: one of `fidelities`.
            demands: what the players ask of it.
            burn_in: clean epochs before epoch 0.
            num_runs: N.
            slices: the threads to use.

        Raises:
            ValueError: the true motion does not reach back so many epochs, or a demand cannot be met.
        """

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Truth and filter just before epoch -burn_in, drawn as the navigator's `reset` takes them, (n, J)."""

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Noise of the measurements at epochs -burn_in..K, (n, burn_in + K + 1, m), m and m/s."""
