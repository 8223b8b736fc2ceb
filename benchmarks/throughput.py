"""Environment steps per second, end to end: observation, reward, infos and autoreset included.

    python -m benchmarks.throughput                # a table
    python -m benchmarks.throughput --json -       # JSON to stdout

Measure on an idle machine. Actions are uniformly random, so that most games end by an alarm after some 25 epochs and
resets weigh heavily, as at the start of training; rows "ramp" play an attack that mostly reaches the end, as a trained
spoofer does.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import give_json, program

SECONDS = 1.0
ROUNDS = 3
NUM_ENVS = (1, 64, 1024)
RAMP = np.array([0.07, -0.07, 0.0], dtype=np.float32)


def rate(step: Callable[[], int]) -> float:
    """Steps per second: the median of a few rounds after a warm-up; ``step`` returns how many steps it made."""
    for _ in range(3):
        step()
    rates = []
    for _ in range(ROUNDS):
        count, begin = 0, time.perf_counter()
        while time.perf_counter() - begin < SECONDS:
            count += step()
        rates.append(count / (time.perf_counter() - begin))
    return sorted(rates)[ROUNDS // 2]


def actions(play: str, num_envs: int) -> list[np.ndarray]:
    """Actions of 64 steps, (N, 3) each."""
    rng = np.random.default_rng(0)
    if play == "random":
        return [rng.uniform(-1, 1, (num_envs, 3)).astype(np.float32) for _ in range(64)]
    return [np.broadcast_to(RAMP, (num_envs, 3)).copy() for _ in range(64)]


def vector_rate(environment: gym.vector.VectorEnv, play: str) -> float:
    """Steps per second of a vector environment, all lanes counted."""
    environment.reset(seed=0)
    given, place = actions(play, environment.num_envs), 0

    def step() -> int:
        nonlocal place
        environment.step(given[place % len(given)])
        place += 1
        return environment.num_envs

    result = rate(step)
    environment.close()
    return result


def single_rate(environment: gym.Env[Any, Any], play: str) -> float:
    """Steps per second of a single environment, reset when a game is over."""
    environment.reset(seed=0)
    given, place = [action[0] for action in actions(play, 1)], 0

    def step() -> int:
        nonlocal place
        _, _, terminated, truncated, _ = environment.step(given[place % len(given)])
        place += 1
        if terminated or truncated:
            environment.reset()
        return 1

    result = rate(step)
    environment.close()
    return result


def defender_rate(threads: int) -> float:
    """Steps per second of Defender-v0 with a covariance per run while nobody backtracks, every fix used."""
    environment = DefenderVectorEnv(1024, threads=threads)
    environment.reset(seed=0)
    use = np.zeros((1024, 2), dtype=np.int64)

    def step() -> int:
        environment.step(use)
        return 1024

    return rate(step)


def backtrack_epochs(depth: int) -> float:
    """Cost of taking ``depth`` epochs back, in ordinary epochs of the navigator (propagate, innovate, update)."""
    from spoofgym.navigation.interface import Decision, Demands
    from spoofgym.scenarios import make_scenario
    from spoofgym.simulation import Simulation

    runs = 1024
    simulation = Simulation(make_scenario("foi-drive"), None, (), None, runs, 0, demands=Demands(True, 60))
    simulation.reset()
    use, nothing = Decision(np.ones(runs, dtype=bool)), np.zeros((runs, 3))
    back = Decision(np.zeros(runs, dtype=bool), backtrack=np.full(runs, depth))
    navigator = simulation.navigator
    ordinary, deep = [], []
    for _ in range(200):
        begin = time.perf_counter()
        navigator.resolve(use)
        navigator.propagate()
        navigator.innovate(nothing)
        ordinary.append(time.perf_counter() - begin)
        if navigator.index[0] >= 60 and navigator.index[0] % 20 == 0:
            begin = time.perf_counter()
            navigator.resolve(back)
            deep.append(time.perf_counter() - begin)
    return float(np.median(deep) / np.median(ordinary))


def learner_rate() -> float:
    """Steps per second of Stable-Baselines3's PPO with the default settings: simulation, policy and update."""
    import tempfile
    from pathlib import Path

    import torch

    from spoofgym.learning.ppo import Settings, make_learner

    torch.set_num_threads(2)
    with tempfile.TemporaryDirectory() as folder:
        learner = make_learner(SpooferConfig(threads=2), Settings(), 0, Path(folder))
        rollout = learner.n_steps * learner.n_envs
        learner.learn(rollout)
        begin = time.perf_counter()
        learner.learn(4 * rollout, reset_num_timesteps=False)
        return 4 * rollout / (time.perf_counter() - begin)


