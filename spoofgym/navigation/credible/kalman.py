"""The equations of the credible filter (Song 2021, eqs 7-10), on one horizontal axis.

State [p, v], with a white acceleration; both horizontal axes have the same covariance and never meet. The position
that odometer and INS give is a measurement at every odometer sample (auxiliary update model, eq 10), the fix is one
beside it at every epoch (credible update model, eq 9). Independent measurements are processed one after the other. The
yaw in eqs 9 and 10 has no state that it could observe; it is used where the auxiliary position is made. The height is
known.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.warm_start import COLOUR, NUM_JOINT
from spoofgym.sensors.receiver import Receiver

SETTLING = 500
"""Epochs after which the covariance no longer changes."""
VELOCITIES, POSITIONS = (3, 4), (6, 7)
"""Places of east and north in the 15 states."""
HEIGHT = 2


@dataclass(frozen=True, kw_only=True)
class CredibleTuning:
    """What the filter believes.

    Attributes:
        step: between odometer samples, s.
        samples: of the odometer per epoch.
        acceleration: density of the white acceleration, m/s²/√Hz.
        auxiliary_sigma: of the position by odometer and INS, 1 sigma per axis, m; independent from sample to sample,
            which it is not.
        fix_sigma: of a fix, 1 sigma per horizontal axis, m.
        height_sigma: of a fix, m.
    """

    step: float = 0.1
    samples: int = 10
    acceleration: float
    auxiliary_sigma: float
    fix_sigma: float
    height_sigma: float

    def __post_init__(self) -> None:
        for name in ("step", "acceleration", "auxiliary_sigma", "fix_sigma", "height_sigma"):
            validation.above("credible filter", name, getattr(self, name))
        validation.epochs("credible filter", "samples", self.samples)


@njit(cache=True, nogil=True, error_model="numpy")
def predict_covariance(step: float, density: float, covariance: Floats) -> None:
    """P <- F P F' + Q with P = [pp, pv, vv] (3,), F of eq 8, and Q of a white acceleration of this density, squared."""
    pv, vv = covariance[1], covariance[2]
    covariance[0] += 2.0 * step * pv + step * step * vv + density * step**3 / 3.0
    covariance[1] += step * vv + density * step * step / 2.0
    covariance[2] += density * step


@njit(cache=True, nogil=True, error_model="numpy")
def update_covariance(variance: float, covariance: Floats) -> tuple[float, float]:
    """P <- (I - K H) P for a measured position of this variance; the gain K on position and velocity."""
    total = covariance[0] + variance
    position_gain, velocity_gain = covariance[0] / total, covariance[1] / total
    covariance[2] -= velocity_gain * covariance[1]
    covariance[1] -= position_gain * covariance[1]
    covariance[0] -= position_gain * covariance[0]
    return position_gain, velocity_gain


@njit(cache=True, nogil=True, error_model="numpy")
def carry(
    step: float,
    density: float,
    variance: float,
    displacement: Floats,
    true_displacement: Floats,
    true_velocity: Floats,
    state: Floats,
    covariance: Floats,
) -> None:
    """The odometer samples of one epoch: eq 8, then the auxiliary update (eq 10), in errors.

    Args:
        step: between samples, s.
        density: of the acceleration, squared.
        variance: of the auxiliary position, m².
        displacement: by odometer and INS, (samples, 2), m.
        true_displacement: (samples, 2), m.
        true_velocity: before and after each sample, (samples + 1, 2), m/s.
        state: errors of position, velocity and auxiliary position, east and north each, (6,); changed.
        covariance: [pp, pv, vv], (3,); changed.
    """
    for j in range(displacement.shape[0]):
        predict_covariance(step, density, covariance)
        position_gain, velocity_gain = update_covariance(variance, covariance)
        for a in range(2):
            state[a] += step * (state[2 + a] + true_velocity[j, a]) - true_displacement[j, a]
            state[2 + a] += true_velocity[j, a] - true_velocity[j + 1, a]
            state[4 + a] += displacement[j, a] - true_displacement[j, a]
            innovation = state[4 + a] - state[a]
            state[a] += position_gain * innovation
            state[2 + a] += velocity_gain * innovation


def settled_covariance(tuning: CredibleTuning) -> Floats:
    """[pp, pv, vv] after a fix where every fix is used, (3,), m², m²/s, m²/s²."""
    return np.array(_settled(tuning))


@lru_cache(maxsize=128)
def _settled(tuning: CredibleTuning) -> tuple[float, ...]:
    """Many simulations begin with one tuning, and it takes thousands of steps."""
    covariance = np.array([tuning.fix_sigma**2, 0.0, 1.0])
    for _ in range(SETTLING):
        _predict_epoch(tuning, covariance)
        update_covariance(tuning.fix_sigma**2, covariance)
    return tuple(covariance.tolist())


def _predict_epoch(tuning: CredibleTuning, covariance: Floats) -> None:
    for _ in range(tuning.samples):
        predict_covariance(tuning.step, tuning.acceleration**2, covariance)
        update_covariance(tuning.auxiliary_sigma**2, covariance)


