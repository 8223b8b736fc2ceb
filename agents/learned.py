"""Learned players: small networks in NumPy, so that a policy can be used without torch and without a pickle."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.envs.observation import Field
from spoofgym.envs.range_features import SLOT_FIELD

POLICY_FILE = "policy.npz"
CONFIG_FILE = "config.json"


@dataclass(frozen=True)
class LearnedPolicy:
    """A tanh network and what it was trained on.

    Attributes:
        name: its run folder's name.
        config: the environment it was trained on, a ``config_type``.
        layout: the entries of the observation it was trained on, by name.
        weights: of each layer, (outputs, inputs).
        biases: of each layer, (outputs,).
    """

    config_type: ClassVar[type]

    name: str
    config: Any
    layout: tuple[str, ...]
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]

    def outputs(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the last layer gives for observations (N, D)."""
        hidden = observation
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = np.tanh(hidden @ weight.T + bias)
        return hidden @ self.weights[-1].T + self.biases[-1]

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
    def load(cls, folder: Path) -> Self:
        """Read a run folder.

        Raises:
            FileNotFoundError: it holds no policy.
            ValueError: its files are damaged.
        """
        for name in (POLICY_FILE, CONFIG_FILE):
            if not (folder / name).is_file():
                raise FileNotFoundError(f"{folder} is no run folder: it has no {name}")
        try:
            config: Any = configure(cls.config_type, json.loads((folder / CONFIG_FILE).read_text())["environment"])
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


class LearnedSpoofer(LearnedPolicy):
    """A spoofer that plays the mean action of its network."""

    config_type = SpooferConfig

    def with_shadow(self, shadow: str | None) -> Self:
        """The same policy with a shadow filter of another scenario (None: the victim's own); a blind one has none."""
        if self.config.knowledge == "blind":
            return self
        return replace(self, config=replace(self.config, shadow=shadow))

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions in [-1, 1] for observations (N, D), (N, 3), or (N, 4) where the filter takes ranges."""
        return np.clip(self.outputs(observation), -1.0, 1.0)


class LearnedDefender(LearnedPolicy):
    """A defender that plays the likeliest action.

    Two outputs of its network are of use and exclude, D of the depth and, where the filter takes ranges, two of each
    slot.
    """

    config_type = DefenderConfig

    @property
    def slots(self) -> int:
        """S, slots of satellites that it was trained on; 0 where the filter takes fixes."""
        return sum(name.startswith(SLOT_FIELD) for name in self.layout)

    @property
    def depths(self) -> int:
        """D, entries of the depth table that it was trained on."""
        return len(self.biases[-1]) - 2 - 2 * self.slots

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions for observations (N, D), (N, 2 + S)."""
        ends = np.cumsum([2, self.depths, *[2] * self.slots])[:-1]
        parts = np.split(self.outputs(observation), ends, axis=1)
        return np.stack([part.argmax(axis=1) for part in parts], axis=1)
