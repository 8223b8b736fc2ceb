"""ACNA: jump and slow-change verification of the GNSS drift (Song 2021)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.facts import ODOMETER, FilterFacts
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.specification import spell
from spoofgym.validation import written

SONG_JUMP_EPOCHS = 2
SONG_SLOW_EPOCHS = 5
SONG_JUMP_THRESHOLD = 1.5
SONG_SLOW_THRESHOLD = 1.28
DEFAULT_ARL0 = 1e5
POSITIONS = ("innovation", "auxiliary")
LIMIT = 3.0
"""Largest threshold over the receiver's sigma (Song 2021, eqs 18 and 20)."""


def horizontal_drift(residual: Floats) -> Floats:
    """Distance between the fix and the auxiliary position, (N,), m (Song 2021, eq 11, without its height term).

    The height is left out because Song's robot and attacks are planar and a receiver's height is its noisiest axis.

    Args:
        residual: position of the INS minus the fix, (N, m), m, of which the first two are east and north.
    """
    return np.hypot(residual[:, 0], residual[:, 1])


def gnss_drift(epoch: Epoch, position: str) -> Floats:
    """Drift of the fix, (N,), m, against the filter's prediction (``innovation``) or the auxiliary position.

    The innovation is p_filter - p_GNSS, the view's auxiliary_offset p_auxiliary - p_filter.

    Raises:
        RuntimeError: an auxiliary position is asked for, and the epoch was made without a navigator.
    """
    if position == "innovation":
        return horizontal_drift(epoch.innovation.residual)
    if epoch.view is None:
        raise RuntimeError("the auxiliary position is known to a navigator only: this epoch has none")
    return horizontal_drift(epoch.innovation.residual[:, :3] + epoch.view.auxiliary_offset)


