"""The states of aids behind those of a filter on ranges, and what the aids observe at its epochs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.aids.aid import Aid, Place
from spoofgym.navigation.aids.aid_set import AidSet
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight.model import TightDynamics

STEADY = 1e-9
"""Relative difference up to which rates are multiples of each other."""


def epochs_per_reading(owner: str, aid: Aid, rate: float) -> int:
    """Epochs from one reading to the next.

    Raises:
        ValueError: the rate of the aid is not that of the epochs, Hz, or a whole fraction of it.
    """
    ratio = rate / aid.rate
    if round(ratio) < 1 or abs(ratio - round(ratio)) > STEADY * ratio:
        raise ValueError(
            f"{owner}: aids: a filter on ranges takes readings at its epochs: the rate of {aid.kind} must be "
            f"{rate:g} Hz or a whole fraction of it, got {aid.rate:g} Hz"
        )
    return round(ratio)


def with_aid_states(dynamics: TightDynamics, aids: AidSet) -> TightDynamics:
    """Dynamics with the states of the aids, random walks, behind the others."""
    own = aids.num_states
    return replace(
        dynamics,
        decay=np.concatenate([dynamics.decay, np.ones(own)]),
        variance=np.concatenate([dynamics.variance, aids.walk**2 * dynamics.interval]),
    )


@dataclass(frozen=True, eq=False)
class EpochReadings:
    """What the aids of a filter on ranges read, by its epochs E.

    Attributes:
        aids: of the filter.
        first_state: place of the aids' first state in the filter.
        number: of each aid's reading at each epoch, (E, A); -1 = it reads nothing then.
        values: of each aid, (M, q).
        observations: H of each aid on all n states along the truth, (M, r, n).
    """

    aids: AidSet
    first_state: int
    number: Runs
    values: list[Floats]
    observations: list[Floats]

    def part(self, first: int, last: int) -> EpochReadings:
        """Epochs first..last-1 of these; the readings keep their numbers."""
        return replace(self, number=self.number[first:last])

    def on_all(self, place: int, observation: Floats) -> Floats:
        """H (k, r, 9 + own) of an aid at this place on all n states, (k, r, n)."""
        aid = self.aids.aids[place]
        whole = np.zeros((*observation.shape[:2], self.first_state + self.aids.num_states))
        whole[:, :, :NUM_NAVIGATION] = observation[:, :, :NUM_NAVIGATION]
        first = self.first_state + self.aids.first_state[place]
        whole[:, :, first : first + aid.num_states] = observation[:, :, NUM_NAVIGATION:]
        return whole


def epoch_readings(owner: str, aids: AidSet, first_state: int, place: Place, rate: float) -> EpochReadings:
    """The readings at true places of all epochs from the start of a trajectory on.

    Args:
        owner: of the aids, for messages.
        aids: of the filter.
        first_state: of them in the filter.
        place: the truth at the epochs, (E, ...).
        rate: of the epochs, Hz.

    Raises:
        ValueError: rates that do not fit.
    """
    epochs = np.arange(len(place.velocity))
    number = np.full((len(epochs), len(aids.aids)), -1)
    made = EpochReadings(aids, first_state, number, [], [])
    for j, aid in enumerate(aids.aids):
        every = epochs_per_reading(owner, aid, rate)
        there = aid.measures(place) & ((epochs + 1) % every == 0)
        number[there, j] = np.arange(np.count_nonzero(there))
        here = Place(place.attitude[there], place.velocity[there], place.position[there])
        values = aid.read(here)
        made.values.append(values)
        made.observations.append(made.on_all(j, aid.observe(here, values)))
    return made
