"""A copy of a simulation in mid-game goes on as the original does, bit for bit: every detector, attack and response."""

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numba import typeof

from spoofgym.attacks import ATTACKS, make_attack
from spoofgym.attacks.base import Attack
from spoofgym.detectors import DETECTORS
from spoofgym.detectors.base import Detector
from spoofgym.immutable import Immutable
from spoofgym.parallel import RunSlices
from spoofgym.responses import RESPONSES, make_response
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.golden.parts import ready, spelled

COPY: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda original: pickle.loads(pickle.dumps(original)),
}
LOOSE = "liu-flight:horizon=24,onset=300"
TIGHT = "kujur-flight:horizon=24,onset=120"
ROBOT = "song-robot:horizon=24"
AIDED, AIDED_TIGHT = f"{LOOSE},aids=barometer", f"{TIGHT},aids=barometer"
BOTH = (LOOSE, TIGHT, AIDED, AIDED_TIGHT)
"""Scenarios with both fidelities."""
GAMES = [(text, fidelity) for text in BOTH for fidelity in ("linear", "strapdown")] + [(ROBOT, "linear")]
BEFORE, AFTER = 9, 12


def fitting(part: Detector | Response) -> list[str]:
    """The scenarios that offer what the part needs."""
    return [text for text in (*BOTH, ROBOT) if set(part.needs) <= set(make_scenario(text).offers)]


def together(text: str) -> list[Detector]:
    """Every detector that fits a scenario."""
    return [detector for detector in map(ready, DETECTORS) if text in fitting(detector)]


def play(simulation: Simulation, epochs: int, offset: np.ndarray | None = None) -> list[np.ndarray]:
    """All that can be seen of some epochs."""
    trace = []
    for _ in range(epochs):
        simulation.resolve()
        epoch = simulation.observe(offset)
        seen = (epoch.innovation.residual, epoch.innovation.nis, simulation.error, simulation.offset)
        trace += [*epoch.statistics.values(), *seen, simulation.alarm, simulation.used, simulation.decision.use]
    return [np.array(values) for values in trace]


def rest(simulation: Simulation) -> list[np.ndarray]:
    """The rest of a game, a new game of the first run, and one of all runs."""
    trace = play(simulation, AFTER)
    for runs in (np.array([0]), None):
        simulation.reset(runs)
        trace += play(simulation, 3)
    return trace


def check_copies(make: Callable[[], Simulation]) -> None:
    """Either kind of copy, taken in mid-game and played first, sees what the original sees."""
    original = make()
    original.reset()
    play(original, BEFORE)
    check_no_views(original)
    copies = {how: make_copy(original) for how, make_copy in COPY.items()}
    traces = {how: rest(simulation) for how, simulation in copies.items()}
    expected = rest(original)
    for how, trace in traces.items():
        for number, (one, other) in enumerate(zip(trace, expected, strict=True)):
            np.testing.assert_array_equal(one, other, err_msg=f"{how}, value {number}")


def check_no_views(root: object) -> None:
    """No two attributes share memory, which a copy would part, but for one and the same array and for what is fixed."""
    arrays = {id(array): array for array in arrays_in(root, set())}
    for one, other in combinations(arrays.values(), 2):
        apart = not np.may_share_memory(one, other) or not np.shares_memory(one, other)
        assert apart, f"arrays of shapes {one.shape} and {other.shape} share memory"


def arrays_in(part: Any, seen: set[int]) -> Iterator[np.ndarray]:
    """The arrays in an object and in all of it that a copy takes, but for what is never written."""
    if id(part) in seen or isinstance(part, Immutable | RunSlices):
        return
    seen.add(id(part))
    if isinstance(part, np.ndarray):
        yield part
        return
    own = part.__getstate__() if "__getstate__" in vars(type(part)) else getattr(part, "__dict__", {})
    inner = list(part) if isinstance(part, list | tuple | set) else list((own or {}).values())
    for item in [*inner, *(part.values() if isinstance(part, dict) else ())]:
        yield from arrays_in(item, seen)


