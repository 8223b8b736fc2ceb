"""On a recorded log fidelity and knowledge choose themselves; what is given by hand stays."""

import gymnasium as gym
import pytest

from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.scenarios import make_scenario
from tests.scenarios.test_recorded import write_log


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return f"recorded:{write_log(tmp_path_factory.mktemp('log') / 'log', velocity=False)},horizon=8"


def test_a_log_is_played_with_nothing_but_its_name(log):
    for name, arguments in (("Spoofer", {}), ("Defender", {"detectors": "snapshot", "attacks": "ramp:1"})):
        env = gym.make(f"spoofgym/{name}-v0", scenario=log, **arguments)
        assert env.unwrapped.config.fidelity == "strapdown"
        env.reset(seed=0)
        env.step(env.action_space.sample())
    assert configure(SpooferConfig, {"scenario": log}).knowledge == "blind"
    assert configure(SpooferConfig, {"scenario": make_scenario(log)}).fidelity == "strapdown"


def test_what_is_given_stays(log):
    assert configure(SpooferConfig, {"scenario": log, "knowledge": "full"}).knowledge == "full"
    with pytest.raises(ValueError, match="fidelity"):
        gym.make("spoofgym/Defender-v0", scenario=log, detectors="snapshot", fidelity="linear")


def test_simulated_scenarios_keep_their_defaults():
    assert configure(SpooferConfig, {}) == SpooferConfig()
    assert configure(SpooferConfig, {"scenario": make_scenario("liu-flight")}).knowledge == "shadow"
    assert configure(DefenderConfig, {"scenario": "recorded:/nowhere"}).fidelity == "linear"  # refused when it is built
