"""The filter of a recorded log on its unspoofed fixes, or ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.mechanization import mechanize
from spoofgym.navigation.divergence import FilterDivergedError, diverged_error
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.loose.inertial import InertialBatch
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import NUM_JOINT
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

NUM_BIASES = 6
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


@dataclass(frozen=True, eq=False)
class TightCleanRun(CleanRun):
    """That of a filter on ranges, with its P of all states, (E + 1, n, n).

    Attributes:
        state: what the filter estimates beside the inertial states, less the reference of `RecordedRanges`, (E + 1, n).
    """

    state: Floats


def clean_run(model: StrapdownModel) -> CleanRun:
    """Run the filter over all epochs of a model, every fix used.

    Raises:
        CleanRunDivergedError: the filter diverges.
    """
    navigator = StrapdownNavigator(model, 1, RunSlices(1))
    return CleanRun(*_states(navigator, np.zeros(NUM_JOINT), np.zeros((len(model.time), model.dimension))))


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
    velocity = np.empty((samples.stop - samples.start + 1, 3))
    _coast(
        run.attitude[epoch].copy(),
        run.velocity[epoch].copy(),
        run.position[epoch].copy(),
        run.bias[epoch],
        model.angular_rate[samples],
        model.specific_force[samples],
        model.step[samples],
        velocity,
    )
    time = model.time[epoch] - np.append(np.cumsum(model.step[samples][::-1])[::-1], 0.0)
    return time, velocity


@njit(cache=True, nogil=True)
def _coast(
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    angular_rate: Floats,
    specific_force: Floats,
    step: Floats,
    result: Floats,
) -> None:
    """Mechanize samples less the biases from a state, in place; the velocity before and after each, (n + 1, 3)."""
    unused = np.zeros(3)
    result[0] = velocity
    for i in range(len(step)):
        rate, force = angular_rate[i] - bias[:3], specific_force[i] - bias[3:]
        mechanize(attitude, velocity, position, rate, force, step[i], unused)
        result[i + 1] = velocity


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
