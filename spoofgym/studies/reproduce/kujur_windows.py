"""Missed detection, shortest windows and protection levels of Kujur 2024, by the paper's formula and exactly.

The paper's formula takes an innovation for the tracking error itself (eqs 38 and 46 to 48). In truth the filter
follows what it is fed, and the next innovation sees the difference (`spoofgym.navigation.tight.tracking_response`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.detectors import cpi_theory
from spoofgym.detectors.cpi import UP, unit_vector
from spoofgym.detectors.separation_theory import protection_level, separation_threshold
from spoofgym.navigation.separation.coasting import coasting_tables
from spoofgym.navigation.tight.tracking_response import projected_response, tracking_response
from spoofgym.scenario import Scenario
from spoofgym.studies.reproduce.kujur_games import INTERVAL, Replica, flight

P_FA, P_MD_CPI, P_MD_SS = 1e-5, 1e-7, 1e-6


@dataclass(frozen=True)
class Windows:
    """What decides about windows that begin with the spoofing.

    Attributes:
        information: σ_s² of the epochs 1 to K, (K,), 1/m².
        response: G of s_k / σ_s, (K, K), 1/m.
    """

    information: Floats
    response: Floats

    def formula(self, replica: Replica, n: int) -> float:
        """P_MD after n epochs by the paper's formula."""
        if replica.time == 0.0:
            kappa = cpi_theory.kappa(replica.sigma, float(self.information[:n].mean()))
            return float(cpi_theory.missed_detection_white(P_FA, n, kappa))
        return cpi_theory.missed_detection_coloured(P_FA, self.information[:n], _tracking(replica, n))

    def exact(self, replica: Replica, n: int) -> float:
        """P_MD after n epochs with the filter's feedback."""
        return cpi_theory.missed_detection(P_FA, self.response[:n, :n], _tracking(replica, n))

    def variances(self, replica: Replica, n: int) -> Floats:
        """Eigenvalues of the covariance of s_k / σ_s with the filter's feedback, (n,)."""
        return cpi_theory.spoofed_variances(self.response[:n, :n], _tracking(replica, n))

    def shortest(self, replica: Replica, missed: Callable[[Replica, int], float]) -> int | None:
        """N_min: epochs until P_MD is 1e-7, by `formula` or `exact`; None where K are too few."""
        return cpi_theory.minimum_epochs(P_MD_CPI, lambda n: missed(replica, n), len(self.information))


def _tracking(replica: Replica, n: int) -> Floats:
    return cpi_theory.gauss_markov_covariance(n, replica.sigma, replica.time, INTERVAL)


@lru_cache(maxsize=32)
def windows(imu: str, hour: float | None = None, horizon: int = 360) -> Windows:
    """Those of the flight; arguments as in `flight`."""
    model, up = flight(imu, hour, horizon).tight_model(), unit_vector("kujur-2024", UP)
    information = np.add.reduce((model.position_response[1:] @ up) ** 2, axis=1)
    return Windows(information, projected_response(model, up))


def cumulative_exact(scenario: Scenario, replica: Replica, n: int) -> float:
    """P_MD of the CI after n epochs, with the filter's feedback."""
    model = scenario.tight_model()
    response = tracking_response(model, unit_vector("kujur-2024", UP))[:n, :, :n]
    return cpi_theory.missed_detection(P_FA, response.reshape(-1, n), _tracking(replica, n))


@dataclass(frozen=True)
class Coasting:
    """The coasting that has departed from the filter 1 to K epochs ago, up.

    Attributes:
        separation: σ_ss, (K,), m (eq 50).
        sigma: σ_coast, (K,), m.
    """

    separation: Floats
    sigma: Floats

    def level(self, n: int) -> float:
        """The protection level of n windows, n epochs long, each with its part of P_FA, m (eq 51)."""
        threshold = separation_threshold(P_FA, n, self.separation[n - 1])
        return float(protection_level(threshold, P_MD_SS, self.sigma[n - 1]))


def coasting(scenario: Scenario) -> Coasting:
    """Of the last epoch of a flight."""
    model = scenario.tight_model()
    tables = coasting_tables(model, (2,), model.num_epochs + 1)
    variance = tables.variance[-1, 0]
    return Coasting(np.sqrt(variance), np.sqrt(variance + tables.filtered[-1, 0]))
