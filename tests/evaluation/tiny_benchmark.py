"""A benchmark of a few short games, whose thresholds are pinned, for tests of whoever plays one."""

from spoofgym.evaluation.benchmark import (
    ATTACK,
    DEFEND,
    HELD_OUT,
    UNDETECTED,
    WORST,
    Benchmark,
    BenchmarkTask,
    Match,
    Place,
)

SCENARIO = "foi-drive:horizon=24"
LATCH = "windowed:n=5 > latch"


def task(track: str, place: str, payoff: str, kind: str, clean: float, zero: float, one: float, *opponents: str):
    matches = tuple(Match(opponent, 6, 1000 * place_of + 7) for place_of, opponent in enumerate(opponents))
    label = kind if track == DEFEND else opponents[0].partition(" ")[0]
    return BenchmarkTask(f"{place}/{payoff}/{label}", track, place, payoff, kind, clean, matches, zero, one, "somebody")


TINY = Benchmark(
    name="tiny v0",
    places=(
        Place("drive", SCENARIO, ("snapshot", "windowed:n=5"), (("snapshot", 25.9), ("windowed:n=5", 50.0))),
        Place("flight", "liu-flight:horizon=24", ("snapshot",), (("snapshot", 25.9),)),
    ),
    tasks=(
        task(ATTACK, "drive", UNDETECTED, UNDETECTED, 0.0, 0.0, 20.0, "snapshot"),
        task(ATTACK, "flight", UNDETECTED, UNDETECTED, 0.0, 0.0, 10.0, "snapshot"),
        task(ATTACK, "drive", "error", "duel", 0.0, 0.5, 10.0, LATCH),
        task(DEFEND, "drive", "error", HELD_OUT, 0.5, 3.0, 1.0, "held-out"),
        task(DEFEND, "drive", "error", WORST, 0.5, 20.0, 2.0, "ramp:1", "unseen:16"),
        task(DEFEND, "flight", "beyond:2", HELD_OUT, 0.5, 1.0, 0.0, "held-out"),
    ),
    arl0=1e5,
    fidelity="linear",
    outage=0.15,
    multipath=0.15,
    agents=(),
    attackers=("none", "ramp:1", "best-against-snapshot"),
    defenders=("always-use", "always-exclude", LATCH),
    resamples=50,
)
