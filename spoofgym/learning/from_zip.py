"""A policy of Stable-Baselines3 that somebody has saved as a zip, as plain arrays.

Such a zip holds pickled objects: to load it runs what is in it. So it must be a file of one's own; what comes out of it
holds arrays alone, and is safe to share.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import torch
from stable_baselines3 import PPO

from spoofgym import files
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.learning.ppo import arrays
from spoofgym.policies.learned import CONFIG_FILE, LearnedSpoofer

UNDERSTOOD = (torch.nn.Linear, torch.nn.Tanh)


def spoofer_of_zip(path: Path, config: SpooferConfig, folder: Path) -> LearnedSpoofer:
    """The spoofer of a PPO model, written into a folder.

    Args:
        path: of the zip, of one's own making.
        config: of the environment that it was trained on.
        folder: gets ``policy.npz`` and ``config.json``.

    Raises:
        ValueError: it is no PPO model, its network is not one that plain arrays hold, or it was trained on another
            environment.
        OSError: the folder cannot be written.
    """
    with files.reading(path):
        model = PPO.load(path, device="cpu")
    policy = model.policy
    layers = [*getattr(policy.mlp_extractor, "policy_net", ()), policy.action_net]
    odd = [type(layer).__name__ for layer in layers if not isinstance(layer, UNDERSTOOD)]
    if odd or type(policy.features_extractor).__name__ != "FlattenExtractor":
        raise ValueError(f"{path}: only an MlpPolicy of tanh layers can be exported, this one has {', '.join(odd)}")
    weights, biases = arrays(layers)
    game = SpooferGame(config, 1)
    layout = tuple(field.name for field in game.fields)
    rates = game.seat.space.shape[0]
    if (weights[0].shape[1], len(biases[-1])) != (len(layout), rates):
        raise ValueError(
            f"{path} takes {weights[0].shape[1]} numbers and gives {len(biases[-1])}; this environment shows "
            f"{len(layout)} and takes {rates}: name the scenario, detector and knowledge of its training"
        )
    files.check_folder(folder)
    found = LearnedSpoofer(folder, dict(vars(config)), layout, weights, biases)
    found.save(folder)
    run = {"environment": asdict(config), "learner": {}, "seed": model.seed or 0, "steps": model.num_timesteps}
    files.write_json(folder / CONFIG_FILE, run)
    return found
