"""Learned policies: small networks in NumPy. Using one needs neither torch nor a pickle.

A run folder may come from a stranger. It is arrays and text, both are read within limits, and a damaged file is
reported in one line that names it.
"""

from __future__ import annotations

import io
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.policies.card import CARD_FILE, Card, layout_digest, read_card, weights_digest
from spoofgym.policies.network import affine

POLICY_FILE = "policy.npz"
CONFIG_FILE = "config.json"
LARGEST_CONFIG = 2**20
"""Largest ``config.json`` that is read, bytes; a real one has about a thousand."""
SPOOFER, DEFENDER = "spoofer", "defender"
TOLD_BY = (
    ("defender", SPOOFER, "spoofgym/DuelSpoofer-v0"),
    ("spoofer", DEFENDER, "spoofgym/DuelDefender-v0"),
    ("knowledge", SPOOFER, "spoofgym/Spoofer-v0"),
    ("attacks", DEFENDER, "spoofgym/Defender-v0"),
)
"""The first argument found among those of an environment tells who plays there, and its id."""
SLOT_FIELD = "satellite in slot"
"""How the names of the entries begin that tell which slots hold a satellite."""


def read_config(folder: Path) -> dict[str, Any]:
    """Read ``config.json`` of a run folder.

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


def kind_of(configuration: Mapping[str, Any]) -> str:
    """Who was trained on an environment of this configuration: ``SPOOFER`` or ``DEFENDER``.

    Raises:
        ValueError: the configuration does not tell.
    """
    return _told(configuration)[0]


def environment_of(configuration: Mapping[str, Any]) -> str:
    """The id of the environment whose configuration this is.

    Raises:
        ValueError: the configuration does not tell.
    """
    return _told(configuration)[1]


def _told(configuration: Mapping[str, Any]) -> tuple[str, str]:
    for argument, kind, environment in TOLD_BY:
        if argument in configuration:
            return kind, environment
    names = ", ".join(argument for argument, *_ in TOLD_BY)
    raise ValueError(f"its environment has none of the arguments {names}: who plays is unknown")


@dataclass(frozen=True)
class LearnedPolicy:
    """A tanh network and what it was trained on.

    Attributes:
        kind: who plays, ``SPOOFER`` or ``DEFENDER``.
        folder: of the run or of the published agent; its name is the name of the policy.
        configuration: arguments of the environment that it was trained on, as plain values.
        layout: names of the entries of the observation that it was trained on, in order.
        weights: of each layer, (outputs, inputs).
        biases: of each layer, (outputs,).
    """

    kind: ClassVar[str]

    folder: Path
    configuration: Mapping[str, Any]
    layout: tuple[str, ...]
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.resolve().name

    def outputs(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the last layer gives for observations (N, D); a row of it depends on its own observation alone."""
        hidden = observation
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = np.tanh(affine(hidden, weight, bias))
        return affine(hidden, self.weights[-1], self.biases[-1])

    def check_layout(self, layout: Sequence[str]) -> None:
        """Refuse an observation that has other entries than the policy was trained on.

        Args:
            layout: names of the entries, in order.

        Raises:
            ValueError: naming the first entry that differs.
        """
        present = tuple(layout)
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
            ValueError: a file is damaged, or the policy plays the other side.
        """
        configuration = _configuration(folder)
        with files.reading(described_by(folder)):
            kind = kind_of(configuration)
        if kind != cls.kind:
            raise ValueError(f"{folder} is the run folder of a {kind}, not of a {cls.kind}")
        path = folder / POLICY_FILE
        arrays = read_arrays(path)
        with files.reading(path):
            policy = cls(folder, configuration, *network_of(arrays))
            policy.check_outputs()
        if (folder / CARD_FILE).is_file():
            policy.check_card(read_card(folder))
        return policy

    @property
    def weights_digest(self) -> str:
        """Digest of the weights and biases: equal for equal policies."""
        return weights_digest((*self.weights, *self.biases))

    def check_card(self, card: Card) -> None:
        """Refuse the card of another policy.

        Raises:
            ValueError: its layout or its weights are not those of this policy.
        """
        pairs = {
            "layout": (card.layout_digest, layout_digest(self.layout)),
            "weights": (card.weights_digest, self.weights_digest),
        }
        for what, (told, found) in pairs.items():
            if told != found:
                raise ValueError(
                    f"{self.folder / CARD_FILE} is the card of another policy: its {what} have the digest "
                    f"{told[:12]}, those of {POLICY_FILE} have {found[:12]}"
                )

    def check_outputs(self) -> None:
        """Refuse a network whose last layer is not that of the player.

        Raises:
            ValueError: naming the number of its outputs.
        """
        raise NotImplementedError


def described_by(folder: Path) -> Path:
    """The file that tells what a policy was trained on: the card, where there is one, else that of the run."""
    card = folder / CARD_FILE
    return card if card.is_file() else folder / CONFIG_FILE


def _configuration(folder: Path) -> dict[str, Any]:
    """The arguments of the environment of a folder that holds a policy: a run, or a published agent with its card.

    Raises:
        FileNotFoundError: it holds no policy.
        ValueError: ``config.json`` or ``card.json`` is damaged.
    """
    if (folder / POLICY_FILE).is_file() and (folder / CARD_FILE).is_file():
        return dict(read_card(folder).arguments)
    for name in (POLICY_FILE, CONFIG_FILE):
        if not (folder / name).is_file():
            raise FileNotFoundError(f"{folder} is no run folder: it has no {name}")
    environment: dict[str, Any] = read_config(folder)["environment"]
    return environment


def network_of(arrays: Mapping[str, NDArray[Any]]) -> tuple[tuple[str, ...], tuple[Any, ...], tuple[Any, ...]]:
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

    kind = SPOOFER

    def check_outputs(self) -> None:
        """Refuse a network that gives neither three nor four rates.

        Raises:
            ValueError: naming the number of its outputs.
        """
        if len(self.biases[-1]) not in (3, 4):
            raise ValueError(f"a spoofer's network has 3 or 4 outputs, this one {len(self.biases[-1])}")

    def with_shadow(self, shadow: str | None) -> Self:
        """This policy with a shadow filter of another scenario (None: the victim's own); a blind one has none."""
        if self.configuration.get("knowledge") == "blind":
            return self
        return replace(self, configuration={**self.configuration, "shadow": shadow})

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions in [-1, 1] for observations (N, D), (N, 3), or (N, 4) where the filter takes ranges."""
        return np.clip(self.outputs(observation), -1.0, 1.0)


class LearnedDefender(LearnedPolicy):
    """A defender that plays the likeliest action.

    Two outputs of its network are of use and exclude, D of the depth and, where the filter takes ranges, two of each
    slot.
    """

    kind = DEFENDER

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


def load_policy(folder: Path) -> LearnedSpoofer | LearnedDefender:
    """Read a run folder, whoever plays.

    Raises:
        FileNotFoundError: it holds no policy.
        ValueError: a file is damaged, or does not tell who plays.
    """
    configuration = _configuration(folder)
    with files.reading(described_by(folder)):
        kind = kind_of(configuration)
    return LearnedSpoofer.load(folder) if kind == SPOOFER else LearnedDefender.load(folder)
