"""Any callable is scored as a learned policy is: on the same games, with the same figures."""

import numpy as np
import pytest

from spoofgym.evaluation.agent_scores import agent_scores, evaluate_policy
from spoofgym.policies.learned import load_policy
from tests.run_folders import defender, spoofer

FLIGHT = "liu-flight:horizon=12"


def test_a_callable_is_worth_what_the_policy_that_it_calls_is_worth(tmp_path):
    arguments = {"scenario": FLIGHT, "knowledge": "blind", "detector": "snapshot"}
    spoofer(arguments, tmp_path / "x")
    policy = load_policy(tmp_path / "x")
    (expected,) = agent_scores(policy, 30, 7)
    assert evaluate_policy(policy.act, arguments, games=30, seed=7) == expected


def test_a_defender_and_a_duel_are_scored_in_their_units(tmp_path):
    arguments = {"scenario": "foi-drive:horizon=40", "attacks": "ramp:1", "detectors": ("snapshot",)}
    defender({**arguments, "detectors": ["snapshot"]}, tmp_path / "d")
    act = load_policy(tmp_path / "d").act
    score = evaluate_policy(act, arguments, "spoofgym/Defender-v0", games=10)
    assert (score.opponent, score.metric, score.unit) == ("ramp:1", "mean error", "m")
    duel = {"scenario": "foi-drive:horizon=40", "detectors": "snapshot", "defender": "snapshot/exclude", "clean": 0.0}
    still = lambda observations: np.zeros((len(observations), 3))  # noqa: E731
    score = evaluate_policy(still, duel, "spoofgym/DuelSpoofer-v0", games=10)
    assert (score.metric, score.games) == ("harm", 10)
    assert score.interval[0] <= score.value <= score.interval[1] < 5.0


def test_an_unknown_environment_is_told_with_the_nearest():
    with pytest.raises(ValueError, match=r"got 'spoofgym/Spofer-v0': did you mean 'spoofgym/Spoofer-v0'\?"):
        evaluate_policy(lambda o: o, {}, "spoofgym/Spofer-v0")
