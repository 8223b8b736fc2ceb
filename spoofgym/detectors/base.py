"""The base class of every detector."""

from __future__ import annotations

from abc import ABC, abstractmethod

from spoofgym import validation
from spoofgym.arrays import Floats, Runs, take_runs
from spoofgym.navigation.interface import Demands, Epoch


class Detector(ABC):
    """A test on each epoch of N runs: alarm where the statistic exceeds the threshold.

    A subclass says what it remembers in `bind`, forgets it for some runs in `reset`, and computes its statistic in
    `update`. A detector with several tests reports the largest statistic_i / threshold_i against 1; calibration scales
    all of them by one factor, which is then the threshold.

    Attributes:
        threshold: alarm where statistic > threshold; None until `bind` or calibration sets it.
        arl0: the average run length between false alarms at the threshold, in epochs; None if unknown. Unless
            ``calibrated`` it holds for white innovations (a matched filter) only.
        target_arl0: the ARL0 that was asked for, to which calibration sets the threshold; None if the threshold was
            given otherwise.
        calibrated: the threshold was set on clean runs, and ``arl0`` holds where they came from.
        demands: what it asks of the navigator beside innovations, e.g. an unaided inertial solution.
        needs_view: it reads the epoch's view, so that only simulated runs can calibrate it.
        lacks_slope: its statistic grows along clean runs, and `set_slope` has not told yet how fast.
        memory: epochs that the statistic looks back, the present one left out; a warm start needs as many clean epochs.
    """

    threshold: float | None = None
    arl0: float | None = None
    target_arl0: float | None = None
    calibrated: bool = False
    demands: Demands = Demands()
    needs_view: bool = False
    lacks_slope: bool = False
    memory: int = 0

    @property
    @abstractmethod
    def name(self) -> str:
        """The specification that builds this detector."""

    def bind(self, num_runs: int, dimension: int) -> None:  # noqa: B027 - a snapshot needs no memory
        """Allocate the memory of ``num_runs`` runs for fixes of ``dimension`` m (3 or 6)."""

    def know(self, bias_sigma: Floats) -> None:  # noqa: B027 - most tests do without
        """Learn, after `bind`, the data-sheet biases of gyros and accelerometers, (6,), rad/s and m/s²."""

    def reset(self, runs: Runs) -> None:  # noqa: B027 - a snapshot has nothing to forget
        """Forget everything about these runs."""

    @abstractmethod
    def update(self, epoch: Epoch) -> Floats:
        """The statistic after this epoch, (N,)."""

    def set_threshold(self, threshold: float, arl0: float | None = None) -> None:
        """Take a threshold from calibration, and the ARL0 that was measured at it; a later `bind` keeps both.

        Raises:
            ValueError: the threshold is not a positive finite number.
        """
        self.threshold = validation.above(self.name, "threshold", threshold)
        self.arl0 = arl0
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
