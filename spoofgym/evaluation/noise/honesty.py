"""Whether a filter is as good as it believes: its innovations and position errors on a log, in its own sigmas."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2, norm

from spoofgym.arrays import Floats
from spoofgym.detectors.chi_square import DEFAULT_P_FA
from spoofgym.evaluation.noise.innovations import Innovations, believing, innovations
from spoofgym.logs.log_noise import LogNoise
from spoofgym.scenarios.recorded_loose import RecordedFixes

SIGMAS = (1.0, 2.0, 3.0)
EXPECTED = tuple(float(1.0 - 2.0 * norm.sf(k)) for k in SIGMAS)
"""Share of normal errors within one, two and three sigma."""
RATES = (1e-3, DEFAULT_P_FA)
"""False-alarm probabilities of the snapshot test, per epoch."""
LAGS = 10
"""Of the test of whiteness."""
HOUR = 3600.0


def honesty(log: RecordedFixes, noise: LogNoise | None, stretch: slice) -> dict[str, Any]:
    """Figures of the filter that believes in noises, on some epochs of a log; it runs from the alignment on.

    Args:
        log: of fixes.
        noise: estimated; None = what the filter believes without any estimate.
        stretch: the epochs that are judged.

    Returns:
        epochs; hours; nis_per_degree; autocorrelation (of the whitened innovations at lag 1, a number per measured
        component) and white_band (95 % of those of white ones lie within ± it); whiteness_p (Ljung-Box over
        `LAGS` lags, smallest of all components times their number); false_alarms, a row per rate of `RATES`: p_fa,
        alarms, per_hour, expected_per_hour; jump_seen_m, the jump of the position that the test with the last of these
        rates sees half the time, median over epochs and horizontal axes; coverage of the errors of the predicted
        position against the reference, horizontal and up: shares within one, two and three sigma of the filter
        (``filter``), and of the filter and the slow error of the fixes together (``whole``); None without a reference.

    Raises:
        ValueError: the filter diverges.
    """
    found = innovations(believing(log, noise))
    if found is None:
        raise ValueError(f"scenario {log.name!r}: the filter diverges under these noises")
    part = Innovations(*(values[stretch] for values in vars(found).values()))
    measured = log.measured[stretch]
    degrees = measured.sum(axis=1)
    time = log.epoch_time[stretch]
    hours = float(time[-1] - time[0]) / HOUR
    correlations, p_values = _whiteness(part.whitened[:, measured.any(axis=0)])
    return {
        "epochs": len(time),
        "hours": hours,
        "nis_per_degree": float(part.nis.sum() / degrees.sum()),
        "autocorrelation": correlations,
        "white_band": float(norm.isf(0.025) / np.sqrt(len(time))),
        "whiteness_p": min(1.0, len(p_values) * min(p_values)),
        "false_alarms": [_false_alarms(part.nis, degrees, rate, hours) for rate in RATES],
        "jump_seen_m": _jump_seen(part.covariance, degrees),
        "coverage": _coverage(log, noise, part, stretch),
    }


def _whiteness(whitened: Floats) -> tuple[list[float], list[float]]:
    """Autocorrelation at lag 1, and the p-value of Ljung and Box, of each column of (n, c)."""
    first, p_values = [], []
    for column in whitened.T:
        n, power = len(column), float(column @ column)
        lags = range(1, min(LAGS, n - 1) + 1)
        correlations = np.array([float(column[lag:] @ column[:-lag]) / power for lag in lags])
        q = n * (n + 2.0) * float(np.sum(correlations**2 / (n - np.array(lags))))
        first.append(float(correlations[0]))
        p_values.append(float(chi2.sf(q, len(lags))))
    return first, p_values


def _false_alarms(nis: Floats, degrees: Floats, rate: float, hours: float) -> dict[str, Any]:
    """How often the snapshot test alarms on clean fixes."""
    alarms = int(np.sum(nis > chi2.isf(rate, degrees)))
    return {
        "p_fa": rate,
        "alarms": alarms,
        "per_hour": alarms / hours,
        "expected_per_hour": rate * len(nis) / hours,
        "per_hour_interval": [_poisson(alarms, side) / hours for side in (0.025, 0.975)],
    }


def _poisson(count: int, side: float) -> float:
    """Bound of the exact 95 % interval of a mean of which ``count`` was counted."""
    if side < 0.5:
        return float(chi2.ppf(side, 2 * count) / 2.0) if count else 0.0
    return float(chi2.ppf(side, 2 * count + 2) / 2.0)


def _jump_seen(covariance: Floats, degrees: Floats) -> float:
    """The jump east or north that the snapshot test sees in one fix with probability one half, median, m."""
    size = int(np.median(degrees))
    threshold = chi2.isf(RATES[-1], size)
    needed = brentq(lambda value: ncx2.sf(threshold, size, value) - 0.5, 1e-6, 10.0 * threshold)
    information = np.linalg.inv(covariance)[:, [0, 1], [0, 1]]
    return float(np.median(np.sqrt(needed / information)))


def slow_variance(log: RecordedFixes, noise: LogNoise | None) -> Floats:
    """Variance of the part of the fixes' position error that does not change from fix to fix, (E, 3), m².

    A filter cannot see it: what is stated of the fixes and does not show in the innovations is taken for it.
    """
    believed = np.square(log.believed_sigma(noise)[:, :3])
    return np.asarray(np.maximum(np.square(log.stated_sigma[:, :3]) - believed, 0.0))


def _coverage(log: RecordedFixes, noise: LogNoise | None, part: Innovations, stretch: slice) -> dict[str, Any] | None:
    """Shares of the errors of the predicted position within so many sigma."""
    known = log.compared[stretch]
    if log.log.reference is None or not known.any():
        return None
    error, alone = np.abs(part.position_error[known]), part.position_sigma[known]
    whole = np.sqrt(alone**2 + slow_variance(log, noise)[stretch][known])

    def shares(sigma: Floats, axes: slice) -> list[float]:
        return [float(np.mean(error[:, axes] <= k * sigma[:, axes])) for k in SIGMAS]

    return {
        name: {"filter": shares(alone, axes), "whole": shares(whole, axes)}
        for name, axes in (("horizontal", slice(0, 2)), ("up", slice(2, 3)))
    }
