"""What a league costs: games of a cell, steps of a best response, solving, files, engines, and all of it together.

    python -m benchmarks.league                    # a table
    python -m benchmarks.league --json -           # JSON to stdout

Seconds are those of the processor in one thread, so that other work on the machine counts little. It takes three
minutes of it.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks import first_cell
from spoofgym.command_line import STDOUT, Parser, add_json, count
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.native import NativeVectorEnv
from spoofgym.envs.payoffs import make_payoff
from spoofgym.envs.vector import DuelVectorEnv, SpooferVectorEnv
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.duels import play_cell
from spoofgym.evaluation.engine import Engine, Processes, Ray, Task
from spoofgym.evaluation.payoff import RESAMPLES, value_interval
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.learning import defender_ppo, imitation, league, ppo
from spoofgym.learning.double_oracle import MORE_GAMES
from spoofgym.learning.run_folder import Run, RunFolder
from spoofgym.policies.learned import LearnedPolicy
from spoofgym.program import give_json, program
from spoofgym.scenarios import make_scenario

SCENARIOS = ("foi-drive", "liu-flight:horizon=250,imu=tactical")
PAIRS = (
    ("ramp:0.5", "always-use"),
    ("ramp:0.5", "snapshot > exclude"),
    ("training", "windowed:n=20 > exclude-and-backtrack:20"),
    ("unseen:16", "windowed:n=5 > exclude-and-backtrack:20"),
)
FEW = 2
"""Games that cost as much as setting a cell up."""
LANES = 256
ROLLOUTS = 3
MATRICES = ((10, 16), (15, 21), (30, 36))


def processor(call: Callable[[], Any]) -> float:
    """Seconds of the processor that a call takes."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def learners(duel: DuelConfig, folder: Path) -> Iterable[dict[str, Any]]:
    """What a best response of either side costs: its steps, and what a defender is taught before them.

    The policies are left in ``folder``, to be measured as players.
    """
    epochs = make_scenario(duel.scenario).timeline.num_epochs
    spoofing = DuelSpooferConfig(**vars(replace(duel, clean=0.0)), defender="windowed:n=20 > exclude")
    attacking = ppo.make_learner(spoofing, ppo.Settings(), 0, folder)
    yield {"scenario": duel.scenario, **_learned("spoofer", attacking)}
    _keep(ppo.export(attacking, spoofing, folder / "spoofer"), Run(spoofing, ppo.Settings(), 0, 1), "spoofer")
    defending = DuelDefenderConfig(**vars(duel), spoofer="pool:ramp:1+unseen:16")
    settings = defender_ppo.Settings()
    guarding = defender_ppo.make_learner(defending, settings, 0, folder)
    yield {"scenario": duel.scenario, **_learned("defender", guarding)}
    _keep(defender_ppo.export(guarding, defending, folder / "defender"), Run(defending, settings, 0, 1), "defender")
    vector = defender_ppo.lanes(defending, replace(settings, lanes=defender_ppo.TEACHING_LANES))
    teachers = len(imitation.REUSES) * (1 + len(vector.game.seat.depths))
    games = teachers * imitation.FEW + -(-teachers // 4) * imitation.MANY
    teacher = imitation.Teacher(None, 5)
    seconds = processor(lambda: imitation.total_error(vector, teacher, 1, 0))
    steps = games * defender_ppo.TEACHING_LANES * epochs
    row = {"what": "teachers compared", "steps": steps, "seconds": games * seconds, "rate": steps / (games * seconds)}
    yield {"scenario": duel.scenario, **row}


def _keep(policy: LearnedPolicy, run: Run, side: str) -> None:
    """Leave a policy where it can be played from."""
    RunFolder(policy.folder, f"spoofgym.learning.{side}", (type(run.environment),), type(run.learner)).begin(run)
    policy.save(policy.folder)


def _learned(side: str, learner: Any) -> dict[str, Any]:
    """Steps per second of PPO with its default settings: games, policy and update."""
    rollout = learner.n_steps * learner.n_envs
    learner.learn(rollout)
    seconds = processor(lambda: learner.learn(ROLLOUTS * rollout, reset_num_timesteps=False))
    steps = ROLLOUTS * rollout
    return {"what": f"PPO {side}", "steps": steps, "seconds": seconds, "rate": steps / seconds}


def cells(duel: DuelConfig, games: int, folder: Path) -> Iterable[dict[str, Any]]:
    """What cells cost: each is set up once, and every game is played to its end."""
    epochs = make_scenario(duel.scenario).timeline.num_epochs
    learned = [f"policy:{folder / side}" for side in ("spoofer", "defender")]
    for spoofer, defender in (*PAIRS, (learned[0], PAIRS[1][1]), (PAIRS[0][0], learned[1]), tuple(learned)):
        play_cell(duel, spoofer, defender, FEW, 0)  # compiles
        setting_up = processor(lambda: play_cell(duel, spoofer, defender, FEW, 0))  # noqa: B023
        whole = processor(lambda: play_cell(duel, spoofer, defender, games, 0))  # noqa: B023
        per_game = (whole - setting_up) / (games - FEW)
        yield {
            "scenario": duel.scenario,
            "spoofer": _short(spoofer),
            "defender": _short(defender),
            "setting_up_seconds": setting_up,
            "games_per_second": 1.0 / per_game,
            "steps_per_second": epochs / per_game,
        }


def _short(player: str) -> str:
    return "a learned policy" if player.startswith("policy:") else player


def views(scenario: str) -> Iterable[dict[str, Any]]:
    """Steps of all lanes per second where the runs share their gains, and where each has its own covariance."""
    spoofing, deciding = np.zeros((LANES, 3)), np.zeros((LANES, 2), dtype=np.int64)
    alone: dict[str, Any] = {"scenario": scenario, "detector": "snapshot:threshold=1000"}
    views: tuple[tuple[str, NativeVectorEnv, Any], ...] = (
        ("Spoofer-v0, shared gains", SpooferVectorEnv(LANES, **alone), spoofing),
        ("Spoofer-v0, own covariance", SpooferVectorEnv(LANES, on_alarm="respond", **alone), spoofing),
        (
            "duel",
            DuelVectorEnv(LANES, scenario=scenario, detectors=alone["detector"]),
            {"spoofer": spoofing, "defender": deciding},
        ),
    )
    for name, vector, actions in views:
        steps = 2 * vector.game.scenario.timeline.num_epochs
        vector.reset(seed=0)
        vector.step(actions)
        seconds = processor(lambda: [vector.step(actions) for _ in range(steps)])  # noqa: B023
        yield {"scenario": scenario, "view": name, "steps_per_second": LANES * steps / seconds}


def solving() -> Iterable[dict[str, Any]]:
    """The interval of the value: a linear programme of both sides for each resample."""
    for rows, columns in MATRICES:
        harms = np.random.default_rng(0).normal(size=(rows, columns, 500))
        resamples = RESAMPLES // 10
        seconds = 10 * processor(lambda: value_interval(harms, resamples=resamples))  # noqa: B023
        yield {"spoofers": rows, "defenders": columns, "interval_seconds": seconds}


def disk(duel: DuelConfig, folder: Path) -> dict[str, int]:
    """Bytes of a cell and of a policy."""
    store = CellStore(folder / "cells", duel, 100, 0)
    store.cell(*PAIRS[0])
    (cell,) = (folder / "cells").iterdir()
    few = cell.stat().st_size
    store.cell(*PAIRS[0], 200)
    policies = [(folder / side / "policy.npz").stat().st_size for side in ("spoofer", "defender")]
    per_game = (cell.stat().st_size - few) // 100
    return {"per_game": per_game, "per_cell": few - 100 * per_game, "spoofer": policies[0], "defender": policies[1]}


def engines(duel: DuelConfig, folder: Path) -> Iterable[dict[str, Any]]:
    """Seconds of the processor that a new worker takes to begin, beside those of its first cell."""
    built: list[tuple[str, Callable[[], Engine]]] = [("processes", lambda: Processes(1))]
    if importlib.util.find_spec("ray") is not None:
        built.append(("ray", Ray))
    cell = processor(lambda: play_cell(duel, *PAIRS[0], FEW, 0))
    for name, build in built:
        store = CellStore(folder / name, duel, FEW, 0)
        (taken,) = build().run([Task("the first cell", first_cell.seconds, (store, *PAIRS[0]))], lambda _: None)
        yield {"engine": name, "start_seconds": taken - cell}


def forecast(tables: dict[str, Any], scenario: str) -> Iterable[dict[str, Any]]:
    """A league with the default settings: cells of all rounds, both trainings of each, and intervals."""
    options = league.parser().parse_args([])
    played = [row for row in tables["cells"] if row["scenario"] == scenario]
    setting_up = float(np.mean([row["setting_up_seconds"] for row in played]))
    per_game = float(np.mean([1.0 / row["games_per_second"] for row in played]))
    learned = {row["what"]: row for row in tables["learners"] if row["scenario"] == scenario}
    training = options.spoofer_steps / learned["PPO spoofer"]["rate"] + learned["teachers compared"]["seconds"]
    training += options.defender_steps / learned["PPO defender"]["rate"]
    made = make_scenario(scenario)
    spoofers, defenders = len(league.SPOOFERS), len(league.classical_defenders(made, make_payoff(options.payoff, made)))
    for rounds in (0, 1, 5, 10):
        number = (spoofers + rounds) * (defenders + rounds)
        least = number * (setting_up + options.games * per_game)
        yield {
            "scenario": scenario,
            "rounds": rounds,
            "cells": number,
            "games_hours": least / 3600.0,
            "most_games_hours": number * (setting_up + MORE_GAMES * options.games * per_game) / 3600.0,
            "trainings_hours": rounds * training / 3600.0,
        }


LINES = {
    "learners": "{what:<20}{rate:>10,.0f} steps/s{seconds:>8.1f} s",
    "views": "{view:<27}{steps_per_second:>10,.0f} steps/s",
    "cells": "{spoofer:<18}{defender:<42}{setting_up_seconds:>6.2f} s +{games_per_second:>6,.0f} games/s"
    "{steps_per_second:>10,.0f} steps/s",
    "leagues": "{rounds:>3} rounds{cells:>6} cells{games_hours:>7.2f} to{most_games_hours:>6.2f} h of games"
    "{trainings_hours:>7.2f} h of trainings",
    "disk": "a cell {per_cell:,} + {per_game} bytes a game; policies: spoofer {spoofer:,}, defender {defender:,} bytes",
    "engines": "a worker of {engine:<10}{start_seconds:>6.1f} s to begin",
    "solving": "{spoofers:>3} x{defenders:>3}: interval of the value{interval_seconds:>7.1f} s",
}
"""How a row of each table is printed."""


def measure(scenarios: Sequence[str], games: int, show: Callable[[str], None]) -> dict[str, Any]:
    """All tables, each row shown when it is there."""
    tables: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "kind": "league-cost", **{name: [] for name in LINES}}

    def keep(name: str, found: Iterable[dict[str, Any]]) -> None:
        for row in found:
            tables[name].append(row)
            show(LINES[name].format(**row))

    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        for place, scenario in enumerate(scenarios):
            show(scenario)
            duel, _ = league.duel_of(league.parser().parse_args(["--scenario", scenario]))
            inside = folder / str(place)
            keep("learners", learners(duel, inside))
            keep("views", views(scenario))
            keep("cells", cells(duel, games, inside))
            keep("leagues", forecast(tables, scenario))
            if not place:
                keep("disk", [disk(duel, inside)])
                keep("engines", engines(duel, inside))
                keep("solving", solving())
    return tables


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = Parser(prog="python -m benchmarks.league", description=main.__doc__)
    parser.add_argument("--scenario", action="append", help=f"repeatable (default: {' and '.join(SCENARIOS)})")
    parser.add_argument("--games", type=count, default=400, help="of each cell (default: %(default)s)")
    add_json(parser)
    options = parser.parse_args(arguments)
    out = sys.stderr if options.json == STDOUT else sys.stdout
    report = measure(options.scenario or SCENARIOS, options.games, lambda line: print(line, file=out, flush=True))
    give_json(report, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
