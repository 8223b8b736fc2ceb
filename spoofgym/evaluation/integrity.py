"""Integrity, availability and continuity of a position with a protection level, over runs.

Epochs of a run hang together, runs do not: what is rare is counted by runs and has the exact interval of a proportion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.matrix import exact_interval
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.stanford import NAMES, StanfordDiagram, checked, stanford_diagram

OWNER = "integrity"


@dataclass(frozen=True)
class Proportion:
    """How many of so many.

    Attributes:
        events: counted.
        trials: of which.
    """

    events: int
    trials: int

    @property
    def share(self) -> float:
        """Events over trials."""
        return self.events / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % interval (Clopper and Pearson 1934)."""
        low, high = exact_interval(self.events, self.trials)
        return low, high

    def content(self) -> dict[str, Any]:
        """For a report."""
        return {"events": self.events, "runs": self.trials, "share": self.share, "ci95": list(self.interval)}


@dataclass(frozen=True)
class Integrity:
    """What a protection level and an alarm were worth.

    Attributes:
        alert_limit: AL, m.
        time_to_alert: epochs.
        failed: runs with an integrity failure: |e| > AL at an epoch and no alarm at it nor within the time to alert,
            whatever PL is. Their share is the integrity risk of a run.
        misled: runs with misleading information: |e| > PL at an epoch without an alarm, whatever PL is.
        hazardously_misled: runs with hazardously misleading information: |e| > AL >= PL at an epoch without an alarm.
        continuous: of the runs that begin with the service (PL <= AL and no alarm), those that keep it to their end;
            None if none begins with it. Their share is the continuity of a run.
        availability: share of epochs with PL <= AL.
        availability_interval: its 95 % interval, runs being independent.
        diagram: the epochs without an alarm in the Stanford diagram.
        alarmed: epochs with an alarm.
    """

    alert_limit: float
    time_to_alert: int
    failed: Proportion
    misled: Proportion
    hazardously_misled: Proportion
    continuous: Proportion | None
    availability: float
    availability_interval: tuple[float, float]
    diagram: StanfordDiagram
    alarmed: int

    def content(self) -> dict[str, Any]:
        """For a report."""
        return {
            "alert_limit_m": self.alert_limit,
            "time_to_alert": self.time_to_alert,
            "integrity_failure": self.failed.content(),
            "misleading_information": self.misled.content(),
            "hazardously_misleading_information": self.hazardously_misled.content(),
            "continuity": None if self.continuous is None else self.continuous.content(),
            "availability": self.availability,
            "availability_ci95": list(self.availability_interval),
            "epochs_in_alarm": self.alarmed,
            "diagram": self.diagram.content(),
        }

    def text(self) -> str:
        """A table, one figure a line."""
        low, high = self.availability_interval
        limits = f"alert limit {self.alert_limit:g} m, time to alert {self.time_to_alert} epochs"
        regions = zip(NAMES, self.diagram.regions.tolist(), strict=True)
        return "\n".join(
            [
                f"{self.failed.trials} runs, {limits}",
                _line("integrity failure", self.failed),
                _line("misleading information", self.misled),
                _line("hazardously misleading", self.hazardously_misled),
                f"{'continuous':<24}no run begins with the service"
                if self.continuous is None
                else _line("continuous", self.continuous),
                f"{'available':<24}{self.availability:>10.4g} of epochs  [{max(low, 0.0):.3g}, {min(high, 1.0):.3g}]",
                f"{'epochs':<24}" + ", ".join(f"{name} {count}" for name, count in regions) + f", alarm {self.alarmed}",
            ]
        )


def integrity(
    error: Floats, protection_level: Floats, alert_limit: float, alarm: Flags, time_to_alert: int = 0
) -> Integrity:
    """All figures of N runs of K epochs.

    Args:
        error: of the position, signed or not, (N, K), m.
        protection_level: PL, (N, K), m; infinite where there is none.
        alert_limit: AL, m.
        alarm: true while the user is warned, (N, K).
        time_to_alert: epochs after that at which the error passes AL, by which an alarm must have come.

    Raises:
        ValueError: a shape or a value does not fit.
    """
    error, protection_level = checked(OWNER, error, protection_level, alert_limit)
    time_to_alert = validation.epochs(OWNER, "time_to_alert", time_to_alert, 0)
    alarm = np.asarray(alarm, dtype=np.bool_)
    if error.ndim != 2 or alarm.shape != error.shape:
        raise ValueError(f"{OWNER}: error and alarm must be (N, K), got {error.shape} and {alarm.shape}")
    size = np.abs(error)
    available = protection_level <= alert_limit
    served = available & ~alarm
    begins = served[:, 0]
    return Integrity(
        alert_limit=float(alert_limit),
        time_to_alert=time_to_alert,
        failed=_runs(integrity_failure(error, alert_limit, alarm, time_to_alert)),
        misled=_runs((size > protection_level) & ~alarm),
        hazardously_misled=_runs((size > alert_limit) & served),
        continuous=Proportion(int(served.all(axis=1).sum()), int(begins.sum())) if begins.any() else None,
        availability=float(available.mean()),
        availability_interval=mean_interval(available.mean(axis=1)),
        diagram=stanford_diagram(error, protection_level, alert_limit, alarm),
        alarmed=int(np.count_nonzero(alarm)),
    )


def integrity_failure(error: Floats, alert_limit: float, alarm: Flags, time_to_alert: int) -> Flags:
    """Epochs at which |e| > AL with no alarm at them nor in the ``time_to_alert`` epochs after, (N, K).

    Where the run ends before that time is over, nothing has failed yet.
    """
    alarm = np.asarray(alarm, dtype=np.bool_)
    epochs = error.shape[1]
    silent = np.zeros(error.shape, dtype=np.bool_)
    decided = max(epochs - time_to_alert, 0)
    silent[:, :decided] = True
    for delay in range(time_to_alert + 1):
        silent[:, :decided] &= ~alarm[:, delay : delay + decided]
    return silent & (np.abs(error) > alert_limit)


def _runs(epochs: Flags) -> Proportion:
    """Runs with such an epoch."""
    return Proportion(int(np.count_nonzero(epochs.any(axis=1))), len(epochs))


def _line(name: str, proportion: Proportion) -> str:
    low, high = proportion.interval
    return f"{name:<24}{proportion.share:>10.4g} of {proportion.trials} runs  [{low:.3g}, {high:.3g}]"
