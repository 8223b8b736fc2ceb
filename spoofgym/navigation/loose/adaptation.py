"""The self-tuning filter: R and Q matched to the residuals and innovations of a window, and guards for that recursion.

Shadmehri and Mahboobi Esfanjani 2025, eqs 8-13 (covariance matching; J. of Aerospace Science and Technology 18(2)).
After each fix that a run has used,

    C_v = mean of v v' over the last w fixes,  v = z - H x̂⁺,        R ← C_v + H P⁺ H'          (8-10)
    C_γ = mean of γ γ' over the same fixes,                         Q ← Q √α,
    α = tr(C_γ - R) / tr(H P⁻ H')                                                              (11-13)

with R already renewed in (12). Nothing is adapted before the windows hold w fixes. The guards are ours.

Whatever H is, the update's own identities v = R S⁻¹ γ, H P⁺ H' = R - R S⁻¹ R and H P⁻ H' = S - R give all of this from
S, R and γ alone, so that both fidelities share it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman

GUARDS = ("none", "hold", "non-cumulative", "clipped", "lagged", "frozen", "bounded", "all")


class NegativeRatioError(FloatingPointError):
    """The unguarded recursion has met α < 0, whose root is not a number."""


@dataclass(frozen=True)
class Adaptation:
    """How a filter tunes itself.

    ``guard`` is one of these, or several joined by ``+``. Without any the recursion is the published one, and a filter
    that meets α < 0 raises `NegativeRatioError`. Every guard survives α ≤ 0: where it does not clip α it keeps Q. The
    figures are those of `spoofgym.studies.self_tuning`, w = 50, white noise with the filter's R or correlated noise.

    - ``none``: as published. Ends in 100 % of the runs by 20 s under correlated noise.
    - ``hold``: keeps Q where α ≤ 0, nothing else. Q is 1300 times too large at 20 s of white noise.
    - ``non-cumulative``: Q ← Q₀ √α, its factor on Q₀ within ``scale_limits``. Q cannot wind up: 1.2 times.
    - ``clipped``: α within ``ratio_limits`` and the factor on Q₀ within ``scale_limits``: winds up to the limit of 10.
    - ``lagged``: the windows end ``lag`` fixes before the present one. For so long an attack does not raise its own S:
      R stays 3.6 m in 5 s of a 3 m/s ramp, where it rises to 5.5 m without.
    - ``frozen``: a fix whose NIS exceeds ``threshold`` does not enter the windows and leaves R and Q as they are. R
      stays 0.18 m after the alarm under correlated noise, where it rises to 7.4 m without; no use before an alarm.
    - ``bounded``: the standard deviations of R stay within ``noise_limits`` times their initial values. R falls to
      0.93 m under correlated noise instead of 0.17 m, and false alarms at 25.9 from 5e-4 per epoch to none in 80,000.
    - ``all``: all of these. Detects 71 % of the ramps in white noise, the published recursion 2 %, constant R 59 %.

    Attributes:
        window: w, fixes.
        guard: what keeps the recursion from harm.
        lag: fixes.
        threshold: of the filter's own snapshot test; the paper's 25.9 is exceeded with 1e-5 by 3 degrees of freedom.
        ratio_limits: least and greatest α.
        scale_limits: least and greatest factor on Q₀.
        noise_limits: floor and cap of R, factors on the initial standard deviation of each axis.

    Raises:
        ValueError: a guard that is unknown or joined to ``none``, or a number out of range.
    """

    window: int = 50
    guard: str = "none"
    lag: int = 50
    threshold: float = 25.9
    ratio_limits: tuple[float, float] = (0.25, 4.0)
    scale_limits: tuple[float, float] = (0.1, 10.0)
    noise_limits: tuple[float, float] = (0.25, 2.0)

    def __post_init__(self) -> None:
        owner = "adaptation"
        validation.epochs(owner, "window", self.window)
        validation.epochs(owner, "lag", self.lag, 0)
        validation.above(owner, "threshold", self.threshold)
        parts = validation.text(owner, "guard", self.guard).split("+")
        for part in parts:
            validation.one_of(owner, "guard", part, GUARDS)
        if "none" in parts and len(parts) > 1:
            raise ValueError(f"{owner}: guard 'none' cannot be joined to others, got {self.guard!r}")
        for name in ("ratio_limits", "scale_limits", "noise_limits"):
            validation.span(owner, name, getattr(self, name))

    def has(self, guard: str) -> bool:
        """Whether a guard is on, by itself or among all."""
        parts = self.guard.split("+")
        return guard in parts or "all" in parts

    @property
    def literal(self) -> bool:
        """Whether the recursion is the published one."""
        return self.guard == "none"

    @property
    def delay(self) -> int:
        """Fixes between the windows' end and the present one."""
        return self.lag if self.has("lagged") else 0

    @property
    def frozen_above(self) -> float:
        """NIS above which nothing is adapted."""
        return self.threshold if self.has("frozen") else math.inf

    @property
    def ratio_range(self) -> Floats:
        """Least and greatest α, (2,); a least of -inf keeps Q where α is not positive."""
        if self.has("clipped"):
            return np.array(self.ratio_limits)
        return np.array([0.0 if self.has("non-cumulative") else -math.inf, math.inf])

    @property
    def scale_range(self) -> Floats:
        """Least and greatest factor on Q₀, (2,)."""
        limited = self.has("clipped") or self.has("non-cumulative")
        return np.array(self.scale_limits if limited else (0.0, math.inf))

    @property
    def noise_range(self) -> Floats:
        """Least and greatest standard deviation of R as a factor on the initial one, (2,)."""
        return np.array(self.noise_limits if self.has("bounded") else (0.0, math.inf))


