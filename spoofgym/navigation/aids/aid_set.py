"""Several aids on one filter: where their states and their rows stand, and when each of them measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.aids.aid import Aid
from spoofgym.navigation.error_model import NUM_INERTIAL


@dataclass(frozen=True, eq=False)
class AidSet:
    """The aids of a filter; their states stand behind its own, in this order.

    Attributes:
        aids: each of another kind.
        usual_gate: the gate of an aid that has none of its own.
    """

    aids: tuple[Aid, ...]
    usual_gate: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Their kinds."""
        return tuple(aid.kind for aid in self.aids)

    @cached_property
    def first_state(self) -> tuple[int, ...]:
        """Place of each aid's first state among all theirs."""
        return (0, *accumulate(aid.num_states for aid in self.aids))[:-1]

    @cached_property
    def first_row(self) -> tuple[int, ...]:
        """Place of each aid's first row among all theirs."""
        return (0, *accumulate(aid.dimension for aid in self.aids))[:-1]

    @property
    def num_states(self) -> int:
        """a, of all aids."""
        return sum(aid.num_states for aid in self.aids)

    @property
    def num_rows(self) -> int:
        """Rows of one measurement of every aid."""
        return sum(aid.dimension for aid in self.aids)

    @property
    def most_rows(self) -> int:
        """R, of the aid that measures most at once."""
        return max(aid.dimension for aid in self.aids)

    @cached_property
    def sigma(self) -> Floats:
        """Of their states when the filter starts, (a,)."""
        return np.array([value for aid in self.aids for value in aid.states.sigma])

    @cached_property
    def walk(self) -> Floats:
        """Of their states, per root second, (a,)."""
        return np.array([value for aid in self.aids for value in aid.states.walk])

    @property
    def gated(self) -> bool:
        """Whether a measurement may be left out."""
        return any(np.isfinite(aid.limit(self.usual_gate)) for aid in self.aids)

    def whole_rows(self, place: int, observation: Floats) -> Floats:
        """H (k, r, 9 + own) of an aid at this place on all n states, (k, r, n)."""
        aid = self.aids[place]
        whole = np.zeros((*observation.shape[:2], NUM_INERTIAL + self.num_states))
        own = observation.shape[2] - aid.num_states
        whole[:, :, :own] = observation[:, :, :own]
        first = NUM_INERTIAL + self.first_state[place]
        whole[:, :, first : first + aid.num_states] = observation[:, :, own:]
        return whole


class Readings(NamedTuple):
    """What one aid reads in a game.

    Attributes:
        moment: sample, or step, at whose end each is read, (M,), increasing.
        value: (M, q).
    """

    moment: Runs
    value: Floats


def in_turn(readings: list[Readings]) -> tuple[Runs, list[Runs]]:
    """The order in which the measurements of all aids come: by time, at one time as the aids are named.

    Returns:
        The aid of each measurement, (B,), and the place in this order of each aid's own, (M,) each.
    """
    moments = np.concatenate([each.moment for each in readings])
    aid = np.concatenate([np.full(len(each.moment), j) for j, each in enumerate(readings)]).astype(np.int64)
    order = np.lexsort((aid, moments))
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    ends = np.cumsum([len(each.moment) for each in readings])[:-1]
    return aid[order], np.split(place, ends)
