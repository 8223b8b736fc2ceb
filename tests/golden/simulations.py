"""Golden episodes of a `Simulation`: every scenario, fidelity and coupling; every detector, response and attack."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from spoofgym.attacks import ATTACKS, make_attack
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses import RESPONSES, make_response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.golden.parts import detectors_for, fits, ready, spelled

Arrays = dict[str, np.ndarray]
RUNS, SEED, EPOCHS = 3, 5, 14
LOOSE = "liu-flight:horizon=24,onset=300"
TIGHT = "kujur-flight:horizon=24,onset=120"
ROBOT = "song-robot:horizon=24"
SCENARIOS = {
    "liu": LOOSE,
    "liu-tight": f"{LOOSE},coupling=tight",
    "liu-ranges": f"{LOOSE},noise=ranges",
    "foi": "foi-drive:horizon=24",
    "foi-turn": "foi-drive:horizon=24,onset=60",
    "shadmehri": "shadmehri-flight:onset=27",
    "shadmehri-tuned": "shadmehri-flight:self-tuning,onset=27",
    "kujur": TIGHT,
    "song": ROBOT,
}
GUIDED = ("first-order:2", "second-order:2/axes=horizontal")
AIDED = {
    "liu": f"{LOOSE},aids=barometer+magnetometer:rate=2",
    "foi": "foi-drive:horizon=24,aids=wheel-speed:gate=0.01+zero-velocity",
    "kujur": f"{TIGHT},aids=barometer+magnetometer:rate=0.5/gate=0.01",
}
"""Filters with aids; of their games little is kept."""
HISTORY = 6


def trace(
    simulation: Simulation,
    decide: Callable[[int], Decision | None] = lambda k: None,
    see: Callable[[Simulation], Arrays] = lambda simulation: {},
    epochs: int = EPOCHS,
) -> Arrays:
    """What a game shows from its epoch 0 on, and what ``see`` adds; a decision of None is the response's."""
    simulation.reset()
    seen: list[Arrays] = [_seen(simulation) | see(simulation)]
    for k in range(epochs):
        simulation.resolve(decide(k))
        simulation.observe()
        seen.append(_seen(simulation) | see(simulation))
    return {name: np.array([epoch[name] for epoch in seen]) for name in seen[0]}


def _seen(simulation: Simulation) -> Arrays:
    epoch, navigator = simulation.epoch, simulation.navigator
    seen = {
        "residual": epoch.innovation.residual,
        "whitened": epoch.innovation.whitened,
        "nis": epoch.innovation.nis,
        "error": simulation.error,
        "velocity_error": navigator.velocity_error,
        "position_variance": np.diagonal(navigator.position_covariance, axis1=1, axis2=2),
        "bias": navigator.estimated_bias,
        "offset": simulation.offset,
        "alarm": simulation.alarm,
        "used": simulation.used,
        "backtracked": navigator.backtracked,
    }
    seen |= {f"statistic {name}": statistic for name, statistic in epoch.statistics.items()}
    return {name: np.array(values) for name, values in seen.items()}


def make(scenario: Scenario, attack: str, detectors: Any = (), response: Any = None, **options: Any) -> Simulation:
    """A simulation of the golden runs."""
    return Simulation(scenario, make_attack(attack), detectors, response, RUNS, SEED, **options)


def attack_on(text: str) -> str:
    """One that every filter notices within the game."""
    return "jump" if text == ROBOT else "ramp:0.5"


def plain(text: str, fidelity: str) -> Arrays:
    """Every fix is used; every detector that fits looks on."""
    scenario = make_scenario(text)
    return trace(make(scenario, attack_on(text), detectors_for(scenario), fidelity=fidelity))


def decided(text: str, fidelity: str) -> Arrays:
    """Decisions of every kind: exclusion, a scaled noise, a reset, a backtrack, single satellites."""
    scenario = make_scenario(text)
    slots = scenario.slots

    def decide(k: int) -> Decision:
        use = np.array([True, k % 3 != 0, not 4 <= k < 7])
        backtrack = np.array([5 if k == 9 else 0, 2 if k % 5 == 4 else 0, 9 if k == 11 else 0])
        reset = np.array([30.0 if k == 6 else 0.0, 0.0, 8.0 if k == 10 else 0.0])
        scale = np.array([1.0, 3.0 if k % 2 else 1.0, 1.0])
        satellites = None
        if slots:
            satellites = np.ones((RUNS, slots), dtype=bool)
            satellites[1, k % slots] = satellites[2, : k % 3] = False
        return Decision(use, backtrack, reset, scale, satellites)

    demands = Demands(excludes=True, history=HISTORY, auxiliary=True)
    simulation = make(scenario, attack_on(text), [ready("snapshot")], fidelity=fidelity, demands=demands)
    return trace(simulation, decide, lambda simulation: {"auxiliary": np.array(simulation.navigator.auxiliary_offset)})


