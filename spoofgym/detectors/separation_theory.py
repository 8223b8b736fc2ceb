"""Solution separation and its protection level (Kujur 2024, section 5 and appendix E).

The test compares the filter's position with a position that has coasted on inertia since its window was opened. Their
separation along the unit vector u is d = u'(x_KF - x_coast). The error of the filter is d plus the error of the
coasting. The threshold bounds d unless there is an alarm, and no signal can change the error of the coasting. The
protection level therefore holds under any spoofing until d alarms.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Floats

OWNER = "separation_theory"


def separation_threshold(p_fa: float, num_windows: int, sigma: Floats | float) -> Floats:
    """Threshold of |d|: Q⁻¹(P_FA / (2 windows)) σ_ss, two-sided, m (after eq 50).

    Args:
        p_fa: probability of a false alarm at an epoch, shared equally by the open windows; as these are correlated, the
            truth is lower.
        num_windows: open at once.
        sigma: σ_ss = √(u' (P_coast - P_KF) u), the standard deviation of d without spoofing (eq 50), any shape, m.

    Raises:
        ValueError: a value is out of range.
    """
    windows = validation.whole(OWNER, "num_windows", num_windows, 1)
    return _multiplier("p_fa", p_fa, 2 * windows) * validation.non_negatives(OWNER, "sigma", sigma)


def protection_level(threshold: Floats | float, p_md: float, coasting_sigma: Floats | float) -> Floats:
    """PL = threshold + Q⁻¹(P_MD) σ_coast (our reading of eq 51, which the paper prints as a picture), m.

    P(|error| > PL and no alarm) <= 2 P_MD under any spoofing at all, and P_MD to either side.

    Args:
        threshold: of |d|, from `separation_threshold`, m.
        p_md: probability of missed detection to one side, at most a half.
        coasting_sigma: σ_coast = √(u' P_coast u), m.

    Raises:
        ValueError: a value is out of range.
    """
    if validation.probability(OWNER, "p_md", p_md) > 0.5:
        raise ValueError(f"{OWNER}: p_md must be 0.5 or less, got {p_md!r}")
    sigma = validation.non_negatives(OWNER, "coasting_sigma", coasting_sigma)
    return np.asarray(threshold) + _multiplier("p_md", p_md, 1) * sigma


def _multiplier(name: str, probability: float, parts: int) -> float:
    """Q⁻¹ of a part of a probability."""
    return float(-special.ndtri(validation.probability(OWNER, name, probability) / parts))
