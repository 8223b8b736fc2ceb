"""A learned spoofer: a small network in NumPy, so that a policy can be used without torch and without a pickle."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.envs.config import SpooferConfig, configure
from spoofgym.envs.observation import Field

POLICY_FILE = "policy.npz"
CONFIG_FILE = "config.json"


@dataclass(frozen=True)
class LearnedSpoofer:
    """The mean action of a tanh network.

    Attributes:
        name: its run folder's name.
        config: the environment it was trained on.
        layout: the entries of the observation it was trained on, by name.
        weights: of each layer, (outputs, inputs).
        biases: of each layer, (outputs,).
    """

    name: str
    config: SpooferConfig
    layout: tuple[str, ...]
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions in [-1, 1] for observations (N, D), (N, 3)."""
        hidden = observation
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = np.tanh(hidden @ weight.T + bias)
        return np.clip(hidden @ self.weights[-1].T + self.biases[-1], -1.0, 1.0)

    def check_layout(self, fields: tuple[Field, ...]) -> None:
        """Refuse an environment whose observation has other entries.

        Raises:
            ValueError: naming the first entry that differs.
        """
        present = tuple(field.name for field in fields)
        if present == self.layout:
            return
        pairs = zip((*self.layout, *[None] * len(present)), (*present, *[None] * len(self.layout)), strict=False)
        place, (trained, found) = next((i, pair) for i, pair in enumerate(pairs) if pair[0] != pair[1])
        raise ValueError(
            f"policy {self.name!r} was trained for another observation: entry {place} was {trained!r} and is {found!r} "
            f"({len(self.layout)} entries trained, {len(present)} here)"
        )

    def save(self, folder: Path) -> None:
        """Write ``policy.npz`` (arrays only) into ``folder``."""
        arrays: dict[str, Any] = {"layout": np.array(self.layout)}
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"weight_{i}": weight, f"bias_{i}": bias}
        temporary = folder / f".{POLICY_FILE}"
        with temporary.open("wb") as file:
            np.savez(file, **arrays)
        temporary.replace(folder / POLICY_FILE)

    @classmethod
    def load(cls, folder: Path) -> LearnedSpoofer:
        """Read a run folder.

        Raises:
            FileNotFoundError: it holds no policy.
            ValueError: its files are damaged.
        """
        for name in (POLICY_FILE, CONFIG_FILE):
            if not (folder / name).is_file():
                raise FileNotFoundError(f"{folder} is no run folder: it has no {name}")
        try:
            config = configure(SpooferConfig, json.loads((folder / CONFIG_FILE).read_text())["environment"])
            with np.load(folder / POLICY_FILE, allow_pickle=False) as arrays:
                layers = sum(key.startswith("weight_") for key in arrays)
                return cls(
                    folder.resolve().name,
                    config,
                    tuple(str(name) for name in arrays["layout"]),
                    tuple(arrays[f"weight_{i}"] for i in range(layers)),
                    tuple(arrays[f"bias_{i}"] for i in range(layers)),
                )
        except (KeyError, TypeError, json.JSONDecodeError, OSError) as error:
            raise ValueError(f"{folder}: damaged run folder: {error}") from error