class Acna(Detector):
    """Alarm after consecutive large drifts, or when their mean is large (Song 2021, eqs 11, 26, 27).

    With ``position=innovation`` the auxiliary position is the INS propagated without GNSS from the last accepted fix.
    In a closed-loop loosely coupled filter that is the INS itself, so the drift is the horizontal norm of the
    innovation. With ``position=auxiliary`` it is the paper's own, dead reckoned by an odometer and the yaw of an INS,
    which the scenario must offer.

    Jump (eq 26): flag_j counts consecutive drifts above Th_j and alarms at n_j, i.e. when the least of the last n_j
    drifts exceeds Th_j. Slow change (eq 27): the mean of the last n_s drifts reaches Th_s. The statistic is the larger
    of both over its threshold, so Song's rule is ``threshold`` = 1; calibration scales both tests by one factor, which
    is then the threshold. Drifts that have not come yet count as zero.

    An interruption of GNSS (step 3) is told by `Epoch.available`, and no navigator uses a fix that is not there. It is
    no alarm of spoofing: the statistic is 0 then, and both windows stay as they are, neither counting nor forgetting.

    With nothing given the thresholds keep Song's ratio 1.5 : 1.28 and are scaled to an ARL0 of 1e5. A drift is in
    metres and its spread depends on the filter, so ``threshold`` is None until calibration sets it in the scenario.

    Args:
        jump_epochs: n_j, consecutive epochs of the jump test; more than 1 (eq 15).
        jump_threshold: Th_j, m; together with ``slow_threshold``.
        slow_epochs: n_s, epochs of the mean; more than n_j (eq 16).
        slow_threshold: Th_s, m.
        preset: ``song`` for the published Th_j = 1.5 m and Th_s = 1.28 m.
        arl0: average run length between false alarms, epochs.
        position: from which the drift is taken, ``innovation`` or ``auxiliary``. With the latter, thresholds that are
            given (or preset) must lie between one and three sigma of the receiver (eqs 17-20), and Th_s above what
            dead reckoning goes wrong in an epoch (eq 21 with eq 23: all errors of the window alike).

    Raises:
        ValueError: thresholds, preset and arl0 exclude each other; one threshold without the other; a value out of
            range.
    """

    PRESETS = ("song",)
    in_position = True

    def __init__(
        self,
        jump_epochs: int = SONG_JUMP_EPOCHS,
        jump_threshold: float | None = None,
        slow_epochs: int = SONG_SLOW_EPOCHS,
        slow_threshold: float | None = None,
        preset: str | None = None,
        arl0: float | None = None,
        position: str = "innovation",
    ) -> None:
        self.jump_epochs = validation.epochs("acna", "jump_epochs", jump_epochs, 2)
        self.slow_epochs = validation.epochs("acna", "slow_epochs", slow_epochs, 3)
        if self.slow_epochs <= self.jump_epochs:
            raise ValueError(
                f"acna: slow_epochs must be a whole number, {self.jump_epochs + 1} or more, got {self.slow_epochs}: "
                f"more than jump_epochs = {self.jump_epochs}"
            )
        self.memory = self.slow_epochs - 1
        validation.at_most_one("acna", jump_threshold=jump_threshold, preset=preset, arl0=arl0)
        validation.at_most_one("acna", slow_threshold=slow_threshold, preset=preset, arl0=arl0)
        if (jump_threshold is None) != (slow_threshold is None):
            alone, other = ("slow", "jump") if jump_threshold is None else ("jump", "slow")
            raise ValueError(f"acna: {alone}_threshold needs {other}_threshold beside it")
        if preset is not None:
            validation.one_of("acna", "preset", preset, self.PRESETS)
        self.position = validation.one_of("acna", "position", position, POSITIONS)
        if position == "auxiliary":
            self.needs, self.demands, self.needs_view = (ODOMETER,), Demands(auxiliary=True), True
        given = jump_threshold is not None
        self.jump_threshold = validation.above(
            "acna", "jump_threshold", jump_threshold if given else SONG_JUMP_THRESHOLD
        )
        self.slow_threshold = validation.above(
            "acna", "slow_threshold", slow_threshold if given else SONG_SLOW_THRESHOLD
        )
        if given or preset is not None:
            self.threshold = 1.0
        else:
            self.target_arl0 = validation.average_run_length("acna", "arl0", DEFAULT_ARL0 if arl0 is None else arl0)
        self._name = spell(
            "acna",
            jump_epochs=None if self.jump_epochs == SONG_JUMP_EPOCHS else self.jump_epochs,
            jump_threshold=self.jump_threshold if given else None,
            slow_epochs=None if self.slow_epochs == SONG_SLOW_EPOCHS else self.slow_epochs,
            slow_threshold=self.slow_threshold if given else None,
            preset=preset,
            arl0=None if self.target_arl0 == DEFAULT_ARL0 else self.target_arl0,
            position=None if position == "innovation" else position,
        )

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the drifts of both verification windows."""
        self._jump = Ring(num_runs, self.jump_epochs)
        self._slow = Ring(num_runs, self.slow_epochs)

    def know(self, facts: FilterFacts) -> None:
        """Check given thresholds against the errors of receiver and dead reckoning (Song 2021, eqs 17-21).

        Raises:
            ValueError: one lies outside.
        """
        if self.position == "innovation" or self.target_arl0 is not None or facts.fix_sigma is None:
            return
        least, most = facts.fix_sigma, LIMIT * facts.fix_sigma
        for name, threshold in (("Th_j", self.jump_threshold), ("Th_s", self.slow_threshold)):
            if not least <= threshold <= most:
                raise ValueError(
                    f"detector {self.name!r}: {name} = {written(threshold)} m must lie between one and three sigma of "
                    f"the receiver of {facts.scenario!r}, from {least:g} to {most:g} m (Song 2021, eqs 17-20); an arl0 "
                    "has no such bounds"
                )
        if facts.auxiliary_sigma is not None and self.slow_threshold < facts.auxiliary_sigma:
            raise ValueError(
                f"detector {self.name!r}: Th_s = {written(self.slow_threshold)} m must be at least what dead reckoning "
                f"in {facts.scenario!r} goes wrong in an epoch, {facts.auxiliary_sigma:.3g} m (Song 2021, eq 21)"
            )

    def reset(self, runs: Runs) -> None:
        """Forget the drifts of these runs."""
        self._jump.reset(runs)
        self._slow.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """The larger of both tests over its threshold, (N,)."""
        drift = gnss_drift(epoch, self.position)
        given = np.ones(len(drift), dtype=bool) if epoch.available is None else epoch.available
        self._jump.push_where(given, drift)
        self._slow.push_where(given, drift)
        jump = np.minimum.reduce(self._jump.values, axis=1)
        total = np.add.reduce(self._slow.values, axis=1)
        statistic = np.maximum(jump / self.jump_threshold, total / (self.slow_epochs * self.slow_threshold))
        return np.where(given, statistic, 0.0)
