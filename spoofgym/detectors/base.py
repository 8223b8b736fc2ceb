"""The base class of every detector."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs, take_runs
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.specification import spell


class Detector(ABC):
    """A test on each epoch of N runs: alarm where the statistic exceeds the threshold.

    A subclass allocates its memory in `bind`, clears it for some runs in `reset`, and computes its statistic in
    `update`. A detector with several tests returns the largest ratio statistic_i / threshold_i, and its threshold is 1.
    Calibration multiplies all its thresholds by one factor; that factor is then the threshold of the detector.

    Attributes:
        threshold: the detector alarms if statistic > threshold. It is positive and finite, or None until `bind` or
            calibration sets it.
        arl0: average run length between false alarms at the threshold, epochs; None if unknown. If ``calibrated`` is
            False, it holds only for white innovations (a matched filter).
        arl0_interval: 95 % interval of ``arl0``, epochs; None if ``calibrated`` is False.
        target_arl0: the ARL0 that the user requested and that calibration sets the threshold for; None if the threshold
            was given in another way.
        calibrated: whether the threshold was measured on clean runs. ``arl0`` then holds where these runs came from.
        origin: where these runs came from, in the form that calibration uses; None if a user set the threshold.
        demands: what the detector requests of the navigator beside innovations, e.g. an unaided inertial solution.
        needs: what the scenario must offer beside innovations, e.g. a linear model of the filter.
        members: detectors inside this one. They are calibrated before it.
        needs_view: whether the detector reads the epoch's view. Only simulated runs can then calibrate it.
        lacks_slope: whether the statistic grows along clean runs and `set_slope` has not been called yet.
        in_position: whether the detector tests axes of the position. Ranges are then converted to a position before the
            detector sees them (`Innovation.in_position`).
        memory: number of epochs before the present one that the statistic depends on. A warm start needs as many clean
            epochs.
    """

    threshold: float | None = None
    arl0: float | None = None
    arl0_interval: tuple[float, float] | None = None
    target_arl0: float | None = None
    calibrated: bool = False
    origin: object = None
    demands: Demands = Demands()
    needs: tuple[str, ...] = ()
    members: Sequence[Detector] = ()
    needs_view: bool = False
    lacks_slope: bool = False
    in_position: bool = False
    memory: int = 0

    @property
    @abstractmethod
    def name(self) -> str:
        """The specification that builds this detector."""

    def bind(self, num_runs: int, dimension: int) -> None:  # noqa: B027 - a snapshot needs no memory
        """Allocate the memory of ``num_runs`` runs for fixes of ``dimension`` m (3, 6, or two per satellite slot)."""

    def know(self, facts: FilterFacts) -> None:  # noqa: B027 - most tests do without
        """Learn, after `bind`, what the designer of the filter knows.

        Raises:
            ValueError: the scenario does not fit.
        """

    def join(self, simulation: Any) -> None:  # noqa: B027 - most tests do not look at the game that they watch
        """Take the `Simulation` that the detector watches, when it has been set up and before its first episode."""

    def reset(self, runs: Runs) -> None:  # noqa: B027 - a snapshot has nothing to forget
        """Forget everything about these runs."""

    @abstractmethod
    def update(self, epoch: Epoch) -> Floats:
        """Return the statistic after this epoch, (N,).

        Values are real numbers or +inf, which is a certain alarm. NaN and -inf are not allowed. Callers use
        `statistic_of`, which checks this.
        """

    def set_threshold(
        self,
        threshold: float,
        arl0: float | None = None,
        interval: tuple[float, float] | None = None,
        origin: object = None,
    ) -> None:
        """Take a threshold from calibration, and the ARL0 that was measured at it; a later `bind` keeps both.

        Args:
            threshold: compared with the statistic.
            arl0: measured at it, epochs.
            interval: its 95 % interval, epochs.
            origin: where it was measured.

        Raises:
            ValueError: the threshold is not a positive finite number.
        """
        self.threshold = validation.above(self.name, "threshold", threshold)
        self.arl0, self.arl0_interval, self.origin = arl0, interval, origin
        self.calibrated = True

    def set_slope(self, slope: float) -> None:
        """Take from calibration how fast the statistic grows along clean runs, per second.

        Raises:
            TypeError: this detector subtracts no growth.
        """
        raise TypeError(f"detector {self.name!r} subtracts no growth")

    def take(self, runs: Runs, other: Detector) -> None:
        """Copy the memory of ``other``, a copy of this detector bound to fewer runs; its run j becomes ``runs[j]``.

        Works on every `Ring` and on every array attribute whose leading axis is the runs, which is how detectors keep
        their memory.
        """
        take_runs(self, runs, other)


def seen(detector: Detector, epoch: Epoch) -> Epoch:
    """The epoch as the detector sees it: in the position domain, if it tests axes of the position."""
    return epoch.in_position if detector.in_position else epoch


def statistic_of(detector: Detector, epoch: Epoch) -> Floats:
    """Let a detector see an epoch; its statistic, (N,).

    NaN and -inf are refused, for they exceed no threshold: the detector would be blind and nobody would know.

    Raises:
        ValueError: naming the detector and what it gave instead of N real numbers.
    """
    given: object = detector.update(seen(detector, epoch))
    statistic, runs = _real_array(given), len(epoch.index)
    if statistic is None or statistic.shape != (runs,):
        got = f"{given.dtype} of shape {given.shape}" if isinstance(given, np.ndarray) else repr(given)
        raise ValueError(
            f"detector {detector.name!r}: update must return the statistics of {runs} runs, real numbers in an array "
            f"of shape ({runs},), got {got}"
        )
    blind = ~(statistic > -np.inf)
    if blind.any():
        run = int(blind.argmax())
        raise ValueError(
            f"detector {detector.name!r}: update must return numbers, or +inf for a certain alarm; it returned "
            f"{statistic[run]} in run {run}, which exceeds no threshold"
        )
    return statistic


def _real_array(given: object) -> Floats | None:
    try:
        values = np.asarray(given)
    except ValueError:  # sequences of different lengths
        return None
    return values.astype(np.float64, copy=False) if values.dtype.kind in "fiub" else None


def require_threshold(detector: Detector) -> float:
    """The threshold of a detector.

    Raises:
        ValueError: it has none yet, or that of the detector or of a member is not a positive finite number.
    """
    if detector.threshold is None:
        raise ValueError(f"detector {detector.name!r} has no threshold yet: calibrate it first")
    for part in (*detector.members, detector):
        given: object = part.threshold
        if given is not None and not _positive(given):
            raise ValueError(f"detector {part.name!r}: threshold must be a finite number greater than 0, got {given}")
    return detector.threshold


def _positive(value: object) -> bool:
    return isinstance(value, float | int | np.integer | np.floating) and bool(0.0 < value < np.inf)


def seen_dimension(detector: Detector, dimension: int, ranges: bool) -> int:
    """The dimension of the innovations that it sees, where the filter's is ``dimension``, of ranges or of fixes."""
    return 3 if ranges and detector.in_position else dimension


