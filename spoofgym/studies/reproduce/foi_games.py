"""The games behind the tables of FOI-R-5687, and the figures that the report reads from each."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Windowed
from spoofgym.detectors.relative_motion import RelativeMotion
from spoofgym.navigation.interface import Decision, Epoch
from spoofgym.responses import make_response
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies.reproduce.foi_azimuth import FittedAzimuth
from spoofgym.studies.reproduce.foi_tables import ATTACKS, Attacked, Setting
from spoofgym.studies.reproduce.tracks import Tracks, play

PROCESS_NOISE = 1000.0
WINDOWED_THRESHOLDS = {5: 1.0, 20: 2.0}  # table 4
ARMED = 42.0
"""From here on alarms count, s: the longest window no longer holds the first fixes, of a filter that has just begun."""
CLEAN_RUNS = 6
CLEAN_SEED = 1_000_000
NEVER_REACHED = 1e9
EXPONENTS = (0.05, 4.0)


SCORED = 21
"""From here on errors count, s: the longest window of test (3) is full."""
STANDSTILL = 2
"""Where games of test (1) begin, s: the vehicle stands, and its unaided INS starts with it (section 6.1)."""
DRIVE_ENDS = 250


def drive(process_noise: float, start: int = SCORED) -> Scenario:
    """The report's drive with its receiver and nine states, from ``start`` on, s."""
    return make_scenario(
        f"foi-drive:onset={start},horizon={DRIVE_ENDS - start},receiver=foi,process_noise={process_noise:g},"
        "bias_states=false"
    )


def scored(tracks: Tracks, values: Floats) -> Floats:
    """The part of a series of each run, (N, K+1), in which errors count."""
    return values[:, tracks.time >= SCORED]


class Armed(Response):
    """A response that hears of no alarm before `ARMED`.

    Args:
        response: that hears of the others.
    """

    def __init__(self, response: Response) -> None:
        self._response = response
        self.demands = response.demands

    @property
    def name(self) -> str:
        """That of the response."""
        return self._response.name

    def bind(self, num_runs: int) -> None:
        """Allocate a response of its own."""
        super().bind(num_runs)
        self._response = copy.copy(self._response)
        self._response.bind(num_runs)

    def reset(self, runs: Runs) -> None:
        """Forget everything about these runs."""
        self._response.reset(runs)

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """What the response decides."""
        return self._response.decide(epoch, alarm & (epoch.time >= ARMED))


@dataclass(frozen=True)
class RelativeThreshold:
    """Test (1) as the report sets it: growth in time and the largest value beyond it, over six clean runs.

    Attributes:
        slope: m/s.
        threshold: m.
    """

    slope: float
    threshold: float


def relative_threshold(window: int, seed: int) -> RelativeThreshold:
    """Slope and threshold of test (1) for a window of k samples (section 5.1), on runs of their own."""
    detector = RelativeMotion(window, slope=0.0, threshold=NEVER_REACHED)
    scenario = drive(PROCESS_NOISE, STANDSTILL)
    tracks = play(Simulation(scenario, None, [detector], None, CLEAN_RUNS, CLEAN_SEED + seed))
    full = slice(tracks.at(ARMED), None)
    elapsed, statistic = tracks.time[full] - tracks.time[0], tracks.statistics[detector.name][:, full]
    slope = float(np.polyfit(elapsed, statistic.mean(axis=0), 1)[0])
    return RelativeThreshold(slope, float(np.max(statistic - slope * elapsed)))


def windowed_thresholds(process_noise: float, window: int, runs: int, seed: int) -> Floats:
    """Threshold of test (3) as each clean run sets it: its largest value, rounded up (section 5.2), (N,)."""
    detector = Windowed(window + 1, threshold=NEVER_REACHED)
    tracks = play(Simulation(drive(process_noise), None, [detector], None, runs, CLEAN_SEED + seed))
    return np.ceil(tracks.statistics[detector.name][:, tracks.at(ARMED) :].max(axis=1))


