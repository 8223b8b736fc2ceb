"""Liu's range check of the estimated inertial biases."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.detectors.base import Detector
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Epoch
from spoofgym.sensors.imu import DEGREE_PER_HOUR, MICRO_G
from spoofgym.specification import spell

DEFAULT_FACTOR = 5.0


class BiasRange(Detector):
    """Alarm where the filter estimates a bias that no healthy sensor of its data sheet has (Liu 2018, section 4.3).

    The statistic is the largest |b_a| / (factor σ_a) over the six axes of gyro and accelerometer, against 1. Liu wants
    the limit at least three to five times the manufacturer's value. This is no test of an epoch but of what the filter
    has come to believe: it sees a spoofer who drags the position off for minutes, and late; a false alarm lasts. A
    sensor outside its data sheet alarms, too. The chance of a false alarm is that of a true bias beyond the limit, and
    does not grow with time (one axis in 370 at three sigma, in 1.7 million at five): the factor has no ARL0.

    Calibration can choose the factor all the same, from clean games of the scenario: ``arl0`` then is their epochs per
    first alarm, and a property of whole games. Longer ones alarm less often than it says, shorter ones more often. The
    statistic is then |b_a| / σ_a, and the factor its threshold.

    The data-sheet values are those of the scenario's IMU, unless both are given. Before the game, where innovations are
    drawn without a filter, the statistic is 0.

    Args:
        factor: times the data-sheet value; 5 with nothing given.
        gyro: data-sheet bias of every gyro axis, deg/h; together with ``accelerometer``.
        accelerometer: data-sheet bias of every accelerometer axis, µg.
        arl0: clean epochs per first alarm of the scenario's games, which calibrate the factor.

    Raises:
        ValueError: factor and arl0 are given, one data-sheet value without the other, or a value out of range.
    """

    needs_view = True

    def __init__(
        self,
        factor: float | None = None,
        gyro: float | None = None,
        accelerometer: float | None = None,
        arl0: float | None = None,
    ) -> None:
        validation.at_most_one("bias-range", factor=factor, arl0=arl0)
        self.factor = validation.above("bias-range", "factor", DEFAULT_FACTOR if factor is None else factor)
        if arl0 is None:
            self.threshold = 1.0
        else:
            self.factor, self.target_arl0 = 1.0, validation.average_run_length("bias-range", "arl0", arl0)
        if (gyro is None) != (accelerometer is None):
            alone, other = ("accelerometer", "gyro") if gyro is None else ("gyro", "accelerometer")
            raise ValueError(f"bias-range: {alone} needs {other} beside it")
        self._given: Floats | None = None
        if gyro is not None:
            per_gyro = validation.above("bias-range", "gyro", gyro) * DEGREE_PER_HOUR
            per_accelerometer = validation.above("bias-range", "accelerometer", accelerometer) * MICRO_G
            self._given = np.repeat([per_gyro, per_accelerometer], 3)
        self._limit: Floats | None = None if self._given is None else self.factor * self._given
        self._name = spell(
            "bias-range",
            factor=None if factor == DEFAULT_FACTOR else factor,
            gyro=gyro,
            accelerometer=accelerometer,
            arl0=arl0,
        )

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def know(self, facts: FilterFacts) -> None:
        """Take the data-sheet values of the scenario's IMU, unless they were given.

        Raises:
            ValueError: not all are positive.
        """
        if self._given is not None:
            return
        if not np.all(facts.bias_sigma > 0.0):
            raise ValueError(
                f"detector {self.name!r}: the scenario's IMU has no data-sheet bias on every axis: give gyro (deg/h) "
                "and accelerometer (µg)"
            )
        self._limit = self.factor * np.asarray(facts.bias_sigma, dtype=np.float64)

    def update(self, epoch: Epoch) -> Floats:
        """The largest estimated bias over its limit, (N,).

        Raises:
            RuntimeError: the data-sheet values are not known yet.
        """
        if self._limit is None:
            raise RuntimeError(f"detector {self.name!r} does not know the data-sheet biases yet")
        if epoch.view is None:
            return np.zeros(len(epoch.index))
        return np.asarray(np.maximum.reduce(np.abs(epoch.view.estimated_bias) / self._limit, axis=1))
