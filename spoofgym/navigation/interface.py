"""What one GNSS epoch is made of, and what a navigator offers.

Arrays carry a leading axis of runs N; m is the dimension of the fix (3: position, 6: position and velocity), in east,
north, up.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Protocol, cast

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs, read_only
from spoofgym.navigation.aid_innovations import AidInnovations
from spoofgym.navigation.position_domain import project_onto_position, whitened_axes
from spoofgym.streams import RunStreams


@dataclass(frozen=True)
class Clock:
    """Where each run stands.

    Attributes:
        index: epochs since the clean epoch 0 of its episode, (N,).
        time: scenario time, (N,), s.
    """

    index: Runs
    time: Floats


@dataclass(frozen=True)
class Innovation:
    """The innovation of one epoch, whitened once: every test uses it.

    Attributes:
        residual: z = p_INS - p_GNSS (and v_INS - v_GNSS), or predicted minus measured ranges, (N, m), m and m/s.
        covariance: S = H P H' + R, (N, m, m).
        whitened: L⁻¹ residual with S = L L', (N, m).
        nis: normalised innovation squared, whitened' whitened, (N,).
        range_response: L⁻¹ H on the three states of the position, (N, m, 3), 1/m, where ranges are measured; None for
            fixes of position.
        present: whether each measurement is there, (N, m), where ranges are measured; None = all are.
    """

    residual: Floats
    covariance: Floats
    whitened: Floats
    nis: Floats
    range_response: Floats | None = None
    present: Flags | None = None

    @cached_property
    def response(self) -> Floats:
        """L⁻¹ H on the three states of the position, (N, m, 3), 1/m; a fix of position observes them as they are."""
        if self.range_response is not None:
            return self.range_response
        return whitened_axes(self.covariance)

    @cached_property
    def degrees(self) -> Runs:
        """Measurements that are there, (N,): the degrees of freedom of `nis` under a matched filter."""
        if self.present is None:
            return np.full(self.whitened.shape[0], self.whitened.shape[1])
        return np.add.reduce(self.present, axis=1, dtype=np.int64)

    def put(self, runs: Runs, part: Innovation) -> Innovation:
        """These innovations with those of some runs exchanged."""

        def exchange(mine: Any, theirs: Any) -> Any:
            if mine is None:
                return None
            whole = mine if mine.flags.writeable else mine.copy()
            whole[runs] = theirs
            return whole

        return Innovation(*(exchange(getattr(self, item.name), getattr(part, item.name)) for item in fields(self)))

    @cached_property
    def in_position(self) -> Innovation:
        """What the ranges say about the position alone, as the innovation of a fix of position, m = 3.

        With A = H'S⁻¹H on the states of the position (Kujur 2024, eq 20, for all directions at once), the residual is
        A⁻¹ H'S⁻¹ z, and A⁻¹ its covariance: the position that the ranges ask for by generalised least squares. It is
        zero where fewer than three directions are observed. A fix of position is left as it is.
        """
        if self.range_response is None:
            return self
        n = len(self.nis)
        residual, covariance, whitened, nis = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(n)
        project_onto_position(read_only(self.range_response), self.whitened, residual, covariance, whitened, nis)
        return Innovation(residual, covariance, whitened, nis)


@dataclass(frozen=True)
class Epoch(Clock):
    """What one epoch knows; never the truth.

    Attributes:
        innovation: of this epoch; zero in a run whose receiver gives no fix.
        statistics: each detector's statistic by its name, (N,) each; filled in the order of the detectors.
        available: whether the receiver gives a fix, (N,); None = in every run.
        view: what else the filter knows; None where an epoch was made without a navigator.
    """

    innovation: Innovation
    statistics: dict[str, Floats] = field(default_factory=dict)
    available: Flags | None = None
    view: FilterView | None = None

    @cached_property
    def in_position(self) -> Epoch:
        """The same epoch as seen by a test of the position: the innovation of `Innovation.in_position`."""
        innovation = self.innovation.in_position
        return self if innovation is self.innovation else replace(self, innovation=innovation)


@dataclass(frozen=True)
class Decision:
    """What becomes of the present fix.

    A reset and a scaled noise act on a fix that is used. The order is: backtrack, then reset or use.

    Attributes:
        use: apply the fix (True) or leave it out, (N,).
        backtrack: epochs whose fixes are taken back first, (N,); 0 = none, None = none in any run.
        reset: the filter's position jumps to the fix (its velocity, too, where the receiver gives one) and has this
            variance per axis afterwards, (N,), m²; 0 = no reset, None = none in any run.
        noise_scale: factor on the variance R of the fix, (N,); None = 1 in every run.
        satellites: which slots' ranges to apply where the fix is used, (N, S); None = all.
    """

    use: Flags
    backtrack: Runs | None = None
    reset: Floats | None = None
    noise_scale: Floats | None = None
    satellites: Flags | None = None

    def of(self, runs: Runs) -> Decision:
        """The decisions of some runs only."""
        return Decision(
            self.use[runs],
            None if self.backtrack is None else self.backtrack[runs],
            None if self.reset is None else self.reset[runs],
            None if self.noise_scale is None else self.noise_scale[runs],
            None if self.satellites is None else self.satellites[runs],
        )

    def put(self, runs: Runs, part: Decision) -> Decision:
        """These decisions with those of some runs exchanged."""
        use = self.use.copy()
        use[runs] = part.use

        def exchange(mine: Any, theirs: Any, absent: float) -> Any:
            if mine is None and theirs is None:
                return None
            present = [value for value in (mine, theirs) if value is not None]
            kind, shape = np.result_type(*present), (len(use), *present[0].shape[1:])
            whole = np.full(shape, absent, dtype=kind) if mine is None else mine.astype(kind)
            whole[runs] = absent if theirs is None else theirs
            return whole

        return Decision(
            use,
            exchange(self.backtrack, part.backtrack, 0),
            exchange(self.reset, part.reset, 0.0),
            exchange(self.noise_scale, part.noise_scale, 1.0),
            exchange(self.satellites, part.satellites, True),
        )


@dataclass(frozen=True)
class Demands:
    """What the players of a game request of its navigator, beyond using every fix.

    The navigator allocates memory only for features that a player requests.

    Attributes:
        excludes: decisions may leave a fix out, reset the filter to it, or change its weight. Each run then has its own
            covariance.
        history: number of epochs that a decision can take back; 0 = none. Needs ``excludes``.
        auxiliary: the navigator also carries an inertial solution that no fix corrects after the burn-in.
    """

    excludes: bool = False
    history: int = 0
    auxiliary: bool = False

    def __post_init__(self) -> None:
        validation.epochs("demands", "history", self.history, 0)
        if self.history and not self.excludes:
            raise ValueError("a history needs a covariance per run: excludes must be True")

    def __or__(self, other: Demands) -> Demands:
        """The features that at least one of two players requests."""
        return Demands(
            self.excludes or other.excludes, max(self.history, other.history), self.auxiliary or other.auxiliary
        )


NO_DEMANDS = Demands()
"""Every run uses every fix, and nothing else is asked for."""


class Navigator(Protocol):
    """N filters that go through the epochs of a scenario in two half-steps.

    Every half-step can be asked for some of the runs only; arrays then have their length, in their order. ``index``
    counts the epochs of the navigator's model, -1 before the first. ``deviation`` is what lies between the fix and the
    scenario's reference position (and velocity) of the epoch: receiver noise plus spoofing offset, (N, m).
    """

    index: Runs
    diverged: Flags
    """Whether the filter has diverged since the episode began, (N,): it is then held at its last valid solution."""
    backtracked: Runs
    """Epochs that the last `resolve` took back, (N,): the depth decided, cut at what the history holds."""

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes, before the model's first epoch, from joint states (n, 30) of truth and filter."""

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by inertial measurements."""

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of the present epoch."""

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take fixes back, then apply the present one, or reset to it, where the decision says so."""

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided inertial solution of runs, where there is one, begin anew from the filter's."""

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""

    @property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """

    @property
    def position_covariance(self) -> Floats:
        """The filter's own covariance of the position, (N, 3, 3), m²."""

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""


