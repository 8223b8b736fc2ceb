"""Games of defenders: the same episodes for all, and what the simplest ones do is what a plain simulation gives."""

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.opponents import spoofer_pool
from spoofgym.evaluation import defence
from spoofgym.evaluation.defence import (
    World,
    play_always,
    play_never,
    play_oracle_onset,
    play_policy,
    play_random,
    play_response,
)
from spoofgym.evaluation.defence_metrics import paired_difference
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

DETECTORS = ("snapshot", "signed-mean:p_fa=0.001")
EPISODES, EPOCHS, SEED = 30, 60, 11
SAME = ("available", "attacked", "clean", "member")
DISTURBANCES = Disturbances(
    outage_share=0.4, outage_duration=(5.0, 15.0), multipath_share=0.4, multipath_duration=(5.0, 10.0)
)
CONFIG = DefenderConfig(scenario=f"foi-drive:horizon={EPOCHS}", detectors=DETECTORS)


@pytest.fixture(scope="module")
def world():
    scenario = make_scenario(CONFIG.scenario)
    return World(scenario, "training", 0.4, detectors_for(scenario), DISTURBANCES)


def detectors_for(scenario):
    """Their thresholds are those of theory: nothing is calibrated."""
    return tuple(calibrated_all([make_detector(name) for name in DETECTORS], scenario))


def constant(exclude, depth=0):
    """A policy that does not look."""
    return lambda observation: np.tile([exclude, depth], (len(observation), 1))


@pytest.fixture(scope="module")
def played(world):
    """Games of every kind of defender on the same seeds."""
    follow = {
        "exclude": ("snapshot", "exclude"),
        "backtrack": ("signed-mean:p_fa=0.001", "exclude-and-backtrack:20,reuse=5"),
        "px4-auto": ("snapshot", "px4-auto"),
    }
    games = {
        name: play_response(world, detector, make_response(response), EPISODES, SEED)
        for name, (detector, response) in follow.items()
    }
    simple = {"never": play_never, "always": play_always, "random": play_random, "oracle-onset": play_oracle_onset}
    games |= {name: play(world, EPISODES, SEED) for name, play in simple.items()}
    games["policy uses"] = play_policy(world, CONFIG, constant(0), EPISODES, SEED)
    games["policy excludes"] = play_policy(world, CONFIG, constant(1), EPISODES, SEED)
    return games


def horizontal(simulation):
    return np.sqrt(simulation.error[:, 0] ** 2 + simulation.error[:, 1] ** 2)


def plain(world, use):
    """Errors of a plain simulation of the same games, (n, K), in which ``use`` decides on every fix."""
    simulation = Simulation(
        world.scenario,
        spoofer_pool(world.attacks, world.clean),
        detectors_for(world.scenario),
        None,
        EPISODES,
        SEED,
        demands=Demands(excludes=True),
        confounders=Confounders(world.disturbances),
    )
    simulation.reset()
    errors = []
    for k in range(EPOCHS):
        if k:
            simulation.observe()
        simulation.resolve(Decision(np.full(EPISODES, use)))
        errors.append(horizontal(simulation))
    return np.array(errors).T


# --- common random numbers --------------------------------------------------------------------------------------------


def test_the_games_have_everything_in_them(played):
    games = played["never"]
    assert games.error.shape == (EPISODES, EPOCHS)
    assert games.timeline.interval == 1.0
    assert (games.member == -1).any()
    assert set(games.member[games.member >= 0]) == set(range(len(games.names)))
    assert not games.available.all()
    assert (games.clean != (games.available & ~games.attacked)).any()  # multipath
    assert not games.clean[games.attacked | ~games.available].any()
    assert games.available[:, 0].all()
    assert not games.attacked[:, 0].any()
    np.testing.assert_array_equal(games.attacked.any(axis=1), games.member >= 0)


def test_every_defender_meets_the_same_games(played):
    first = played["never"]
    for name, games in played.items():
        for part in SAME:
            np.testing.assert_array_equal(getattr(games, part), getattr(first, part), err_msg=f"{part} of {name}")
        assert games.names == first.names
        paired_difference(games, first)


def test_the_same_decisions_have_the_same_errors(played):
    """Bit for bit, up to the first epoch in which a defender decides otherwise than one that uses every fix."""
    first, compared = played["never"], 0
    for name in ("exclude", "backtrack", "random", "oracle-onset"):
        same = ~np.logical_or.accumulate(played[name].excluded & first.available, axis=1)
        np.testing.assert_array_equal(played[name].error[same], first.error[same], err_msg=name)
        assert same[:, 0].any()
        compared += np.count_nonzero(same)
    assert compared > EPISODES * EPOCHS


def test_games_do_not_depend_on_their_batch(world, played, monkeypatch):
    monkeypatch.setattr(defence, "BATCH", 13)
    again = play_response(
        world, "signed-mean:p_fa=0.001", make_response("exclude-and-backtrack:20,reuse=5"), EPISODES, SEED
    )
    policy = play_policy(world, CONFIG, constant(0), EPISODES, SEED)
    for games, expected in ((again, played["backtrack"]), (policy, played["policy uses"])):
        for part in (*SAME, "error", "excluded"):
            np.testing.assert_array_equal(getattr(games, part), getattr(expected, part))


