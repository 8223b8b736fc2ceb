"""The filter of a recorded log on its unspoofed fixes, or ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.mechanization import mechanize
from spoofgym.navigation.divergence import FilterDivergedError, diverged_error
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.loose.aided.strapdown import AidedStrapdownNavigator
from spoofgym.navigation.loose.inertial import InertialBatch
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import NUM_JOINT
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

NUM_BIASES = 6
LARGEST_NIS = 1.5
"""Mean NIS of a clean run per degree of freedom above which the log is doubted. A filter whose model is right has
1; the process noise of recorded scenarios is so generous that the logs by which it was chosen stay below 0.9."""
CHANCE = 1e-6
"""Probability that the mean NIS of a short log exceeds its limit although the model is right."""
LOST_NIS = 100.0
"""NIS of one epoch per degree of freedom from which a filter that diverged was lost."""


class CleanRunDivergedError(FilterDivergedError):
    """The filter diverges on a log.

    Attributes:
        lost: when the innovations were first too large, s.
    """

    def __init__(self, text: str, lost: float) -> None:
        """An error with this text."""
        super().__init__(text)
        self.lost = lost


@dataclass(frozen=True, eq=False)
class CleanRun:
    """The filter's states on unspoofed fixes; row 0 is the alignment, row k + 1 the state after epoch k was used.

    Attributes:
        attitude: body to ENU, (E + 1, 3, 3).
        velocity: ENU, (E + 1, 3), m/s.
        position: latitude rad, longitude rad, height m, (E + 1, 3).
        bias: estimated, (E + 1, 6), rad/s and m/s².
        covariance: P, (E + 1, 15, 15).
        nis: normalised innovation squared of each epoch, (E,).
        degrees: of freedom of each, (E,).
    """

    attitude: Floats
    velocity: Floats
    position: Floats
    bias: Floats
    covariance: Floats
    nis: Floats
    degrees: Floats

    def nis_per_degree(self, first: int) -> float:
        """Mean from an epoch on; about 1 where innovations are as large as the filter believes, 0 without any."""
        degrees = float(self.degrees[first:].sum())
        return float(self.nis[first:].sum()) / degrees if degrees > 0.0 else 0.0

    def is_doubtful(self, first: int) -> bool:
        """Whether innovations from an epoch on are larger than the filter believes, and not by chance."""
        per_degree, degrees = self.nis_per_degree(first), float(self.degrees[first:].sum())
        return bool(per_degree > LARGEST_NIS and per_degree * degrees > chi2.isf(CHANCE, degrees))

    def told(self, first: int) -> str:
        """How large innovations from an epoch on are, to the largest of them, for a message."""
        per_degree = self.nis_per_degree(first)
        return (
            f"clean innovations are {np.sqrt(per_degree):.1f} times as large as the filter believes: mean NIS "
            f"{np.mean(self.nis[first:]):.3g}, {per_degree:.3g} per degree of freedom, where 1 or less is right; "
            f"the largest is {self.nis[first:].max():.3g}"
        )


@dataclass(frozen=True, eq=False)
class TightCleanRun(CleanRun):
    """That of a filter on ranges, with its P of all states, (E + 1, n, n).

    Attributes:
        state: what the filter estimates beside the inertial states, less the reference of `RecordedRanges`, (E + 1, n).
    """

    state: Floats


@dataclass(frozen=True, eq=False)
class AidedCleanRun(CleanRun):
    """That of a filter with aids, with its P of all states, (E + 1, n, n).

    Attributes:
        state: what the filter estimates of the states of the aids, (E + 1, a).
        number: readings of each aid since the epoch before, (E + 1, A).
        rejected: those that its gate left out, (E + 1, A).
    """

    state: Floats
    number: Floats
    rejected: Floats


def clean_run(model: StrapdownModel) -> CleanRun:
    """Run the filter over all epochs of a model, every fix used.

    Raises:
        CleanRunDivergedError: the filter diverges.
    """
    navigator = StrapdownNavigator(model, 1, RunSlices(1))
    return CleanRun(*_states(navigator, np.zeros(NUM_JOINT), np.zeros((len(model.time), model.dimension))))


def aided_clean_run(navigator: AidedStrapdownNavigator) -> AidedCleanRun:
    """Run a filter with aids over all epochs of a navigator of one run, every fix used.

    Raises:
        CleanRunDivergedError: the filter diverges.
    """
    model, state = navigator.model, navigator.aid_error
    deviation = np.zeros((len(model.time), model.dimension))
    run = np.array([0])
    more: tuple[Callable[[], Floats], ...] = (
        lambda: state,
        lambda: navigator.aid_innovations(run).count.astype(np.float64),
        lambda: navigator.aid_innovations(run).rejected.astype(np.float64),
    )
    return AidedCleanRun(*_states(navigator, np.zeros(NUM_JOINT + state.shape[1]), deviation, *more))


def tight_clean_run(navigator: TightStrapdownNavigator, deviation: Floats) -> TightCleanRun:
    """Run the filter over all epochs of a navigator of one run, every range used.

    Args:
        navigator: of the log.
        deviation: of the ranges from those of its reference, (E, m), m and m/s.

    Raises:
        CleanRunDivergedError: the filter diverges.
    """
    state = navigator.state
    parts = _states(navigator, np.zeros(state.shape[1] + NUM_BIASES), deviation, lambda: state)
    return TightCleanRun(*parts)


class Starts(NamedTuple):
    """States from which coasting starts.

    Attributes:
        attitude: body to ENU, (k, 3, 3).
        velocity: ENU, (k, 3), m/s.
        position: latitude rad, longitude rad, height m, (k, 3).
        bias: estimated, (k, 6), rad/s and m/s².
    """

    attitude: Floats
    velocity: Floats
    position: Floats
    bias: Floats


class Samples(NamedTuple):
    """Inertial samples that follow the states.

    Attributes:
        angular_rate: (n, 3), rad/s.
        specific_force: (n, 3), m/s².
        step: duration of each, (n,), s.
        boundaries: first sample after each state, and n, (k + 1,).
    """

    angular_rate: Floats
    specific_force: Floats
    step: Floats
    boundaries: Runs


def coast(model: StrapdownModel, run: CleanRun, epoch: int) -> tuple[Floats, Floats]:
    """The filter's velocity on the way to an epoch, by inertial samples from the state after the epoch before.

    Args:
        model: of the log.
        run: on it.
        epoch: of the model.

    Returns:
        Times of the samples' ends, the epoch before first, (n + 1,), s, and velocities, (n + 1, 3), ENU, m/s.
    """
    samples = slice(model.boundaries[epoch], model.boundaries[epoch + 1])
    step = model.step[samples]
    one = slice(epoch, epoch + 1)
    start = Starts(run.attitude[one], run.velocity[one], run.position[one], run.bias[one])
    ends = np.array([0, len(step)])
    _, velocity = _coasted(start, Samples(model.angular_rate[samples], model.specific_force[samples], step, ends))
    time = model.time[epoch] - np.append(np.cumsum(step[::-1])[::-1], 0.0)
    return time, np.vstack([run.velocity[one], velocity])


def coasted_positions(model: StrapdownModel, run: CleanRun) -> Floats:
    """The position at the end of every inertial sample; each epoch's samples start from the state after the fix before.

    Args:
        model: of the log.
        run: on it.

    Returns:
        Latitude rad, longitude rad, height m, (n, 3).
    """
    starts = Starts(run.attitude, run.velocity, run.position, run.bias)
    samples = Samples(model.angular_rate, model.specific_force, model.step, model.boundaries)
    return _coasted(starts, samples)[0]


def _coasted(starts: Starts, samples: Samples) -> tuple[Floats, Floats]:
    """Position and velocity at the end of every sample, (n, 3) each."""
    position, velocity = np.empty((2, len(samples.step), 3))
    _coast(starts, samples, position, velocity)
    return position, velocity


@njit(cache=True, nogil=True)
def _coast(starts: Starts, samples: Samples, position: Floats, velocity: Floats) -> None:
    """Mechanize the samples less the biases; position and velocity at the end of each, (n, 3), are the result."""
    attitude, angular_rate, specific_force = starts.attitude, samples.angular_rate, samples.specific_force
    boundaries, step, bias = samples.boundaries, samples.step, starts.bias
    c, v, p = np.empty((3, 3)), np.empty(3), np.empty(3)
    rate, force, unused = np.empty(3), np.empty(3), np.zeros(3)
    for k in range(len(boundaries) - 1):
        c[:, :], v[:], p[:] = attitude[k], starts.velocity[k], starts.position[k]
        for i in range(boundaries[k], boundaries[k + 1]):
            for a in range(3):
                rate[a] = angular_rate[i, a] - bias[k, a]
                force[a] = specific_force[i, a] - bias[k, 3 + a]
            mechanize(c, v, p, rate, force, step[i], unused)
            position[i] = p
            velocity[i] = v


def _states(
    navigator: InertialBatch, initial: Floats, deviation: Floats, *more: Callable[[], Floats]
) -> list[Floats]:
    """Attitude, velocity, position, bias, P, (E + 1, ...), NIS and its degrees, (E,), and more, (E + 1, ...).

    Raises:
        CleanRunDivergedError: the filter diverges.
    """
    navigator.reset(np.array([0]), initial[None], RunStreams.from_seed(0, 1))
    use = Decision(np.ones(1, dtype=bool))
    states: list[list[Floats]] = []
    nis, degrees = np.empty(len(deviation)), np.empty(len(deviation))

    def keep() -> None:
        parts = [navigator.attitude, navigator.velocity, navigator.position, navigator.bias, navigator.covariance]
        parts += [part() for part in more]
        states.append([part[0].copy() for part in parts])

    keep()
    for epoch, measured in enumerate(deviation):
        navigator.propagate()
        innovation = navigator.innovate(measured[None])
        nis[epoch], degrees[epoch] = innovation.nis[0], innovation.degrees[0]
        navigator.resolve(use)
        if navigator.diverged[0]:
            time = navigator.model.time
            lost = int(np.argmax(~(nis[: epoch + 1] <= LOST_NIS * degrees[: epoch + 1])))
            raise CleanRunDivergedError(str(diverged_error(0, float(time[epoch]))), float(time[lost]))
        keep()
    parts = [np.stack(part) for part in zip(*states, strict=True)]
    return [*parts[:5], nis, degrees, *parts[5:]]
