"""Errors of the code that its carrier does not have, of simulated runs: multipath and twice the ionosphere's change.

A navigator carries the error of its estimate alone; the true processes follow from the same noise. With the error
e = estimate - truth of a first-order Gauss-Markov state, e <- a e + w, so the truth goes x <- a x - w.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import CARRIER_MULTIPATH, CODE_MULTIPATH, DRIFT, IONOSPHERE, slot_states

OWN = (CODE_MULTIPATH, CARRIER_MULTIPATH, IONOSPHERE)
"""States of a satellite that act on code and carrier in different ways."""
SLANT = 5
"""Column of H's entries that holds the obliquity."""


class CodeErrors:
    """The true values of N runs, epoch by epoch, worked out where somebody asks for them."""

    def __init__(self, model: TightModel, num_runs: int) -> None:
        """Allocate what a reset leaves.

        Args:
            model: of the game.
            num_runs: N.
        """
        dynamics = model.dynamics
        self._dynamics, self._slots = dynamics, dynamics.num_slots
        self._places = slot_states(self._slots)[:, OWN].T
        self._prior = np.sqrt(np.diag(model.prior_covariance)[self._places])
        self._on_carrier = not (dynamics.columns == DRIFT).any()
        self._there = bool(dynamics.satellite_sigma[list(OWN)].any())
        self._start = np.zeros((num_runs, 3, self._slots))
        self._stale = np.ones(num_runs, dtype=bool)
        self._values = np.empty((num_runs, 0, 3, self._slots))

    def begin(self, runs: Runs, initial: Floats) -> None:
        """Note the errors with which runs begin, (k, n or more): the truth has their signs and its own spread."""
        sigma = self._dynamics.satellite_sigma[list(OWN)][:, None]
        spread = np.divide(sigma, self._prior, out=np.zeros_like(self._prior), where=self._prior > 0.0)
        self._start[runs] = -initial[:, self._places] * spread
        self._stale[runs] = True

    def added(self, epochs: Runs, normals: Floats) -> Floats:
        """What they add to code and second observable of all runs at their epochs, (N, m), m.

        Args:
            epochs: where each run stands, (N,).
            normals: of the episodes, (N, K+1, n).
        """
        added = np.zeros((len(epochs), 2 * self._slots))
        if not self._there:
            return added
        if not self._values.shape[1]:
            self._values = np.empty((*normals.shape[:2], 3, self._slots))
        stale = np.flatnonzero(self._stale)
        if len(stale):
            self._values[stale] = self._processes(self._start[stale], normals[stale])
            self._stale[stale] = False
        rows = np.maximum(epochs, 0)
        code, carrier, vertical = self._values[np.arange(len(epochs)), rows].swapaxes(0, 1)
        slant = self._dynamics.values[rows, : self._slots, SLANT] * vertical
        added[:, : self._slots] = code + slant
        if self._on_carrier:
            added[:, self._slots :] = carrier - slant
        return added

    def _processes(self, start: Floats, normals: Floats) -> Floats:
        """The true values of runs at all epochs, (k, K+1, 3, S), m."""
        dynamics, places = self._dynamics, self._places
        decay, noise = dynamics.decay[places], dynamics.noise_sigma[places]
        prior = dynamics.satellite_sigma[list(OWN)][:, None]
        value, values = start, np.empty((*normals.shape[:2], 3, self._slots))
        for k in range(normals.shape[1]):
            drawn = normals[:, k, places]
            value = np.where(dynamics.started[k], -prior * drawn, decay * value - noise * drawn)
            values[:, k] = value
        return values
