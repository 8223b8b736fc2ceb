"""Spoofer-v0 on ranges, and what both environments have in common there: spaces, actions, entries, arguments."""

import pickle
import re
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import stable_baselines3.common.env_checker
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.navigation.tight.states import POSITION
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario

SPOOFER, DEFENDER = "spoofgym/Spoofer-v0", "spoofgym/Defender-v0"
KUJUR = "kujur-flight:horizon=40,onset=60"
LIU = "liu-flight:horizon=40,onset=60,coupling=tight"
SHORT = "kujur-flight:horizon=12,onset=60"
DEAF = "snapshot:threshold=1e9"
SKIES = [(4.0, 5.0), (8.5, 15.0), (9.5, 25.0), (10.7, 20.0)]
QUIET: dict[str, Any] = {"attacks": "none", "outage": 0.0, "multipath": 0.0}

Under = Callable[[float, float], Scenario]


# --- both environments ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scenario", "fidelity"), [(KUJUR, "linear"), (LIU, "strapdown")])
def test_checkers_of_gymnasium_and_sb3(scenario: str, fidelity: str) -> None:
    spoofer: dict[str, Any] = {"knowledge": "full", "frames": 2, "tracking_sigma": 0.1}
    watched: dict[str, Any] = {"detectors": ("snapshot", "separation-bank"), "attacks": "ramp:0.5"}
    for name, arguments in ((SPOOFER, spoofer), (DEFENDER, watched)):
        env = gym.make(name, scenario=scenario, fidelity=fidelity, render_mode="rgb_array", **arguments)
        check_env(env.unwrapped)
        stable_baselines3.common.env_checker.check_env(env.unwrapped)
        env.close()


@pytest.mark.parametrize("kind", [SpooferEnv, DefenderEnv])
def test_coupling_is_written_into_the_specification(kind: type[Any]) -> None:
    """The argument, the option of the scenario, and a flight that is tight by itself."""
    given = {} if kind is SpooferEnv else {"detectors": "snapshot", "attacks": "none"}
    argued = kind(scenario="liu-flight:horizon=12", coupling="tight", **given)
    spelled = kind(scenario="liu-flight:horizon=12,coupling=tight", **given)
    assert argued.game.scenario.name == spelled.game.scenario.name == "liu-flight:horizon=12,coupling=tight"
    np.testing.assert_array_equal(argued.reset(seed=3)[0], spelled.reset(seed=3)[0])
    assert kind(scenario=SHORT, coupling="tight", **given).game.scenario.name == SHORT
    assert kind(scenario=SHORT, coupling="loose", **given).game.scenario.family.coupling == "loose"
    with pytest.raises(ValueError, match=r"'foi-drive' is loosely coupled, not tightly.*: kujur-flight, liu-flight"):
        kind(scenario="foi-drive", coupling="tight", **given)
    with pytest.raises(ValueError, match="tightly coupled, not loosely"):
        kind(scenario=make_scenario(SHORT), coupling="loose", **given)
    with pytest.raises(ValueError, match="coupling must be one of loose, tight, got 'firm'"):
        kind(coupling="firm", **given)


def test_configurations_survive_pickle_and_json() -> None:
    for config in (SpooferConfig(scenario=SHORT, coupling="tight"), DefenderConfig(scenario=SHORT, coupling="tight")):
        assert pickle.loads(pickle.dumps(config)) == config
    spec = gym.make(SPOOFER, scenario="liu-flight:horizon=12", coupling="tight").spec
    again = gym.make(EnvSpec.from_json(spec.to_json()))
    assert again.unwrapped.action_space.shape == (4,)


def part_of_page(kind: type[Any], pattern: str) -> str:
    found = re.search(pattern, re.sub(r"\s+", " ", kind.__doc__ or ""))
    assert found is not None
    return found.group(1)


# --- the spoofer ------------------------------------------------------------------------------------------------------


def test_four_rates_move_position_and_clock() -> None:
    """Each by its own largest rate times the interval; what lies outside the box is clipped."""
    env = SpooferEnv(scenario=KUJUR + ",drag_off_rate=4", detector=DEAF)
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (4,), np.float32)
    env.reset(seed=0)
    env.step(np.array([0.5, -0.25, 0.1, 1.0]))
    np.testing.assert_allclose(env.game.seat.offset[0], [1.0, -0.5, 0.2, 2.0])
    *_, info = env.step(np.array([0.0, 0.0, 0.0, -7.0]))
    np.testing.assert_allclose(env.game.seat.offset[0], [1.0, -0.5, 0.2, 0.0], atol=1e-12)
    assert env.game.simulation.clock_offset[0] == env.game.seat.offset[0, 3]
    assert info["clock_error"] == pytest.approx(env.game.seat.clock_error[0])
    for scenario, rate in ((KUJUR, 0.25), (LIU, 0.25), (KUJUR + ",drag_off_rate=4", 4.0)):
        rates = make_scenario(scenario)
        assert (rates.drag_off_rate, rates.clock_rate) == ((rate, rate, rate), rate)
    with pytest.raises(ValueError, match="drag_off_rate must be a finite number greater than 0, got 0"):
        make_scenario("kujur-flight:drag_off_rate=0")
    with pytest.raises(ValueError, match=r"shape \(4,\), got \(3,\)"):
        env.step(np.zeros(3))
    with pytest.raises(ValueError, match="not finite"):
        env.step(np.array([0.0, 0.0, 0.0, np.nan]))


