"""Hostile arguments: whatever a person gives is either played, with finite numbers and no warning, or refused by name.

Parts and their parameters are taken from the registries and signatures, so that new ones are tried without a word here.
``fuzz(seed, tries)`` gives the broken promises, one text each.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from spoofgym import optimum
from spoofgym.attacks import ATTACKS, make_attack
from spoofgym.attacks.base import Attack
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.navigation.credible.kalman import CredibleTuning
from spoofgym.navigation.credible.runs import AuxiliaryRule
from spoofgym.navigation.facts import RANGES
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose.adaptation import Adaptation
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.parallel import RunSlices
from spoofgym.responses import RESPONSES, make_response
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import SCENARIOS, make_scenario
from spoofgym.sensors.confounders import Disturbances
from spoofgym.sensors.imu import grade
from spoofgym.sensors.odometer import Odometer
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.trajectory import Accelerate, Climb, Straight, Turn
from tests.stress.hostile import ACTIONS, hostile, hostile_text, shown
from tests.stress.tries import Try, broken_promise

LOOSE, TIGHT, LONG = "liu-flight:horizon=12", "kujur-flight:horizon=12,onset=60", "foi-drive:horizon=30"
UNMATCHED = "foi-drive:receiver=foi,onset=60,horizon=12"
LONG_TIGHT = "kujur-flight:horizon=60,onset=60"
QUICK: dict[str, dict[str, Any]] = {"kujur-flight": {"horizon": 12, "onset": 60.0}, "liu-flight": {"horizon": 12}}
"""Options that make a scenario short, where it has them."""
STEPS = 4


def fuzz(seed: int, tries: int) -> list[str]:
    """Make tries; the broken promises."""
    return [words for attempt in attempts(seed, tries) if (words := broken_promise(attempt))]


def attempts(seed: int, tries: int) -> Iterator[Try]:
    """The tries of `fuzz`, one by one."""
    rng = np.random.default_rng(seed)
    for _ in range(tries):
        yield GENERATORS[int(rng.integers(len(GENERATORS)))](rng)


# --- parts ------------------------------------------------------------------------------------------------------------

MAKERS: dict[str, Callable[[Any], Any]] = {
    "attack": make_attack,
    "detector": make_detector,
    "response": make_response,
    "scenario": make_scenario,
}
KINDS: dict[str, tuple[dict[str, Callable[..., Any]], Callable[[Any], None]]] = {}


def _parts(rng: np.random.Generator) -> Try:
    kind = str(rng.choice(list(KINDS)))
    registry, play = KINDS[kind]
    names = [name for name in registry if inspect.signature(registry[name]).parameters and name != "recorded"]
    name = str(rng.choice(names))
    factory = registry[name]
    parameters = list(inspect.signature(factory).parameters.values())
    chosen = rng.choice(len(parameters), size=min(len(parameters), 1 + int(rng.random() < 0.2)), replace=False)
    keys = [parameters[int(place)].name for place in chosen]
    played = play if _fits(kind, name) else _nothing
    quick = QUICK.get(name, {}) if kind == "scenario" else {}
    if rng.random() < 0.5:
        options = {p.name: _example(p) for p in parameters if p.default is p.empty} | quick
        options |= {key: hostile_text(rng) for key in keys}
        text = f"{name}:" + ",".join(f"{key}={value}" for key, value in options.items())
        named = (*keys, "specification", "member")
        owners = (name, "specification", *_inner(name))
        return Try(f"{kind} {text[:150]!r}", owners, named, lambda: MAKERS[kind](text), played)
    given = {p.name: _example(p) for p in parameters if p.default is p.empty} | quick
    given |= {key: hostile(rng) for key in keys}
    words = f"{kind} {name}({', '.join(f'{key}={shown(value)}' for key, value in given.items())})"
    return Try(words, (name, *_inner(name)), tuple(keys), lambda: factory(**given), played)


def _inner(name: str) -> tuple[str, ...]:
    """Owners that answer for the options of a part which they make up, or from which it is made."""
    within = {
        "ci": ("windowed",),
        "kujur-monitor": ("cpi", "separation-bank"),
        "training": ("random-ramp", "pool of attacks"),
        "held-out": ("two-stage-ramp", "pool of attacks"),
    }
    return within.get(name, ())


def _example(parameter: inspect.Parameter) -> Any:
    """A good value of a parameter that must be given."""
    return {"attack": "ramp:1", "members": "snapshot+rio"}.get(parameter.name, 2.0)


@cache
def _fits(kind: str, name: str) -> bool:
    """Whether the part plays in the scenarios here at all."""
    registry, play = KINDS[kind]
    parameters = inspect.signature(registry[name]).parameters.values()
    try:
        play(registry[name](**{p.name: _example(p) for p in parameters if p.default is p.empty}))
    except ValueError:
        return False
    return True


def _nothing(part: Any) -> None:
    """A part that does not fit is built only."""


def _run(simulation: Simulation) -> None:
    """A few epochs, all of whose numbers are finite."""
    simulation.reset()
    for _ in range(min(STEPS, simulation.scenario.timeline.num_epochs)):
        simulation.resolve()
        epoch = simulation.observe()
        for values in (simulation.error, epoch.innovation.nis, *epoch.statistics.values(), simulation.offset):
            assert np.all(np.isfinite(values)), "a number that is not finite"


def _play_attack(attack: Attack) -> None:
    scenario = make_scenario(TIGHT if attack.needs_ranges else LONG)
    _run(Simulation(scenario, attack, [make_detector("snapshot")], None, 2, 1))


def _play_detector(detector: Detector) -> None:
    scenario = make_scenario(TIGHT if RANGES in detector.needs else LOOSE if detector.memory > 20 else UNMATCHED)
    for member in (*detector.members, detector):
        if member.lacks_slope:
            member.set_slope(0.0)
        if member.target_arl0 is not None:  # its calibration takes long
            member.set_threshold(1e6)
    _run(Simulation(scenario, make_attack("ramp:1"), [detector], None, 2, 1))


def _play_response(response: Response) -> None:
    scenario = make_scenario(TIGHT if response.needs else LOOSE)
    _run(Simulation(scenario, make_attack("ramp:4"), [make_detector("snapshot:threshold=5")], response, 2, 1))


def _play_scenario(scenario: Scenario) -> None:
    _run(Simulation(scenario, make_attack("ramp:1"), [make_detector("snapshot")], None, 2, 1))


KINDS |= {
    "attack": (ATTACKS, _play_attack),
    "detector": (DETECTORS, _play_detector),
    "response": (RESPONSES, _play_response),
    "scenario": (SCENARIOS, _play_scenario),
}

# --- environments -----------------------------------------------------------------------------------------------------

ENVIRONMENTS: tuple[tuple[type, type, dict[str, Any]], ...] = (
    (SpooferEnv, SpooferConfig, {"scenario": LOOSE}),
    (SpooferVectorEnv, SpooferConfig, {"scenario": LOOSE, "num_envs": 2}),
    (DefenderEnv, DefenderConfig, {"scenario": LONG, "detectors": "snapshot"}),
    (DefenderVectorEnv, DefenderConfig, {"scenario": LONG, "detectors": "snapshot", "num_envs": 2}),
    (SpooferEnv, SpooferConfig, {"scenario": TIGHT}),
    (DefenderVectorEnv, DefenderConfig, {"scenario": LONG_TIGHT, "detectors": "snapshot", "num_envs": 2}),
)
OF_VECTORS = ("num_envs", "autoreset_mode", "max_episode_steps")


def _owners(kind: type) -> tuple[str, ...]:
    return kind.__name__, "Spoofer-v0" if kind.__name__.startswith("Spoofer") else "Defender-v0"


def _play_environment(env: Any) -> None:
    observation, _ = env.reset(seed=1)
    for _ in range(STEPS):
        assert env.observation_space.contains(observation), "an observation outside its space"
        action = env.action_space.sample()
        observation, reward, terminated, truncated, _ = env.step(action)
        assert np.all(np.isfinite(reward)), "a reward that is not finite"
        if np.ndim(terminated) == 0 and (terminated or truncated):
            break
    env.close()


def _environments(rng: np.random.Generator) -> Try:
    kind, config, given = ENVIRONMENTS[int(rng.integers(len(ENVIRONMENTS)))]
    vector = "num_envs" in given
    keys = [item.name for item in fields(config)] + ["render_mode", *(OF_VECTORS if vector else ())]
    key = str(rng.choice(keys))
    value = hostile(rng)
    if isinstance(value, str) and key in ("scenario", "shadow", "detector", "detectors", "attacks", "response"):
        value = hostile_text(rng)
    if key == "num_envs" and isinstance(value, int | float) and 20 < value < 100_000:
        value = 20  # more lanes are only slower
    arguments = {**given, key: value}
    owners = (*_owners(kind), "scenario", "action") if key in ("fidelity", "shadow") else _owners(kind)
    words = f"{kind.__name__}({', '.join(f'{name}={shown(item)}' for name, item in arguments.items())})"
    return Try(words, owners, (key,), lambda: kind(**arguments), _play_environment)


@cache
def _environment(place: int) -> Any:
    kind, _, given = ENVIRONMENTS[place]
    return kind(**given, **({"autoreset_mode": AutoresetMode.SAME_STEP} if "num_envs" in given else {}))


def _resets(rng: np.random.Generator) -> Try:
    place = int(rng.integers(len(ENVIRONMENTS)))
    key, value = ("seed", "options")[int(rng.random() < 0.5)], hostile(rng)
    if key == "options" and rng.random() < 0.5:
        value = {"reset_mask": value} if rng.random() < 0.5 else {str(value)[:20]: 1}
    kind = ENVIRONMENTS[place][0]
    words = f"{kind.__name__}.reset({key}={shown(value)})"
    env = _environment(place)
    return Try(words, (*_owners(kind), "options['reset_mask']"), (key,), lambda: env.reset(**{key: value}), _nothing)


def _actions(rng: np.random.Generator) -> Try:
    place = int(rng.integers(len(ENVIRONMENTS)))
    env = _environment(place)
    env.reset(seed=2)
    good = np.asarray(env.action_space.sample())
    value = ACTIONS[int(rng.integers(len(ACTIONS)))]
    if rng.random() < 0.6:  # within an action of the right shape
        action: Any = good.tolist()
        row = action[0] if good.ndim == 2 else action
        row[int(rng.integers(len(row)))] = value
        if rng.random() < 0.5:
            try:
                action = np.array(action)
            except (ValueError, TypeError):
                action = np.array(action, dtype=object)
    elif rng.random() < 0.5:
        shape = (int(rng.integers(4)),) * int(rng.integers(4))
        action = np.zeros(shape, dtype=str(rng.choice(["f8", "i8", "c16", "?", "U3"])))
    else:
        action = value
    words = f"{ENVIRONMENTS[place][0].__name__}.step({shown(action)})"

    def play(_: Any) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            observation, reward, *_rest = env.step(action)
        assert np.all(np.isfinite(observation)), "an observation that is not finite"
        assert np.all(np.isfinite(reward)), "a reward that is not finite"

    return Try(words, ("action", "actions"), ("action", "actions"), lambda: None, play)


# --- other callables --------------------------------------------------------------------------------------------------


def _simulate(**arguments: Any) -> Simulation:
    return Simulation(make_scenario(LOOSE), None, [make_detector("snapshot")], **arguments)


def _streams(**arguments: Any) -> RunStreams:
    return RunStreams.from_seed(**{"seed": 1, "num_runs": 2, **arguments})


OTHER_CALLABLES: tuple[tuple[Callable[..., Any], tuple[str, ...], tuple[str, ...], Callable[[Any], None]], ...] = (
    (_simulate, ("Simulation", "scenario"), ("num_runs", "seed", "threads", "fidelity", "response", "attack"), _run),
    (RunSlices, ("slices of runs",), ("threads",), _nothing),
    (_streams, ("random streams",), ("seed", "num_runs"), _nothing),
)


def _others(rng: np.random.Generator) -> Try:
    function, owners, keys, play = OTHER_CALLABLES[int(rng.integers(len(OTHER_CALLABLES)))]
    key, value = str(rng.choice(keys)), hostile(rng)
    words = f"{owners[0]}({key}={shown(value)})"
    return Try(words, (*owners, "slices of runs"), (key,), lambda: function(**{key: value}), play)


CREDIBLE = {"step": 0.1, "samples": 5, "acceleration": 0.5, "auxiliary_sigma": 0.5, "fix_sigma": 0.6, "height_sigma": 1}
SETTINGS: tuple[tuple[Callable[..., Any], dict[str, Any]], ...] = (
    (Receiver, {}), (FilterTuning, {}), (Disturbances, {}), (Adaptation, {}), (AuxiliaryRule, {}), (Demands, {}),
    (Odometer, {}), (CredibleTuning, CREDIBLE), (Straight, {"duration": 1.0}), (Turn, {"angle": 1.0, "duration": 1.0}),
    (Climb, {"height_change": 1.0, "duration": 1.0}), (Accelerate, {"speed_change": 1.0, "duration": 1.0}),
    (grade, {"name": "fog"}), (replace, {"obj": grade("fog")}),
)  # fmt: skip


def _settings(rng: np.random.Generator) -> Try:
    """Frozen settings of sensors, filters and trajectories."""
    make, given = SETTINGS[int(rng.integers(len(SETTINGS)))]
    if make is replace:
        keys = [item.name for item in fields(given["obj"]) if item.name != "name"]
    else:
        keys = list(inspect.signature(make).parameters)
    key, value = str(rng.choice(keys)), hostile(rng)
    if rng.random() < 0.3:
        value = (value,) * int(rng.choice([2, 3, 6]))
    words = f"{make.__name__}({key}={shown(value)})"
    arguments = {**given, key: value}
    return Try(words, ("must", "needs", "unknown"), (key, "grade"), lambda: _make(make, arguments), _nothing)


def _make(make: Callable[..., Any], given: dict[str, Any]) -> Any:
    given = dict(given)
    return replace(given.pop("obj"), **given) if make is replace else make(**given)


OF_MODELS = tuple(
    (function, tuple(key for key in inspect.signature(function).parameters if key not in ("model", "tests", "offsets")))
    for function in (
        optimum.best_budget, optimum.best_ramp, optimum.bounded_optimum, optimum.cumulative_optimum,
        optimum.dynamic_programme, optimum.noncentrality_optimum, optimum.upper_bound, optimum.ewma,
        optimum.window_mean, optimum.missed_magnitude, optimum.expected_play, optimum.zero_alarm,
    )
)  # fmt: skip
GOOD = {"threshold": 25.9, "num_epochs": 3, "budget": 1.0, "drag_off_rate": 1.0, "n": 3, "limit": 3.0, "degrees": 9}


def _optima(rng: np.random.Generator) -> Try:
    """Numbers of the optimum's functions, on a model of a few epochs."""
    function, keys = OF_MODELS[int(rng.integers(len(OF_MODELS)))]
    key, value = str(rng.choice(keys)), hostile(rng)
    parameters = inspect.signature(function).parameters
    given = {name: GOOD.get(name, 0.5) for name, p in parameters.items() if p.default is p.empty}
    model = make_scenario(LOOSE).linear_model()
    for name, thing in (("model", model), ("offsets", np.zeros((12, 3))), ("tests", optimum.gate(3.0))):
        if name in parameters:
            given[name] = thing
    given[key] = value
    words = f"optimum.{function.__name__}({key}={shown(value)})"
    return Try(words, (*OF_OPTIMA, function.__name__), (key,), lambda: _found(function, given), _nothing)


def _found(function: Callable[..., Any], given: dict[str, Any]) -> Any:
    """What an optimum finds; that it finds nothing is documented as a RuntimeError."""
    try:
        return function(**given)
    except RuntimeError:
        return None


OF_OPTIMA = ("snapshot test", "cumulative test", "optimum", "linear test", "must")


GENERATORS: tuple[Callable[[np.random.Generator], Try], ...] = (
    _parts, _parts, _parts, _environments, _environments, _resets, _actions, _others, _optima,
    _settings,
)  # fmt: skip