def negative_ratio(run: int, epoch: int, time: float, ratio: float) -> NegativeRatioError:
    """The error of an unguarded run, which says what to choose instead."""
    return NegativeRatioError(
        f"run {run}, epoch {epoch} at {validation.written(time)} s: "
        f"alpha = {ratio:.3g} is negative, so that Q sqrt(alpha) is not a "
        "number: the innovations of the window are smaller than the R just matched to its residuals. The published "
        f"recursion ends here; choose a guard: {', '.join(GUARDS[1:])}"
    )


@njit(cache=True, nogil=True, error_model="numpy")
def post_fit(
    innovation: Floats,
    noise: Floats,
    gamma: Floats,
    factor: Floats,
    weighted: Floats,
    whitened: Floats,
    residual: Floats,
    post: Floats,
) -> None:
    """The residual v = R S⁻¹ γ (10), and H P⁺ H' = R - R S⁻¹ R.

    Args:
        innovation: S, (m, m).
        noise: R of the fix, (m, m).
        gamma: γ, (m,).
        factor: (m, m), overwritten with L of S = L L'.
        weighted: (m, m), overwritten with L⁻¹ R.
        whitened: (m,), overwritten with L⁻¹ γ.
        residual: v, (m,), overwritten.
        post: H P⁺ H', (m, m), overwritten.
    """
    m = len(gamma)
    kalman.cholesky(innovation, factor)
    for j in range(m):
        kalman.whiten(factor, noise[:, j], weighted[:, j])
    kalman.whiten(factor, gamma, whitened)
    for a in range(m):
        residual[a] = 0.0
        for b in range(m):
            residual[a] += weighted[b, a] * whitened[b]
        for b in range(m):
            total = noise[a, b]
            for c in range(m):
                total -= weighted[c, a] * weighted[c, b]
            post[a, b] = total


@njit(cache=True, nogil=True, error_model="numpy")
def window_mean(ring: Floats, last: int, window: int, mean: Floats) -> None:
    """C = mean of u u' over a window (9, 13).

    Args:
        ring: of vectors u, (L, m).
        last: number of the window's last fix; fix n stands at n % L.
        window: w.
        mean: C, (m, m), overwritten.
    """
    m = ring.shape[1]
    mean[:, :] = 0.0
    for n in range(last - window + 1, last + 1):
        vector = ring[n % len(ring)]
        for a in range(m):
            for b in range(a + 1):
                mean[a, b] += vector[a] * vector[b]
    for a in range(m):
        for b in range(a + 1):
            mean[a, b] /= window
            mean[b, a] = mean[a, b]


