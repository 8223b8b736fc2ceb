"""Theory of monitors that sum innovations in order to see a spoofer's tracking error (Kujur 2024, section 3).

The spoofer replays true signals of a place that is off by its tracking error ν_k along the direction u, in metres. With
γ the innovation of a matched filter, S its covariance and H its design matrix,

    cumulative innovation (CI):              Σ γ_k' S_k⁻¹ γ_k,
    cumulative position-domain (CPI):        Σ s_k² / σ_s²,    s_k = u' H' S⁻¹ γ_k,    σ_s² = u' H' S⁻¹ H u,

Both are chi-square without spoofing. σ_s² is the information of one epoch on the position along u, 1/m². The module has
three formulas of missed detection: the paper's for white tracking error, the paper's for coloured tracking error, and
the exact one. The paper neglects that the filter follows the spoofed measurements. In truth an innovation sees little
more than the first difference of the tracking error. White error is therefore easier to detect than the paper says, and
coloured error is harder to detect.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.detectors import quadratic_form
from spoofgym.detectors.chi_square import quantile

OWNER = "cpi_theory"


def cpi_threshold(p_fa: float, num_epochs: int) -> float:
    """Threshold of the CPI after N epochs: the quantile of Gamma(N / 2, 2) (eq 35).

    Args:
        p_fa: probability of a false alarm, of this one test.
        num_epochs: N.

    Raises:
        ValueError: a value is out of range.
    """
    validation.probability(OWNER, "p_fa", p_fa)
    return quantile(p_fa, validation.whole(OWNER, "num_epochs", num_epochs, 1))


def ci_threshold(p_fa: float, num_epochs: int, num_measurements: int) -> float:
    """Threshold of the CI after N epochs of m measurements: chi-square with m N degrees of freedom.

    The paper says N degrees (after eq 4), which holds for m = 1 only.

    Raises:
        ValueError: a value is out of range.
    """
    num_measurements = validation.epochs(OWNER, "num_measurements", num_measurements)
    return cpi_threshold(p_fa, validation.whole(OWNER, "num_epochs", num_epochs, 1) * num_measurements)


def kappa(sigma: float, information: Floats | float) -> Floats:
    """κ = σ_t² σ_s²: variance that the tracking error adds to s_k, over that which it has (eqs 24 and 37).

    The CPI has no power where it is far below 1.

    Args:
        sigma: σ_t, standard deviation of the tracking error, m.
        information: σ_s², 1/m².

    Raises:
        ValueError: σ_t is negative.
    """
    return np.asarray(validation.non_negative(OWNER, "sigma", sigma) ** 2 * information)


def gauss_markov_covariance(num_epochs: int, sigma: float, time: float, interval: float) -> Floats:
    """Covariance of a first-order Gauss-Markov tracking error: σ² exp(-|i - j| interval / time), (N, N), m².

    Args:
        num_epochs: N.
        sigma: standard deviation, m.
        time: correlation time, s; 0 = white.
        interval: between epochs, s.

    Raises:
        ValueError: a value is out of range.
    """
    epochs = np.arange(validation.epochs(OWNER, "num_epochs", num_epochs))
    variance = validation.non_negative(OWNER, "sigma", sigma) ** 2
    validation.above(OWNER, "interval", interval)
    if validation.non_negative(OWNER, "time", time) == 0.0:
        return variance * np.eye(len(epochs))
    return variance * np.exp(-np.abs(epochs[:, None] - epochs) * interval / time)


def missed_detection_white(p_fa: float, num_epochs: int, kappa: Floats | float) -> Floats:
    """P_MD of the CPI for white tracking error by the paper's formula (eq 38): Gamma(N / 2, 2 (1 + κ)) below T_N.

    Args:
        p_fa: probability of a false alarm.
        num_epochs: N.
        kappa: κ of `kappa`, any shape.

    Raises:
        ValueError: a value is out of range.
    """
    ratio = 1.0 + validation.non_negatives(OWNER, "kappa", kappa)
    return special.gammainc(0.5 * num_epochs, 0.5 * cpi_threshold(p_fa, num_epochs) / ratio)


def missed_detection_coloured(p_fa: float, information: Floats | float, tracking: Floats) -> float:
    """P_MD of the CPI for any Gaussian tracking error by the paper's model, in which the filter ignores it (eqs 46-48).

    Args:
        p_fa: probability of a false alarm.
        information: σ_s², of all epochs or of each, () or (N,), 1/m².
        tracking: covariance of the tracking error, (N, N), m².

    Raises:
        ValueError: a value is out of range or a shape does not fit.
    """
    return missed_detection(p_fa, np.eye(len(tracking)) * np.sqrt(information), tracking)


def missed_detection(p_fa: float, response: Floats, tracking: Floats) -> float:
    """P_MD of a monitor that sums the squares of numbers which are standard normal and independent without spoofing.

    Exact for any linear filter (ours): with G the response of these numbers to the tracking error, the filter's
    feedback included, they have the covariance I + G R G'. For the CPI the numbers are the s_k / σ_s; for the CI those
    of the whitened innovations of all epochs, one below the other.

    Args:
        p_fa: probability of a false alarm.
        response: G, (r, N), 1/m; r = N for the CPI, m N for the CI.
        tracking: R, covariance of the tracking error, (N, N), m².

    Returns:
        P_MD, 0 where it is below 1e-308.

    Raises:
        ValueError: ``p_fa`` is out of range or a shape does not fit.
    """
    return quadratic_form.imhof(cpi_threshold(p_fa, len(response)), spoofed_variances(response, tracking))[0]


def spoofed_variances(response: Floats, tracking: Floats) -> Floats:
    """The eigenvalues of I + G R G', (r,), ascending: 1 without spoofing. Arguments as in `missed_detection`.

    Of more rows than epochs only N eigenvalues differ from 1; they are those of the triangle T of G = Q T.

    Raises:
        ValueError: a shape does not fit.
    """
    epochs = len(tracking)
    if np.ndim(response) != 2 or response.shape[1] != epochs or tracking.shape != (epochs, epochs):
        raise ValueError(
            f"{OWNER}: response must be (r, N) and tracking (N, N), got {np.shape(response)} and {np.shape(tracking)}"
        )
    rows = len(response)
    triangle: Floats = np.asarray(np.linalg.qr(response, mode="r")) if rows > epochs else response
    added = np.maximum(np.linalg.eigvalsh(triangle @ tracking @ triangle.T), 0.0)
    return np.sort(1.0 + np.concatenate([np.zeros(rows - len(added)), added]))


def minimum_epochs(required: float, missed: Callable[[int], float], most: int) -> int | None:
    """The shortest window with the required probability of missed detection, epochs; None if none up to ``most`` has.

    Windows are tried one after the other from N = 1: with coloured tracking error nothing says that P_MD falls with
    every epoch. A causal response has nested windows: ``response[:N, :N]`` (CPI) or ``response[:m * N, :N]``
    (CI), and ``tracking[:N, :N]``.

    Args:
        required: P_MD.
        missed: P_MD of a window of N epochs.
        most: the longest window.

    Raises:
        ValueError: a value is out of range.
    """
    validation.probability(OWNER, "required", required)
    windows = range(1, validation.epochs(OWNER, "most", most) + 1)
    return next((window for window in windows if missed(window) <= required), None)


def minimum_epochs_white(p_fa: float, required: float, kappa: float) -> int:
    """The shortest window for white tracking error by the paper's formula, epochs, by bisection.

    P_MD falls with N here: the CPI is the most powerful test of N epochs, and one that ignores the last of N + 1 is a
    test of N + 1 epochs.

    Args:
        p_fa: probability of a false alarm.
        required: P_MD.
        kappa: κ of `kappa`.

    Raises:
        ValueError: a value is out of range.
    """
    validation.probability(OWNER, "required", required)
    validation.above(OWNER, "kappa", kappa)
    short, long = 0, 1
    while missed_detection_white(p_fa, long, kappa) > required:
        short, long = long, 2 * long
    while long - short > 1:
        middle = (short + long) // 2
        if missed_detection_white(p_fa, middle, kappa) > required:
            short = middle
        else:
            long = middle
    return long
