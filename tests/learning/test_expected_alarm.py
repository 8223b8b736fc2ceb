"""Alarms in expectation pay, on average, what the real game pays."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from scipy import stats

from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.learning.expected_alarm import ExpectedAlarmVectorEnv, alarm_probability_is_known

SCENARIO = "liu-flight:horizon=40"
ACTION = np.array([0.12, -0.096, 0.0], dtype=np.float32)  # 0.6 m/s: caught in about half of the games


def returns(environment, action=ACTION):
    """Return of the first game of every lane, and its last info."""
    environment.reset(seed=1)
    total, running = np.zeros(environment.num_envs), np.ones(environment.num_envs, dtype=bool)
    while running.any():
        _, reward, terminated, _, _ = environment.step(np.tile(action, (environment.num_envs, 1)))
        total[running] += reward[running]
        running &= ~terminated
    return total


def test_mean_return_is_that_of_the_real_game():
    """4000 games each; 6 sigma of the difference: false failure below 1e-8."""
    lanes = 4000
    real = returns(SpooferVectorEnv(lanes, scenario=SCENARIO, autoreset_mode=AutoresetMode.SAME_STEP))
    config = SpooferConfig(scenario=SCENARIO)
    expected = returns(ExpectedAlarmVectorEnv(lanes, config, autoreset_mode=AutoresetMode.SAME_STEP))
    assert 0.1 < np.mean(real == 0.0) < 0.7
    deviation = np.sqrt((real.var() + expected.var()) / lanes)
    assert abs(real.mean() - expected.mean()) < 6 * deviation
    assert expected.std() < 0.2 * real.std()


def test_a_game_pays_its_survival_times_what_it_gained():
    config = SpooferConfig(scenario=SCENARIO)
    environment = ExpectedAlarmVectorEnv(3, config, autoreset_mode=AutoresetMode.DISABLED)
    environment.reset(seed=2)
    start = environment.game.error.copy()
    total, survival = np.zeros(3), np.ones(3)
    for _ in range(40):
        _, reward, terminated, _, info = environment.step(np.tile(ACTION, (3, 1)))
        total += reward
        np.testing.assert_allclose(info["reward_terms"]["growth"] + info["reward_terms"]["forfeit"], reward)
        noncentrality = np.sum(environment.game.seat.shadow.whitened**2, axis=1)
        survival *= stats.ncx2.cdf(25.9, 3, noncentrality)
    assert terminated.all()
    np.testing.assert_allclose(total, survival * (environment.game.error - start) / 10.0, rtol=1e-9)


def test_the_victim_named_as_shadow_is_known():
    assert alarm_probability_is_known(SpooferConfig(shadow="liu-flight"))


@pytest.mark.parametrize(
    "arguments",
    [
        {"detector": "windowed"},
        {"knowledge": "blind"},
        {"tracking_sigma": 1.0},
        {"shadow": "liu-flight:imu=tactical"},
        {"forfeit": 0.5},
        {"on_alarm": "respond"},
        {"scenario": "liu-flight:markov_sigma=2,markov_time=30"},
        {"scenario": "kujur-flight:horizon=12,onset=60"},
        {"scenario": "liu-flight:horizon=12,onset=60", "coupling": "tight"},
    ],
)
def test_games_without_a_known_probability_are_refused(arguments):
    config = SpooferConfig(**arguments)
    assert not alarm_probability_is_known(config)
    with pytest.raises(ValueError, match="probability of an alarm is not known"):
        ExpectedAlarmVectorEnv(2, config)
