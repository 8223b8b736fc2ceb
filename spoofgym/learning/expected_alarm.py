"""The spoofer's game with the chance of the alarm taken out of the reward.

Whether the snapshot test alarms at an epoch depends, given the spoofer's offsets, on a white innovation that nobody can
foresee. Its probability p_k is known from a shadow filter of the victim's own model (noncentral chi-square), so a
learner can be paid the expectation instead of the draw: the game goes on after an alarm, and with the survival S_k =
Π (1 - p_i) and the error gained G_k it pays

    S_k G_k - S_{k-1} G_{k-1},

which sums to S_K G_K, the expectation of the return of the game that an alarm ends. The alarms are nearly all of the
return's variance (a few of 256 games lose all they gained), so that gradients become about ten times less noisy. What
is learned is evaluated in the real game.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Flags, Runs
from spoofgym.detectors.chi_square import Snapshot
from spoofgym.envs.config import SpooferConfig, arguments_of
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.optimum.survival import log_survival
from spoofgym.scenarios import make_scenario


def alarm_probability_is_known(config: SpooferConfig) -> bool:
    """Whether the snapshot test is alone, its filter matched, and shadowed by the spoofer without tracking error.

    A shadow filter of another scenario's model (``config.shadow``) does not tell the victim's mean innovations, and one
    on ranges shows only their part in the position.
    """
    scenario = make_scenario(config.scenario, config.coupling)
    detector = config.detector
    return (
        isinstance(detector, str)
        and detector.partition(":")[0] == "snapshot"
        and config.knowledge != "blind"
        and config.shadow in (None, config.scenario)
        and config.on_alarm == "end"
        and config.forfeit == 1.0
        and config.tracking_sigma == 0.0
        and scenario.matched
        and not scenario.slots
    )


class ExpectedAlarmVectorEnv(SpooferVectorEnv):
    """N lanes of Spoofer-v0 that pay the expected instead of the drawn loss by alarms.

    Arguments as of `SpooferVectorEnv`.
    """

    def __init__(self, num_envs: int, config: SpooferConfig, **arguments: object) -> None:
        """Take the game of ``config``, without its alarms' effect.

        Raises:
            ValueError: the alarm's probability is not known in that game.
        """
        if not alarm_probability_is_known(config):
            raise ValueError(f"the probability of an alarm is not known in this game: {config}")
        endless = replace(config, on_alarm="respond", response="always-use")
        super().__init__(num_envs, **arguments, **arguments_of(endless))  # type: ignore[arg-type]
        (detector,) = self.game.simulation.detectors.values()
        assert isinstance(detector, Snapshot)
        assert detector.threshold is not None
        self._threshold = detector.threshold
        self._survival = np.ones(num_envs)
        self._gained = np.zeros(num_envs)

    def _play(self, actions: NDArray[np.float32], restarting: Runs | None) -> tuple[Any, Flags]:
        outcome, truncated = super()._play(actions, restarting)
        shadow = self.game.seat.shadow
        assert shadow is not None
        magnitude = np.sqrt(np.sum(shadow.whitened**2, axis=1))
        survival = self._survival * np.exp(log_survival(magnitude, shadow.whitened.shape[1], self._threshold))
        gained = self._gained + outcome.growth
        paid = replace(
            outcome, growth=survival * outcome.growth, forfeit=(survival - self._survival) * self._gained
        )
        over = outcome.terminated | truncated
        self._survival, self._gained = np.where(over, 1.0, survival), np.where(over, 0.0, gained)
        return paid, truncated
