"""Made-up motion of a receiver, an unaided inertial solution and a filter, as epochs of the game."""

import copy
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


class White:
    """Epochs of which a test of the whitened innovations reads something: (K, N, m), and a covariance of unity."""

    @staticmethod
    def epoch(whitened, k=0, available=None):
        n, m = whitened.shape
        covariance = np.broadcast_to(np.eye(m), (n, m, m))
        innovation = Innovation(whitened, covariance, whitened, (whitened**2).sum(axis=1))
        return Epoch(np.full(n, k), np.full(n, float(k)), innovation, available=available)

    @classmethod
    def run(cls, detector, whitened, available=None, resets=None):
        """Statistics, (K, N); ``resets`` says which runs are reset before which epoch, as `since` reads it."""
        detector.bind(whitened.shape[1], whitened.shape[2])
        rows = []
        for k, values in enumerate(whitened):
            if resets and k in resets:
                detector.reset(np.array(resets[k]))
            rows.append(detector.update(cls.epoch(values, k, None if available is None else available[k])))
        return np.array(rows)

    @staticmethod
    def since(epochs, runs, resets):
        """Epoch at which each run was last reset, (K, N)."""
        rows = np.zeros((epochs, runs), dtype=int)
        for k in range(1, epochs):
            rows[k] = rows[k - 1]
            rows[k, resets.get(k, [])] = k
        return rows

    @classmethod
    def runs_are_independent(cls, make, whitened):
        """Any slice of the runs gives the same bits, and a copy of fewer runs is taken over."""
        whole = cls.run(make(), whitened)
        for part in (slice(0, 1), slice(3, 10), slice(100, 164)):
            np.testing.assert_array_equal(cls.run(make(), whitened[:, part]), whole[:, part])
        large = make()
        small = copy.copy(large)
        cls.run(large, whitened[:7, :20])
        cls.run(small, whitened[:7, 50:52])
        large.take(np.array([4, 0]), small)
        mixed = whitened[:, :20].copy()
        mixed[:, [4, 0]] = whitened[:, 50:52]
        rows = np.array([large.update(cls.epoch(values, k)) for k, values in enumerate(mixed[7:], 7)])
        np.testing.assert_array_equal(rows[:, [4, 0]], whole[7:, 50:52])
        np.testing.assert_array_equal(rows[:, 5:], whole[7:, 5:20])


@pytest.fixture
def white():
    """The class of epochs from whitened innovations."""
    return White
