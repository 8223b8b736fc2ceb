"""Random streams: one generator per run and purpose.

Run i of a batch draws from children of its own generator only, so that it is bit-identical for any number of runs and
threads. The purposes are separate streams and every episode takes blocks of a fixed size from them, so that two
attackers on the same seed meet the same noise, in this episode and in the later ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from spoofgym import validation

PURPOSES = (
    *("initial", "imu", "receiver", "tracking", "opponent", "memory", "confounders", "defender", "aids", "rare events"),
    "receiver flag",
)


class RunStreams:
    """The generators of a batch of runs, made when first asked for.

    A child depends on its parent's seed sequence and its purpose alone, never on the order in which children are asked
    for. It is the child that ``spawn`` would give at the purpose's place, so nobody else spawns from these parents.

    Seed sequences are kept beside the generators, because NumPy before 2.0 leaves them out of copies of a generator.
    """

    def __init__(self, parents: Sequence[np.random.Generator]) -> None:
        """Take the seed sequences of the runs' own generators, in order."""
        self._sequences = [_sequence(parent) for parent in parents]
        self._children: dict[tuple[int, str], tuple[np.random.SeedSequence, np.random.Generator]] = {}

    @classmethod
    def from_seed(cls, seed: int | None, num_runs: int) -> RunStreams:
        """Streams of runs seeded ``seed + i``, as Gymnasium seeds the lanes of a vector environment.

        Raises:
            ValueError: the seed is negative or no integer, or there is no run, or too many.
        """
        seed = validation.seed("random streams", seed)
        num_runs = validation.runs("random streams", "num_runs", num_runs)
        seeds = [None] * num_runs if seed is None else [seed + i for i in range(num_runs)]
        streams = cls([])
        streams._sequences = [np.random.SeedSequence(s) for s in seeds]
        return streams

    def __len__(self) -> int:
        return len(self._sequences)

    def replace(self, run: int, parent: np.random.Generator) -> None:
        """Give a run a new generator; its children start anew."""
        self._sequences[run] = _sequence(parent)
        for purpose in PURPOSES:
            self._children.pop((run, purpose), None)

    def __call__(self, run: int, purpose: str) -> np.random.Generator:
        """The generator of one run for one purpose.

        Raises:
            ValueError: unknown purpose.
        """
        return self._child(run, purpose)[1]

    def spawn(self, run: int, purpose: str) -> np.random.Generator:
        """A new generator below the one of a run for a purpose, another one at each call.

        Raises:
            ValueError: unknown purpose.
        """
        return _generator(self._child(run, purpose)[0].spawn(1)[0])

    def _child(self, run: int, purpose: str) -> tuple[np.random.SeedSequence, np.random.Generator]:
        child = self._children.get((run, purpose))
        if child is None:
            if purpose not in PURPOSES:
                valid = ", ".join(PURPOSES)
                raise ValueError(f"unknown purpose {purpose!r} of a random stream; valid purposes: {valid}")
            parent = self._sequences[run]
            key = (*parent.spawn_key, PURPOSES.index(purpose))
            sequence = np.random.SeedSequence(parent.entropy, spawn_key=key)
            child = self._children[run, purpose] = sequence, _generator(sequence)
        return child


def given_streams(owner: str, seed: int | None, streams: RunStreams | None, num_runs: int) -> RunStreams:
    """The given random streams, or those of a seed where none are given.

    Args:
        owner: whose arguments, for messages.
        seed: of run 0; None = fresh entropy.
        streams: of ``num_runs`` runs; None = those of the seed.
        num_runs: N.

    Raises:
        ValueError: both are given, or streams of another number of runs, or a seed that is none.
        TypeError: the streams are none.
    """
    if streams is None:
        return RunStreams.from_seed(validation.seed(owner, seed), num_runs)
    validation.instance(owner, "streams", streams, RunStreams, "random streams, or None")
    validation.at_most_one(owner, seed=seed, streams=streams)
    if len(streams) != num_runs:
        raise ValueError(f"{owner}: streams must be those of {num_runs} runs, got {len(streams)}")
    return streams


def _sequence(generator: np.random.Generator) -> np.random.SeedSequence:
    return cast(np.random.SeedSequence, generator.bit_generator.seed_seq)


def _generator(sequence: np.random.SeedSequence) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(sequence))
