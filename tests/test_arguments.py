"""Whatever is given is played without a warning, or refused with the name of the argument and of its owner."""

import math
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.attacks.pool import training_population
from spoofgym.detectors import at_arl0, make_detector
from spoofgym.detectors.cpi import unit_vector
from spoofgym.envs.config import SpooferConfig, arguments_of, configuration, configure
from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.duel_config import DuelDefenderConfig
from spoofgym.envs.duel_sides import DuelDefenderEnv, DuelSpooferEnv
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.stress.arguments import fuzz

SHORT = "liu-flight:horizon=12"


@pytest.mark.slow
def test_hostile_arguments_are_played_or_refused_by_name():
    assert fuzz(seed=0, tries=400) == []


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (SpooferVectorEnv, {"max_episode_steps": math.nan}, "VectorEnv: max_episode_steps must be a whole number"),
        (SpooferVectorEnv, {"num_envs": 10**9}, "SpooferVectorEnv: num_envs must be .*, 20000 at most"),
        (SpooferVectorEnv, {"num_envs": True}, "num_envs must be a whole number, 1 or more, got True"),
        (SpooferVectorEnv, {"num_envs": 20_000, "frames": 1000}, "frames times num_envs"),
        (SpooferVectorEnv, {"autoreset_mode": 3}, "autoreset_mode must be one of"),
        (SpooferEnv, {"frames": 10**30}, "Spoofer-v0: frames must be a whole number, 1 or more, 1000 at most"),
        (SpooferEnv, {"tracking_sigma": 1e160}, "Spoofer-v0: tracking_sigma must be .*, from 0 to 1e\\+06"),
        (SpooferEnv, {"tracking_time": 1e-320}, "Spoofer-v0: tracking_time must be"),
        (SpooferEnv, {"forfeit": "1"}, "Spoofer-v0: forfeit must be a finite number, 0 or more, got '1'"),
        (SpooferEnv, {"threads": 2.5}, "Spoofer-v0: threads must be a whole number, 1 or more, got 2.5"),
        (SpooferEnv, {"render_mode": 5}, "SpooferEnv: render_mode must be one of human, rgb_array, ansi, got 5"),
        (SpooferEnv, {"knowledge": np.array(["full"])}, "Spoofer-v0: knowledge must be one of"),
        (SpooferEnv, {"detector": "windowed:n=20,threshold=1e-6"}, "threshold 1e-06 of 'windowed:threshold=1e-06' is"),
        (DefenderEnv, {"error_clip": None}, "Defender-v0: error_clip must be"),
        (DefenderEnv, {"exclusion_cost": 1e300}, "Defender-v0: exclusion_cost must be .*, got 1e\\+300"),
        (DefenderEnv, {"detectors": "snapshot", "attacks": "ramp:1e300"}, "Defender-v0: attacks: ramp: rate must be"),
    ],
)
def test_arguments_of_the_environments_are_refused_by_name(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(**arguments)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (SpooferEnv, {"scenario": ["liu-flight"]}, "Spoofer-v0: scenario: scenario must be a specification"),
        (SpooferEnv, {"on_alarm": "respond", "response": None}, "Spoofer-v0: response: response must be a spec"),
        (DefenderEnv, {"detectors": 5}, "Defender-v0: detectors: detector must be a specification"),
    ],
)
def test_what_is_no_part_at_all_is_refused_by_name(kind, arguments, message):
    with pytest.raises(TypeError, match=message):
        kind(**arguments)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (SpooferEnv, {"response": "exclude"}, "Spoofer-v0: response 'exclude' needs on_alarm='respond'"),
        (SpooferVectorEnv, {"response": ("latch", "exclude")}, "Spoofer-v0: response .* needs on_alarm='respond'"),
        (SpooferEnv, {"on_alarm": "respond", "forfeit": 1.0}, "Spoofer-v0: forfeit 1.0 needs on_alarm='end'"),
        (SpooferEnv, {"tracking_time": 4.0}, "Spoofer-v0: tracking_time 4.0 needs a tracking_sigma"),
        (DuelSpooferEnv, {"tracking_time": 4.0}, "duel: tracking_time 4.0 needs a tracking_sigma"),
        (DefenderEnv, {"attacks": training_population(), "clean": 0.5}, "Defender-v0: clean 0.5 is given twice"),
        (DuelDefenderEnv, {"spoofer": training_population(), "clean": 0.5}, "duel: clean 0.5 is given twice"),
        *(
            (DuelDefenderEnv, {name: value}, f"duel: {name} .* is of a spoofer outside")
            for name, value in (
                *(("knowledge", "full"), ("action", "innovation"), ("frames", 2), ("shadow", SHORT)),
                *(("tracking_sigma", 1.0), ("tracking_time", 1.0)),
            )
        ),
    ],
)
def test_arguments_without_effect_are_refused(kind, arguments, message):
    with pytest.raises(ValueError, match=message):
        kind(**arguments)


