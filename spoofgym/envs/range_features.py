"""What a defender sees beside the position domain where the filter takes ranges: single satellites, protection levels.

Two kinds of protection levels stand side by side. The filter's own is K times the sigma of its own covariance. It is
blind to spoofing: neither gains nor covariance depend on what the spoofer sends (Liu 2018, section 4). That of a
detector with a ``protection_level``, a bank of coasting solutions, holds whatever the signals say.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.envs.observation import Field
from spoofgym.policies.learned import SLOT_FIELD
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

HORIZONTAL_FACTOR, VERTICAL_FACTOR = 6.0, 5.33
"""K of the filter's own protection levels: K_H and K_V of RTCA DO-229 for approaches with vertical guidance."""
BEYOND = 1e6
"""Protection levels over their alert limits count as at most this: an infinite one has no squashed form."""


@runtime_checkable
class Bounding(Protocol):
    """A detector that bounds the position error."""

    @property
    def protection_level(self) -> Floats:
        """PL after the present epoch, (N,), m."""


def bounding_detectors(simulation: Simulation, names: Sequence[str]) -> tuple[str, ...]:
    """Those of the detectors that give a protection level, in order."""
    return tuple(name for name in names if isinstance(simulation.detectors[name], Bounding))


def direction_of(detector: Bounding) -> str:
    """The direction that a detector's protection level bounds: up unless it says another."""
    return str(getattr(detector, "direction", "up"))


def filter_protection_levels(covariance: Floats) -> tuple[Floats, Floats]:
    """The filter's own, K sigma of its covariance (N, 3, 3): horizontal and vertical, (N,) each, m."""
    east, north, cross = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    largest = 0.5 * (east + north) + np.sqrt(0.25 * (east - north) ** 2 + cross**2)
    return HORIZONTAL_FACTOR * np.sqrt(largest), VERTICAL_FACTOR * np.sqrt(covariance[:, 2, 2])


def satellites_in_view(simulation: Simulation) -> Flags:
    """Whether each slot holds a satellite in the present epoch, (N, S); none in an outage, S = 0 on fixes."""
    epoch = simulation.epoch
    present = epoch.innovation.present
    if present is None:
        return np.zeros((simulation.num_runs, 0), dtype=bool)
    present = present[:, : simulation.scenario.slots]
    return present if epoch.available is None else present & epoch.available[:, None]


def range_fields(slots: int, bounding: Sequence[str]) -> tuple[Field, ...]:
    """The entries, in order.

    Args:
        slots: S, satellites that are tracked at most.
        bounding: names of the detectors that give a protection level.
    """
    levels = ["protection level horizontal", "protection level vertical"]
    levels += [f"protection level of {name}" for name in bounding]
    return (
        *(Field(f"code residual of slot {slot}", "sigma", 2.0) for slot in range(slots)),
        *(Field(f"{SLOT_FIELD} {slot}", "1", 0.0) for slot in range(slots)),
        Field("satellites in view", "1", 8.0),
        *(Field(f"{level} over its alert limit", "1", 1.0) for level in levels),
    )


class RangeFeatures:
    """The entries of N lanes of a game on ranges.

    Attributes:
        fields: the entries, in order.
    """

    def __init__(self, scenario: Scenario, simulation: Simulation, detectors: Sequence[str]) -> None:
        """Look at a simulation, of which the defender sees the ``detectors`` of these names."""
        bounding = bounding_detectors(simulation, detectors)
        self.fields = range_fields(scenario.slots, bounding)
        self._simulation, self._slots = simulation, scenario.slots
        self._horizontal, self._vertical = scenario.alert_limits
        found = (simulation.detectors[name] for name in bounding)
        self._bounding = [(detector, self._limit(detector)) for detector in found if isinstance(detector, Bounding)]

    def _limit(self, detector: Bounding) -> float:
        """The alert limit of a detector's protection level, m."""
        return self._vertical if direction_of(detector) == "up" else self._horizontal

    def __call__(self) -> Floats:
        """Of the present epoch, before its ranges are resolved, (N, F)."""
        epoch = self._simulation.epoch
        innovation, view = epoch.innovation, epoch.view
        assert view is not None
        code = range(self._slots)
        present = satellites_in_view(self._simulation)
        residual = innovation.residual[:, code] / np.sqrt(innovation.covariance[:, code, code])
        levels = np.stack([*self._own_levels(view.position_covariance), *self._detectors_levels()], axis=1)
        count = np.add.reduce(present, axis=1, dtype=np.float64)
        return np.concatenate([residual * present, present, count[:, None], np.minimum(levels, BEYOND)], axis=1)

    def _own_levels(self, covariance: Floats) -> tuple[Floats, Floats]:
        """K sigma of the filter's covariance (N, 3, 3) over the alert limits, horizontal and vertical, (N,) each."""
        horizontal, vertical = filter_protection_levels(covariance)
        return horizontal / self._horizontal, vertical / self._vertical

    def _detectors_levels(self) -> list[Floats]:
        return [detector.protection_level / limit for detector, limit in self._bounding]
