"""Random pulls of a spoofer that leave the victim's problem linear and Gaussian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_INERTIAL, POSITION
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import quiet_offsets


class PullProcess(NamedTuple):
    """A Gaussian process of p states whose horizontal offset is added to the fixes of the epochs 1..K.

    Attributes:
        name: of the pull.
        covariance: of the states before epoch 0, (p, p).
        transition: of the states to each epoch, (K+1, p, p).
        noise: added on the way, (K+1, p, p).
        observation: from the states to the offset, (K+1, 2, p), m; zero at epoch 0.
    """

    name: str
    covariance: Floats
    transition: Floats
    noise: Floats
    observation: Floats


def no_pull(model: LinearModel) -> PullProcess:
    """Nobody attacks: p = 0."""
    epochs = model.num_epochs + 1
    nothing = np.zeros((epochs, 0, 0))
    return PullProcess("none", np.zeros((0, 0)), nothing, nothing, np.zeros((epochs, 2, 0)))


def drift_pull(model: LinearModel, scale: float) -> PullProcess:
    """A pull that grows like the inertial drift: p = 15.

    It is an inertial error that begins with the filter's own uncertainty, that of the position excepted, and is carried
    by the filter's Φ and Q, so that no measurement tells one from the other but by its size.

    Args:
        model: of the game.
        scale: λ, in units of the inertial drift.
    """
    covariance = model.prior_covariance.copy()
    covariance[POSITION] = 0.0
    covariance[:, POSITION] = 0.0
    observation = np.zeros((model.num_epochs + 1, 2, NUM_INERTIAL))
    observation[1:, :, : model.observation.shape[2]] = scale * model.observation[1:, :2]
    return PullProcess(f"drift:{scale:g}", covariance, model.transition, model.process_noise, observation)


def unseen_pull(model: LinearModel, scale: float, directions: int = 2) -> PullProcess:
    """A random mixture of the attacks that err most per unit of noncentrality: constant amplitudes, p of them.

    Their mean whitened innovations are the first right singular vectors of `error_map`, the east and north ones of
    most scenarios, each times an independent normal number.

    Args:
        model: of the game.
        scale: 1 sigma of each amplitude, the root of the noncentrality that it has on average.
        directions: p, how many of these attacks.
    """
    observation = scale * quiet_offsets(model, directions)
    still = np.tile(np.eye(directions), (model.num_epochs + 1, 1, 1))
    return PullProcess(f"unseen:{scale:g}", np.eye(directions), still, np.zeros_like(still), observation)
