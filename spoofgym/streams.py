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

PURPOSES = ("initial", "imu", "receiver", "tracking", "opponent", "memory", "confounders")


class RunStreams:
    """The generators of a batch of runs, made when first asked for.

    A child depends on its parent's seed sequence and its purpose alone, never on the order in which children are asked
    for. It is the child that ``spawn`` would give at the purpose's place, so nobody else spawns from these parents.
    """

    def __init__(self, parents: Sequence[np.random.Generator]) -> None:
        """Keep the runs' own generators, in order."""
        self._parents = list(parents)
        self._children: dict[tuple[int, str], np.random.Generator] = {}

    @classmethod
    def from_seed(cls, seed: int | None, num_runs: int) -> RunStreams:
        """Streams of runs seeded ``seed + i``, as Gymnasium seeds the lanes of a vector environment.

        Raises:
            ValueError: the seed is negative or no integer, or there is no run, or too many.
        """
        seed = validation.seed("random streams", seed)
        num_runs = validation.runs("random streams", "num_runs", num_runs)
        seeds = [None] * num_runs if seed is None else [seed + i for i in range(num_runs)]
        return cls([np.random.Generator(np.random.PCG64(np.random.SeedSequence(s))) for s in seeds])

    def __len__(self) -> int:
        return len(self._parents)

    def replace(self, run: int, parent: np.random.Generator) -> None:
        """Give a run a new generator; its children start anew."""
        self._parents[run] = parent
        for purpose in PURPOSES:
            self._children.pop((run, purpose), None)

    def __call__(self, run: int, purpose: str) -> np.random.Generator:
        """The generator of one run for one purpose.

        Raises:
            ValueError: unknown purpose.
        """
        child = self._children.get((run, purpose))
        if child is None:
            if purpose not in PURPOSES:
                valid = ", ".join(PURPOSES)
                raise ValueError(f"unknown purpose {purpose!r} of a random stream; valid purposes: {valid}")
            sequence = cast(np.random.SeedSequence, self._parents[run].bit_generator.seed_seq)
            key = (*sequence.spawn_key, PURPOSES.index(purpose))
            child = np.random.Generator(np.random.SFC64(np.random.SeedSequence(sequence.entropy, spawn_key=key)))
            self._children[run, purpose] = child
        return child
