"""What a run folder holds becomes the configuration of an environment, or is refused with the name of its file."""

from pathlib import Path

import pytest

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.trained import config_from, defender_config, spoofer_config
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer


def test_a_spoofer_has_the_environment_it_was_trained_on():
    policy = LearnedSpoofer(Path("x"), {"knowledge": "full", "detector": ["snapshot"], "frames": 3}, (), (), ())
    assert spoofer_config(policy) == SpooferConfig(knowledge="full", detector=("snapshot",), frames=3)
    assert spoofer_config(policy.with_shadow("liu-flight")).shadow == "liu-flight"


def test_a_blind_spoofer_takes_no_shadow_filter():
    policy = LearnedSpoofer(Path("x"), {"knowledge": "blind"}, (), (), ())
    assert spoofer_config(policy.with_shadow("liu-flight")).shadow is None


def test_a_defender_has_the_environment_it_was_trained_on():
    policy = LearnedDefender(Path("x"), {"attacks": "held-out", "detectors": ["snapshot"], "clean": 0.25}, (), (), ())
    assert defender_config(policy) == DefenderConfig(attacks="held-out", detectors=("snapshot",), clean=0.25)


@pytest.mark.parametrize(
    "arguments",
    [
        {"colour": 1},
        {"scenario": 5},
        {"scenario": ["liu-flight"]},
        {"detector": 3},
        {"detector": []},
        {"detector": [None]},
        {"shadow": {}},
        {"fidelity": 1},
        {"knowledge": 1},
        {"knowledge": "all"},
        {"frames": "two"},
        {"forfeit": "x"},
        {"threads": None},
        {"tracking_sigma": []},
        {"coupling": 7},
    ],
)
def test_an_argument_of_another_type_is_named_with_its_file(arguments):
    policy = LearnedSpoofer(Path("x"), {"knowledge": "shadow", **arguments}, (), (), ())
    with pytest.raises(ValueError, match=r"^x/config\.json is damaged: ") as raised:
        spoofer_config(policy)
    assert "\n" not in str(raised.value)


def test_the_environment_of_the_other_side_is_refused():
    with pytest.raises(ValueError, match=r"^run is the run folder of a defender, not of a spoofer$"):
        config_from(SpooferConfig, {"attacks": "training"}, Path("run/config.json"))