def test_a_configuration_of_before_builds_its_environment():
    """A run folder holds all arguments, and a league has one duel for both sides."""
    kept = configuration(SpooferConfig, {"scenario": SHORT, "response": "latch", "tracking_time": 4.0})
    given = arguments_of(kept)
    assert not {"response", "tracking_time"} & set(given)
    assert SpooferEnv(**given).config == replace(kept, response="exclude", tracking_time=0.0)
    assert "forfeit" not in arguments_of(replace(kept, on_alarm="respond"))
    both = DuelDefenderConfig(knowledge="full", frames=2, clean=0.25)
    assert {"clean", "payoff"} < set(arguments_of(both))
    assert configure(DuelDefenderConfig, arguments_of(both)) == replace(both, knowledge="shadow", frames=1)


def test_whole_numbers_may_come_as_numbers_of_any_kind():
    env = SpooferEnv(scenario=SHORT, frames=np.float64(2.0), threads=np.int32(1), forfeit=np.array(0.5))
    assert (env.config.frames, env.config.threads, env.config.forfeit) == (2, 1, 0.5)
    assert type(env.config.frames) is int
    env.reset(seed=0)


@pytest.mark.parametrize(
    ("make", "specification", "message"),
    [
        (make_scenario, "kujur-flight:hour=25", "hour must be a finite number, from 0 to 24, got 25"),
        (make_scenario, "kujur-flight:onset=1e9", "kujur-flight: onset must be"),
        (make_scenario, "kujur-flight:onset=7000,horizon=1000", "onset and horizon must end the game by 7200 s"),
        (make_scenario, "liu-flight:horizon=99999999", "liu-flight: horizon must be .*, 100000 at most"),
        (make_scenario, "liu-flight:rate=1e-300", "liu-flight: rate must be"),
        (make_scenario, "foi-drive:process_noise=1e300", "foi-drive: process_noise must be"),
        (make_scenario, "shadmehri-flight:speed=1e300", "shadmehri-flight: speed must be"),
        (make_scenario, "song-robot:sigma=1e-300", "song-robot: sigma must be"),
        (make_detector, "windowed:n=99999999", "windowed: n must be .*, 10000 at most"),
        (make_detector, "window-bank:lengths=5+99999999", "lengths must be whole numbers"),
        (make_detector, "cusum:k=1.000001", "k must be .*, from 1.02"),
        (make_detector, "ewma:weight=1e-9", "weight must be .*, from 0.0003"),
        (make_detector, "snapshot:threshold=1e-300", "threshold must be .*, from 1e-09"),
        (make_attack, "meaconing:delay=2,ramp_up=1e-320", "ramp_up must be"),
        (make_attack, "partial:jump:1e300", "partial: attack: jump: mean must be"),
        (make_attack, "partial:ramp:1,numbers=" + "9" * 5000, "partial: numbers must be"),
        (make_attack, "ramp:1e300", "ramp: rate must be"),
    ],
)
def test_options_out_of_range_are_refused_by_name(make, specification, message):
    with pytest.raises(ValueError, match=message):
        make(specification)


def test_an_onset_far_away_keeps_its_digits():
    with pytest.raises(ValueError, match=r"onset 1732876800\.25 s lies outside the game.* from 800 s to 812 s"):
        Simulation(make_scenario(SHORT), make_attack("ramp:1,onset=1732876800.25"))


def test_an_arl0_keeps_its_digits():
    assert at_arl0("windowed", 1234567.0) == "windowed:arl0=1234567.0"
    assert at_arl0("windowed", 1e5) == "windowed:arl0=100000"


def test_an_azimuth_may_be_a_text():
    np.testing.assert_array_equal(unit_vector("kappa", "90"), unit_vector("kappa", 90.0))
    with pytest.raises(ValueError, match="kappa: direction must be east, north, up or an azimuth in degrees, got 'x'"):
        unit_vector("kappa", "x")
    with pytest.raises(ValueError, match="kappa: direction must be a finite number"):
        unit_vector("kappa", "nan")