def epoch_transition(tuning: CredibleTuning, anchored: bool) -> tuple[Floats, Floats]:
    """What an epoch without any noise makes of an error [p, v] after a fix, every fix used.

    Args:
        tuning: of the filter.
        anchored: whether the auxiliary position starts from the filter's, and carries its error on.

    Returns:
        Φ, (2, 2), and the gain of the fix that follows, (2,).
    """
    nothing, still = np.zeros((tuning.samples, 2)), np.zeros((tuning.samples + 1, 2))
    transition = np.empty((2, 2))
    for column in range(2):
        covariance, state = settled_covariance(tuning), np.zeros(6)
        state[2 * column] = 1.0
        state[4] = state[0] if anchored else 0.0
        density, variance = tuning.acceleration**2, tuning.auxiliary_sigma**2
        carry(tuning.step, density, variance, nothing, nothing, still, state, covariance)
        transition[:, column] = state[0], state[2]
    return transition, np.array(update_covariance(tuning.fix_sigma**2, covariance))


def credible_linear_model(tuning: CredibleTuning, anchored: bool, time: Floats) -> LinearModel:
    """The filter in the arrays of the 15 states: exactly what offsets do to it while every fix is used.

    The states that it does not have are never corrected. Q is what takes P from one epoch to the next under Φ, and no
    covariance: the filter does not know that the auxiliary position carries its own error on, which is in Φ. What
    odometer and receiver add, and the filter's lag in a turn, is no noise of this model.

    Args:
        tuning: of the filter.
        anchored: whether the auxiliary position is anchored to the filter at every fix that is used.
        time: of the epochs, (K+1,), s.
    """
    block, _ = epoch_transition(tuning, anchored)
    settled = settled_covariance(tuning)
    before = settled.copy()
    _predict_epoch(tuning, before)
    transition, prior = np.eye(NUM_INERTIAL), np.zeros((NUM_INERTIAL, NUM_INERTIAL))
    after = np.zeros_like(prior)
    for v, p in zip(VELOCITIES, POSITIONS, strict=True):
        places = np.ix_((p, v), (p, v))
        transition[places] = block
        prior[places] = [[before[0], before[1]], [before[1], before[2]]]
        after[places] = [[settled[0], settled[1]], [settled[1], settled[2]]]
    observation = np.zeros((3, NUM_NAVIGATION))
    observation[range(3), range(6, 9)] = 1.0
    noise = np.diag(np.square([tuning.fix_sigma, tuning.fix_sigma, tuning.height_sigma]))
    innovation = observation @ prior[:NUM_NAVIGATION, :NUM_NAVIGATION] @ observation.T + noise
    factor = np.sqrt(innovation)
    gain = np.linalg.solve(factor, observation @ prior[:NUM_NAVIGATION])

    def everywhere(matrix: Floats) -> Floats:
        return np.tile(matrix, (len(time), 1, 1))

    return LinearModel(
        time=time,
        transition=everywhere(transition),
        process_noise=everywhere(prior - transition @ after @ transition.T),
        noise_factor=np.zeros((len(time), NUM_NAVIGATION, NUM_NAVIGATION)),
        observation=everywhere(observation),
        measurement_covariance=noise,
        prior_covariance=after,
        covariance=everywhere(prior),
        innovation_covariance=everywhere(innovation),
        innovation_factor=everywhere(factor),
        whitened_gain=everywhere(gain),
    )


def standing_start(tuning: CredibleTuning, receiver: Receiver) -> Floats:
    """A square root of the joint covariance of a filter that has stood still for long, and its receiver, (30, 30).

    In the layout of `spoofgym.navigation.loose.warm_start`. The wheels do not turn, so that only the receiver errs
    (Song 2021, step 1, and data set Ψ1). Solves Y = A Y A' + N for y = [p, v, colour].
    """
    transition, gain = epoch_transition(tuning, anchored=True)
    kept = transition - np.outer(gain, transition[0])
    decay = np.exp(-receiver.interval / receiver.markov_time) if any(receiver.markov_sigma) else 0.0
    factor = np.zeros((NUM_JOINT, NUM_JOINT))
    for axis, (v, p) in enumerate(zip(VELOCITIES, POSITIONS, strict=True)):
        advance = np.block([[kept, decay * gain[:, None]], [np.zeros((1, 2)), np.array([[decay]])]])
        driven = np.append(gain, 1.0) * receiver.markov_sigma[axis] * np.sqrt(1.0 - decay**2)
        white = np.append(gain, 0.0) * receiver.white_sigma[axis]
        joint = solve_discrete_lyapunov(advance, np.outer(driven, driven) + np.outer(white, white))
        places = (p, v, COLOUR.start + axis)
        values, vectors = np.linalg.eigh(joint)
        factor[np.ix_(places, places)] = vectors * np.sqrt(np.maximum(values, 0.0))
    height = COLOUR.start + HEIGHT
    factor[height, height] = receiver.markov_sigma[HEIGHT]
    return factor