class FixNavigator(Navigator, Protocol):
    """A navigator on fixes whose runs have covariances of their own."""

    auxiliary: Floats
    """The fifteen inertial states of the unaided solution minus those of the filter, (N, 15); (N, 0) undemanded."""

    @property
    def fix_gain(self) -> Floats:
        """U' for the present fix, (N, m, 15): with the whitened innovation w the fix takes U w off the error."""


class AidedNavigator(Navigator, Protocol):
    """A navigator that aids correct, too."""

    def aid_innovations(self, runs: Runs) -> AidInnovations:
        """What the aids told these runs on the way to their present epoch."""


class RangeNavigator(Navigator, Protocol):
    """A navigator on ranges, which shows monitors more of its filters."""

    shared_gains: bool
    """Every run uses every range, with the gains of the model."""
    auxiliary: Floats
    """The fifteen inertial states of the unaided solution minus those of the filter, (N, 15); (N, 0) undemanded."""

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the inertial states before the ranges of the present epoch, (N, 15, 15)."""

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""

    @property
    def clock_error(self) -> Floats:
        """Estimate minus truth of the receiver's clock, (N,), m."""

    @property
    def measured(self) -> Floats:
        """Code and second observable as they were measured, less geometry and clocks, which both share, (N, m)."""


class FilterView:
    """What the filter of some runs knows beside its innovation, before the present fix is resolved; never the truth.

    Read it while its epoch is the present one. Every property is computed when it is first asked for.
    """

    def __init__(self, navigator: Navigator, true_velocity: Floats, runs: Runs) -> None:
        """Look at ``runs`` of a navigator; ``true_velocity``, (E, 3), of its model's epochs carries the estimate."""
        self._navigator, self._true_velocity, self._runs = navigator, true_velocity, runs

    @property
    def runs(self) -> Runs:
        """Which runs of their simulation these are, (N,)."""
        return self._runs

    @cached_property
    def velocity(self) -> Floats:
        """Estimated velocity, (N, 3), ENU, m/s."""
        truth = self._true_velocity[self._navigator.index[self._runs]]
        return np.asarray(truth + self._navigator.velocity_error[self._runs])

    @cached_property
    def position_covariance(self) -> Floats:
        """The filter's own covariance of the position, (N, 3, 3), m²."""
        return self._navigator.position_covariance[self._runs]

    @cached_property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self._navigator.estimated_bias[self._runs]

    @cached_property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """
        return self._navigator.auxiliary_offset[self._runs]

    @cached_property
    def aid_innovations(self) -> AidInnovations:
        """What the aids told on the way to the present epoch; of a filter with aids."""
        return cast(AidedNavigator, self._navigator).aid_innovations(self._runs)

    @cached_property
    def backtracked(self) -> Runs:
        """Epochs that the `resolve` before the present epoch took back, (N,)."""
        return self._navigator.backtracked[self._runs]

    @property
    def _on_ranges(self) -> RangeNavigator:
        return cast(RangeNavigator, self._navigator)

    @property
    def shared_gains(self) -> bool:
        """Whether every run uses every range, with the gains of the model; of a filter on ranges."""
        return self._on_ranges.shared_gains

    @cached_property
    def fix_gain(self) -> Floats:
        """U' for the present fix, (N, m, 15); of a filter on fixes whose runs have covariances of their own."""
        return cast(FixNavigator, self._navigator).fix_gain[self._runs]

    @cached_property
    def auxiliary(self) -> Floats:
        """Inertial states of the unaided solution minus those of the filter, (N, 15); (N, 0) undemanded."""
        return self._on_ranges.auxiliary[self._runs]

    @cached_property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the inertial states, (N, 15, 15); of a filter on ranges."""
        return self._on_ranges.inertial_covariance[self._runs]

    @cached_property
    def measured(self) -> Floats:
        """Code and second observable as measured, less what both share, (N, m), m and m/s; of a filter on ranges."""
        return self._on_ranges.measured[self._runs]

    @cached_property
    def position_gain(self) -> Floats:
        """U' of the position for the present ranges, (N, m, 3), m; of a filter on ranges."""
        return self._on_ranges.position_gain[self._runs]