def test_another_seed_is_another_set_of_games(world, played):
    other = play_never(world, EPISODES, SEED + 1)
    np.testing.assert_array_equal(other.error[:-1], played["never"].error[1:])
    with pytest.raises(ValueError, match="not played on the same episodes"):
        paired_difference(other, played["never"])


# --- the simplest defenders -------------------------------------------------------------------------------------------


def test_never_is_a_simulation_that_uses_every_fix(world, played):
    np.testing.assert_array_equal(played["never"].error, plain(world, True))
    assert not played["never"].excluded.any()


def test_always_coasts(world, played):
    np.testing.assert_array_equal(played["always"].error, plain(world, False))
    assert played["always"].excluded.all()


def test_a_coast_does_not_notice_the_attack(world, played):
    """Nothing of the spoofer is in the errors of a defender that takes no fix."""
    undisturbed = Disturbances(outage_share=0.0, multipath_share=0.0)
    harmless = play_always(replace(world, clean=1.0, disturbances=undisturbed), EPISODES, SEED)
    np.testing.assert_array_equal(played["always"].error, harmless.error)
    assert not harmless.attacked.any()


def test_oracle_onset_excludes_just_the_spoofed_fixes(played):
    games = played["oracle-onset"]
    np.testing.assert_array_equal(games.excluded, games.attacked)


def test_random_excludes_half(played):
    """Of 1800 tosses; 5 standard deviations: false failure below 1e-6."""
    tosses = EPISODES * EPOCHS
    assert abs(played["random"].excluded.mean() - 0.5) < 5 * 0.5 / np.sqrt(tosses)


def test_random_takes_fixes_back(world, played):
    """The same exclusions without depth have other errors."""
    expected = played["random"]
    again = play_random(world, EPISODES, SEED)
    np.testing.assert_array_equal(again.error, expected.error)
    flat = world.scenario.changed(depth_table=(0,) * len(world.scenario.depth_table))
    shallow = play_random(replace(world, scenario=flat), EPISODES, SEED)
    np.testing.assert_array_equal(shallow.excluded, expected.excluded)
    assert not np.array_equal(shallow.error, expected.error)


@pytest.mark.parametrize(("policy", "simple"), [("policy uses", "never"), ("policy excludes", "always")])
def test_a_constant_policy_is_the_simple_defender(played, policy, simple):
    np.testing.assert_array_equal(played[policy].error, played[simple].error)
    np.testing.assert_array_equal(played[policy].excluded, played[simple].excluded)


# --- responses and policies -------------------------------------------------------------------------------------------


def test_a_response_does_not_use_what_is_not_there(played):
    for name in ("exclude", "backtrack", "px4-auto"):
        assert played[name].excluded[~played[name].available].all()


def test_a_response_excludes_where_its_detector_alarms(world, played):
    """`exclude` leaves a fix out just while the snapshot's statistic of its own innovations is above the threshold."""
    simulation = world.simulation(make_response("exclude"), RunStreams.from_seed(SEED, EPISODES), Demands())
    threshold = world.detectors[0].threshold
    simulation.reset()
    for k in range(EPOCHS):
        if k:
            simulation.observe()
        alarm = simulation.epoch.statistics["snapshot"] > threshold
        available = simulation.epoch.available
        np.testing.assert_array_equal(played["exclude"].excluded[:, k], alarm | ~available)
        simulation.resolve(Decision(~alarm))
        np.testing.assert_array_equal(played["exclude"].error[:, k], horizontal(simulation))


def test_a_policy_sees_the_observations_of_its_game(world):
    seen = []

    def act(observation):
        seen.append(observation.copy())
        return constant(0)(observation)

    play_policy(world, CONFIG, act, 5, SEED)
    assert len(seen) == EPOCHS
    assert seen[0].shape[0] == 5
    assert all(np.isfinite(one).all() and np.abs(one).max() <= 1.0 for one in seen)
    assert not np.array_equal(seen[0], seen[-1])


def test_a_policy_may_be_trained_on_other_games(world, played):
    """What it plays in is the world's, whatever stands in its configuration."""
    other = replace(CONFIG, scenario="foi-drive", attacks="held-out", clean=0.9, outage=0.0, multipath=1.0)
    games = play_policy(world, other, constant(0), EPISODES, SEED)
    np.testing.assert_array_equal(games.error, played["policy uses"].error)
    np.testing.assert_array_equal(games.available, played["never"].available)


@pytest.mark.parametrize("play", [play_never, play_always, play_random, play_oracle_onset])
def test_no_episodes_are_refused(world, play):
    with pytest.raises(ValueError, match="episodes must be a whole number, 1 or more, got 0"):
        play(world, 0, SEED)


def test_what_is_not_there_cannot_be_watched(world):
    with pytest.raises(ValueError, match=r"no detector 'windowed'; there are: snapshot, signed-mean:p_fa=0\.001"):
        play_response(world, "windowed", make_response("exclude"), 1, 0)
