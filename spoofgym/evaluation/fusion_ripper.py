"""FusionRipper's published outcomes on a recorded drive beside our attack with the same parameters on our filter.

A log may hold the outcomes of the study of Shen et al. (USENIX Security 2020) on its trace,
``fusion_ripper_outcomes.csv``: one line an attack, with the largest lateral deviation of the victim, a fusion of GNSS,
inertial unit and lidar. Ours has no lidar.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.fusion_ripper import FusionRipper
from spoofgym.attacks.profiles import NoAttack
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.travel import SIDES, lateral

OUTCOMES = "fusion_ripper_outcomes.csv"
PUBLISHED_SIDES = dict(zip(("lhs", "rhs"), SIDES, strict=True))
LIMITS = (0.895, 2.405)
"""Lateral deviations whose first crossing the study gives, m: touching the line of a lane and of a highway's."""
FOLLOWED, HELD, LOST = "follows", "holds", "is lost"
TOLERANCE = 0.05
"""Of the pull, within which a victim has followed it to its end."""


@dataclass(frozen=True)
class PublishedAttack:
    """A line of the published outcomes.

    Attributes:
        side: of the road, "left" or "right".
        profiling: time at which the constant offset begins, s.
        aggressive: time at which it begins to grow, s.
        d: the constant offset, m.
        f: growth per second.
        largest: lateral deviation of the victim, m.
        first_over: each of `LIMITS`, s; None = never.
    """

    side: str
    profiling: float
    aggressive: float
    d: float
    f: float
    largest: float
    first_over: tuple[float | None, ...]

    @property
    def growth(self) -> int:
        """Seconds of growth after which the offset is as large as the victim's largest deviation, rounded."""
        return round(math.log(max(self.largest, self.d) / self.d) / math.log(self.f))

    def outcome(self, seconds: int) -> str:
        """What became of the victim where the published attacks grow for so many seconds."""
        if self.first_over[-1] is None:
            return HELD
        end = self.d * self.f**seconds
        return FOLLOWED if abs(self.largest - end) <= TOLERANCE * end else LOST


def read_outcomes(folder: Path) -> list[PublishedAttack]:
    """The published outcomes in the folder of a log.

    Raises:
        ValueError: there are none, or a line lacks a number.
    """
    path = folder / OUTCOMES
    if not path.is_file():
        raise ValueError(f"{folder}: there is no {OUTCOMES}, the published outcomes on this drive")
    with files.reading(path), path.open(encoding="utf-8", newline="") as file:
        found = [_read(line, row) for line, row in enumerate(csv.DictReader(file), start=2)]
    if not found:
        raise ValueError(f"{path} holds no attack")
    return found


def _read(line: int, row: dict[str, str | None]) -> PublishedAttack:
    """One line of the file.

    Raises:
        ValueError: naming the line.
    """
    try:
        crossings = [row[f"first_over_{limit}_s"] for limit in LIMITS]
        return PublishedAttack(
            side=PUBLISHED_SIDES[str(row["side"])],
            profiling=float(row["profiling_start_s"] or ""),
            aggressive=float(row["aggressive_start_s"] or ""),
            d=float(row["d_m"] or ""),
            f=float(row["f"] or ""),
            largest=float(row["max_dev_m"] or ""),
            first_over=tuple(float(value) if value else None for value in crossings),
        )
    except (KeyError, ValueError) as error:
        raise ValueError(f"line {line} is no outcome: {error}") from error


@dataclass(frozen=True)
class Replayed:
    """What an attack does to our victim until its growth ends, along its side of the road, positive towards it.

    Attributes:
        pulled: largest difference to the estimate without the attack, m.
        error: of the estimate at that epoch, against the truth, m.
        departed: largest distance of the vehicle from where it is without the attack, towards the other side, m.
        first_over: times from the beginning of the growth until ``pulled`` exceeds each of `LIMITS`, s.
    """

    pulled: float
    error: float
    departed: float
    first_over: tuple[float | None, ...]