@njit(cache=True, nogil=True, error_model="numpy")
def trace(matrix: Floats) -> float:
    """Sum of the diagonal."""
    total = 0.0
    for a in range(len(matrix)):
        total += matrix[a, a]
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def bound_noise(initial: Floats, limits: Floats, noise: Floats) -> None:
    """Scale axes of R whose standard deviation leaves its limits; correlations stay. R (m, m) in place; ours."""
    m = len(noise)
    for a in range(m):
        sigma, unit = np.sqrt(noise[a, a]), np.sqrt(initial[a, a])
        within = min(max(sigma, limits[0] * unit), limits[1] * unit)
        if within != sigma:
            for b in range(m):
                noise[a, b] *= within / sigma
                noise[b, a] *= within / sigma


@njit(cache=True, nogil=True, error_model="numpy")
def next_scale(scale: float, ratio: float, cumulative: bool, ratio_range: Floats, scale_range: Floats) -> float:
    """The factor on Q₀ after √α (11), from the last one or from 1."""
    if not ratio > max(ratio_range[0], 0.0):
        if ratio_range[0] == -np.inf:
            return scale
        ratio = ratio_range[0]
    ratio = min(ratio, ratio_range[1])
    base = scale if cumulative else 1.0
    return min(max(base * np.sqrt(ratio), scale_range[0]), scale_range[1])


class Rules(NamedTuple):
    """How all runs tune themselves.

    Attributes:
        window: w, fixes.
        delay: fixes between the windows' end and the present one.
        frozen_above: NIS above which nothing is adapted.
        cumulative: whether √α multiplies the last factor on Q₀, or 1.
        ratio_range: least and greatest α, (2,).
        scale_range: least and greatest factor on Q₀, (2,).
        noise_range: least and greatest factor on the initial standard deviations of R, (2,).
        initial: R that every run begins with, (m, m).
    """

    window: int
    delay: int
    frozen_above: float
    cumulative: bool
    ratio_range: Floats
    scale_range: Floats
    noise_range: Floats
    initial: Floats


class LastFixes(NamedTuple):
    """The last innovations of all runs: S (N, m, m), γ (N, m), NIS (N,), and the factor on R they were formed with."""

    innovation: Floats
    gamma: Floats
    nis: Floats
    weight: Floats


class Learnt(NamedTuple):
    """What all runs have learnt: windows of v and γ (N, L, m), fixes in them (N,), α (N,), R (N, m, m), factor (N,)."""

    residuals: Floats
    innovations: Floats
    fixes: Runs
    ratio: Floats
    noise: Floats
    scale: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def adapt(runs: Runs, rules: Rules, last_fixes: LastFixes, learnt: Learnt) -> None:
    """Renew R and the factor on Q of runs that have just used a fix."""
    window, delay, frozen_above, cumulative, ratio_range, scale_range, noise_range, initial = rules
    innovation, gamma, nis, weight = last_fixes
    residuals, innovations, count, ratio, noise, scale = learnt
    m = gamma.shape[1]
    used, factor, weighted = np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    whitened, post, mean = np.empty(m), np.empty((m, m)), np.empty((m, m))
    length = residuals.shape[1]
    for run in runs:
        ratio[run] = 1.0
        if nis[run] > frozen_above:
            continue
        for a in range(m):
            for b in range(m):
                used[a, b] = weight[run] * noise[run, a, b]
        place = count[run] % length
        post_fit(innovation[run], used, gamma[run], factor, weighted, whitened, residuals[run, place], post)
        innovations[run, place] = gamma[run]
        last = count[run] - delay
        count[run] += 1
        if last + 1 < window:
            continue
        window_mean(residuals[run], last, window, noise[run])
        for a in range(m):
            for b in range(m):
                noise[run, a, b] += post[a, b]
        bound_noise(initial, noise_range, noise[run])
        window_mean(innovations[run], last, window, mean)
        ratio[run] = (trace(mean) - trace(noise[run])) / (trace(innovation[run]) - trace(used))
        scale[run] = next_scale(scale[run], ratio[run], cumulative, ratio_range, scale_range)