def test_every_detector_fits_a_scenario() -> None:
    assert [name for name in DETECTORS if not fitting(ready(name))] == []


@pytest.mark.parametrize(("text", "fidelity"), GAMES)
def test_detectors(text: str, fidelity: str) -> None:
    scenario, detectors = make_scenario(text), together(text)
    assert len(detectors) > 15
    attack = "ramp:0.5" if text != ROBOT else "jump"
    check_copies(lambda: Simulation(scenario, make_attack(attack), detectors, None, 3, 5, fidelity=fidelity))


@pytest.mark.parametrize("name", ATTACKS)
def test_attacks(name: str) -> None:
    attack = make_attack(spelled(name))
    scenario = game_of(attack)
    check_copies(lambda: Simulation(scenario, attack, [ready("windowed:n=4")], make_response("exclude"), 3, 5))


def game_of(attack: Attack) -> Scenario:
    """A short game in which the attack begins, on ranges or on fixes with velocity where it needs them."""
    if attack.needs_ranges:
        return make_scenario(TIGHT)
    first = 300 if attack.onset is None else round(attack.onset) - 5
    scenario = make_scenario(f"liu-flight:horizon=120,onset={first}")
    if not attack.needs_velocity:
        return scenario
    sigma = (0.1, 0.1, 0.1)
    tuning = replace(scenario.family.tuning, measurement_sigma=scenario.family.tuning.measurement_sigma + sigma)
    return scenario.changed(receiver=replace(scenario.family.receiver, velocity_sigma=sigma), tuning=tuning)


@pytest.mark.parametrize("name", RESPONSES)
def test_responses(name: str) -> None:
    """Detectors that soon alarm, so that the response has something to remember."""
    text = fitting(make_response(name))[0]
    detectors = [ready("windowed:n=4", 60.0 if text == LOOSE else 300.0), ready("snapshot:threshold=40")]
    check_copies(lambda: Simulation(make_scenario(text), make_attack("jump:30"), detectors, make_response(name), 3, 5))


def test_what_is_never_written_is_shared_by_deep_copies() -> None:
    """A copy for a search costs little, and the models that a scenario remembers are found again."""
    for text, fidelity in GAMES:
        original = Simulation(make_scenario(text), fidelity=fidelity)
        other = copy.deepcopy(original)
        assert other.scenario is original.scenario
        assert other.navigator is not original.navigator
        assert other.navigator.model is original.navigator.model


@pytest.mark.parametrize(("text", "fidelity"), GAMES)
def test_arrays_of_a_navigator_lie_in_memory_as_before(text: str, fidelity: str) -> None:
    """The kernels are compiled for layouts: a copy must not ask for another one."""
    original = Simulation(make_scenario(text), fidelity=fidelity)
    original.reset()
    for how, make_copy in COPY.items():
        other = make_copy(original)
        for name, value in vars(original.navigator).items():
            if isinstance(value, np.ndarray):
                assert typeof(getattr(other.navigator, name)) == typeof(value), f"{how}: {name}"


def test_a_shallow_copy_that_is_bound_anew_shares_no_memory() -> None:
    """As the simulation copies detectors to warm up some runs."""
    for text in (LOOSE, TIGHT, ROBOT):
        simulation = Simulation(make_scenario(text), make_attack("jump"), together(text), None, 3, 5)
        simulation.reset()
        play(simulation, BEFORE)
        before = {name: memory(detector) for name, detector in simulation.detectors.items()}
        simulation._warm(np.array([1]))
        for name, detector in simulation.detectors.items():
            assert memory(detector) == before[name], name


def memory(detector: Detector) -> bytes:
    """What it remembers, without the game that it has joined."""
    return pickle.dumps({name: value for name, value in vars(detector).items() if not isinstance(value, Simulation)})
