"""Games of Kujur 2024: a spoofer that replays the true signals with a tracking error in the vertical."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.profiles import Ramp
from spoofgym.attacks.tracking_error import TrackingError
from spoofgym.detectors.cpi import UP, projected, unit_vector
from spoofgym.navigation.interface import Demands
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

HORIZON = 360
"""Epochs of half a second: the longest monitor run time of the paper, 180 s."""
INTERVAL = 0.5
NAVIGATION = "kujur-navigation"
GRADES = ("kujur-navigation", "kujur-tactical", "kujur-automotive", "kujur-lousy")


@dataclass(frozen=True)
class Replica:
    """A spoofer's tracking error.

    Attributes:
        sigma: σ_t, m.
        time: τ, s; 0 = white.
    """

    sigma: float
    time: float = 0.0

    @property
    def words(self) -> str:
        """What a row calls it."""
        return f"{100.0 * self.sigma:g} cm, " + (f"τ {self.time:g} s" if self.time else "white")


@dataclass(frozen=True)
class Game:
    """N runs of K epochs.

    Attributes:
        cpi: Σ s² / σ_s² over the epochs 1 to k, (N, K).
        ci: Σ γ' S⁻¹ γ over these epochs, (N, K).
        carrier: innovations of the carriers, (N, K, S), m.
        separation: filter minus unaided inertial solution, up, after the last epoch, (N,), m.
    """

    cpi: Floats
    ci: Floats
    carrier: Floats
    separation: Floats


def flight(imu: str = NAVIGATION, hour: float | None = None, horizon: int = HORIZON) -> Scenario:
    """The flight of the paper with one IMU, at its own hour of the constellation's day or at another."""
    options = f"kujur-flight:horizon={horizon},imu={imu}" + ("" if hour is None else f",hour={hour:g}")
    return make_scenario(options)


def play(scenario: Scenario, replica: Replica, runs: int, seed: int) -> Game:
    """Play runs in which every range from epoch 1 on is spoofed; run i is seeded ``seed + i``, whatever the replica.

    Args:
        scenario: the flight.
        replica: the spoofer's tracking error; 0 m = clean.
        runs: N.
        seed: of run 0.
    """
    attack = TrackingError(Ramp(0.0), replica.sigma, replica.time, UP)
    simulation = Simulation(scenario, attack, (), None, runs, seed, demands=Demands(auxiliary=True))
    simulation.reset()
    epochs, slots, up = scenario.timeline.num_epochs, scenario.slots, unit_vector("kujur-2024", UP)
    cpi, ci, carrier = np.empty((runs, epochs)), np.empty((runs, epochs)), np.empty((runs, epochs, slots))
    for k in range(epochs):
        simulation.resolve()
        innovation = simulation.observe().innovation
        s, information = projected(innovation, up)
        cpi[:, k], ci[:, k], carrier[:, k] = s**2 / information, innovation.nis, innovation.residual[:, slots:]
    simulation.resolve()
    separation = -simulation.navigator.auxiliary_offset[:, 2]
    return Game(np.cumsum(cpi, axis=1), np.cumsum(ci, axis=1), carrier, separation)


def correlation_time(innovation: Floats, interval: float) -> Floats:
    """Where the sample autocorrelation has fallen to 1/e, by linear interpolation between lags, (N,), s (appendix D).

    White noise has 0.632 of the interval, by the interpolation alone.

    Args:
        innovation: (N, K, S), averaged over the S series of a run.
        interval: between epochs, s.
    """
    series = innovation - innovation.mean(axis=1, keepdims=True)
    power, level = (series**2).sum(axis=1), np.exp(-1.0)
    before, result = np.ones(len(series)), np.full(len(series), np.inf)
    for lag in range(1, series.shape[1]):
        after = ((series[:, lag:] * series[:, :-lag]).sum(axis=1) / power).mean(axis=1)
        crossed = np.isinf(result) & (after < level)
        result[crossed] = interval * (lag - 1 + (before - level)[crossed] / (before - after)[crossed])
        if np.isfinite(result).all():
            break
        before = after
    return result
