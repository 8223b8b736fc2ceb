"""The state from which a learner goes on: tensors and numbers, read by a loader that builds nothing else."""

from __future__ import annotations

import io
import zipfile
from collections import deque
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO

from spoofgym import files

LARGEST = 256 * 2**20
"""Bytes that a checkpoint may unpack to; that of a policy with the widest layers has less."""
GAMES = 100
"""The last games of a learner, by which it is compared with others; as many as Stable-Baselines3 keeps."""
State = dict[str, Any]


def learner_state(learner: PPO) -> State:
    """A copy of all that decides how a learner goes on, without its random numbers: every leg draws new ones."""
    policy = learner.policy
    moments = {
        name: {key: value.detach().clone() for key, value in policy.optimizer.state[parameter].items()}
        for name, parameter in policy.named_parameters()
        if policy.optimizer.state.get(parameter)
    }
    games = [[float(game["r"]), float(game["l"])] for game in learner.ep_info_buffer or ()]
    return {
        "steps": learner.num_timesteps,
        "weights": {name: value.detach().clone() for name, value in policy.state_dict().items()},
        "moments": moments,
        "games": torch.tensor(games, dtype=torch.float64).reshape(-1, 2),
    }


def check(learner: PPO, state: Any) -> None:
    """Refuse a state that no learner of this run can have.

    Raises:
        ValueError: the state is of another network, or a number in it is not finite.
    """
    policy = learner.policy
    _check_tensors("weights", state["weights"], policy.state_dict())
    parameters = dict(policy.named_parameters())
    for name, moments in state["moments"].items():
        if name not in parameters:
            raise ValueError(f"moments of {name!r}, which the network does not have")
        wanted = {"step": torch.zeros(()), "exp_avg": parameters[name], "exp_avg_sq": parameters[name]}
        _check_tensors(f"moments of {name!r}", moments, wanted)
    games = state["games"]
    if games.dim() != 2 or games.shape[1] != 2 or len(games) > GAMES or not bool(torch.isfinite(games).all()):
        raise ValueError(f"games have shape {tuple(games.shape)}")
    whole(state["steps"])


def restore(learner: PPO, state: State) -> None:
    """Put a learner where a state was taken, which `check` has accepted."""
    policy = learner.policy
    policy.load_state_dict(state["weights"])
    policy.optimizer.state.clear()
    for name, parameter in policy.named_parameters():
        if name in state["moments"]:
            moments = state["moments"][name]
            policy.optimizer.state[parameter] = {key: value.clone() for key, value in moments.items()}
    learner.num_timesteps = state["steps"]
    games = ({"r": gain, "l": length} for gain, length in state["games"].tolist())
    learner.ep_info_buffer, learner.ep_success_buffer = deque(games, maxlen=GAMES), deque(maxlen=GAMES)


def mean_gain(state: State) -> float:
    """Mean return of the last games of a learner, or 0 before any has ended."""
    games = state["games"]
    return float(games[:, 0].mean()) if len(games) else 0.0


def whole(value: Any) -> int:
    """A number of steps of a checkpoint.

    Raises:
        ValueError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"a number of steps is a whole number, 0 or more, got {value!r}")
    return value


def save(path: Path, content: State) -> None:
    """Write a checkpoint whole or not at all."""
    packed = io.BytesIO()
    torch.save(content, packed)
    files.write_bytes(path, packed.getvalue())


def load(path: Path) -> State:
    """Read a checkpoint: tensors, numbers, text, lists and dictionaries, nothing else.

    Raises:
        ValueError: it is damaged, or too large to be one.
    """
    with files.reading(path):
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
            if size > LARGEST:
                raise ValueError(f"it unpacks to {size} bytes, a checkpoint to {LARGEST} at most")
            spoilt = archive.testzip()  # PyTorch itself does not look at the checksums
        if spoilt is not None:
            raise ValueError(f"the checksum of {spoilt} is wrong")
        content = torch.load(path, weights_only=True, map_location="cpu")
        if not isinstance(content, dict):
            raise ValueError(f"expected a dictionary, got {type(content).__name__}")
        return content


def _check_tensors(what: str, given: Any, wanted: dict[str, Any]) -> None:
    if not isinstance(given, dict) or set(given) != set(wanted):
        raise ValueError(f"{what} have other names than the run's network")
    for name, value in given.items():
        if not isinstance(value, torch.Tensor) or value.shape != wanted[name].shape:
            raise ValueError(f"{what}: {name} has another shape than in the run's network")
        if value.dtype != wanted[name].dtype or not bool(torch.isfinite(value).all()):
            raise ValueError(f"{what}: {name} must hold finite numbers of type {wanted[name].dtype}")
