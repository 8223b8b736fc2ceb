"""Tests for spoofing, one file per family."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import replace

from spoofgym import validation
from spoofgym.detectors.acceleration import Acceleration
from spoofgym.detectors.acna import Acna
from spoofgym.detectors.aid_innovation import AidInnovation
from spoofgym.detectors.aime import Aime
from spoofgym.detectors.base import Detector
from spoofgym.detectors.bias_range import BiasRange
from spoofgym.detectors.chi_square import DEFAULT_P_FA, Snapshot, Windowed
from spoofgym.detectors.clock_drift import ClockDrift
from spoofgym.detectors.code_minus_carrier import CodeMinusCarrier
from spoofgym.detectors.cpi import DEFAULT_WINDOW as CUMULATED
from spoofgym.detectors.cpi import Cpi
from spoofgym.detectors.cusum import Cusum, SignedCusum
from spoofgym.detectors.ensemble import Ensemble
from spoofgym.detectors.ewma import Ewma, Mewma
from spoofgym.detectors.gates import ArduPilotGate, Px4Gate
from spoofgym.detectors.growing_window import GrowingWindow
from spoofgym.detectors.kujur_monitor import KujurMonitor
from spoofgym.detectors.mean_innovation import MeanInnovation
from spoofgym.detectors.moving_average import FiniteMovingAverage
from spoofgym.detectors.raim import Raim
from spoofgym.detectors.ramp_bank import RampBank
from spoofgym.detectors.receiver_flag import ReceiverFlag
from spoofgym.detectors.relative_motion import RelativeMotion
from spoofgym.detectors.rio import Rio
from spoofgym.detectors.separation_bank import SeparationBank
from spoofgym.detectors.signed_mean import SignedMean
from spoofgym.detectors.solution_separation import SolutionSeparation
from spoofgym.detectors.whiteness import Whiteness
from spoofgym.detectors.window_bank import WindowBank
from spoofgym.specification import Specification, build, unknown_name, unnest, write

SETS_THRESHOLD = ("threshold", "p_fa", "preset", "arl0", "jump_threshold", "slow_threshold", "gate", "factor")
"""Options that decide the threshold of a detector."""


ENSEMBLE = "snapshot+cusum+signed-mean:n=30+signed-cusum+mewma"
"""Members of an ensemble that is named without any."""
BETWEEN_MEMBERS = re.compile(r"(?<!\d[eE])\+")
"""The plus between two members, not that of an exponent as in 1e+04."""


def _ensemble(members: str = ENSEMBLE, threshold: float | None = None, arl0: float | None = None) -> Ensemble:
    """The ensemble of members spelled ``detector+detector``, each with ``/`` in place of its commas."""
    asked = Ensemble.default_arl0 if arl0 is None else validation.average_run_length("ensemble", "arl0", arl0)
    pieces = BETWEEN_MEMBERS.split(validation.text("ensemble", "members", members))
    return Ensemble([_member(text, asked) for text in pieces], threshold, arl0)


def _member(text: str, arl0: float) -> Detector:
    """A member of an ensemble, to be calibrated to its ARL0 where nothing else decides.

    Raises:
        ValueError: no detector; the message tells the member and how one is spelled.
    """
    try:
        return make_detector(at_arl0(unnest(text), arl0))
    except ValueError as error:
        raise ValueError(
            f"ensemble: members: {validation.shown(text)}: {error} (within a member '/' stands for ',' and '~' for '+')"
        ) from error


def _cumulative_innovation(
    n: int = CUMULATED, threshold: float | None = None, p_fa: float | None = None, arl0: float | None = None
) -> Windowed:
    """The cumulative innovation of Kujur 2024, eq 4: the windowed test at the paper's false-alarm probability."""
    given = threshold is not None or arl0 is not None
    return Windowed(n, threshold, p_fa if p_fa is not None or given else DEFAULT_P_FA, None, arl0)


DETECTORS: dict[str, Callable[..., Detector]] = {
    "snapshot": Snapshot,
    "windowed": Windowed,
    "acna": Acna,
    "signed-mean": SignedMean,
    "mean-innovation": MeanInnovation,
    "relative-motion": RelativeMotion,
    "growing-window": GrowingWindow,
    "bias-range": BiasRange,
    "window-bank": WindowBank,
    "aime": Aime,
    "cusum": Cusum,
    "signed-cusum": SignedCusum,
    "ewma": Ewma,
    "mewma": Mewma,
    "fma": FiniteMovingAverage,
    "whiteness": Whiteness,
    "ramp-bank": RampBank,
    "solution-separation": SolutionSeparation,
    "separation-bank": SeparationBank,
    "kujur-monitor": KujurMonitor,
    "acceleration": Acceleration,
    "px4-gate": Px4Gate,
    "ardupilot-gate": ArduPilotGate,
    "rio": Rio,
    "ci": _cumulative_innovation,
    "cpi": Cpi,
    "raim": Raim,
    "clock-drift": ClockDrift,
    "code-minus-carrier": CodeMinusCarrier,
    "receiver-flag": ReceiverFlag,
    "aid-innovation": AidInnovation,
    "ensemble": _ensemble,
}


def at_arl0(text: str, arl0: float) -> str:
    """The specification of a detector at an ARL0, where it has one and no option that decides its threshold is given.

    Raises:
        ValueError: unknown name.
    """
    specification = Specification.parse(text)
    decided = any(option in specification.options for option in SETS_THRESHOLD)
    factory = DETECTORS.get(specification.name)
    if factory is None:
        raise ValueError(unknown_name("detector", specification.name, DETECTORS))
    if decided or "arl0" not in inspect.signature(factory).parameters:
        return text
    asked = write(validation.average_run_length(specification.name, "arl0", arl0))
    return str(replace(specification, options={**specification.options, "arl0": asked}))


def make_detector(detector: str | Detector) -> Detector:
    """The detector that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    return detector if isinstance(detector, Detector) else build(detector, DETECTORS, "detector")
