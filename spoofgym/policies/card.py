"""The card of a published policy: what it is, how it was trained, and what it is worth.

``card.json`` lies beside ``policy.npz``. It holds text and numbers only, is read within limits, and names the weights
by their digest, so that a card cannot stand beside another policy.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import files

CARD_FILE = "card.json"
LARGEST_CARD = 2**20
"""Bytes; a real one has a few thousand."""
SCHEMA_VERSION = 1
LICENCE = "MIT"


@dataclass(frozen=True)
class Score:
    """What a policy is worth against one opponent.

    Attributes:
        opponent: its specification.
        metric: what was measured: "mean undetected error", "mean error" or "harm".
        unit: of the value.
        value: mean over the games.
        interval: its 95 % interval.
        games: how many.
        seed: of game 0.
    """

    opponent: str
    metric: str
    unit: str
    value: float
    interval: tuple[float, float]
    games: int
    seed: int


@dataclass(frozen=True, kw_only=True)
class Card:
    """What is said of a published policy.

    Attributes:
        name: of the policy.
        role: "spoofer" or "defender".
        environment: id of the environment that it was trained on.
        arguments: of that environment, as plain values.
        layout_digest: of the names of the entries of its observation.
        weights_digest: of its weights.
        training: how it was trained: program, settings, steps, seed, version, date.
        scores: what it is worth.
        licence: of the policy.
        schema_version: of the card.
    """

    name: str
    role: str
    environment: str
    arguments: Mapping[str, Any]
    layout_digest: str
    weights_digest: str
    training: Mapping[str, Any]
    scores: tuple[Score, ...] = ()
    licence: str = LICENCE
    schema_version: int = field(default=SCHEMA_VERSION)

    def write(self, folder: Path) -> None:
        """Write the card, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        files.write_json(folder / CARD_FILE, asdict(self))


def layout_digest(layout: Sequence[str]) -> str:
    """Digest of the names of the entries of an observation, in order."""
    return hashlib.sha256(json.dumps(list(layout)).encode()).hexdigest()


def weights_digest(arrays: Sequence[NDArray[Any]]) -> str:
    """Digest of the arrays of a network, in order."""
    found = hashlib.sha256()
    for array in arrays:
        plain = np.ascontiguousarray(array, dtype="<f4")
        found.update(repr(plain.shape).encode() + plain.tobytes())
    return found.hexdigest()


def read_card(folder: Path) -> Card:
    """Read the card of a folder.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is damaged, of another version, or lacks an entry; naming the file and the entry.
    """
    path = folder / CARD_FILE
    if not path.is_file():
        raise FileNotFoundError(f"{folder} has no {CARD_FILE}")
    with files.reading(path):
        if path.stat().st_size > LARGEST_CARD:
            raise ValueError(f"it has more than {LARGEST_CARD} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ValueError("it is no card of a policy")
        version = content.get("schema_version")
        if version != SCHEMA_VERSION:
            raise ValueError(f"it is a card of version {version!r}; this program reads version {SCHEMA_VERSION}")
        return _card(content)


_TEXTS = ("name", "role", "environment", "layout_digest", "weights_digest", "licence")
_TABLES = ("arguments", "training")


def _card(content: dict[str, Any]) -> Card:
    known = {*_TEXTS, *_TABLES, "scores", "schema_version"}
    if set(content) != known:
        differing = ", ".join(sorted(set(content) ^ known))
        raise ValueError(f"entries are missing or unknown: {differing}")
    for name in _TEXTS:
        if not isinstance(content[name], str) or not content[name]:
            raise ValueError(f"{name} must be text, got {content[name]!r}")
    for name in _TABLES:
        if not isinstance(content[name], dict):
            raise ValueError(f"{name} must be a table, got {content[name]!r}")
    if not isinstance(content["scores"], list):
        raise ValueError(f"scores must be a list, got {content['scores']!r}")
    scores = tuple(_score(given) for given in content["scores"])
    return Card(**{**content, "scores": scores})


def _score(given: Any) -> Score:
    names = set(Score.__dataclass_fields__)
    if not isinstance(given, dict) or set(given) != names:
        raise ValueError(f"a score has the entries {', '.join(sorted(names))}, got {given!r}")
    numbers = [given["value"], *given["interval"]] if isinstance(given["interval"], list) else []
    whole = (given["games"], given["seed"])
    right = len(numbers) == 3 and all(isinstance(n, int | float) and np.isfinite(n) for n in numbers)
    right &= all(isinstance(n, int) and not isinstance(n, bool) and n >= 0 for n in whole)
    right &= all(isinstance(given[name], str) for name in ("opponent", "metric", "unit"))
    if not right:
        raise ValueError(f"a score holds an entry of another kind: {given!r}")
    return Score(**{**given, "interval": (float(numbers[1]), float(numbers[2]))})
