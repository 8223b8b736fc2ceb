"""What a defender's delay costs on the road: every spoofed fix is left out, but only so long after the first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks import make_attack
from spoofgym.evaluation.departure_rows import departure_entry
from spoofgym.evaluation.departures import Departures, departures_of, joined
from spoofgym.evaluation.episodes import SimulationBatch, play
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

OWNER = "delay"
BATCH = 1000
LONGEST = 10_000
"""Epochs: as many filters are kept to be taken back to."""


class LateDefender:
    """Knows which fixes are spoofed, and leaves them out from some epochs after the first one on."""

    def __init__(self, delay: int, takes_back: bool, num_runs: int) -> None:
        """Begin games.

        Args:
            delay: from the first spoofed fix to the first that is left out, epochs.
            takes_back: whether the spoofed fixes that were used before are taken back then.
            num_runs: N.
        """
        self._delay, self._takes_back = delay, takes_back
        self._spoofed = np.zeros(num_runs, dtype=np.int64)

    def decide(self, simulation: Simulation) -> Flags:
        """Resolve the present epoch; which runs leave its fix out, (N,)."""
        attacked = simulation.attacked
        out = attacked & (self._spoofed >= self._delay)
        first = attacked & (self._spoofed == self._delay)
        self._spoofed += attacked
        simulation.resolve(Decision(~out, np.where(first, self._delay, 0) if self._takes_back else None))
        return out


@dataclass(frozen=True)
class _Noted:
    """Of a batch of games: the largest error of each, (n,), m, and what the vehicles did."""

    largest_error: Floats
    departures: Departures | None


class _Record:
    """Notes the largest error of each game."""

    def __init__(self, batch: SimulationBatch) -> None:
        self._batch, self._largest = batch, np.zeros(batch.simulation.num_runs)

    def before(self, epoch: int) -> None:
        """Note nothing."""

    def after(self, epoch: int) -> None:
        """Note the error that the decision has left."""
        self._largest = np.maximum(self._largest, self._batch.error)

    def result(self) -> _Noted:
        """All games of the batch."""
        return _Noted(self._largest, departures_of(self._batch.simulation))


def delay_reports(
    scenario: Scenario,
    attacks: Sequence[str],
    delays: Sequence[float],
    episodes: int,
    seed: int,
    threads: int = 1,
    progress: Progress = silent,
) -> Iterator[dict[str, Any]]:
    """A report after every row; the last one has all.

    Args:
        scenario: with guidance.
        attacks: specifications.
        delays: from the first spoofed fix to the first that is left out, s, rounded to epochs.
        episodes: games of each row.
        seed: of game 0.
        threads: of the simulation.
        progress: shows what is played.

    Raises:
        ValueError: the vehicle keeps its path, a delay that is negative, or what `Simulation` refuses.
    """
    if scenario.guidance is None:
        raise ValueError(
            f"scenario {scenario.name!r}: a delay costs metres on the road where the vehicle is steered by its "
            "estimate: add guidance=first-order:2"
        )
    interval = scenario.timeline.interval
    given = [validation.non_negative(OWNER, "delay", delay, LONGEST * interval) for delay in delays]
    rows: list[dict[str, Any]] = []
    for attack in attacks:
        for delay in given:
            for takes_back in (False, True):
                epochs = round(delay / interval)
                with progress(f"{attack}, {delay:g} s"):
                    noted = _played(scenario, attack, epochs, takes_back, episodes, seed, threads)
                rows.append({"attack": attack, "delay_s": epochs * interval, "takes_back": takes_back, **noted})
                yield {
                    "schema_version": 1,
                    "kind": "delay",
                    "scenario": scenario.name,
                    "episodes": episodes,
                    "seed": seed,
                    "rows": list(rows),
                }


def _played(
    scenario: Scenario, attack: str, delay: int, takes_back: bool, episodes: int, seed: int, threads: int
) -> dict[str, Any]:
    """The figures of a row."""
    demands = Demands(excludes=True, history=delay + 1)

    def make(streams: RunStreams) -> SimulationBatch:
        made = make_attack(attack)
        fidelity = scenario.fidelities[0]
        simulation = Simulation(
            scenario, made, (), None, len(streams), fidelity=fidelity, threads=threads, demands=demands, streams=streams
        )
        return SimulationBatch(simulation, LateDefender(delay, takes_back, len(streams)).decide)

    parts = play(make, _Record, episodes, seed, BATCH)
    largest = np.concatenate([part.largest_error for part in parts])
    return {
        "largest_error_m": float(largest.mean()),
        **departure_entry(joined([part.departures for part in parts])),
    }
