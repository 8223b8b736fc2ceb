"""An attack whose mean innovation is as large as the noise in every epoch, so that no epoch stands out."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.fixed_offsets import FixedOffsets
from spoofgym.attacks.profiles import EAST, heading
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import check_position_fix, offsets_of
from spoofgym.specification import spell

LEVEL = 1.0


def innovations_along(factor: Floats, azimuth: float, magnitude: float) -> Floats:
    """Whitened mean innovations u_k = -c_k L_k⁻¹ h with |u_k| = magnitude, which pull the estimate along h.

    The fix then lies c_k metres from where the filter expects it, in the direction h. The innovation is INS minus fix:
    hence the sign.

    Args:
        factor: L_k, (M, 3, 3).
        azimuth: of h, degrees clockwise from north.
        magnitude: standard deviations.

    Returns:
        u_k, (M, 3).
    """
    direction = heading(azimuth)
    unit = np.array([np.linalg.solve(matrix, direction) for matrix in factor])
    return -magnitude * unit / np.linalg.norm(unit, axis=1)[:, None]


class NoiseMatched(FixedOffsets):
    """Every epoch's innovation has a mean of ``level`` standard deviations along a heading (ours).

    The mean whitened innovation has the constant magnitude ``level``, so that the statistic of a snapshot test has the
    noncentrality level² and never more, while the offset grows as the filter gives way. It stands for a spoofer who
    knows the victim's filter and hides in its noise; what finds it is memory, above all one that keeps signs. It plans
    with the linear model in which every fix is used.

    Args:
        level: of the mean innovation, standard deviations.
        direction: azimuth in which the fixes lie from where the filter expects them, degrees clockwise from north.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: the level is negative, or a value is not finite.
    """

    needs_model = True

    def __init__(self, level: float = LEVEL, direction: float = EAST, onset: float | None = None) -> None:
        self.level = validation.non_negative("noise-matched", "level", level)
        self.direction = validation.finite("noise-matched", "direction", direction)
        self.onset = None if onset is None else validation.time("noise-matched", "onset", onset)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            "noise-matched",
            None if self.level == LEVEL else self.level,
            direction=None if self.direction == EAST else self.direction,
            onset=self.onset,
        )

    def study(self, model: LinearModel) -> None:
        """Find the offsets in the victim's linear model.

        Raises:
            ValueError: the fixes have a velocity, whose innovations three offsets cannot choose, too.
        """
        check_position_fix(model, f"attack {self.name!r}")
        whitened = innovations_along(model.innovation_factor[1:], self.direction, self.level)
        whitened[self._since()[1:] <= 1e-6 * self._timeline.interval] = 0.0
        self._lay(np.concatenate([np.zeros((1, 3)), offsets_of(model, whitened)]))
