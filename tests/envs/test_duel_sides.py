"""One play is one play, through whichever view: the duel, its sides, Spoofer-v0 and Defender-v0."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import spoofgym  # noqa: F401 - registers the environments
from spoofgym import duel
from spoofgym.envs.vector import (
    DefenderVectorEnv,
    DuelDefenderVectorEnv,
    DuelSpooferVectorEnv,
    SpooferVectorEnv,
)
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from tests.run_folders import defender, spoofer

DRIVE, SKY = "foi-drive:horizon=22", "kujur-flight:horizon=12,onset=60"
DETECTORS = ("snapshot",)
LANES, SEED = 4, 7
NOT_AGAIN: dict[str, Any] = {"autoreset_mode": "Disabled"}


def played(env: Any, act: Any) -> dict[str, Any]:
    """Errors after each decision, offsets and innovations of one game of all lanes, and what the last step told."""
    seen, _ = env.reset(seed=SEED)
    simulation = env.game.simulation
    rows: dict[str, list[np.ndarray]] = {"error": [], "offset": [], "residual": []}
    over = np.zeros(LANES, dtype=bool)
    while not over.any():
        seen, reward, over, _, info = env.step(act(seen))
        told = info.get("spoofer", info) if isinstance(info.get("spoofer"), dict) else info
        rows["error"].append(told["error"].copy())
        rows["offset"].append(simulation.offset.copy())
        rows["residual"].append(simulation.epoch.innovation.residual.copy())
    return {name: np.array(values) for name, values in rows.items()} | {"told": told, "reward": reward}


def assert_same(one: dict[str, Any], two: dict[str, Any], last_error: bool = True) -> None:
    count = len(one["error"]) - (not last_error)
    np.testing.assert_array_equal(one["error"][:count], two["error"][:count])
    for name in ("offset", "residual"):
        np.testing.assert_array_equal(one[name], two[name])


@pytest.mark.parametrize("scenario", [DRIVE, SKY])
@pytest.mark.parametrize("knowledge", ["shadow", "full"])
def test_two_policies_play_the_same_game_in_every_view(scenario: str, knowledge: str, tmp_path: Path) -> None:
    """With knowledge "full" the duel's spoofer sees decisions, so the policy of Spoofer-v0 drops those two entries."""
    if scenario == SKY and knowledge == "full":
        pytest.skip("one game on ranges suffices")
    attacking = spoofer({"scenario": scenario, "knowledge": knowledge, "detector": list(DETECTORS)}, tmp_path / "x")
    defending = defender({"scenario": scenario, "attacks": "none", "detectors": list(DETECTORS)}, tmp_path / "d")
    x, d = LearnedSpoofer.load(tmp_path / "x"), LearnedDefender.load(tmp_path / "d")
    common: dict[str, Any] = {"scenario": scenario, "clean": 0.0, "outage": 0.0, "multipath": 0.0}
    play: dict[str, Any] = {**common, "detectors": DETECTORS, **NOT_AGAIN}

    def attack(seen: Any) -> Any:
        return x.act(seen[:, : len(x.layout)])

    both = played(
        duel.vector_env(LANES, knowledge=knowledge, **play),
        lambda seen: {"spoofer": attack(seen["spoofer"]), "defender": d.act(seen["defender"])},
    )
    assert both["offset"].any()
    one = DuelSpooferVectorEnv(LANES, knowledge=knowledge, defender=defending, **play)
    from_one_side = played(one, attack)
    from_the_other = played(DuelDefenderVectorEnv(LANES, spoofer=attacking, **play), d.act)
    for view in (from_one_side, from_the_other):
        assert_same(both, view)
        np.testing.assert_array_equal(view["told"]["harm"], both["told"]["harm"])
    np.testing.assert_array_equal(from_one_side["reward"], -from_the_other["reward"])
    alone = SpooferVectorEnv(
        LANES, scenario=scenario, knowledge=knowledge, detector=DETECTORS, on_alarm="respond", response=defending,
        **NOT_AGAIN,
    )
    # a defender inside Spoofer-v0 decides on the last fix, too
    assert_same(both, played(alone, attack), last_error=False)
    other = DefenderVectorEnv(LANES, **common, detectors=DETECTORS, attacks=attacking, **NOT_AGAIN)
    assert_same(both, played(other, d.act))