@dataclass(frozen=True)
class Games:
    """How games are played.

    Attributes:
        runs: N.
        seed: of run 0.
        relative: slope and threshold of test (1) by its window.
    """

    runs: int
    seed: int
    relative: dict[int, RelativeThreshold]

    def undefended(self, scenario: int) -> Tracks:
        """Every fix is used."""
        attack = FittedAzimuth(ATTACKS[scenario])
        return play(Simulation(drive(PROCESS_NOISE), attack, [], None, self.runs, self.seed))

    def defended(
        self, scenario: int, setting: Setting, process_noise: float = PROCESS_NOISE, threshold: float | None = None
    ) -> Tracks:
        """A detector and its response; ``threshold`` replaces that of test (3)."""
        response = make_response("exclude" if not setting.depth else f"exclude-and-backtrack:{setting.depth}")
        return play(
            Simulation(
                drive(process_noise, STANDSTILL if setting.test == 1 else SCORED),
                FittedAzimuth(ATTACKS[scenario]),
                [self._detector(setting, threshold)],
                Armed(response),
                self.runs,
                self.seed,
            )
        )

    def _detector(self, setting: Setting, threshold: float | None) -> Detector:
        window = setting.window
        if setting.test == 1:
            relative = self.relative[window]
            return RelativeMotion(window, slope=relative.slope, threshold=relative.threshold)
        return Windowed(window + 1, threshold=WINDOWED_THRESHOLDS[window] if threshold is None else threshold)


@dataclass(frozen=True)
class Figures:
    """What the report's tables list, of each run, (N,); infinite where a thing never happens.

    Attributes:
        first_alarm: after the attack's start, scenario time, s.
        receiver_error: of the fix at that alarm, m.
        rmse: of the real-time output over the whole game, three axes, m.
        reuse: from the attack's end until GNSS is used without interruption, s.
        largest: error of the output, three axes, m.
    """

    first_alarm: Floats
    receiver_error: Floats
    rmse: Floats
    reuse: Floats
    largest: Floats


def figures(tracks: Tracks, attack: Attacked) -> Figures:
    """Read them from the tracks of a game."""
    runs, epochs = np.arange(len(tracks.alarm)), tracks.time
    alarm = tracks.alarm & (epochs > attack.start)
    alarmed, first = alarm.any(axis=1), alarm.argmax(axis=1)
    error = scored(tracks, length(tracks.error))
    excluded = ~tracks.used & (epochs >= attack.end)
    # the last epoch without GNSS; 1 before the attack's end where there is none
    last = np.where(excluded, epochs, attack.end - 1.0).max(axis=1)
    return Figures(
        first_alarm=np.where(alarmed, epochs[first], math.inf),
        receiver_error=np.where(alarmed, length(tracks.receiver_error)[runs, first], math.inf),
        rmse=root_mean_square(error),
        reuse=np.where(last < epochs[-1], last + 1.0 - attack.end, math.inf),
        largest=error.max(axis=1),
    )


def spoofed_after_alarm(tracks: Tracks, attack: Attacked) -> Floats:
    """Spoofed fixes that each run uses after its first alarm of the attack, (N,)."""
    first = figures(tracks, attack).first_alarm
    late = (tracks.time > first[:, None]) & (tracks.time < attack.end)
    return np.sum(tracks.used & late, axis=1).astype(np.float64)


def length(vectors: Floats) -> Floats:
    """Of vectors (N, K+1, 3), (N, K+1)."""
    return np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2 + vectors[..., 2] ** 2)


def root_mean_square(values: Floats) -> Floats:
    """Over the epochs of each run, (N,)."""
    return np.sqrt(np.mean(values**2, axis=1))


@dataclass(frozen=True)
class Growth:
    """How the error grew while there was no GNSS (table 6), of the runs that use it again, (n,).

    Attributes:
        time: from the first alarm to the use of GNSS, s.
        growth: of the error, m.
        exponent: a of the fit b t^a.
        factor: b, m/s^a.
    """

    time: Floats
    growth: Floats
    exponent: Floats
    factor: Floats


def growth(tracks: Tracks, scenario: int) -> Growth:
    """Fit p_0 + b (t - t_0)^a to the error of each run, with b such that the last value is met (section 5.2)."""
    attack = ATTACKS[scenario]
    result = figures(tracks, attack)
    error = length(tracks.error)
    rows = []
    for run in np.flatnonzero(np.isfinite(result.reuse) & np.isfinite(result.first_alarm)):
        first, last = tracks.at(result.first_alarm[run]), tracks.at(attack.end + result.reuse[run] - 1.0)
        if last <= first:
            continue
        elapsed = tracks.time[first : last + 1] - tracks.time[first]
        stretch = error[run, first : last + 1] - error[run, first]
        exponent = _exponent(elapsed, stretch)
        time = attack.end + result.reuse[run] - result.first_alarm[run]
        rows.append((time, stretch[-1], exponent, stretch[-1] / elapsed[-1] ** exponent))
    return Growth(*np.array(rows, dtype=np.float64).reshape(-1, 4).T)


def _exponent(elapsed: Floats, stretch: Floats) -> float:
    """The a that fits best."""

    def misfit(exponent: float) -> float:
        return float(np.sum((stretch[-1] * (elapsed / elapsed[-1]) ** exponent - stretch) ** 2))

    return float(minimize_scalar(misfit, bounds=EXPONENTS, method="bounded").x)
