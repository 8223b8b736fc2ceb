"""Made-up motion of a receiver, an unaided inertial solution and a filter, as epochs of the game."""

from types import SimpleNamespace

import numpy as np
import pytest

from spoofgym.navigation.interface import Epoch, Innovation


class Motion:
    """N runs of K epochs, whose index may begin below 0 and whose fixes may be missing.

    Attributes:
        gnss, ins, filter: positions, (K, N, 3), m.
    """

    def __init__(self, seed, epochs, runs, interval=0.5):
        rng = np.random.default_rng(seed)
        self.gnss = rng.standard_normal((epochs, runs, 3)).cumsum(axis=0)
        self.ins = self.gnss + rng.standard_normal((epochs, runs, 3))
        self.filter = 100.0 * rng.standard_normal((epochs, runs, 3))
        self.available = np.ones((epochs, runs), dtype=bool)
        self.index = np.tile(np.arange(epochs)[:, None], (1, runs))
        self.interval = interval

    def epoch(self, k, runs=slice(None)):
        residual = self.filter[k, runs] - self.gnss[k, runs]
        n = len(residual)
        innovation = Innovation(
            np.where(self.available[k, runs, None], residual, 0.0), np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n)
        )
        view = SimpleNamespace(auxiliary_offset=self.ins[k, runs] - self.filter[k, runs])
        index = self.index[k, runs]
        time = 20.0 + self.interval * index
        return Epoch(index, time, innovation, available=self.available[k, runs], view=view)

    def run(self, detector, runs=slice(None)):
        """Statistics, (K, n)."""
        detector.bind(len(self.gnss[0, runs]), 3)
        return np.array([detector.update(self.epoch(k, runs)) for k in range(len(self.gnss))])


@pytest.fixture
def motion():
    """The class of made-up motion."""
    return Motion