@pytest.mark.parametrize("scenario", [SHORT, "liu-flight:horizon=12,coupling=tight"])
def test_an_innovation_cannot_be_chosen(scenario: str) -> None:
    with pytest.raises(ValueError, match=r"action 'innovation' is for filters on fixes.*use action='rate'"):
        gym.make(SPOOFER, scenario=scenario, action="innovation")


@pytest.mark.parametrize(("knowledge", "place"), [("blind", 0), ("shadow", 1), ("full", 2)])
def test_entries_of_the_spoofer_are_those_of_the_page(knowledge: str, place: int) -> None:
    env = SpooferEnv(scenario=KUJUR + ",drag_off_rate=4", knowledge=knowledge)
    numbers = part_of_page(SpooferEnv, r"there are two more entries, ([\d, and]+) in all:")
    assert env.observation_space.shape == (int(re.findall(r"\d+", numbers)[place]),)
    names = [field.name for field in env.game.fields]
    assert names[3] == "offset of the clock"
    loose = [field.name for field in SpooferEnv(knowledge=knowledge, scenario=KUJUR + ",coupling=loose").game.fields]
    assert [name for name in names if "clock" not in name] == loose
    if knowledge != "blind":
        assert names[names.index("mean velocity error up") + 1] == "mean clock error"
    env.reset(seed=1)
    seen = env.step(np.array([0.0, 0.0, 0.0, 0.5]))[0]
    assert seen[3] == pytest.approx(1.0 / 11.0)
    if knowledge != "blind":
        clock = env.game.seat.shadow.clock_error[0]
        assert seen[names.index("mean clock error")] == pytest.approx(clock / (10.0 + abs(clock)), rel=1e-6)
        assert clock > 0.3


def test_the_tracking_error_moves_the_position_and_never_the_clock() -> None:
    """Its standard deviation over 40 epochs and 50 games, 3 axes: 6000 numbers, 10 % is 10 of its standard errors."""
    vector = SpooferVectorEnv(50, scenario=KUJUR, detector=DEAF, tracking_sigma=0.5, autoreset_mode="Disabled")
    vector.reset(seed=2)
    sent = []
    for _ in range(40):
        vector.step(np.tile([0.1, 0.0, 0.0, 0.2], (50, 1)))
        game = vector.game
        sent.append(game.simulation.offset - game.seat.offset[:, :3])
        np.testing.assert_array_equal(game.simulation.clock_offset, game.seat.offset[:, 3])
    assert np.std(sent) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(("scenario", "sigma"), [(KUJUR, 0.1), (LIU, 1.0), (KUJUR + ",coupling=loose", 0.1)])
def test_kappa_is_that_of_the_model(scenario: str, sigma: float) -> None:
    """σ_t² times the diagonal of H' S⁻¹ H at epoch 1, each matrix in full; nothing without a tracking error."""
    env = SpooferEnv(scenario=scenario, detector=DEAF, tracking_sigma=sigma)
    env.reset(seed=0)
    nothing = np.zeros(env.action_space.shape)
    told = env.step(nothing)[4]["kappa"]
    played = make_scenario(scenario)
    if played.family.coupling == "tight":
        model = played.tight_model()
        dynamics = model.dynamics
        observation = np.zeros((dynamics.dimension, dynamics.num_states))
        for row, (columns, values) in enumerate(zip(dynamics.columns, dynamics.values[1], strict=True)):
            np.add.at(observation[row], columns, values)
        covariance, moved = model.innovation_covariance[1], observation[:, POSITION]
    else:
        covariance, moved = env.game.simulation.epoch.innovation.covariance[0], np.eye(3)
    information = np.diag(moved.T @ np.linalg.solve(covariance, moved))
    np.testing.assert_allclose([told[axis] for axis in ("east", "north", "up")], sigma**2 * information, rtol=1e-9)
    blind = SpooferEnv(scenario=scenario, detector=DEAF)
    blind.reset(seed=0)
    assert "kappa" not in blind.step(nothing)[4]
