"""Cumulative position-domain innovation: what the measurements say about one direction of the position (Kujur 2024)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs, read_only
from spoofgym.detectors import cpi_theory
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import DEFAULT_P_FA
from spoofgym.detectors.ring import MovingSum
from spoofgym.kernels import njit
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.specification import spell

DEFAULT_WINDOW = 60
UP = "up"
UNIT_VECTORS = {"east": (1.0, 0.0, 0.0), "north": (0.0, 1.0, 0.0), UP: (0.0, 0.0, 1.0)}


def unit_vector(owner: str, direction: float | str) -> Floats:
    """The unit vector (3,), ENU, of ``east``, ``north``, ``up``, or of an azimuth in degrees clockwise from north.

    Args:
        owner: whose option, for the message.
        direction: the name, or the azimuth as a number or its text.

    Raises:
        ValueError: it is none of these.
    """
    if isinstance(direction, str):
        if direction in UNIT_VECTORS:
            return np.array(UNIT_VECTORS[direction])
        try:
            direction = float(direction)
        except ValueError:
            valid = ", ".join(UNIT_VECTORS)
            raise ValueError(
                f"{owner}: direction must be {valid} or an azimuth in degrees, got {validation.shown(direction)}"
            ) from None
    azimuth = np.radians(validation.finite(owner, "direction", direction))
    return np.array([np.sin(azimuth), np.cos(azimuth), 0.0])


def projected(innovation: Innovation, direction: Floats) -> tuple[Floats, Floats]:
    """The innovation projected onto a direction u, and its variance (eqs 17 to 20).

    s = u'H'S⁻¹ z = (W u)'w and σ_s² = u'H'S⁻¹H u = |W u|², with W = L⁻¹ H on the position; a fix of position has H = 1.

    Args:
        innovation: of N runs.
        direction: u, (3,), ENU.

    Returns:
        s, (N,), 1/m, and σ_s², (N,), 1/m²: the information of the epoch on the position along u, zero where there is
        none.
    """
    runs = len(innovation.nis)
    projection, information = np.empty(runs), np.empty(runs)
    _project(read_only(innovation.response), innovation.whitened, direction, projection, information)
    return projection, information


def kappa(innovation: Innovation, sigma: float, direction: float | str = UP) -> Floats:
    """κ = σ_t² σ_s², (N,): what a tracking error adds to the variance of the CPI, over that which it has (eq 37).

    Far below 1 the CPI has no power against this spoofer, for any window that a game can hold.

    Args:
        innovation: of N runs.
        sigma: σ_t, standard deviation of the spoofer's tracking error along the direction, m.
        direction: ``east``, ``north``, ``up``, or an azimuth in degrees.

    Raises:
        ValueError: another direction, or a sigma that is negative or not finite.
    """
    return cpi_theory.kappa(sigma, projected(innovation, unit_vector("kappa", direction))[1])


class Cpi(Detector):
    """Alarm where innovations along one direction of the position have been too large: the CPI of Kujur 2024.

    A spoofer who does not know to the centimetre where its target is shakes all ranges at once, each by its tracking
    error projected onto the line of sight. The innovation is projected onto a direction u of the position, which
    collects what all ranges say about it, and its squares are summed over the last n epochs (eqs 17 to 20 and 33):

        statistic = Σ s² / σ_s²,      s = u'H'S⁻¹ z,      σ_s² = u'H'S⁻¹H u.

    Under a matched filter Gamma(n / 2, 2), chi-square with n degrees of freedom, whatever the number of ranges: that is
    what it has over the cumulative innovation (`Windowed`), which has m n. A spoofed epoch has the variance 1 + κ, with
    κ = σ_t² σ_s² (`kappa`); where κ is far below 1, as for fixes with metres of noise, the test has no power.
    `cpi_theory` has its probability of missed detection.

    The paper accumulates from the beginning of the spoofing on; a window that slides, and an azimuth as direction, are
    ours. Windows overlap, so ARL0 is not 1 / P_FA. Epochs that have not come, and those without a fix, count as zero.

    Args:
        n: terms of the sum, epochs.
        direction: ``east``, ``north``, ``up``, or an azimuth in degrees clockwise from north.
        threshold: compared with the statistic, no unit.
        p_fa: probability that the statistic of one epoch exceeds the threshold; 1e-5, the paper's, with nothing given.
        arl0: average run length between false alarms, epochs; calibrated.

    Raises:
        ValueError: more than one of the last three is given, or a value is out of range.
    """

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        direction: float | str = UP,
        threshold: float | None = None,
        p_fa: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.n = validation.epochs("cpi", "n", n, 1)
        self.memory = self.n - 1
        self.direction = unit_vector("cpi", direction)
        validation.at_most_one("cpi", threshold=threshold, p_fa=p_fa, arl0=arl0)
        if arl0 is not None:
            self.target_arl0 = validation.average_run_length("cpi", "arl0", arl0)
        elif threshold is not None:
            self.threshold = validation.above("cpi", "threshold", threshold)
        else:
            p_exceeds = validation.probability("cpi", "p_fa", DEFAULT_P_FA if p_fa is None else p_fa)
            self.threshold = cpi_theory.cpi_threshold(p_exceeds, self.n)
        self._name = spell(
            "cpi",
            n=None if self.n == DEFAULT_WINDOW else self.n,
            direction=None if direction == UP else direction,
            threshold=None if threshold is None else self.threshold,
            p_fa=p_fa,
            arl0=self.target_arl0,
        )

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window."""
        self._sum = MovingSum(num_runs, self.n)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """Σ s² / σ_s² over the window, (N,)."""
        projection, information = projected(epoch.innovation, self.direction)
        return self._sum.push(projection**2 / np.where(information > 0.0, information, 1.0)).copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _project(response: Floats, whitened: Floats, direction: Floats, projection: Floats, information: Floats) -> None:
    """Shapes as in `projected`; response W, (N, m, 3)."""
    for run in range(len(projection)):
        projection[run], information[run] = 0.0, 0.0
        for a in range(whitened.shape[1]):
            along = 0.0
            for c in range(3):
                along += response[run, a, c] * direction[c]
            projection[run] += along * whitened[run, a]
            information[run] += along * along
