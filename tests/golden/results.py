"""Golden episodes of what is computed around a game: recorded logs, optima, and Monte Carlo evaluation."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.attacks import make_attack
from spoofgym.evaluation.defence import World, play_always, play_oracle_onset, play_response
from spoofgym.evaluation.monte_carlo import watch_attack
from spoofgym.optimum import best_budget, best_ramp, expected_play, upper_bound, window_mean, zero_alarm
from spoofgym.optimum.response import error_response, increment_maps
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.golden.parts import detectors_for, ready
from tests.golden.simulations import LOOSE, RUNS, SEED, trace
from tests.logs.range_drive import write_drive
from tests.logs.test_ranges_log import FIRST
from tests.scenarios.test_recorded import write_log

Arrays = dict[str, np.ndarray]
THRESHOLD = 25.9
EPISODES = 20
DATA = Path(__file__).parents[3] / "shared" / "data"


def recorded(coupling: str) -> Arrays:
    """A game on a made-up log, every fix used."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "log"
        if coupling == "loose":
            write_log(folder)
        else:
            write_drive(folder, turns=3)
        onset = 60.0 if coupling == "loose" else FIRST + 60.0
        return log_game(f"recorded:{folder},onset={onset},horizon=20,coupling={coupling}")


def log_game(text: str) -> Arrays:
    """A game on a log, every fix used; every detector that fits looks on."""
    scenario = make_scenario(text)
    detectors = [detector for detector in detectors_for(scenario) if detector.memory <= 40]
    return trace(Simulation(scenario, make_attack("ramp:0.5"), detectors, None, RUNS, SEED, fidelity="strapdown"))


def optima() -> Arrays:
    """Exact values of a short game on the loosely coupled filter."""
    model = make_scenario(LOOSE).linear_model()
    rates = np.array([4.0, 4.0, 4.0])
    offsets = 0.5 * np.outer(np.arange(1, len(model.time)), [1.0, 0.5, 0.2])
    ramp, bound = best_ramp(model, THRESHOLD, rates), upper_bound(model, THRESHOLD)
    play = expected_play(model, offsets, THRESHOLD)
    closed, outcome = best_budget(model, THRESHOLD)
    silent = zero_alarm(model, window_mean(4, 1.5), drag_off_rate=rates)
    whitened, errors = increment_maps(model)
    return {
        "error_response": error_response(model, 12),
        "increment_maps": np.concatenate([whitened[-12:, -36:].ravel(), errors.ravel()]),
        **_numbers("ramp", ramp),
        **_numbers("bound", bound),
        **_numbers("play", play),
        **_numbers("closed", closed),
        **_numbers("outcome", outcome),
        **_numbers("silent", silent),
    }


def _numbers(name: str, result: Any) -> Arrays:
    """The numbers and arrays among the fields of a result."""
    return {
        f"{name} {field}": np.asarray(value)
        for field, value in vars(result).items()
        if isinstance(value, float | np.ndarray)
    }


def monte_carlo() -> Arrays:
    """An attack under the eyes of two detectors."""
    detectors = [ready("snapshot"), ready("windowed:n=4", 60.0)]
    games = watch_attack(make_scenario(LOOSE), make_attack("ramp:0.8"), detectors, EPISODES, SEED)
    names = ("alarm_epoch", "alarm_error", "peak", "final_error", "onset_epoch")
    return {name: getattr(games, name) for name in names}


def defended(defender: str) -> Arrays:
    """A population of attacks against a defender."""
    detectors = (ready("snapshot"), ready("windowed:n=4", 60.0))
    world = World(make_scenario("foi-drive:horizon=40"), "training", 0.5, detectors)
    if defender == "response":
        response = make_response("exclude-and-backtrack")
        games = play_response(world, "snapshot", response, EPISODES, SEED)
    else:
        games = {"always": play_always, "oracle": play_oracle_onset}[defender](world, EPISODES, SEED)
    return {name: getattr(games, name) for name in ("error", "excluded", "available", "attacked", "clean", "member")}


def real_logs() -> dict[str, Callable[[], Arrays]]:
    """Games on the recorded logs beside the checkout, for a comparison on one machine; none where they are absent."""
    texts = {
        "car-loop": "horizon=30",
        "car-phone-raw loose": "horizon=20",
        "car-phone-raw tight": "horizon=20,coupling=tight",
        "uav-octa": "horizon=20",
    }
    if not DATA.is_dir():
        return {}
    logs = {name: f"recorded:{DATA / name.split()[0]},{options}" for name, options in texts.items()}
    return {f"log {name}": partial(log_game, text) for name, text in logs.items()}


def episodes() -> dict[str, Callable[[], Arrays]]:
    """All golden results by their names."""
    return {
        **{f"recorded {coupling}": partial(recorded, coupling) for coupling in ("loose", "tight")},
        "optima": optima,
        "monte carlo": monte_carlo,
        **{f"defence {name}": partial(defended, name) for name in ("response", "always", "oracle")},
    }
