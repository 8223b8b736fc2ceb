"""The tightly coupled filter on a log, whose ranges it takes.

As on recorded fixes, nothing is drawn: the samples and the ranges carry their own errors. What lies between the ranges
of the log and those of a reference trajectory is replayed to the filter, and the spoofer adds to it. The reference is
that of the log, or else the unspoofed run of the same filter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.logs.range_epochs import RangeEpochs
from spoofgym.logs.spoofed_fixes import RecordedSpoof
from spoofgym.logs.spoofed_ranges import spoofed_within
from spoofgym.logs.table import seconds
from spoofgym.navigation.divergence import Solution
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.linear_model import ErrorDynamics
from spoofgym.navigation.loose.kernels import mechanize_part
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.tight.model import TightDynamics, TightModel, cold_covariance, tight_dynamics, tight_model
from spoofgym.navigation.tight.ranges import RangeFamily, along, captured_ranges, disturbed_ranges
from spoofgym.navigation.tight.replay import TightReplayNavigator
from spoofgym.navigation.tight.states import BIAS, CLOCK
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.clean_run import TightCleanRun, tight_clean_run
from spoofgym.scenarios.recorded_family import RecordedFamily
from spoofgym.sensors.ranging import KUJUR, DrawnErrors, RangeErrors, pseudoranges
from spoofgym.streams import RunStreams

ERRORS = replace(KUJUR, code_multipath_sigma=0.0)
"""Slow errors of a satellite, the troposphere, and the clock of a usual quartz oscillator, as in Kujur 2024. Multipath
has no state of its own: `CODE_SIGMA` is twice the white noise on its account, and it would count a second time."""
CLOCK_SIGMA = (100.0, 10.0)
"""Initial uncertainty of the receiver's clock, m and m/s: ten times that of a fix, which is where it begins."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedRanges(RecordedFamily, RangeFamily):
    """Tightly coupled filters on the ranges of a log; epochs are equally spaced, some without satellites.

    White noise of code and range rate follows from C/N0, as that of the fixes made from them. The slow errors of each
    satellite, the troposphere and the clock are those of ``errors``. The filter is not matched: nobody knows the errors
    of a log.

    Attributes:
        epochs: the ranges.
        errors: what the filter believes of slow errors and of the clock; its noise of code and rate is not read.
        code_scale: on the sigma of a code that follows from its C/N0.
        rate_scale: on that of a range rate.
    """

    doubts = (
        "range rates of the wrong sign or unit (range_rate_mps), wrong ranges or ephemerides, ranges and IMU on "
        "different clocks (imu_delay_s), a wrong mounting (imu_to_body_frd), an IMU that is worse than its grade"
    )
    offers = RangeFamily.offers
    kind = TightReplayNavigator

    epochs: RangeEpochs
    errors: RangeErrors = ERRORS
    code_scale: float = 1.0
    rate_scale: float = 1.0

    @property
    def slots(self) -> int:
        """S, satellites of the log."""
        return self.epochs.geometry.num_slots

    @property
    def unmeasured(self) -> Runs:
        """None at any epoch, (E,)."""
        return np.zeros(len(self.epoch_time), dtype=np.int64)

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return replace(super().facts, range_model=self.tight_model, observable="rate")

    @cached_property
    def ranges(self) -> RangeEpochs:
        """Those after the alignment, as far as IMU and reference reach.

        Ranges that are spoofed themselves belong to the game of their attack alone.

        Raises:
            ValueError: too few.
        """
        start = int(self.epochs.fix[self.alignment.fix]) + 1
        stop = int(np.searchsorted(self.epochs.time, self._end, side="right"))
        if self.spoofed_within and not self.attacked:  # nobody knows what the ranges would be without the attack
            stop = min(stop, int(np.argmax(self.epochs.spoofed)))
        if stop - start < 4:
            raise ValueError(
                f"scenario {self.name!r}: too few ranges after the alignment at {seconds(self.align_time)} s"
            )
        return self.epochs.part(start, stop)

    @property
    def epoch_time(self) -> Floats:
        """Times of all epochs after the alignment, (E,), s."""
        return self.ranges.time

    @property
    def _prior_sigma(self) -> Floats:
        sigma = self.tuning.initial_sigma(self.grade)
        sigma[:3] = self.alignment.attitude_sigma
        stated = self.log.fixes.position_sigma
        assert stated is not None
        sigma[6:9] = stated[self.alignment.fix]
        return sigma

    @cached_property
    def model(self) -> StrapdownModel:
        """The inertial part of all epochs after the alignment; fixes from ranges where the log has no reference."""
        ranges = self.ranges
        return self._inertial_model(
            ranges.position, ranges.velocity, np.broadcast_to(np.eye(3), (len(ranges.time), 3, 3))
        )

    @cached_property
    def dynamics(self) -> TightDynamics:
        """What the filter believes of all epochs after the alignment; Φ and Q of the navigation states are left out."""
        ranges, epochs = self.ranges, len(self.epoch_time)
        inertial = ErrorDynamics(
            transition=np.zeros((epochs, NUM_INERTIAL, NUM_INERTIAL)),
            process_noise=np.zeros((epochs, NUM_INERTIAL, NUM_INERTIAL)),
            true_noise=np.zeros((epochs, NUM_NAVIGATION, NUM_NAVIGATION)),
            observation=np.zeros((epochs, 0, NUM_NAVIGATION)),
        )
        steady = tight_dynamics(inertial, self.grade, self.errors, ranges.geometry, ranges.interval, "rate")
        sigma = np.concatenate([self.code_scale * ranges.code_sigma, self.rate_scale * ranges.rate_sigma], axis=1)
        return replace(
            steady,
            time=ranges.time,
            intervals=np.diff(ranges.time, prepend=self.align_time),
            clock_jump=ranges.clock_jump,
            started=ranges.started,
            noise_variance=np.where(np.tile(ranges.geometry.present, 2), sigma**2, 1.0),
        )

    def deviation(self, position: Floats, velocity: Floats) -> Floats:
        """The ranges of the log minus those of a reference with a steady clock, (E, m), m and m/s.

        The clock of the reference starts with that of the first epoch and keeps its drift; it is there to keep the
        numbers small.

        Args:
            position: of the reference at all epochs after the alignment, (E, 3), latitude rad, longitude rad, height m.
            velocity: of the reference at these epochs, (E, 3), ENU, m/s.
        """
        ranges = self.ranges
        since = ranges.time - ranges.time[0]
        drift = np.full(len(since), ranges.clock_drift[0])
        clock = np.column_stack([ranges.clock[0] + drift * since, drift])
        none = np.zeros(ranges.code.shape)
        expected = pseudoranges(ranges.geometry, position, velocity, DrawnErrors(none, none, none, clock))
        measured = np.concatenate([ranges.code, ranges.rate], axis=1)
        return (measured - np.concatenate([expected.code, expected.rate], axis=1)) * np.tile(ranges.geometry.present, 2)

    @cached_property
    def _cold(self) -> Floats:
        """The filter's P at the alignment, (n, n)."""
        sigma = self.tuning.initial_scale * self._prior_sigma
        return cold_covariance(sigma, CLOCK_SIGMA, self.errors, self.slots)

    @cached_property
    def clean(self) -> TightCleanRun:
        """The filter on the unspoofed ranges, from the alignment to the end of the log.

        Without a reference, or with one that has holes, it runs twice: along the fixes of the ranges there, and along
        its own first solution, so that a game, whose reference is the clean run, has the same lines of sight.
        """
        with self._refusing_divergence():
            run = self._clean_along(self.model)
            if self.log.reference is None or not self.compared.all():
                position, velocity = self._known(0, run.position[1:]), self._known(1, run.velocity[1:])
                run = self._clean_along(replace(self.model, true_position=position, true_velocity=velocity))
        self._warn_of_large_innovations(self._unspoofed(run))
        return run

    def _unspoofed(self, run: TightCleanRun) -> TightCleanRun:
        """The innovations of a run as far as the log's own ranges are those of no attack."""
        if not self.spoofed_within:
            return run
        stop = int(np.searchsorted(self.epoch_time, self.recorded_spoof().begin))
        return replace(run, nis=run.nis[:stop], degrees=run.degrees[:stop])

    def _clean_along(self, model: StrapdownModel) -> TightCleanRun:
        satellites, unknown = self.ranges.geometry.position, np.zeros(len(self.epoch_time))
        tight = bare_model(self.dynamics, self._cold)
        navigator = TightReplayNavigator(model, tight, satellites, unknown, 1, RunSlices(1))
        return tight_clean_run(navigator, self.deviation(model.true_position, model.true_velocity))

    @cached_property
    def _measured(self) -> Floats:
        """Deviation of the ranges from those of the truth, (E, m)."""
        return self.deviation(self.true_position, self.true_velocity)

    @property
    def spoofed_within(self) -> bool:
        """Whether the log's own ranges are spoofed at some time."""
        return bool(self.epochs.spoofed.any() and spoofed_within(self.log))

    def recorded_spoof(self) -> RecordedSpoof:
        """The real attack that the log holds on its ranges.

        Raises:
            ValueError: it holds none.
        """
        ranges, time = self.epochs, self.epochs.time
        during = np.flatnonzero(ranges.spoofed)
        if not len(during):
            raise ValueError(
                f"log {str(self.log.folder)!r}: attack recorded: it holds none on its ranges, neither "
                "ranges_spoofed.csv nor first_effect_s in log.toml"
            )
        begin, end = float(time[during[0]]), float(time[during[-1]])
        lasts = self.spoofed_within and during[-1] == len(time) - 1
        nothing = np.zeros((len(time), 3))
        return RecordedSpoof(time, nothing, nothing, begin, np.inf if lasts else end, ranges.added)

    def _dynamics(self, burn_in: int) -> TightDynamics:
        return self.dynamics.part(self._first(burn_in), self.last + 1)

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> TightReplayNavigator:
        """A navigator that starts from the clean run's filter before epoch -burn_in; arguments as in `FilterFamily`."""
        first, stop = self._first(burn_in), self.last + 1
        tight = bare_model(self._dynamics(burn_in), self.clean.covariance[first])
        satellites, clock = self.ranges.geometry.position[first:stop], self.clean.state[first + 1 : stop + 1, CLOCK]
        return self.kind(self._game_model(first), tight, satellites, clock, num_runs, slices, demands)

    @kept_by_burn_in
    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The covariances of the game along the clean run, from epoch -burn_in on, every range used."""
        first, stop = self._first(burn_in), self.last + 1
        transition, noise = self._transitions(first, stop)
        dynamics = replace(self._dynamics(burn_in), transition=transition, process_noise=noise)
        return tight_model(dynamics, self.clean.covariance[first])

    def _transitions(self, first: int, stop: int) -> tuple[Floats, Floats]:
        """Φ (e, 9, 15) and Q (e, 9, 9) of the navigation states over epochs first..stop-1 of the clean run."""
        model, clean = self.model, self.clean
        transition = np.empty((stop - first, NUM_NAVIGATION, NUM_INERTIAL))
        noise = np.empty((stop - first, NUM_NAVIGATION, NUM_NAVIGATION))
        density = np.diag(model.filter_density[:NUM_NAVIGATION])
        steps = model.steps
        one, no_noise, force = np.empty((NUM_NAVIGATION, NUM_INERTIAL)), np.empty(0), np.empty(3)
        for k in range(first, stop):
            solution = Solution(
                clean.attitude[k].copy(), clean.velocity[k].copy(), clean.position[k].copy(), clean.bias[k].copy()
            )
            total, gathered = np.eye(NUM_NAVIGATION, NUM_INERTIAL), np.zeros((NUM_NAVIGATION, NUM_NAVIGATION))
            for part in range(steps.places[k], steps.places[k + 1]):
                span = (steps.bounds[part], steps.bounds[part + 1], -1)
                length = mechanize_part(
                    span, -solution.bias, no_noise, steps.samples, solution, np.empty((6, 3)), force, one
                )
                phi, half = one[:, :NUM_NAVIGATION], 0.5 * length * density
                total = phi @ total
                total[:, NUM_NAVIGATION:] += one[:, NUM_NAVIGATION:]
                gathered = phi @ (gathered + half) @ phi.T + half
            transition[k - first], noise[k - first] = total, gathered
        return transition, noise

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """No error but the biases', and what the clean run's filter estimates before epoch -burn_in, (k, n + 6)."""
        first, clean = self._first(burn_in), self.clean
        state, bias = clean.state[first].copy(), clean.bias[first]
        state[BIAS] = -bias
        return np.tile(np.concatenate([state, bias]), (len(runs), 1))

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """The log's ranges minus those of the truth at the epochs -burn_in..K, (k, burn_in + K + 1, m), m and m/s."""
        return np.tile(self._measured[self._first(burn_in) : self.last + 1], (len(runs), 1, 1))

    def spoofed(self, fidelity: str, index: Runs, burn_in: int, spoof: Spoof) -> Floats:
        """What a spoofer adds to the ranges, (k, m): they become those of a receiver at the offset, its clock moved."""
        place = self._first(burn_in) + index
        geometry, truth = self.ranges.geometry, self.true_position[place]
        satellites = geometry.position[place]
        code = _distance(satellites, displace(truth, spoof.offset)) - _distance(satellites, truth)
        rate = spoof.clock_rate[:, None] - along(geometry.line_of_sight[place], spoof.rate)
        return captured_ranges(geometry.present[place], spoof, code + spoof.clock[:, None], rate)

    def disturbed(self, multipath: Floats, burn_in: int, clock: Floats | None = None) -> Floats:
        """What disturbances add to the code at epochs 0..K, (k, K+1, m), so that a fix would err by ``multipath``."""
        geometry, game = self.ranges.geometry, slice(self.first, self.last + 1)
        return disturbed_ranges(geometry.line_of_sight[game], multipath, geometry.present[game], clock)

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """Number of the satellite in each slot, (k, S); -1 = none."""
        return self.ranges.geometry.satellite[self._first(burn_in) + index]


def bare_model(dynamics: TightDynamics, prior: Floats) -> TightModel:
    """The model as a navigator at the IMU rate takes it, which forms all covariances itself."""
    nothing = np.empty((0, 0, 0))
    return TightModel(dynamics, prior, nothing, nothing, nothing, nothing, nothing)


def _distance(satellites: Floats, position: Floats) -> Floats:
    """From satellites (k, S, 3) to receivers (k, 3), (k, S), m."""
    return np.asarray(np.sqrt(np.square(satellites - geodetic_to_ecef(position)[:, None]).sum(axis=2)))