class Replay:
    """Plays published attacks on the filter of a log."""

    def __init__(self, scenario: Scenario) -> None:
        """Take the log, from before the first attack on, with its vehicle steered.

        Raises:
            ValueError: the vehicle never moves.
        """
        self._scenario = scenario
        epochs = scenario.timeline.steps[2]
        velocity = scenario.velocity_in_steps()
        self._across = {side: lateral(velocity, side)[epochs] for side in SIDES}
        self._time = scenario.timeline.times
        self._clean = self._played(NoAttack(), len(self._time) - 1)

    def of(self, attack: PublishedAttack, seconds: int) -> Replayed:
        """The same attack, ended after so many seconds of growth.

        Raises:
            ValueError: it lies outside the game.
        """
        wait, limit = attack.aggressive - attack.profiling, attack.d * attack.f**seconds
        ours = FusionRipper(attack.d, attack.f, wait, attack.side, limit, attack.profiling)
        last = int(np.searchsorted(self._time, attack.aggressive + seconds + 0.5)) - 1
        error, deviation = (self._along(series, attack.side) for series in self._played(ours, last))
        clean = [self._along(series[: last + 1], attack.side) for series in self._clean]
        pulled, departed = error - clean[0], clean[1] - deviation
        worst, since = int(pulled.argmax()), self._time[: last + 1] - attack.aggressive
        first_over = tuple(float(since[pulled > limit][0]) if (pulled > limit).any() else None for limit in LIMITS)
        return Replayed(float(pulled[worst]), float(error[worst]), float(departed.max()), first_over)

    def _along(self, series: Floats, side: str) -> Floats:
        """Components of vectors (n, 3) towards a side, (n,), m."""
        return np.asarray(np.add.reduce(series * self._across[side][: len(series)], axis=1))

    def _played(self, attack: Attack, last: int) -> tuple[Floats, Floats]:
        """Error of the estimate and deviation of the vehicle at epochs 0..last, (last + 1, 3) each, m ENU."""
        simulation = Simulation(self._scenario, attack, (), None, 1, 0, fidelity="strapdown")
        steering = simulation.steering
        assert steering is not None
        simulation.reset()
        simulation.resolve()
        errors, deviations = [simulation.error[0]], [steering.deviation[0]]
        for _ in range(last):
            simulation.observe()
            simulation.resolve()
            errors.append(simulation.error[0])
            deviations.append(steering.deviation[0])
        return np.array(errors), np.array(deviations)


def fusion_ripper_report(folder: Path, guidance: str, progress: Progress = silent) -> dict[str, Any]:
    """Published outcomes beside ours, in a row for each kind of outcome.

    Args:
        folder: of the log.
        guidance: of the vehicle.
        progress: shows what is played.

    Raises:
        ValueError: the log has no outcomes, or cannot be played from before the first attack on.
    """
    attacks = read_outcomes(folder)
    onset = min(attack.profiling for attack in attacks) - 1.0
    scenario = make_scenario(f"recorded:{folder},onset={onset!r},guidance={guidance}")
    growths = [attack.growth for attack in attacks if attack.first_over[-1] is not None]
    seconds = max(set(growths), key=growths.count) if growths else 0
    with progress("the clean log"):
        replay = Replay(scenario)
    played: dict[str, list[tuple[PublishedAttack, Replayed]]] = {name: [] for name in (FOLLOWED, HELD, LOST)}
    for place, attack in enumerate(attacks, start=1):
        with progress(f"attack {place} of {len(attacks)}"):
            played[attack.outcome(seconds)].append((attack, replay.of(attack, seconds)))
    return {
        "schema_version": 1,
        "kind": "fusion-ripper",
        "scenario": scenario.name,
        "growth_s": seconds,
        "rows": [_row(name, pairs) for name, pairs in played.items() if pairs],
    }


def _row(name: str, pairs: Sequence[tuple[PublishedAttack, Replayed]]) -> dict[str, Any]:
    """Medians over the attacks of one outcome, with the least and the largest of ours."""
    published, ours = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    return {
        "published_victim": name,
        "attacks": len(pairs),
        "offset_m": sorted({(attack.d, attack.f) for attack in published}),
        "published_largest_m": float(np.median([attack.largest for attack in published])),
        "pulled_m": _spread([each.pulled for each in ours]),
        "error_m": _spread([each.error for each in ours]),
        "departed_m": _spread([each.departed for each in ours]),
        "first_over": [
            {
                "limit_m": limit,
                "published_s": _median(_since(published, place)),
                "ours_s": _median(each.first_over[place] for each in ours),
            }
            for place, limit in enumerate(LIMITS)
        ],
    }


def _since(attacks: Sequence[PublishedAttack], place: int) -> Iterator[float | None]:
    """Times from the beginning of the growth until a limit is crossed, s."""
    for attack in attacks:
        crossing = attack.first_over[place]
        yield None if crossing is None else crossing - attack.aggressive


def _median(values: Iterator[float | None]) -> float | None:
    """Of those that there are; None where half or more are missing."""
    given = list(values)
    found = [value for value in given if value is not None]
    return float(np.median(found)) if 2 * len(found) > len(given) else None


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "least": float(min(values)), "most": float(max(values))}
