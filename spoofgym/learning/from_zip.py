"""A policy of Stable-Baselines3 that somebody has saved as a zip, as plain arrays.

Such a zip may come from a stranger. Its pickled objects stay unread: the weights are tensors, which PyTorch reads
without running anything, and what is known of the network besides is text. Both are read within limits.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym import files
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.duel_config import DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelDefenderGame, DuelSpooferGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.envs.trained import PLAYERS, AnyConfig
from spoofgym.policies.learned import CONFIG_FILE, SPOOFER, LearnedDefender, LearnedSpoofer, network_of

DATA, WEIGHTS = "data", "policy.pth"
LARGEST = {DATA: 16 * 2**20, WEIGHTS: 256 * 2**20}
"""Bytes to which the parts that are read may unpack; those of the widest network have less."""
LAYER = re.compile(r"mlp_extractor\.policy_net\.(\d+)\.weight")
LAST = "action_net"
UNUSED = ("mlp_extractor.value_net.", "value_net.", "log_std")
"""How the names of tensors begin that have no part in the actions."""
TANH = "torch.nn.modules.activation.Tanh"
HARMLESS = (
    *("net_arch", "log_std_init", "ortho_init", "optimizer_class", "optimizer_kwargs", "share_features_extractor"),
    *("full_std", "use_expln", "normalize_images", "activation_fn"),
)
"""Arguments of a policy that change nothing of how it computes its actions, and its activation, which is looked at."""
OWN_CLASSES = ("stable_baselines3.", "sb3_contrib.")
ONLY = "only an MlpPolicy of tanh layers, as PPO and A2C have it, can be exported"
GAMES: dict[type, Callable[[Any, int], Any]] = {
    SpooferConfig: SpooferGame,
    DefenderConfig: DefenderGame,
    DuelSpooferConfig: DuelSpooferGame,
    DuelDefenderConfig: DuelDefenderGame,
}
Tensors = Mapping[str, NDArray[np.float32]]


def policy_of_zip(path: Path, config: AnyConfig, folder: Path) -> LearnedSpoofer | LearnedDefender:
    """The policy of a zip, written into a folder.

    Args:
        path: of the zip.
        config: of the environment that it was trained on.
        folder: gets ``policy.npz`` and ``config.json``.

    Raises:
        ValueError: it is no zip of Stable-Baselines3, its network is not one that plain arrays hold, or it was trained
            on another environment.
        OSError: the folder cannot be written.
    """
    with files.reading(path), zipfile.ZipFile(path) as archive:
        about = json.loads(_part(archive, DATA))
        tensors = _tensors(_part(archive, WEIGHTS))
        if not isinstance(about, dict):
            raise ValueError(f"{DATA} does not say what was saved")
    layers = _layers(path, about, tensors)
    game = GAMES[type(config)](config, 1)
    layout = tuple(field.name for field in game.fields)
    found, asked = (tensors[f"{layers[0]}.weight"].shape[1], len(tensors[f"{LAST}.bias"])), _outputs(game.seat.space)
    if found != (len(layout), asked):
        raise ValueError(
            f"{path} takes {found[0]} numbers and gives {found[1]}; {config.owner} shows {len(layout)} and takes "
            f"{asked} with these options: name the environment, and the scenario, detectors and knowledge of its "
            "training"
        )
    kind = LearnedSpoofer if PLAYERS[type(config)] == SPOOFER else LearnedDefender
    parts = [(part, place, layer) for place, layer in enumerate(layers) for part in ("weight", "bias")]
    arrays = {f"{part}_{place}": tensors[f"{layer}.{part}"] for part, place, layer in parts}
    with files.reading(path):
        policy = kind(folder, dict(vars(config)), *network_of({"layout": np.array(layout), **arrays}))
    files.check_folder(folder)
    policy.save(folder)
    run = {"environment": asdict(config), "learner": {}, "seed": _number(about, "seed")}
    files.write_json(folder / CONFIG_FILE, {**run, "steps": _number(about, "num_timesteps")})
    return policy


def _part(archive: zipfile.ZipFile, name: str) -> bytes:
    """A part of the zip, read within its limit.

    Raises:
        ValueError: there is none, or it is too large.
    """
    if name not in archive.namelist():
        raise ValueError(f"no zip of Stable-Baselines3: it holds no {name}")
    size = archive.getinfo(name).file_size
    if size > LARGEST[name]:
        raise ValueError(f"{name} unpacks to {size} bytes, more than are read")
    return archive.read(name)


def _tensors(content: bytes) -> dict[str, NDArray[np.float32]]:
    """The tensors of a saved policy, by their names; whatever else is pickled there is refused by PyTorch.

    Raises:
        Exception: it holds something else.
    """
    state = torch.load(io.BytesIO(content), weights_only=True, map_location="cpu")
    if not isinstance(state, dict) or not all(isinstance(value, torch.Tensor) for value in state.values()):
        raise ValueError(f"{WEIGHTS} holds something else than tensors")
    return {str(name): value.detach().to(torch.float32).numpy().copy() for name, value in state.items()}


def _layers(path: Path, about: Mapping[str, Any], tensors: Tensors) -> list[str]:
    """The names of the layers that make the actions, in order.

    Raises:
        ValueError: the network is none that plain arrays hold.
    """
    hidden = sorted(int(match[1]) for match in map(LAYER.fullmatch, tensors) if match)
    layers = [*(f"mlp_extractor.policy_net.{place}" for place in hidden), LAST]
    wanted = [f"{layer}.{part}" for layer in layers for part in ("weight", "bias")]
    odd = [name for name in tensors if name not in wanted and not name.startswith(UNUSED)]
    odd += [f"no {name}" for name in wanted if name not in tensors]
    given = about.get("policy_kwargs") or {}
    odd += [name for name in given if name not in HARMLESS and not name.startswith(":")]
    activation = str(given.get("activation_fn", TANH))
    odd += [] if TANH in activation else [activation]
    kept = about.get("policy_class")
    module = str(kept.get("__module__", "")) if isinstance(kept, dict) else ""
    odd += [] if module.startswith(OWN_CLASSES) else [f"a policy class of {module or 'nobody'}"]
    if odd:
        raise ValueError(f"{path}: {ONLY}; this one has {', '.join(odd[:5])}")
    return layers


def _outputs(space: spaces.Space[Any]) -> int:
    """How many numbers a network gives for an action: those of a box, or the choices of each part."""
    if isinstance(space, spaces.MultiDiscrete):
        return int(space.nvec.sum())
    assert isinstance(space, spaces.Box)
    return int(space.shape[0])


def _number(about: Mapping[str, Any], name: str) -> int:
    value = about.get(name)
    return value if isinstance(value, int) else 0
