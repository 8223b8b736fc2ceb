"""The rule by which GNSS is used again after it was left out."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Runs, take_runs
from spoofgym.detectors.chi_square import quantile
from spoofgym.navigation.interface import Epoch

DEFAULT_P = 1e-3
"""Probability that an honest fix is not consistent with a coasting filter whose covariance is right."""


class Reuse(ABC):
    """The end of an exclusion, in N runs.

    `decide` of an excluding response asks in every epoch which alarms count, then where the exclusion ends.
    """

    @property
    def options(self) -> dict[str, float | None]:
        """What spells this rule among the options of a response; None where it is the default."""
        return {}

    def bind(self, num_runs: int) -> None:  # noqa: B027 - a rule about one epoch needs no memory
        """Allocate the memory of ``num_runs`` runs."""

    def reset(self, runs: Runs) -> None:  # noqa: B027 - a rule about one epoch has nothing to forget
        """Forget everything about these runs."""

    def heeds(self, epoch: Epoch, alarm: Flags) -> Flags:
        """Where an alarm (N,) begins an exclusion if there is none, (N,)."""
        return alarm

    @abstractmethod
    def accepts(self, epoch: Epoch, alarm: Flags, coasting: Flags) -> Flags:
        """Where the fix of this epoch is used again, (N,).

        Args:
            epoch: the present one.
            alarm: whether any detector alarms, (N,).
            coasting: whether the run has been excluding GNSS and there is a fix, (N,).
        """

    def take(self, runs: Runs, other: Reuse) -> None:
        """Copy the memory of a rule of fewer runs: its run j becomes run ``runs[j]`` here."""
        take_runs(self, runs, other)


class AlarmGone(Reuse):
    """GNSS is used again as soon as no detector alarms (FOI-R-5687, chapter 4)."""

    def accepts(self, epoch: Epoch, alarm: Flags, coasting: Flags) -> Flags:
        """Where there is no alarm."""
        return coasting & ~alarm


class Never(Reuse):
    """GNSS is not used again."""

    def accepts(self, epoch: Epoch, alarm: Flags, coasting: Flags) -> Flags:
        """Nowhere."""
        return np.zeros_like(coasting)


class Consistent(Reuse):
    """GNSS is used again after consecutive fixes that agree with the coasting filter, whatever the detectors say.

    A fix agrees whose normalised innovation squared is below a threshold. A test with a memory may go on alarming over
    epochs that have passed: such an alarm does not exclude GNSS again until it has been gone once, or a fix disagrees.
    Epochs without a fix neither count nor interrupt.

    Args:
        epochs: how many fixes in a row, 1 or more.
        threshold: of the NIS; None = the chi-square quantile at 1e-3. Where the filter over-states R, the NIS is larger
            in coasting than it is in use: `spoofgym.calibration.reuse` sets the threshold for coasting.
    """

    def __init__(self, epochs: int, threshold: float | None = None) -> None:
        self.epochs = epochs
        self.threshold = threshold

    @property
    def options(self) -> dict[str, float | None]:
        """What spells this rule among the options of a response."""
        return {"reuse": self.epochs, "reuse_threshold": self.threshold}

    def bind(self, num_runs: int) -> None:
        """Allocate the counts of ``num_runs`` runs."""
        self._count = np.zeros(num_runs, dtype=np.int64)
        self._old = np.zeros(num_runs, dtype=bool)

    def reset(self, runs: Runs) -> None:
        """Forget the counts of these runs."""
        self._count[runs] = 0
        self._old[runs] = False

    def heeds(self, epoch: Epoch, alarm: Flags) -> Flags:
        """Where an alarm is not one that has lasted since before GNSS was used again, (N,)."""
        self._old &= alarm & self._agrees(epoch)
        return alarm & ~self._old

    def accepts(self, epoch: Epoch, alarm: Flags, coasting: Flags) -> Flags:
        """Where this is the last of so many fixes that agree, (N,)."""
        counted = np.where(self._agrees(epoch), self._count + 1, 0)
        self._count = np.where(coasting, counted, self._count)
        accepted = coasting & (self._count >= self.epochs)
        self._count[accepted] = 0
        self._old |= accepted & alarm
        return accepted

    def _agrees(self, epoch: Epoch) -> Flags:
        threshold = self.threshold
        if threshold is None:
            threshold = quantile(DEFAULT_P, epoch.innovation.whitened.shape[1])
        return epoch.innovation.nis < threshold


def reuse_rule(owner: str, reuse: int, reuse_threshold: float | None) -> Reuse:
    """The rule that a response's options name.

    Args:
        owner: the response, for error messages.
        reuse: consecutive consistent fixes; 0 = as soon as no detector alarms.
        reuse_threshold: of the NIS of a consistent fix; None = the chi-square quantile at 1e-3.

    Raises:
        ValueError: a value out of range, or a threshold without a number of fixes.
    """
    epochs = validation.whole(owner, "reuse", reuse, 0)
    if epochs:
        threshold = None if reuse_threshold is None else validation.above(owner, "reuse_threshold", reuse_threshold)
        return Consistent(epochs, threshold)
    if reuse_threshold is not None:
        raise ValueError(f"{owner}: reuse_threshold needs reuse, a number of consistent fixes, beside it")
    return AlarmGone()
