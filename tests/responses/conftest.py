"""Epochs made by hand: what a receiver and a filter show of K epochs of N runs, drawn at random or written down."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from spoofgym.navigation.interface import Epoch, Innovation


@dataclass(frozen=True)
class Script:
    """Everything a response sees; arrays (K, N, ...)."""

    time: np.ndarray
    residual: np.ndarray
    covariance: np.ndarray
    position_covariance: np.ndarray
    velocity: np.ndarray
    available: np.ndarray
    alarm: np.ndarray

    def whitened(self, epochs=slice(None)):
        factor = np.linalg.cholesky(self.covariance[epochs])
        return np.linalg.solve(factor, self.residual[epochs][..., None])[..., 0]

    @property
    def num_runs(self):
        return self.alarm.shape[1]

    def of(self, runs):
        return Script(*(array[:, runs] for array in vars(self).values()))

    def epoch(self, k):
        n = self.num_runs
        whitened = self.whitened(k)
        innovation = Innovation(
            self.residual[k].copy(), self.covariance[k].copy(), whitened, (whitened**2).sum(axis=-1)
        )
        view = SimpleNamespace(velocity=self.velocity[k], position_covariance=self.position_covariance[k])
        return Epoch(np.full(n, k), self.time[k], innovation, available=self.available[k].copy(), view=view)


def quiet(epochs, num_runs, dimension=3, interval=1.0):
    """No innovation, no alarm, a vehicle at 20 m/s to the north; S = 4, P = 1 on every axis."""
    shape = (epochs, num_runs)
    return Script(
        time=np.broadcast_to(100.0 + interval * np.arange(epochs)[:, None], shape).copy(),
        residual=np.zeros((*shape, dimension)),
        covariance=np.broadcast_to(4.0 * np.eye(dimension), (*shape, dimension, dimension)).copy(),
        position_covariance=np.broadcast_to(np.eye(3), (*shape, 3, 3)).copy(),
        velocity=np.broadcast_to([0.0, 20.0, 0.0], (*shape, 3)).copy(),
        available=np.ones(shape, dtype=bool),
        alarm=np.zeros(shape, dtype=bool),
    )


def eventful(epochs, num_runs, dimension=3, seed=0):
    """Innovations in and out of the gates, alarms that come and go, outages, turns."""
    rng = np.random.default_rng(seed)
    script = quiet(epochs, num_runs, dimension)
    shape = (epochs, num_runs)

    def spells(enter, leave):
        state = np.zeros(shape, dtype=bool)
        for k in range(1, epochs):
            draw = rng.random(num_runs)
            state[k] = np.where(state[k - 1], draw >= leave, draw < enter)
        return state

    strength = np.where(spells(0.1, 0.15), 12.0, 1.0)[..., None]
    mix = rng.standard_normal((*shape, dimension, dimension))
    covariance = mix @ mix.swapaxes(-1, -2) + 4.0 * np.eye(dimension)
    residual = strength * (np.linalg.cholesky(covariance) @ rng.standard_normal((*shape, dimension, 1)))[..., 0]
    available = ~spells(0.05, 0.2)
    turning = spells(0.05, 0.2)
    heading = np.cumsum(turning * 0.1, axis=0)
    velocity = 20.0 * np.stack([np.sin(heading), np.cos(heading), 0.0 * heading], axis=-1)
    factor = rng.uniform(0.1, 0.9, (*shape, 1, 1))
    return replace(
        script,
        residual=np.where(available[..., None], residual, 0.0),
        covariance=covariance,
        position_covariance=factor * covariance[..., :3, :3],
        velocity=velocity + 0.1 * rng.standard_normal(velocity.shape),
        available=available,
        alarm=spells(0.1, 0.2),
    )


def play(response, script, restarts=()):
    """Decisions on a script: use, backtrack, reset and noise_scale, (K, N) each; ``restarts`` are (epoch, runs)."""
    response.bind(script.num_runs)
    response.reset(np.arange(script.num_runs))
    rows = {"use": [], "backtrack": [], "reset": [], "noise_scale": []}
    absent = {"backtrack": 0, "reset": 0.0, "noise_scale": 1.0}
    for k in range(len(script.time)):
        for when, runs in restarts:
            if when == k:
                response.reset(np.asarray(runs))
        alarm = script.alarm[k].copy()
        decision = response.decide(script.epoch(k), alarm)
        assert np.array_equal(alarm, script.alarm[k])
        for key, values in rows.items():
            value = getattr(decision, key)
            values.append(np.full(script.num_runs, absent[key]) if value is None else value.copy())
    return SimpleNamespace(**{key: np.array(values) for key, values in rows.items()})


@pytest.fixture
def scripts():
    """The functions that make and play scripts."""
    return SimpleNamespace(quiet=quiet, eventful=eventful, play=play)
