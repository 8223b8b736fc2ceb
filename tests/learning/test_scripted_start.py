"""A spoofer that begins with a scripted attack: the attack is followed, taught, and the best of them is taken."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from gymnasium.vector import AutoresetMode

from spoofgym.envs.config import arguments_of
from spoofgym.envs.duel_config import DuelConfig, DuelSpooferConfig
from spoofgym.envs.vector import DuelSpooferVectorEnv
from spoofgym.evaluation.duels import play_cell
from spoofgym.learning import scripted_start, spoofer
from spoofgym.learning.ppo import SCRIPTED_START, Settings, export, make_learner
from spoofgym.learning.run_folder import given_options
from spoofgym.learning.scripted_start import FEW, OPTIMAL, SCRIPTED, Follower, begin, best_attack

DRIVE = DuelSpooferConfig(
    scenario="foi-drive:horizon=60",
    detectors=("windowed:n=5,threshold=60",),
    defender="windowed:n=5,threshold=60 > exclude",
    knowledge="full",
    clean=0.0,
    outage=0.0,
    multipath=0.0,
)


def lanes(number: int) -> DuelSpooferVectorEnv:
    """Lanes of the game."""
    return DuelSpooferVectorEnv(number, autoreset_mode=AutoresetMode.SAME_STEP, **arguments_of(DRIVE))


def harm(vector: DuelSpooferVectorEnv, act, seed: int) -> np.ndarray:
    """Harm of one game of every lane."""
    observation, _ = vector.reset(seed=seed)
    total = np.zeros(vector.num_envs)
    for _ in range(vector.game.scenario.timeline.num_epochs):
        observation, reward, *_ = vector.step(act(observation))
        total += reward
    return total


@pytest.mark.parametrize("attack", ["ramp:0.5", "unseen:16", "closed-form:4"])
def test_an_attack_is_followed_to_the_last_epoch(attack: str) -> None:
    vector = lanes(8)
    follower = Follower(attack, vector)
    followed = harm(vector, lambda _: follower.act(), 3)
    arguments = {name: value for name, value in arguments_of(DRIVE).items() if name != "defender"}
    played = play_cell(DuelConfig(**arguments), attack, str(DRIVE.defender), 8, 3)
    np.testing.assert_allclose(followed, played.harm, rtol=1e-6)


def test_a_jump_is_followed_as_fast_as_the_spoofer_may_drag() -> None:
    vector = lanes(2)
    vector.reset(seed=0)
    follower = Follower("jump:20", vector)
    assert np.abs(follower.act()).max() == 1.0
    reach = np.abs(vector.game.scenario.drag_off_rate) * vector.game.scenario.timeline.interval
    vector.step(follower.act())
    assert (np.abs(vector.game.seat.offset[:, :3]) <= reach + 1e-12).all()


def test_the_attack_that_harms_most_is_taken() -> None:
    vector = lanes(FEW)
    found = best_attack(vector, 5)
    harms = {}
    for attack in (*SCRIPTED, *OPTIMAL):
        follower = Follower(attack, vector)
        harms[attack] = float(harm(vector, lambda _, follower=follower: follower.act(), 5).mean())
    assert harms[found] == max(harms.values())


def test_the_policy_is_taught_it_and_the_critic_its_return(tmp_path: Path) -> None:
    learner = make_learner(DRIVE, Settings(**{**SCRIPTED_START, "lanes": 32}), 0, tmp_path)
    before = learner.policy.log_std.detach().clone()
    attack = begin(learner, DRIVE, 2, 0)
    assert learner.num_timesteps == 0
    assert (learner.policy.log_std == before).all()
    assert all(parameter.requires_grad for parameter in learner.policy.parameters())
    vector = lanes(200)
    policy = export(learner, DRIVE, tmp_path)
    follower = Follower(attack, vector)
    wanted = harm(vector, lambda _: follower.act(), 7).mean()
    # the same games, so what differs is what was not learned; an untrained policy has a third of it
    assert harm(vector, lambda seen: np.clip(policy.act(seen), -1.0, 1.0), 7).mean() > 0.8 * wanted


def test_a_run_that_is_scripted_says_so_in_its_settings(tmp_path: Path) -> None:
    given = ["--scripted", "--defender", "exclude", "--lanes", "8"]
    run = spoofer.asked_run(given_options(spoofer.parser().parse_args(given)))
    assert run.learner == Settings(**{**SCRIPTED_START, "lanes": 8})
    assert spoofer.asked_run(given_options(spoofer.parser().parse_args(given[1:]))).learner == Settings(lanes=8)


def test_the_start_is_the_same_whenever_it_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scripted_start, "SCRIPTED", ("ramp:0.5",))
    monkeypatch.setattr(scripted_start, "OPTIMAL", ())
    weights = []
    for _ in range(2):
        learner = make_learner(DRIVE, Settings(**{**SCRIPTED_START, "lanes": 8}), 0, tmp_path)
        begin(learner, DRIVE, 1, 0)
        weights.append([parameter.detach().numpy().copy() for parameter in learner.policy.parameters()])
    for one, two in zip(*weights, strict=True):
        np.testing.assert_array_equal(one, two)