def test_classical_players_clean_games_and_outages_are_those_of_the_defenders_game() -> None:
    """A population against a response: decided outside by the decisions of the same response inside."""
    play: dict[str, Any] = {"scenario": "foi-drive", "detectors": DETECTORS, "outage": 0.9, **NOT_AGAIN}
    inside = DuelSpooferVectorEnv(LANES, defender="exclude:reuse=5", clean=0.5, **play)
    outside = duel.vector_env(LANES, clean=0.5, **play)
    inside.reset(seed=SEED)
    outside.reset(seed=SEED)
    rates = np.full((LANES, 3), 0.2, dtype=np.float32)
    for _ in range(230):
        decisions = np.zeros((LANES, 2), dtype=int)
        decisions[:, 0] = ~inside.game.simulation.decision.use
        _, reward, _, _, info = inside.step(rates)
        _, paid, _, _, told = outside.step({"spoofer": rates, "defender": decisions})
        np.testing.assert_array_equal(info["error"], told["defender"]["error"])
        np.testing.assert_array_equal(reward, paid)
    np.testing.assert_array_equal(info["harm"], told["spoofer"]["harm"])
    assert set(info["defender"]) == {"exclude:reuse=5"}
    assert set(told["spoofer"]["defender"]) == {"agent"}
    population = DuelDefenderVectorEnv(LANES, spoofer="held-out", **play)
    own = DefenderVectorEnv(LANES, attacks="held-out", **play)
    use = np.zeros((LANES, 2), dtype=int)
    assert_same(played(population, lambda _: use), played(own, lambda _: use))


@pytest.mark.parametrize(
    ("side", "arguments"),
    [("DuelSpoofer", {"defender": ("exclude", "px4-auto")}), ("DuelDefender", {"spoofer": ("ramp:0.5", "jump:20")})],
)
def test_sides_pass_the_checkers_and_lanes_are_games_of_their_own(side: str, arguments: dict[str, Any]) -> None:
    given = {"scenario": DRIVE, "detectors": DETECTORS, **arguments}
    env = gym.make(f"spoofgym/{side}-v0", **given, render_mode="rgb_array")
    check_env(env.unwrapped)
    vector = gym.make_vec(f"spoofgym/{side}-v0", 2, **given)
    for lane in range(2):
        seen, _ = vector.reset(seed=SEED)
        own, _ = env.reset(seed=SEED + lane)
        over, total = False, 0.0
        vector.action_space.seed(3)
        while not over:
            np.testing.assert_array_equal(seen[lane], own)
            action = vector.action_space.sample()
            seen, reward, _, _, info = vector.step(action)
            own, paid, over, _, told = env.step(action[lane])
            assert (paid, told["error"]) == (reward[lane], info["error"][lane])
            total += paid
        assert abs(total) == pytest.approx(told["harm"])
        assert (told["spoofer"], told["defender"]) == (info["spoofer"][lane], info["defender"][lane])
    assert {told["spoofer"], told["defender"]} & {"agent"}


@pytest.mark.slow
@pytest.mark.parametrize(("side", "seat"), [("DuelSpoofer", "defender"), ("DuelDefender", "spoofer")])
def test_the_other_seat_cannot_stay_empty(side: str, seat: str) -> None:
    with pytest.raises(ValueError, match=f"duel: {seat} must be a specification, .* got None"):
        gym.make(f"spoofgym/{side}-v0", scenario=DRIVE, **{seat: None})


@pytest.mark.parametrize("filler", ["snapshot > px4-auto", "policy"])
def test_sb3_learns_the_spoofers_side(filler: str, tmp_path: Path) -> None:
    ppo = pytest.importorskip("stable_baselines3").PPO
    from spoofgym.envs.sb3 import SB3VecEnv

    if filler == "policy":
        filler = defender({"scenario": DRIVE, "attacks": "none", "detectors": list(DETECTORS)}, tmp_path / "d")
    given: dict[str, Any] = {"scenario": DRIVE, "detectors": DETECTORS, "autoreset_mode": AutoresetMode.SAME_STEP}
    lanes = SB3VecEnv(DuelSpooferVectorEnv(16, defender=filler, **given))
    model = ppo("MlpPolicy", lanes, n_steps=64, n_epochs=2, seed=1)
    model.learn(3000)
    assert model.num_timesteps >= 3000
    assert all(weight.isfinite().all() for weight in model.policy.parameters())


@pytest.mark.slow
@pytest.mark.parametrize("filler", ["training", "policy"])
def test_sb3_learns_the_defenders_side(filler: str, tmp_path: Path) -> None:
    ppo = pytest.importorskip("stable_baselines3").PPO
    from spoofgym.envs.sb3 import SB3VecEnv

    if filler == "policy":
        filler = spoofer({"scenario": DRIVE, "knowledge": "shadow"}, tmp_path / "x")
    given: dict[str, Any] = {"scenario": DRIVE, "detectors": DETECTORS, "autoreset_mode": AutoresetMode.SAME_STEP}
    lanes = SB3VecEnv(DuelDefenderVectorEnv(16, spoofer=filler, **given))
    model = ppo("MlpPolicy", lanes, n_steps=64, n_epochs=2, seed=1)
    before = [weight.detach().clone() for weight in model.policy.parameters()]
    model.learn(3000)
    after = list(model.policy.parameters())
    assert all(weight.isfinite().all() for weight in after)
    assert any((one != two).any() for one, two in zip(before, after, strict=True))
