"""An aid: a sensor that corrects the filter beside GNSS, at its own times, and that no decision on GNSS touches.

An aid is what pyins calls a measurement: it gives a residual, H and R. It may have states of its own behind the fifteen
inertial ones. Each is a random walk (or a constant), its error is estimate minus truth, and

    residual = predicted - read = H [x (9 navigation states); its own states] - noise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.stats import chi2

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.specification import spell

RATES = (1e-3, 1e3)
"""Least and greatest rate of an aid, Hz."""


class Place(NamedTuple):
    """Where n vehicles are, or believe to be.

    Attributes:
        attitude: C, body (right, forward, up) to ENU, (n, 3, 3).
        velocity: ENU, (n, 3), m/s.
        position: latitude rad, longitude rad, height m, (n, 3).
    """

    attitude: Floats
    velocity: Floats
    position: Floats


@dataclass(frozen=True, kw_only=True)
class AidStates:
    """The states that an aid adds to a filter, a of them.

    Attributes:
        sigma: when the filter starts, (a,).
        walk: of their random walk, per root second, (a,).
    """

    sigma: tuple[float, ...] = ()
    walk: tuple[float, ...] = ()


class Aid(ABC):
    """A sensor that the spoofer does not reach.

    A subclass has its options as arguments of ``__init__``, and hands those that all aids have to `set_up`.

    Attributes:
        kind: its registered name.
        dimension: r, of a measurement.
        rate: of the measurements, Hz.
        gate: probability that a measurement of a filter whose model is right is left out: its normalised innovation
            squared then exceeds the chi-square quantile of r degrees of freedom. 0 = every measurement is used; None =
            as is usual where it is used.
        noise: 1 sigma of its white noise, (r,).
        states: its own.
    """

    kind: ClassVar[str]
    dimension: ClassVar[int]
    rate: float
    gate: float | None
    noise: tuple[float, ...]
    states: AidStates
    name: str

    def set_up(self, rate: float, gate: float | None, **options: object) -> None:
        """Take what all aids have, and form the name from the options that are not the defaults."""
        self.rate = validation.between(self.kind, "rate", rate, *RATES)
        self.gate = None if gate is None else validation.between(self.kind, "gate", gate, 0.0, 0.5)
        defaults = type(self).__init__.__kwdefaults__ or {}
        given = {**options, "rate": rate, "gate": gate}
        self.name = spell(self.kind, **{key: value for key, value in given.items() if value != defaults[key]})

    @abstractmethod
    def read(self, place: Place) -> Floats:
        """What it reads without any error, (n, q), from the true place."""

    @abstractmethod
    def residual(self, place: Place, reading: Floats) -> Floats:
        """Predicted minus read, (n, r), where its own states are zero.

        Args:
            place: that the filters believe in.
            reading: (n, q).
        """

    @abstractmethod
    def observe(self, place: Place, reading: Floats) -> Floats:
        """H on the nine navigation states and its own, (n, r, 9 + a); arguments as in `residual`."""

    def measures(self, place: Place) -> Flags:
        """Whether there is a measurement at true places, (n,): everywhere by default."""
        return np.ones(len(place.velocity), dtype=bool)

    def limit(self, usual: float) -> float:
        """The normalised innovation squared above which a measurement is left out; infinite without a gate.

        Args:
            usual: the gate of an aid that has none of its own.
        """
        share = usual if self.gate is None else self.gate
        return float(chi2.isf(share, self.dimension)) if share > 0.0 else np.inf

    @property
    def num_states(self) -> int:
        """a, of its own states."""
        return len(self.states.sigma)

    def __repr__(self) -> str:
        return f"<aid {self.name}>"