def import_seconds() -> tuple[float, float]:
    """Seconds to import spoofgym in a new process, and to import its dependencies alone; each the best of three."""
    dependencies = "import gymnasium, numpy"
    times = []
    for code in (f"{dependencies}, spoofgym", dependencies):
        runs = []
        for _ in range(3):
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            runs.append(time.perf_counter() - begin)
        times.append(min(runs))
    return times[0], times[1]


def _row(what: str, fidelity: str, mode: str, num_envs: int, threads: int, gains: str, value: float) -> dict[str, Any]:
    return {
        "what": what,
        "fidelity": fidelity,
        "mode": mode,
        "num_envs": num_envs,
        "threads": threads,
        "gains": gains,
        "steps_per_second": value,
    }


def measure() -> Iterable[dict[str, Any]]:
    """All rows, one after the other."""
    for fidelity in ("linear", "strapdown"):
        own = "shared" if fidelity == "linear" else "own"
        single = gym.make("spoofgym/Spoofer-v0", fidelity=fidelity)
        yield _row("random", fidelity, "single", 1, 1, own, single_rate(single, "random"))
        for num_envs in NUM_ENVS:
            for threads in (1, 2):
                for play in ("random", "ramp"):
                    environment = SpooferVectorEnv(num_envs, fidelity=fidelity, threads=threads)
                    yield _row(play, fidelity, "vector", num_envs, threads, own, vector_rate(environment, play))
        for num_envs in NUM_ENVS[:2] if fidelity == "strapdown" else NUM_ENVS:
            synchronous = gym.make_vec(
                "spoofgym/Spoofer-v0", num_envs, vectorization_mode="sync", fidelity=fidelity
            )
            yield _row("random", fidelity, "sync", num_envs, 1, own, vector_rate(synchronous, "random"))
    for threads in (1, 2):
        for play in ("random", "ramp"):
            environment = SpooferVectorEnv(1024, on_alarm="respond", threads=threads)
            yield _row(play, "linear", "vector", 1024, threads, "own", vector_rate(environment, play))
    for threads in (1, 2):
        yield _row("defender, use", "linear", "vector", 1024, threads, "own", defender_rate(threads))
    yield _row("SB3 PPO, update included", "linear", "vector", 256, 2, "shared", learner_rate())


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = Parser(prog="python -m benchmarks.throughput", description=main.__doc__)
    add_json(parser)
    options = parser.parse_args(arguments)
    rows = []
    for row in measure():
        rows.append(row)
        line = (
            f"{row['what']:<26}{row['fidelity']:<11}{row['mode']:<8}{row['num_envs']:>5} envs  "
            f"{row['threads']} threads  {row['gains']:<7}{row['steps_per_second']:>12,.0f} steps/s"
        )
        print(line, file=sys.stderr if options.json == STDOUT else sys.stdout, flush=True)
    back = {depth: backtrack_epochs(depth) for depth in (5, 10, 20, 50)}
    with_package, without = import_seconds()
    report = {
        "schema_version": SCHEMA_VERSION,
        "rows": rows,
        "backtrack_epochs": back,
        "import": {"spoofgym_seconds": with_package, "dependencies_seconds": without},
    }
    line = "backtrack, in ordinary epochs: " + ", ".join(f"{cost:.1f} for {depth}" for depth, cost in back.items())
    print(line, file=sys.stderr if options.json == STDOUT else sys.stdout)
    line = f"import spoofgym: {with_package - without:.2f} s beyond its dependencies ({with_package:.2f} s in all)"
    print(line, file=sys.stderr if options.json == STDOUT else sys.stdout)
    give_json(report, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
