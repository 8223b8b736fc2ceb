"""N runs of a scenario, one GNSS epoch at a time: trajectory, sensors, attack, navigation, detectors, response."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.clean_starts import far_too_low, require_clean_starts
from spoofgym.detectors.base import Detector, statistic_of
from spoofgym.fitting import fit_attack, fit_detectors, fit_response, join
from spoofgym.navigation.divergence import diverged_error
from spoofgym.navigation.interface import NO_DEMANDS, Clock, Decision, Demands, Epoch, FilterView, Innovation
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.white import white_epochs
from spoofgym.parallel import RunSlices
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.sensors.confounders import Confounders
from spoofgym.streams import RunStreams, given_streams

OWNER = "Simulation"
ON_DIVERGENCE = ("raise", "hold")
MAX_REDRAWS = 100


class Simulation:
    """The whole loop: `reset`, then `resolve` and `observe` in turn.

    Attributes:
        scenario: what is simulated.
        detectors: by their names, in order.
        navigator: the N filters.
        slices: the threads.
        epoch: the present epoch of every run, as `observe` left it.
        alarm: whether any detector alarms in the present epoch, (N,).
        offset: what the spoofer added to the present fix, (N, 3), m ENU.
        decision: the response's, on the present epoch; to use every fix where there is none.
        steering: how far the vehicles are from their paths; None = they are not steered by their estimates.
        used: whether the last `resolve` used the fix, (N,).
    """

    def __init__(
        self,
        scenario: Scenario,
        attack: Attack | None = None,
        detectors: Sequence[Detector] = (),
        response: Response | None = None,
        num_runs: int = 1,
        seed: int | None = None,
        *,
        streams: RunStreams | None = None,
        fidelity: str = "linear",
        threads: int = 1,
        demands: Demands = NO_DEMANDS,
        confounders: Confounders | None = None,
        on_divergence: str = "raise",
    ) -> None:
        """Set up ``num_runs`` runs seeded ``seed + i``, or with given random streams.

        Args:
            scenario: what is simulated.
            attack: adds offsets by itself; None = the caller gives them to `observe`.
            detectors: each with its threshold set.
            response: decides in `resolve` where the caller does not; None = use every fix.
            num_runs: N.
            seed: of run 0; None = fresh entropy.
            streams: random streams of the N runs, instead of a seed; None = those of the seed.
            fidelity: "linear" or "strapdown".
            threads: for slices of runs.
            demands: of a defender outside, beside those of detectors and response.
            confounders: outages and multipath; None = there are none.
            on_divergence: "raise": a run whose filter diverges ends the simulation with an error; "hold": it is held
                at its last valid solution, and ``navigator.diverged`` tells, for a caller that ends its game.

        Raises:
            ValueError: no runs, a seed beside streams or streams of another number of runs, an uncalibrated detector
                or one that alarms in every clean run, a fidelity that the scenario lacks, an attack outside the game,
                or a part that needs what the scenario does not give.
            TypeError: a part that is no object of its class.
        """
        validation.instance(OWNER, "scenario", scenario, Scenario, "a scenario, as make_scenario gives")
        num_runs = validation.runs(OWNER, "num_runs", num_runs)
        scenario.check_fidelity(fidelity)
        self._holds = validation.one_of(OWNER, "on_divergence", on_divergence, ON_DIVERGENCE) == "hold"
        self.scenario = scenario
        self._family = family = scenario.family
        self.fidelity = fidelity
        self.num_runs = num_runs
        self.streams = given_streams(OWNER, seed, streams, num_runs)
        fit_detectors(OWNER, detectors, scenario, num_runs)
        self.detectors = {detector.name: detector for detector in detectors}
        self.attack = attack
        if attack is not None:
            fit_attack(OWNER, attack, scenario, num_runs)
        self.response = response
        if response is not None:
            fit_response(OWNER, response, scenario, num_runs)
        memory = max((detector.memory for detector in detectors), default=0)
        self._white_memory = memory if scenario.matched else 0
        self.burn_in = 0 if scenario.matched else memory
        for part in (*detectors, *((response,) if response is not None else ())):
            demands |= part.demands
        self.confounders = confounders
        if confounders is not None:
            confounders.bind(scenario.timeline, num_runs)
            demands |= Demands(excludes=True)
        self.slices = RunSlices(threads)
        self.navigator = family.navigator(fidelity, demands, self.burn_in, num_runs, self.slices)
        self._times = scenario.times(self.burn_in)
        self._velocity = scenario.velocity(self.burn_in)
        self._intervals = np.diff(self._times, prepend=self._times[0] - scenario.timeline.interval)
        self._noise = np.zeros((num_runs, len(self._times), scenario.dimension))
        self._all = np.arange(num_runs)
        self.decision = Decision(np.ones(num_runs, dtype=bool))
        self.used = np.zeros(num_runs, dtype=bool)
        self._no_offset = np.zeros((num_runs, 3))
        self.offset = self._no_offset.copy()
        self.clock_offset = np.zeros(num_runs)
        self.alarm: NDArray[np.bool_] = np.zeros(num_runs, dtype=bool)
        self.epoch = self._blank_epoch()
        self.steering = scenario.steering(num_runs)
        join(self, attack, response)
        if scenario.random:
            require_clean_starts(scenario.name, list(self.detectors.values()), self._passing)
        join(self, *detectors)

    def _blank_epoch(self) -> Epoch:
        n, innovation = self.num_runs, self._family.blank_innovation(self.num_runs)
        statistics = {name: np.zeros(n) for name in self.detectors}
        available = np.ones(n, dtype=bool)
        return Epoch(np.zeros(n, dtype=np.int64), np.zeros(n), innovation, statistics, available, self._view(self._all))

    def _view(self, runs: Runs) -> FilterView:
        return FilterView(self.navigator, self._velocity, runs)

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU; never known to any player."""
        return self.navigator.error

    def reset(self, runs: Runs | None = None) -> Epoch:
        """Start new episodes of runs (all by default), up to and including the clean epoch 0."""
        runs = self._all if runs is None else np.asarray(runs, dtype=np.int64)
        if len(runs):
            bank = self._warm(runs)
            epoch = self._clean_epoch(runs)
            self.alarm[runs] = self._test(epoch, bank)
            self._merge(runs, epoch)
            self._remember(runs, bank)
            self._decide_first(runs, epoch)
        return self.epoch

    def restart(self, runs: Runs) -> None:
        """Start new episodes of runs just before their epoch 0, which the next `observe` brings, without an offset."""
        if len(runs):
            self._remember(runs, self._warm(runs))

    def _remember(self, runs: Runs, bank: dict[str, Detector]) -> None:
        for name, detector in self.detectors.items():
            detector.take(runs, bank[name])

    def _warm(self, runs: Runs) -> dict[str, Detector]:
        """New episodes just before epoch 0.

        Returns:
            Detectors of these runs alone, which have seen a clean burn-in without an alarm.

        Raises:
            RuntimeError: a run alarms in every one of its burn-ins.
        """
        bank = {name: copy.copy(detector) for name, detector in self.detectors.items()}
        for detector in bank.values():
            detector.bind(len(runs), self._family.seen_dimension(detector.in_position))
        self.offset[runs], self.clock_offset[runs] = 0.0, 0.0
        self.used[runs] = False
        if self.steering is not None:
            self.steering.begin(runs)
        if self.attack is not None:
            self.attack.reset(runs, self.streams)
        if self.confounders is not None:
            self.confounders.reset(runs, self.streams)
        if self.response is not None:
            self.response.draw(runs, self.streams)
            self.response.reset(runs)
        pending = np.arange(len(runs))
        for _ in range(MAX_REDRAWS):
            pending = pending[self._burn_in(runs[pending], pending, bank)]
            if len(pending) == 0 or not self.scenario.random:
                return bank
        raise RuntimeError(
            f"{len(pending)} runs alarm in each of {MAX_REDRAWS} clean burn-ins: {far_too_low(self.detectors.values())}"
        )

    def _passing(self, detectors: Sequence[Detector], runs: int) -> int:
        """How many of so many clean runs, none of them one of these, get through a burn-in without an alarm."""
        scenario, parts = self.scenario, [copy.deepcopy(detector) for detector in detectors]
        trial = _Trial(scenario, None, parts, None, runs, 0, fidelity=scenario.fidelities[0])
        return runs - int(np.count_nonzero(trial._burn_in(trial._all, trial._all, trial.detectors)))

    def _burn_in(self, runs: Runs, places: Runs, bank: dict[str, Detector]) -> NDArray[np.bool_]:
        """One try of some runs at the burn-in; whether each alarmed in it, (n,)."""
        part = {name: copy.copy(detector) for name, detector in bank.items()}
        for detector in part.values():
            detector.bind(len(runs), self._family.seen_dimension(detector.in_position))
        initial = self._family.draw_initial(runs, self.burn_in, self.streams)
        self._noise[runs] = self._family.draw_receiver_noise(runs, initial, self.burn_in, self.streams)
        if self.confounders is not None:
            noise, clock = self.confounders.noise[runs], self.confounders.clock[runs]
            self._noise[runs, self.burn_in :] += self._family.disturbed(noise, self.burn_in, clock)
        self.navigator.reset(runs, initial, self.streams)
        alarmed = np.zeros(len(runs), dtype=bool)
        for epoch in self._white_epochs(runs):
            alarmed |= self._test(epoch, part)
        use = Decision(np.ones(len(runs), dtype=bool))
        for _ in range(self.burn_in):
            alarmed |= self._test(self._clean_epoch(runs), part)
            self.navigator.resolve(use, runs)
        self.navigator.restart_auxiliary(runs)
        for name, detector in bank.items():
            detector.take(places, part[name])
        return alarmed

    def _clean_epoch(self, runs: Runs) -> Epoch:
        """Carry some runs to their next epoch, without an offset."""
        self.navigator.propagate(runs)
        index = self.navigator.index[runs]
        innovation = self.navigator.innovate(self._noise[runs, index], runs)
        available = np.ones(len(runs), dtype=bool)
        return Epoch(index - self.burn_in, self._times[index], innovation, available=available, view=self._view(runs))

    def _white_epochs(self, runs: Runs) -> list[Epoch]:
        """The epochs before epoch 0 that a matched filter's detectors remember: drawn directly."""
        memory, m = self._white_memory, self.scenario.dimension
        if memory == 0:
            return []
        normals = np.stack([self.streams(run, "memory").standard_normal((memory, m)) for run in runs])
        return white_epochs(self._family.white_innovations(), self.scenario.timeline, normals)

    def _test(self, epoch: Epoch, detectors: dict[str, Detector]) -> NDArray[np.bool_]:
        """Let the detectors see an epoch, in order; whether any alarms, (n,).

        In a burn-in, which is as long as the longest memory, an alarm counts within the detector's own memory only: so
        a detector begins its games in the same way, whatever stands beside it.
        """
        alarm = np.zeros(len(epoch.index), dtype=bool)
        for name, detector in detectors.items():
            statistic = epoch.statistics[name] = statistic_of(detector, epoch)
            assert detector.threshold is not None
            alarm |= (statistic > detector.threshold) & (epoch.index >= -detector.memory)
        return alarm

    def _merge(self, runs: Runs, part: Epoch) -> None:
        """Put the epoch of some runs beside that of the others."""
        if len(runs) == self.num_runs and (runs == self._all).all():
            self.epoch = part
            return
        whole = self.epoch
        for target, source in (
            (whole.index, part.index),
            (whole.time, part.time),
            *((whole.statistics[name], statistic) for name, statistic in part.statistics.items()),
        ):
            target[runs] = source
        assert whole.available is not None
        whole.available[runs] = True if part.available is None else part.available
        innovation = whole.innovation.put(runs, part.innovation)
        self.epoch = replace(whole, innovation=innovation, view=self._view(self._all))

    def resolve(self, decision: Decision | None = None, runs: Runs | None = None) -> None:
        """Second half of the present epoch of runs (all by default): use the fix, leave it out, take fixes back.

        A fix that the receiver does not give is never used.

        Args:
            decision: of a defender outside, for these runs; None = the response's, or to use every fix where there is
                none.
            runs: which.

        Raises:
            FilterDivergedError: the filter of a run has diverged, and the simulation does not hold it.
        """
        if decision is None:
            decision = self.decision if runs is None else self.decision.of(runs)
        available = self.epoch.available
        if self.confounders is not None and available is not None:
            decision = replace(decision, use=decision.use & (available if runs is None else available[runs]))
        self.used[self._all if runs is None else runs] = decision.use
        self.navigator.resolve(decision, runs)
        if not self._holds:
            self.require_converged()

    def require_converged(self) -> None:
        """Refuse to go on where the filter of a run has diverged.

        Raises:
            FilterDivergedError: naming the first such run.
        """
        diverged = self.navigator.diverged
        if diverged.any():
            run = int(diverged.argmax())
            raise diverged_error(run, float(self._times[self.navigator.index[run]]))

    def observe(self, offset: Floats | None = None) -> Epoch:
        """First half of the next epoch of every run: propagate, measure, form the innovation and the statistics.

        Args:
            offset: of the spoofer, (N, 3), m ENU, or (N, 4) with that of the receiver's clock, m; None = the attack's,
                or none where there is no attack.

        Raises:
            ValueError: an offset that is not finite or has another shape.
            RuntimeError: a run has no epoch left.
            FilterDivergedError: the filter of a run has diverged, and the simulation does not hold it.
        """
        navigator = self.navigator
        if navigator.index.max() + 1 >= len(self._times):
            raise RuntimeError(f"run {int(navigator.index.argmax())} has reached its last epoch: reset it")
        following = navigator.index + 1
        clock = Clock(following - self.burn_in, self._times[following])
        attack = self.attack if offset is None else None
        given = self._no_offset if offset is None else validation.rows(OWNER, "offset", offset, self.num_runs, (3, 4))
        spoof = self._spoof(clock, attack, given)
        deviation = self._noise[self._all, following]
        deviation += self._family.spoofed(self.fidelity, following, self.burn_in, spoof)
        self.offset, self.clock_offset = spoof.offset, spoof.clock
        if self.steering is not None:
            self.steering.leave(self.error)
        navigator.propagate()
        if self.steering is not None:
            self.steering.arrive(clock.index, self.error)
        innovation = navigator.innovate(deviation)
        if not self._holds:
            self.require_converged()
        available = self._available(clock.index, innovation)
        self.epoch = Epoch(clock.index, clock.time, innovation, available=available, view=self._view(self._all))
        self.alarm = self._test(self.epoch, self.detectors)
        self._decide()
        return self.epoch

    def _spoof(self, clock: Clock, attack: Attack | None, given: Floats) -> Spoof:
        """What the receiver is made to believe at an epoch: by the attack, or by offsets from outside."""
        intervals = self._intervals[clock.index + self.burn_in]
        offset = given[:, :3] if attack is None else np.array(attack.offset(clock))
        moved = given[:, 3] if given.shape[1] == 4 else self._no_offset[:, 0]
        if attack is not None:
            moved = attack.clock_offset(clock)
        rate, pull = (offset - self.offset) / intervals[:, None], (moved - self.clock_offset) / intervals
        satellites = carrier = ranges = None
        if attack is not None:
            rate = attack.velocity(clock, rate)
            if self._family.slots:
                slots = self._family.satellites(clock.index + self.burn_in, self.burn_in)
                satellites, carrier, ranges = attack.captured(clock, slots), attack.carrier(clock), attack.ranges(clock)
        return Spoof(offset.copy(), rate, moved.copy(), pull, satellites, carrier, ranges)

    @property
    def attacked(self) -> Flags:
        """Whether the present fix is spoofed, (N,)."""
        moved, attack = np.asarray(self.offset.any(axis=1) | (self.clock_offset != 0.0)), self.attack
        elsewhere = attack is not None and (attack.on_ranges or not attack.moves_position)
        return moved | attack.active(self.epoch) if attack is not None and elsewhere else moved

    def _available(self, index: Runs, innovation: Innovation) -> Flags:
        """Whether there is a fix in each run, (N,); where there is none, nobody sees an innovation."""
        if self.confounders is None:
            return np.ones(self.num_runs, dtype=bool)
        available = self.confounders.available[self._all, np.maximum(index, 0)]
        if not available.all():
            for part in (innovation.residual, innovation.whitened, innovation.nis):
                part[~available] = 0.0
        return available

    def _seen_by_response(self, epoch: Epoch) -> Epoch:
        return epoch if self.response is None or not self.response.in_position else epoch.in_position

    def _decide(self) -> None:
        """The response sees each epoch once."""
        if self.response is not None:
            self.decision = self.response.decide(self._seen_by_response(self.epoch), self.alarm)

    def _decide_first(self, runs: Runs, epoch: Epoch) -> None:
        """The response sees epoch 0 of these runs; the others see each epoch once."""
        if self.response is not None:
            part = self.response.begin(runs, self._seen_by_response(epoch), self.alarm[runs])
            self.decision = self.decision.put(runs, part)


class _Trial(Simulation):
    """A simulation whose burn-in is tried, and which is never played."""

    def _passing(self, detectors: Sequence[Detector], runs: int) -> int:
        """All of them: a trial is not tried itself."""
        return runs
