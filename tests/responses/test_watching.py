"""A response that follows one detector: it sees that detector's alarm and no other's."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.navigation.interface import Demands
from spoofgym.responses import make_response
from spoofgym.responses.watching import Watching
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SNAPSHOT, WINDOWED = "snapshot:threshold=20", "windowed:n=5,threshold=40"
EPOCHS, RUNS = 40, 6


def detectors():
    return [make_detector(SNAPSHOT), make_detector(WINDOWED)]


@pytest.fixture
def script(scripts):
    return scripts.eventful(EPOCHS, RUNS)


@pytest.fixture
def statistics():
    """Of both detectors at every epoch, (K, N), each above its threshold at times of its own."""
    rng = np.random.default_rng(3)
    return {name: scale * rng.uniform(0.0, 1.2, (EPOCHS, RUNS)) for name, scale in ((SNAPSHOT, 20), (WINDOWED, 40))}


def decisions(response, script, statistics, alarm, runs=slice(None)):
    part = script.of(runs)
    response.bind(part.num_runs)
    response.reset(np.arange(part.num_runs))
    result = []
    for k in range(EPOCHS):
        epoch = replace(part.epoch(k), statistics={name: values[k, runs] for name, values in statistics.items()})
        decision = response.decide(epoch, alarm[k, runs])
        result.append((decision.use, np.zeros(part.num_runs) if decision.backtrack is None else decision.backtrack))
    return np.array(result)


@pytest.mark.parametrize(("name", "threshold"), [(SNAPSHOT, 20), (WINDOWED, 40)])
@pytest.mark.parametrize("specification", ["exclude", "exclude-and-backtrack:10,reuse=3", "latch"])
def test_it_decides_as_the_response_does_on_that_alarm(script, statistics, specification, name, threshold):
    watching = Watching(make_response(specification), name, detectors())
    anything = np.random.default_rng(4).random((EPOCHS, RUNS)) < 0.5
    found = decisions(watching, script, statistics, anything)
    expected = decisions(make_response(specification), script, statistics, statistics[name] > threshold)
    np.testing.assert_array_equal(found, expected)
    others = decisions(make_response(specification), script, statistics, anything)
    assert not np.array_equal(found, others)


def test_a_statistic_at_its_threshold_is_no_alarm(script):
    at = {SNAPSHOT: np.full((EPOCHS, RUNS), 20.0), WINDOWED: np.full((EPOCHS, RUNS), 99.0)}
    watching = Watching(make_response("exclude"), SNAPSHOT, detectors())
    use = decisions(watching, script, at, np.ones((EPOCHS, RUNS), dtype=bool))[:, 0]
    np.testing.assert_array_equal(use, script.available)


def test_what_it_is_called_and_asks_for():
    watching = Watching(make_response("exclude-and-backtrack:30"), WINDOWED, detectors())
    assert watching.name == f"{WINDOWED} > exclude-and-backtrack:30"
    assert watching.demands == Demands(excludes=True, history=30)


def test_runs_are_independent(script, statistics):
    """Those of a copy bound to some runs are the same, and are taken over by the whole."""
    watching = Watching(make_response("exclude-and-backtrack:10,reuse=3"), SNAPSHOT, detectors())
    alarm = np.zeros((EPOCHS, RUNS), dtype=bool)
    whole = decisions(watching, script, statistics, alarm)
    chosen = np.array([4, 1])
    part = copy.copy(watching)
    few = decisions(part, script, statistics, alarm, chosen)
    np.testing.assert_array_equal(few, whole[:, :, chosen])

    fresh = copy.copy(watching)
    fresh.bind(RUNS)
    fresh.reset(np.arange(RUNS))
    fresh.take(chosen, part)
    state, expected = fresh._response._excluding, watching._response._excluding
    assert expected.any()
    np.testing.assert_array_equal(state[chosen], expected[chosen])
    assert not state[np.setdiff1d(np.arange(RUNS), chosen)].any()


def test_two_simulations_do_not_share_the_given_response():
    given = make_response("exclude")
    first = Watching(given, SNAPSHOT, detectors())
    first.bind(3)
    second = Watching(given, SNAPSHOT, detectors())
    second.bind(5)
    assert first._response._excluding.shape == (3,)
    assert second._response._excluding.shape == (5,)
    assert not hasattr(given, "_excluding")


def test_in_a_simulation_the_other_detector_changes_nothing():
    """The signed mean alarms at a slow ramp where the snapshot does not, and the watching response stays calm."""
    scenario = make_scenario("foi-drive:horizon=40")
    errors = []
    for watched in (False, True):
        beside = [make_detector("snapshot:threshold=9"), make_detector("windowed:n=5,threshold=1e9")]
        response = make_response("exclude-and-backtrack:10")
        if watched:
            beside.append(make_detector("signed-mean:n=5,threshold=12"))
            response = Watching(response, "snapshot:threshold=9", beside)
        simulation = Simulation(scenario, make_attack("ramp:0.3"), beside, response, 8, seed=5)
        simulation.reset()
        used, error, others = [], [], []
        for _ in range(40):
            simulation.resolve()
            used.append(simulation.used.copy())
            simulation.observe()
            error.append(simulation.error.copy())
            others.append(simulation.alarm & (simulation.epoch.statistics["snapshot:threshold=9"] <= 9))
        assert not np.all(used)
        assert np.any(others) == watched
        errors.append(np.array(error))
    np.testing.assert_array_equal(*errors)


def test_the_detector_must_be_there_and_have_a_threshold():
    with pytest.raises(ValueError, match=r"no detector 'oracle'; there are: snapshot:threshold=20, windowed:n=5"):
        Watching(make_response("exclude"), "oracle", detectors())
    with pytest.raises(ValueError, match="'signed-mean' has no threshold yet: calibrate it first"):
        Watching(make_response("exclude"), "signed-mean", [make_detector("signed-mean")])
