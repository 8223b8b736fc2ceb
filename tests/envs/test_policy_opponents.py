"""Learned policies and pools in the other seat: they play there as they play through their own environment."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.opponents import make_defender, make_spoofer, spoofer_pool
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from tests.run_folders import defender, network, spoofer

FLIGHT = "liu-flight:horizon=22,onset=300"
SKY = "kujur-flight:horizon=12,onset=60"
DETECTORS = ("snapshot", "windowed:n=5,threshold=60")
QUIET: dict[str, Any] = {"clean": 0.0, "outage": 0.0, "multipath": 0.0}
LANES, SEED = 3, 5
SPOOFERS: dict[str, dict[str, Any]] = {
    "shadow": {"scenario": FLIGHT, "knowledge": "shadow"},
    "full": {"scenario": FLIGHT, "knowledge": "full", "detector": list(DETECTORS[:1]), "frames": 2},
    "rough": {"scenario": FLIGHT, "knowledge": "shadow", "tracking_sigma": 1.0, "tracking_time": 4.0},
    "innovation": {"scenario": FLIGHT, "knowledge": "shadow", "action": "innovation"},
    "tight": {"scenario": SKY, "knowledge": "shadow"},
}


def streams(lanes: int = LANES) -> RunStreams:
    return RunStreams.from_seed(SEED, lanes)


def seen(simulation: Simulation) -> list[np.ndarray]:
    return [simulation.epoch.innovation.residual, simulation.error, simulation.offset, simulation.clock_offset]


@pytest.mark.parametrize("kind", SPOOFERS)
def test_a_spoofer_plays_in_the_other_seat_as_in_its_own(kind: str, tmp_path: Path) -> None:
    """Once outside against a response, once inside against the same decisions from outside."""
    configuration = SPOOFERS[kind]
    text = spoofer(configuration, tmp_path / "x")
    policy = LearnedSpoofer.load(tmp_path / "x")
    config = SpooferConfig(
        **{**configuration, "detector": DETECTORS[:1]}, on_alarm="respond", response="exclude"
    )
    outside = SpooferGame(config, LANES, streams=streams())
    own = DefenderConfig(scenario=configuration["scenario"], detectors=DETECTORS[:1], attacks=text, **QUIET)
    inside = DefenderGame(own, LANES, streams=streams())
    everyone, last = np.arange(LANES), outside.scenario.timeline.num_epochs
    for number in range(2):
        for game in (outside, inside):
            game.reset(everyone)
        for k in range(last):
            decisions = np.zeros((LANES, len(inside.seat.space.nvec)), dtype=np.int64)
            decisions[:, 0] = ~outside.simulation.decision.use
            inside.step(decisions)
            outside.step(policy.act(outside.observation()))
            for one, two in zip(seen(outside.simulation), seen(inside.simulation), strict=True):
                if k < last - 1 or one is not outside.simulation.error:
                    np.testing.assert_array_equal(one, two, err_msg=f"game {number}, epoch {k + 1}")
        assert outside.simulation.offset.any()
    np.testing.assert_array_equal(inside.attacks.first, 1)


@pytest.mark.parametrize(
    ("scenario", "bank"), [(FLIGHT, None), (SKY, None), (FLIGHT, "multiple-hypothesis:hypotheses=3")]
)
def test_a_defender_plays_in_the_other_seat_as_in_its_own(scenario: str, bank: str | None, tmp_path: Path) -> None:
    """Once outside against an attack, once inside against the same offsets from outside."""
    configuration = {"scenario": scenario, "attacks": "none", "detectors": list(DETECTORS[:1]), "bank": bank}
    text = defender(configuration, tmp_path / "d")
    policy = LearnedDefender.load(tmp_path / "d")
    given = DefenderConfig(scenario=scenario, detectors=DETECTORS[:1], attacks="ramp:3", bank=bank, **QUIET)
    outside = DefenderGame(given, LANES, streams=streams())
    config = SpooferConfig(scenario=scenario, detector=DETECTORS[:1], on_alarm="respond", response=text)
    inside = SpooferGame(config, LANES, streams=streams())
    everyone, last = np.arange(LANES), outside.scenario.timeline.num_epochs
    for game in (outside, inside):
        game.reset(everyone)
    left_out = 0
    for k in range(last):
        actions = policy.act(outside.observation())
        decision = inside.simulation.decision
        np.testing.assert_array_equal(outside.seat.choice(actions).exclude, ~decision.use)
        left_out += int((~decision.use).sum())
        outside.step(actions)
        inside.simulation.resolve()
        inside.simulation.observe(outside.simulation.offset)
        for one, two in zip(seen(outside.simulation), seen(inside.simulation), strict=True):
            np.testing.assert_array_equal(one, two, err_msg=f"epoch {k + 1}")
    assert 0 < left_out < last * LANES


def test_lanes_meet_opponents_of_a_weighted_pool_whatever_their_number(tmp_path: Path) -> None:
    text = defender({"scenario": FLIGHT, "attacks": "none", "detectors": list(DETECTORS)}, tmp_path / "d")
    pool = (("exclude", 1.0), ("px4-auto", 2.0), (text, 1.0), ("windowed:n=5,threshold=60 > latch", 1.0))
    given: dict[str, Any] = {"scenario": FLIGHT, "detector": DETECTORS, "on_alarm": "respond", "response": pool}
    games = [SpooferVectorEnv(lanes, **given) for lanes in (40, 7)]
    traces = []
    for env in games:
        _, info = env.reset(seed=3)
        trace = [info["opponent"][:7]]
        for k in range(30):
            actions = np.full((env.num_envs, 3), 0.3 * np.sin(k), dtype=np.float32)
            _, reward, _, _, info = env.step(actions)
            trace += [reward[:7], env.game.simulation.decision.use[:7].copy()]
        traces.append([*trace, info["opponent"][:7]])
    for one, two in zip(*traces, strict=True):
        np.testing.assert_array_equal(one, two)
    drawn = [games[0].reset(seed=100 * k)[1]["opponent"] for k in range(10)]
    share = [float(np.mean(np.array(drawn) == name)) for name in games[0].game.simulation.response.names]
    np.testing.assert_allclose(share, [0.2, 0.4, 0.2, 0.2], atol=0.1)  # 400 draws: 4 sigma of the larger


def test_a_member_of_a_pool_decides_as_if_it_were_alone() -> None:
    """Lanes that drew a response play the game that all lanes play against it."""
    given: dict[str, Any] = {"scenario": FLIGHT, "detector": "snapshot", "on_alarm": "respond"}
    rates = np.full((20, 3), 0.8, dtype=np.float32)
    pooled = SpooferVectorEnv(20, **given, response="pool:exclude:reuse=5+latch+always-use,weights=1+1+2")
    _, info = pooled.reset(seed=3)
    met = info["opponent"]
    assert set(met) == {"exclude:reuse=5", "latch", "always-use"}
    rewards = [pooled.step(rates)[1] for _ in range(22)]
    for name in set(met):
        alone = SpooferVectorEnv(20, **given, response=name)
        alone.reset(seed=3)
        for reward in rewards:
            expected = alone.step(rates)[1]
            if name == "always-use":  # shared gains round otherwise than a covariance of each run
                np.testing.assert_allclose(reward[met == name], expected[met == name], atol=1e-6)
            else:
                np.testing.assert_array_equal(reward[met == name], expected[met == name])


@pytest.mark.parametrize("seat", ["spoofer", "defender"])
def test_copies_in_mid_game_go_on_bit_for_bit(seat: str, tmp_path: Path) -> None:
    env: Any
    if seat == "spoofer":
        text = spoofer(SPOOFERS["rough"], tmp_path / "x")
        env = DefenderVectorEnv(4, scenario=FLIGHT, detectors=DETECTORS, attacks=(text, "ramp:1"), clean=0.2)
    else:
        text = defender({"scenario": FLIGHT, "attacks": "none", "detectors": list(DETECTORS)}, tmp_path / "d")
        env = SpooferVectorEnv(4, scenario=FLIGHT, detector=DETECTORS, on_alarm="respond", response=(text, "exclude"))
    env.reset(seed=3)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(40)]
    for action in actions[:12]:
        env.step(action)
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    for action in actions[12:]:
        expected = env.step(action)
        for other in others:
            result = other.step(action)
            np.testing.assert_array_equal(result[0], expected[0])
            np.testing.assert_array_equal(result[1], expected[1])


def test_what_a_game_does_not_offer_is_refused_when_it_is_built(tmp_path: Path) -> None:
    full = spoofer(SPOOFERS["full"], tmp_path / "full")
    with pytest.raises(ValueError, match=r"trained to see the detectors snapshot; the game runs windowed:n=5"):
        DefenderGame(DefenderConfig(scenario=FLIGHT, detectors=DETECTORS[1:], attacks=full), 1)
    tight = spoofer(SPOOFERS["tight"], tmp_path / "tight")
    with pytest.raises(ValueError, match=r"was 'offset of the clock' and is 'elapsed fraction of the game'"):
        DefenderGame(DefenderConfig(scenario=FLIGHT, detectors=DETECTORS[:1], attacks=tight), 1)
    configuration = {"scenario": FLIGHT, "attacks": "none", "detectors": list(DETECTORS)}
    text = defender(configuration, tmp_path / "d")
    with pytest.raises(ValueError, match=r"the detectors snapshot, windowed:n=5,threshold=60; the game runs snapshot$"):
        SpooferGame(SpooferConfig(scenario=FLIGHT, on_alarm="respond", response=text), 1)
    drive = {"scenario": "foi-drive:horizon=22", "detector": DETECTORS, "on_alarm": "respond", "response": text}
    with pytest.raises(ValueError, match=r"was trained on 5 depths and 0 slots of satellites, the game has 11 and 0"):
        SpooferGame(SpooferConfig(**drive), 1)
    with pytest.raises(ValueError, match="is the run folder of a defender, not of a spoofer"):
        make_spoofer(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("policy:", "names no policy: write policy:NAME or policy:FOLDER"),
        ("policy:nobody", "'nobody' is no run folder and no published agent"),
        ("pool:weights=2", "a pool is spelled pool:A\\+B or pool:A\\+B,weights=2\\+1"),
        ("pool:exclude+latch,weights=1", "2 parts need as many weights, got 1"),
        ("pool:exclude+latch,weights=1+x", "weights must be numbers"),
        ("pool:exclude+latch,weights=1+0", "weight must be a finite number greater than 0"),
        ("pool:exclude+exclude", "each response can be in a pool once only, got exclude, exclude"),
        ("pool:exclude+latch,shares=1+1", "a pool is spelled"),
        ("pool:", "a pool is spelled"),
        ("cusum > exclude", "no detector 'cusum'; there are: snapshot; a response follows a detector of its game"),
        ("windowed:n=5", "is a detector: name the response to its alarm, too, e.g. 'windowed:n=5/exclude'"),
    ],
)
def test_specifications_that_say_nothing_are_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SpooferGame(SpooferConfig(scenario=FLIGHT, on_alarm="respond", response=text), 1)


def test_pools_are_spelled_and_given_in_python() -> None:
    pool = make_spoofer("pool:ramp:0.5/direction=45+jump,weights=3+1")
    assert pool.name == "pool:ramp:0.5/direction=45+jump,weights=3+1"
    assert spoofer_pool("pool:ramp:0.5/direction=45+jump", 0.25).names == ("ramp:0.5,direction=45", "jump")
    assert spoofer_pool([("ramp:1", 2.0), ("jump", 1)], 0.25).names == ("ramp:1", "jump")
    scenario = make_scenario(FLIGHT)
    assert make_defender(("exclude", "latch"), scenario, []).name == "exclude + latch"
    assert make_defender([("exclude:reuse=5", 2)], scenario, []).name == "exclude:reuse=5"


def test_a_policy_decides_for_a_lane_as_if_it_were_alone() -> None:
    layout = tuple(f"entry {i}" for i in range(11))
    policy = LearnedSpoofer(Path("x"), {"knowledge": "shadow"}, layout, *network(11, 3, 4))
    observation = np.random.default_rng(0).uniform(-1, 1, (517, 11)).astype(np.float32)
    together = policy.outputs(observation)
    for lanes in (slice(0, 1), slice(5, 8), slice(100, 417)):
        np.testing.assert_array_equal(policy.outputs(observation[lanes]), together[lanes])


def test_a_policy_that_needs_a_shadow_filter_is_refused_on_a_log_without_a_linear_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = spoofer(SPOOFERS["shadow"], tmp_path / "x")
    scenario = make_scenario(FLIGHT)

    def lacking(_: Any) -> Any:
        raise ValueError("scenario 'log' has no linear model")

    monkeypatch.setattr(type(scenario.family), "linear_model", lacking)
    with pytest.raises(ValueError, match=r"'policy:.*' cannot play on scenario .*: scenario 'log' has no linear model"):
        Simulation(scenario, make_spoofer(text), fidelity="strapdown")
