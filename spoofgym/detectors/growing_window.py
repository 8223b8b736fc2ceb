"""A test of relative motion whose window grows while the test alarms (FOI-R-5687, 6.1)."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.relative_motion import DEFAULT_WINDOW, RelativeMotion, distance, relative_position
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.interface import Epoch


class GrowingWindow(RelativeMotion):
    """Test (1) until it alarms; from then on against the position where that window began.

    A window of fixed length forgets where the vehicle was before the attack, so that a spoofer who runs beside the true
    track for k epochs is believed, and the jump back to the true track alarms. The report proposes, and leaves open, to
    let the window grow from the detection. The rest is ours:

    - The start s of the window in which the alarm came, k epochs before it, stays fixed for as long as there is an
      alarm; the window has w = i - s ≥ k epochs.
    - The drift of an inertial solution in a window grows with its length, in proportion as long as its velocity error
      hardly changes. So the threshold and the subtracted growth are taken w / k times:

          ‖d_i - d_s‖ > (w / k) (threshold + slope (t_i - t_0)),

      which is reported in the form of test (1), statistic = (k / w) ‖d_i - d_s‖ - slope (t_i - t_0) against the
      threshold: k times the mean relative motion per epoch.
    - After the alarm the start stays for k more epochs, until a window of k epochs holds fixes without an alarm only.
    - An epoch without a fix neither alarms nor ends an alarm's window, which goes on growing.

    It is `RelativeMotion` with the same k until the first alarm, so that threshold, slope and ARL0 are the same. The
    jump back to the true track ends an alarm that has lasted until then. What is not remedied: a constant offset D is
    believed once w > k D / (threshold + slope (t - t_0)), since the receiver's noise, which does not grow with the
    window, is part of the threshold; from then on the return to the true track is what alarms.

    Args:
        k: epochs that the window reaches back where there is no alarm.
        slope: of the growth of test (1), m/s; None = fitted in calibration, or 0 beside a threshold.
        threshold: compared with the statistic, m.
        preset: ``foi``, as for `RelativeMotion`.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: as for `RelativeMotion`.
    """

    KIND = "growing-window"

    def __init__(
        self,
        k: int = DEFAULT_WINDOW,
        slope: float | None = None,
        threshold: float | None = None,
        preset: str | None = None,
        arl0: float | None = None,
    ) -> None:
        super().__init__(k, None, slope, threshold, preset, arl0)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window and the fixed start."""
        self._positions = Ring(num_runs, self.k + 1, 3, empty=np.nan)
        self._origin = np.full((num_runs, 3), np.nan)
        self._length = np.full(num_runs, self.k)
        self._held = np.zeros(num_runs, dtype=np.int64)
        self._start = np.full(num_runs, np.nan)

    def reset(self, runs: Runs) -> None:
        """Forget the positions of these runs."""
        self._positions.reset(runs)
        self._origin[runs] = np.nan
        self._length[runs] = self.k
        self._held[runs] = 0
        self._start[runs] = np.nan

    def update(self, epoch: Epoch) -> Floats:
        """k times the mean relative motion per epoch of the window, less its growth, (N,), m; 0 without a fix."""
        position = relative_position(epoch)
        self._positions.push(position)
        held = self._held > 0
        self._length = np.where(held, self._length + 1, self.k)
        self._origin = np.where(held[:, None], self._origin, self._positions.oldest)
        moved = distance(position, self._origin) * (self.k / self._length)
        statistic = np.where(np.isnan(moved), 0.0, moved - self._growth(epoch))
        self._hold(statistic, ~np.isnan(position[:, 0]))
        return statistic

    def _hold(self, statistic: Floats, given: Flags) -> None:
        """How many fixes the start is kept for: k after an alarm, one fewer after each fix without one."""
        alarm = np.zeros(len(statistic), dtype=bool) if self.threshold is None else statistic > self.threshold
        fewer = np.maximum(self._held - given, 0)
        self._held = np.where(alarm, self.k, fewer)
