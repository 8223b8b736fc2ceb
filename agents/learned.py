"""Learned players: small networks in NumPy, so that a policy can be used without torch and without a pickle.

A run folder may come from a stranger: it is arrays and text, read within limits, and whatever is wrong with a file is
told in one line that names it.
"""

from __future__ import annotations

import io
import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.envs.observation import Field
from spoofgym.envs.range_features import SLOT_FIELD

POLICY_FILE = "policy.npz"
CONFIG_FILE = "config.json"
LARGEST_CONFIG = 2**20
"""Bytes of a ``config.json``; a real one has about a thousand."""
PLAYERS: dict[type, tuple[str, str]] = {
    SpooferConfig: ("a spoofer", "knowledge"),
    DefenderConfig: ("a defender", "attacks"),
}
"""Who is trained on an environment, and an argument that no other environment has."""


def read_config(folder: Path) -> dict[str, Any]:
    """What ``config.json`` of a run folder says.

    Raises:
        ValueError: it is damaged.
    """
    path = folder / CONFIG_FILE
    with files.reading(path):
        if path.stat().st_size > LARGEST_CONFIG:
            raise ValueError(f"it has more than {LARGEST_CONFIG} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict) or not isinstance(content.get("environment"), dict):
            raise ValueError("it does not say what the environment is")
        return content


def environment_of(kind: type, content: Mapping[str, Any], path: Path) -> Any:
    """The environment that a configuration file names, a ``kind``.

    Raises:
        ValueError: the run trains another player, or an argument is unknown or of another type.
    """
    arguments = content["environment"]
    for other, (player, argument) in PLAYERS.items():
        if other is not kind and argument in arguments and PLAYERS[kind][1] not in arguments:
            raise ValueError(f"{path.parent} is the run folder of {player}, not of {PLAYERS[kind][0]}")
    with files.reading(path):
        for name, value in arguments.items():
            _check_specification(name, value)
        return configure(kind, arguments)


def _check_specification(name: str, value: object) -> None:
    """A part of a run is named by its specification, or several by a list of them."""
    if name in ("detector", "detectors", "attacks") and isinstance(value, list):
        right = bool(value) and all(isinstance(item, str) for item in value)
    elif name in ("scenario", "detector", "detectors", "attacks", "response", "fidelity"):
        right = isinstance(value, str)
    elif name == "shadow":
        right = value is None or isinstance(value, str)
    else:
        return
    if not right:
        raise ValueError(f"{name} must be named by a specification, got {value!r}")


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

    def check_like(self, other: LearnedPolicy) -> None:
        """Refuse a network whose layers are not shaped as those of another one, or hold a number that is not finite.

        Raises:
            ValueError: it is none.
        """
        mine, wanted = ((*policy.weights, *policy.biases) for policy in (self, other))
        if [array.shape for array in mine] != [array.shape for array in wanted]:
            raise ValueError(f"policy {self.name!r} is another network than that of {other.name!r}")
        if not all(array.dtype == np.float32 and np.isfinite(array).all() for array in mine):
            raise ValueError(f"policy {self.name!r} must hold finite numbers of type float32")

    def save(self, folder: Path) -> None:
        """Write ``policy.npz`` (arrays only) into ``folder``, whole or not at all."""
        arrays: dict[str, Any] = {"layout": np.array(self.layout)}
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"weight_{i}": weight, f"bias_{i}": bias}
        packed = io.BytesIO()
        np.savez(packed, **arrays)
        files.write_bytes(folder / POLICY_FILE, packed.getvalue())

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Read a run folder.

        Raises:
            FileNotFoundError: it holds no policy.
            ValueError: a file is damaged, or the policy is of another player.
        """
        for name in (POLICY_FILE, CONFIG_FILE):
            if not (folder / name).is_file():
                raise FileNotFoundError(f"{folder} is no run folder: it has no {name}")
        config = environment_of(cls.config_type, read_config(folder), folder / CONFIG_FILE)
        path = folder / POLICY_FILE
        arrays = read_arrays(path)
        with files.reading(path):
            policy = cls(folder.resolve().name, config, *_network(arrays))
            policy.check_outputs()
        return policy

    def check_outputs(self) -> None:
        """Refuse a network whose last layer is not that of the player.

        Raises:
            ValueError: naming the number of its outputs.
        """
        raise NotImplementedError


def _network(arrays: Mapping[str, NDArray[Any]]) -> tuple[tuple[str, ...], tuple[Any, ...], tuple[Any, ...]]:
    """Layout, weights and biases of a saved policy.

    Raises:
        ValueError: an array is missing or unknown, of another type or shape, or not finite.
    """
    layers = (len(arrays) - 1) // 2
    names = {"layout", *(f"{kind}_{i}" for kind in ("weight", "bias") for i in range(layers))}
    if layers < 1 or set(arrays) != names:
        raise ValueError(f"it holds the arrays {', '.join(sorted(arrays))}, which are not those of a policy")
    layout = arrays["layout"]
    if layout.ndim != 1 or layout.dtype.kind != "U":
        raise ValueError("layout must be names")
    weights = [arrays[f"weight_{i}"] for i in range(layers)]
    biases = [arrays[f"bias_{i}"] for i in range(layers)]
    for name, array in arrays.items():
        if name != "layout" and (array.dtype != np.float32 or not np.isfinite(array).all()):
            raise ValueError(f"{name} must hold finite numbers of type float32")
    widths = [len(layout), *(len(bias) if bias.ndim == 1 else -1 for bias in biases)]
    for i, (inputs, outputs) in enumerate(itertools.pairwise(widths)):
        if weights[i].shape != (outputs, inputs):
            raise ValueError(f"weight_{i} has shape {weights[i].shape}, its neighbours need ({outputs}, {inputs})")
    return tuple(str(name) for name in layout), tuple(weights), tuple(biases)


class LearnedSpoofer(LearnedPolicy):
    """A spoofer that plays the mean action of its network."""

    config_type = SpooferConfig

    def check_outputs(self) -> None:
        """Refuse a network that gives neither three nor four rates.

        Raises:
            ValueError: naming the number of its outputs.
        """
        if len(self.biases[-1]) not in (3, 4):
            raise ValueError(f"a spoofer's network has 3 or 4 outputs, this one {len(self.biases[-1])}")

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

    def check_outputs(self) -> None:
        """Refuse a network that has no depth to choose.

        Raises:
            ValueError: naming the number of its outputs.
        """
        if self.depths < 1:
            raise ValueError(f"a defender's network has more outputs than {len(self.biases[-1])}")

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
