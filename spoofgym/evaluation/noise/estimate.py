"""Noises of a log by the likelihood of its innovations (prediction error decomposition).

If the filter's model is right, its innovations ν are independent and normal with covariances S, both of which depend on
the noises θ. So

    -log L(θ) = Σ_k ½ (log det S_k + ν_k' S_k⁻¹ ν_k) + const

(Schweppe 1965). It is minimised over the logarithms of the noises within bounds, by scoring (`scoring.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.noise.innovations import Innovations, believing, innovations, until
from spoofgym.evaluation.noise.parameters import Parameter, first_guess, noise_of, parameters
from spoofgym.evaluation.noise.scoring import minus_log_likelihood, scoring, standard_errors
from spoofgym.logs.log_noise import LogNoise
from spoofgym.logs.table import seconds
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.scenarios.recorded_loose import RecordedFixes

NEAR = 0.01
"""A logarithm this near to a bound has run into it."""
FEWEST = 60
"""Epochs of a stretch."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """The noises of a stretch of a log.

    Attributes:
        noise: the estimate.
        asked: what was estimated.
        value: of each, (p,).
        error: standard error of its logarithm, (p,); NaN where it ran into a bound.
        bound: which one each ran into: ``least``, ``most`` or nothing.
        begin: of the stretch, s.
        end: of the stretch, s.
        epochs: of the stretch.
        gain: log-likelihood over that of the filter without any estimate.
        converged: whether the search ended by itself.
    """

    noise: LogNoise
    asked: tuple[Parameter, ...]
    value: Floats
    error: Floats
    bound: tuple[str, ...]
    begin: float
    end: float
    epochs: int
    gain: float
    converged: bool


def log_of_fixes(scenario: Scenario) -> RecordedFixes:
    """The filter on a log whose noises can be estimated.

    Raises:
        ValueError: the scenario is simulated, or its filter takes ranges.
    """
    family = recorded_family(scenario)
    if not isinstance(family, RecordedFixes):
        raise ValueError(f"scenario {scenario.name!r}: noises are estimated on fixes, not with coupling=tight")
    return family


def clean_stretch(log: RecordedFixes, begin: float | None = None, end: float | None = None) -> slice:
    """The epochs of a log between two times; by default from `SETTLING` after the alignment to its end.

    Raises:
        ValueError: it holds too few epochs.
    """
    time = log.epoch_time
    first = int(np.searchsorted(time, log.align_time + SETTLING if begin is None else begin))
    last = len(time) if end is None else int(np.searchsorted(time, end, side="right"))
    if last - first < FEWEST:
        raise ValueError(
            f"scenario {log.name!r}: a stretch needs {FEWEST} fixes, there are {max(last - first, 0)} between "
            f"{seconds(log.align_time + SETTLING if begin is None else begin)} s and "
            f"{seconds(float(time[-1]) if end is None else end)} s; choose its begin and end"
        )
    return slice(first, last)


def estimate_noise(scenario: Scenario, begin: float | None = None, end: float | None = None) -> Estimate:
    """The noises of a log on a clean stretch of it.

    Args:
        scenario: the log, whose filter takes fixes.
        begin: of the stretch, s; None = `SETTLING` after the alignment.
        end: of the stretch, s; None = the end of the log.

    Raises:
        ValueError: no log of fixes, a stretch that is too short, or a filter that diverges on it.
    """
    log = log_of_fixes(scenario)
    return estimate_on(log, clean_stretch(log, begin, end))


def estimate_on(log: RecordedFixes, stretch: slice) -> Estimate:
    """The noises of a log on some of its epochs; the filter runs from the alignment on."""
    asked = parameters(log, stretch)
    run = partial(_run, log, asked, stretch)
    low, high = (np.log([getattr(each, side) for each in asked]) for side in ("least", "most"))
    start = first_guess(log, asked)
    before = innovations(until(believing(log, None), stretch.stop))
    if before is None or run(start) is None:
        raise ValueError(f"scenario {log.name!r}: the filter diverges on the stretch: spoofgym check-log tells why")

    found = scoring(run, start, low, high)
    bound = np.where(found.at - low < NEAR, "least", np.where(high - found.at < NEAR, "most", ""))
    time = log.epoch_time
    return Estimate(
        noise=noise_of(log, asked, found.at),
        asked=tuple(asked),
        value=np.exp(found.at),
        error=standard_errors(found.information, bound == ""),
        bound=tuple(bound.tolist()),
        begin=float(time[stretch.start]),
        end=float(time[stretch.stop - 1]),
        epochs=stretch.stop - stretch.start,
        gain=minus_log_likelihood(_part(before, stretch.start)) - minus_log_likelihood(found.here),
        converged=found.converged,
    )


def _run(log: RecordedFixes, asked: list[Parameter], stretch: slice, logarithms: Floats) -> Innovations | None:
    """The innovations of a stretch under noises; None = the filter diverges."""
    model = until(believing(log, noise_of(log, asked, logarithms)), stretch.stop)
    return _part(innovations(model), stretch.start)


def _part(whole: Innovations | None, first: int) -> Innovations | None:
    """Innovations from an epoch on."""
    return None if whole is None else Innovations(*(values[first:] for values in vars(whole).values()))