class ThresholdDetector(Detector):
    """A detector whose threshold is given by hand, or by the ARL0 that calibration attains: what most families share.

    A subclass names its ``kind`` and hands its options to `set_up`, under the names of its constructor's parameters.
    """

    kind: str
    default_arl0: float = 1e5

    def set_up(
        self, threshold: float | None, arl0: float | None, value: object = None, **options: object
    ) -> None:
        """Take threshold or ARL0, and form the name from the options that are not the constructor's defaults.

        Args:
            threshold: by hand.
            arl0: to be attained; None beside no threshold = the family's default.
            value: what stands first in the name, without a key.
            options: the others.

        Raises:
            ValueError: both are given, or one is out of range.
        """
        validation.at_most_one(self.kind, threshold=threshold, arl0=arl0)
        if threshold is not None:
            self.threshold = validation.above(self.kind, "threshold", threshold)
        else:
            given = self.default_arl0 if arl0 is None else arl0
            self.target_arl0 = validation.average_run_length(self.kind, "arl0", given)
        parameters = inspect.signature(type(self).__init__).parameters
        other = {key: value for key, value in options.items() if value != parameters[key].default}
        asked = None if self.target_arl0 == self.default_arl0 else self.target_arl0
        self._name = spell(self.kind, value, **other, threshold=self.threshold, arl0=asked)

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name
