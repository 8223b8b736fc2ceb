"""What no test can see: the largest error over a game that a noncentrality of 1 can cause.

With every fix used, the mean error is linear in the mean whitened innovations: e_k = Φ_k e_{k-1} - U_k u_k. Stacked
over the game, the horizontal errors are T u, and the largest root-mean-square error for Σ|u_k|² = 1 is σ_max(T) / √K. A
test of any kind sees only u. A noncentrality of 1 over a whole game is no evidence for any of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import check_position_fix, error_map, offsets_of


@dataclass(frozen=True)
class GameGain:
    """The attack that moves the position furthest over a whole game, per unit of noncentrality.

    Attributes:
        gain: root-mean-square horizontal error over the epochs 1..K per root of noncentrality, m.
        whitened: mean whitened innovations of that attack, Σ|u_k|² = 1, (K, 3).
        offsets: that cause them, (K, 3), m ENU.
        error: horizontal mean error after each epoch, (K, 2), m east and north.
    """

    gain: float
    whitened: Floats
    offsets: Floats
    error: Floats


def game_gain(model: LinearModel) -> GameGain:
    """The largest root-mean-square error over the game per unit of noncentrality, and the attack that causes it.

    Args:
        model: the filter along the scenario.

    Raises:
        ValueError: m is not 3.
    """
    check_position_fix(model, "the gain of a game")
    left, values, right = np.linalg.svd(error_map(model), full_matrices=False)
    # the attack that moves the position eastward at the end, of the two of opposite sign
    sign = 1.0 if left[-2, 0] >= 0.0 else -1.0
    whitened = sign * right[0].reshape(-1, 3)
    error = sign * values[0] * left[:, 0].reshape(-1, 2)
    return GameGain(float(values[0]) / np.sqrt(model.num_epochs), whitened, offsets_of(model, whitened), error)