def guided(guidance: str) -> Arrays:
    """Vehicles that are steered by their estimates, in a turn, and what becomes of them."""
    simulation = make(make_scenario(f"{SCENARIOS['foi-turn']},guidance={guidance}"), "ramp:1")
    steering = simulation.steering
    assert steering is not None
    played = trace(simulation, see=lambda _: {"deviation": steering.deviation, "largest": steering.largest})
    return {name: played[name] for name in ("error", "deviation", "largest")}


def aided(text: str, fidelity: str) -> Arrays:
    """A filter with aids whose fixes are left out and taken back: what the aids say, and what comes of it."""

    def decide(k: int) -> Decision:
        return Decision(np.array([True, k % 3 != 0, k < 4]), np.array([3 if k == 6 else 0, 0, 0]))

    def see(simulation: Simulation) -> Arrays:
        told = simulation.epoch.view.aid_innovations
        return {"aids": told.whitened, "auxiliary": np.array(simulation.navigator.auxiliary_offset)}

    demands = Demands(excludes=True, history=HISTORY, auxiliary=True)
    detectors = [ready("snapshot"), ready("aid-innovation:n=4")]
    simulation = make(make_scenario(text), "ramp:0.5", detectors, fidelity=fidelity, demands=demands)
    kept = ("aids", "auxiliary", "error", "nis", "position_variance", "statistic aid-innovation:n=4")
    seen = trace(simulation, decide, see, epochs=8)
    return {name: seen[name] for name in kept}


def responded(text: str, name: str, fidelity: str) -> Arrays:
    """A response to detectors that soon alarm."""
    threshold = 300.0 if text == TIGHT else 60.0
    detectors = [ready("windowed:n=4", threshold), ready("snapshot:threshold=40")]
    return trace(make(make_scenario(text), "jump:30", detectors, make_response(name), fidelity=fidelity))


def attacked(name: str) -> Arrays:
    """An attack in the game in which it begins, on ranges or on fixes with velocity where it needs them."""
    attack = make_attack(spelled(name))
    if attack.needs_ranges:
        scenario: Scenario = make_scenario(TIGHT)
    else:
        first = 300 if attack.onset is None else round(attack.onset) - 5
        made = make_scenario(f"liu-flight:horizon=120,onset={first}")
        scenario = _with_velocity(made) if attack.needs_velocity else made
    played = trace(Simulation(scenario, attack, (), None, RUNS, SEED), epochs=20)
    return {name: played[name] for name in ("offset", "error", "nis")}


def _with_velocity(scenario: Scenario) -> Scenario:
    sigma = (0.1, 0.1, 0.1)
    tuning = replace(scenario.family.tuning, measurement_sigma=scenario.family.tuning.measurement_sigma + sigma)
    return scenario.changed(receiver=replace(scenario.family.receiver, velocity_sigma=sigma), tuning=tuning)


def episodes() -> dict[str, Callable[[], Arrays]]:
    """All golden simulations by their names."""
    all_of: dict[str, Callable[[], Arrays]] = {}
    for key, text in SCENARIOS.items():
        for fidelity in make_scenario(text).fidelities:
            all_of[f"used {key} {fidelity}"] = partial(plain, text, fidelity)
            all_of[f"decided {key} {fidelity}"] = partial(decided, text, fidelity)
    for key, text in AIDED.items():
        for fidelity in make_scenario(text).fidelities:
            all_of[f"aided {key} {fidelity}"] = partial(aided, text, fidelity)
    for name in RESPONSES:
        for text in (LOOSE, TIGHT):
            scenario = make_scenario(text)
            if fits(make_response(name), scenario):
                for fidelity in scenario.fidelities:
                    key = f"response {name} {scenario.name} {fidelity}"
                    all_of[key] = partial(responded, text, name, fidelity)
    all_of |= {f"guided {guidance}": partial(guided, guidance) for guidance in GUIDED}
    all_of |= {f"attack {name}": partial(attacked, name) for name in ATTACKS}
    return all_of
