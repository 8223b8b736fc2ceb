"""spoofgym-bench v1, pinned: what is played, against whom, on which seeds, and which scores are 0 and 1.

Nothing here may change, nor how an environment behaves: either makes a v2, a module of its own beside this one.
``tests/evaluation/test_benchmark_v1.py`` holds the digest of this definition and some games of two tasks.

The references are scores of the pinned players on the very games of v1: ``spoofgym benchmark
references attack`` (or ``defend``) plays them again and compares. An exact optimum is that of
`spoofgym.optimum.bounded_optimum`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

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

GAMES = 1000
FIRST_SEED, SEEDS_OF_A_MATCH = 7_000_000_000, 1_000_000
"""Match n begins at the first seed plus n times the other, far from the seeds of trainings and of cards."""
DRIVE, FLIGHT, TACTICAL = "foi-drive", "liu-flight", "tactical-flight"
PAYOFFS = {DRIVE: ("error", "beyond:50"), FLIGHT: ("error",), TACTICAL: ("error", "beyond:150")}
"""Alert limits well above the drift: to pass one, a spoofer must give itself away."""
MONITORS = {
    "snapshot": "snapshot",
    "windowed:n=20": "windowed:n=20",
    "signed-mean:n=10": "signed-mean:n=10,arl0=100000",
    "mewma": "mewma",
}
"""That end a game, each with one false alarm in 100,000 epochs."""
WATCHED = (DRIVE, FLIGHT)
"""Where these games are played: a matched filter, whose optimum against the snapshot test is known exactly."""
ATTACKED = {
    DRIVE: {
        "px4-auto": "snapshot > px4-auto",
        "tuned-depth": "signed-mean:n=5 > exclude-and-backtrack:10,reuse=12",
        "tuned-onset": "signed-mean:n=5 > onset-depth:reuse=12",
    },
    FLIGHT: {
        "px4-auto": "snapshot > px4-auto",
        "tuned-onset": "signed-mean:n=5 > onset-depth:reuse=12",
    },
    TACTICAL: {
        "px4-auto": "snapshot > px4-auto",
        "tuned-depth": "signed-mean:n=5 > exclude-and-backtrack:50,reuse=12",
        "tuned-onset": "signed-mean:n=10 > onset-depth:reuse=12",
    },
}
SCRIPTED = ("ramp:0.2", "ramp:0.5", "ramp:1", "ramp:2", "unseen:4", "unseen:16", "unseen:64")
LEARNED = {DRIVE: ("drive-tuned-onset-spoofer",), FLIGHT: ("liu-flight-snapshot-spoofer",), TACTICAL: ()}
AGENTS = (
    ("drive-tuned-onset-spoofer", "2b6c145e33d969bc0bc5d73a29dc9e733133f5572b95c4474376e20c2595d0cb"),
    ("liu-flight-snapshot-spoofer", "e5467c429c7393f4ebc9d52ca3479a0333cb43d98b462d4f1a800c9a829b3649"),
)
ATTACKERS = (
    "none",
    *("ramp:0.1", "ramp:0.2", "ramp:0.5", "ramp:1", "ramp:2", "ramp:4", "jump:20"),
    *("unseen:4", "unseen:16", "unseen:64", "unseen:256"),
    *("closed-form:16", "closed-form:25", "closed-form:49"),
    *("best-against-snapshot", "worst-against-window", "lp-gate", "lp-signed"),
    *(f"policy:{name}" for name, _ in AGENTS),
)
DEFENDERS = (
    "always-use",
    "always-exclude",
    *("snapshot > exclude", "snapshot > latch", "windowed:n=5 > exclude", "windowed:n=20 > exclude"),
    *("windowed:n=5 > exclude-and-backtrack:20", "windowed:n=20 > exclude-and-backtrack:20"),
    *("relative-motion:k=20 > exclude-and-backtrack:20", "windowed:n=5 > constant-velocity-start:20"),
    *("snapshot > px4-auto", "snapshot > px4-dead-reckoning"),
    *("snapshot > ardupilot-glitch", "snapshot > ardupilot-clip"),
    *("signed-mean:n=5 > exclude-and-backtrack:10,reuse=12", "signed-mean:n=5 > exclude-and-backtrack:50,reuse=12"),
    *("signed-mean:n=5 > onset-depth:reuse=12", "signed-mean:n=10 > onset-depth:reuse=12"),
)
WORLD = (
    *("snapshot", "windowed:n=5", "windowed:n=20"),
    *("signed-mean:n=5", "signed-mean:n=10", "relative-motion:k=20"),
)
SHARED_THRESHOLDS = {"snapshot": 25.9}
"""The published one, everywhere."""
THRESHOLDS = {
    DRIVE: {
        "windowed:n=5": 49.169728519340616,
        "windowed:n=20": 114.41,
        "signed-mean:n=5": 13.144214900628645,
        "signed-mean:n=10": 12.468929161187944,
        "relative-motion:k=20": 15.608425202454889,
        "signed-mean:n=10,arl0=100000": 22.251405612641086,
        "mewma": 24.522589299856076,
    },
    FLIGHT: {
        "windowed:n=5": 49.10880199612819,
        "windowed:n=20": 114.41,
        "signed-mean:n=5": 13.142066398669522,
        "signed-mean:n=10": 12.474535308234126,
        "relative-motion:k=20": 38.21683706932391,
        "signed-mean:n=10,arl0=100000": 22.197428865020367,
        "mewma": 24.099744770787847,
    },
    TACTICAL: {
        "windowed:n=5": 49.75417123936715,
        "windowed:n=20": 114.837804597022,
        "signed-mean:n=5": 13.162960399840944,
        "signed-mean:n=10": 12.450509383792866,
        "relative-motion:k=20": 64.47915542620534,
    },
}
"""What `spoofgym.calibration` found for the ARL₀ of each specification: 100,000 epochs, 1,000 of signed means."""
REFERENCES: dict[str, tuple[float, float, str]] = {
    "foi-drive/undetected/snapshot": (0.0, 524.4500553369452, "the optimum"),
    "foi-drive/undetected/windowed:n=20": (0.0, 207.0259845435058, "closed-form:49"),
    "foi-drive/undetected/signed-mean:n=10": (0.0, 138.34664112078056, "closed-form:25"),
    "foi-drive/undetected/mewma": (0.0, 112.55907206489286, "closed-form:16"),
    "liu-flight/undetected/snapshot": (0.0, 57.25415062888905, "the optimum"),
    "liu-flight/undetected/windowed:n=20": (0.0, 24.696170440944847, "closed-form:49"),
    "liu-flight/undetected/signed-mean:n=10": (0.0, 16.62349219953052, "closed-form:25"),
    "liu-flight/undetected/mewma": (0.0, 12.398598779789383, "closed-form:16"),
    "foi-drive/error/px4-auto": (0.39520868446054325, 174.63303708060837, "ramp:4"),
    "foi-drive/error/tuned-depth": (0.4054023114167743, 43.014212967376906, "closed-form:25"),
    "foi-drive/error/tuned-onset": (0.41099643273385095, 41.943071137594615, "unseen:16"),
    "foi-drive/beyond:50/px4-auto": (0.0, 0.9175217391304309, "ramp:4"),
    "foi-drive/beyond:50/tuned-depth": (0.0, 0.3753391304347819, "unseen:16"),
    "foi-drive/beyond:50/tuned-onset": (0.0, 0.3423130434782603, "unseen:16"),
    "liu-flight/error/px4-auto": (0.8722534443292977, 148.90191859008715, "ramp:4"),
    "liu-flight/error/tuned-onset": (0.922259476900186, 6.977260653883943, "closed-form:25"),
    "tactical-flight/error/px4-auto": (1.3843818642018366, 175.9235663131748, "ramp:4"),
    "tactical-flight/error/tuned-depth": (1.5615812747274462, 116.32680496936908, "closed-form:25"),
    "tactical-flight/error/tuned-onset": (1.4776607394045036, 107.20841014484796, "unseen:16"),
    "tactical-flight/beyond:150/px4-auto": (0.0, 0.8311120000000004, "ramp:4"),
    "tactical-flight/beyond:150/tuned-depth": (0.0, 0.4517760000000003, "closed-form:25"),
    "tactical-flight/beyond:150/tuned-onset": (7.200000000000004e-05, 0.3951480000000003, "unseen:16"),
    "foi-drive/error/held-out": (12.492078132155545, 1.581673200107145, "signed-mean:n=5 > onset-depth:reuse=12"),
    "foi-drive/error/worst": (82.41322009081718, 15.43967810236154, "always-exclude"),
    "foi-drive/beyond:50/held-out": (
        0.06379565217391293, 0.0013304347826086959, "signed-mean:n=10 > onset-depth:reuse=12",
    ),
    "foi-drive/beyond:50/worst": (0.43377391304347646, 0.05020434782608695, "always-exclude"),
    "liu-flight/error/held-out": (7.603156274700481, 1.1747274017101954, "signed-mean:n=5 > onset-depth:reuse=12"),
    "liu-flight/error/worst": (49.04132847114389, 2.427487622352106, "always-exclude"),
    "tactical-flight/error/held-out": (
        14.141455162706617, 7.824695337889891, "signed-mean:n=10 > onset-depth:reuse=12",
    ),
    "tactical-flight/error/worst": (80.77992336201136, 51.18790170127439, "always-exclude"),
    "tactical-flight/beyond:150/held-out": (
        0.03356800000000002, 0.010772000000000006, "signed-mean:n=10 > onset-depth:reuse=12",
    ),
    "tactical-flight/beyond:150/worst": (0.37187200000000026, 0.08546400000000005, "always-exclude"),
}
"""Scores that are worth 0 and 1, and who has reached the second: for spoofers nobody (0 where an alarm ends the game)
and the best known one, for defenders ``always-use`` and the best known one."""


def _tasks() -> Iterator[BenchmarkTask]:
    numbers = count()

    def match(opponent: str) -> Match:
        return Match(opponent, GAMES, FIRST_SEED + next(numbers) * SEEDS_OF_A_MATCH)

    def task(track: str, place: str, payoff: str, label: str, kind: str, *opponents: str) -> BenchmarkTask:
        name = f"{place}/{payoff}/{label}"
        zero, one, best = REFERENCES.get(name, (0.0, 1.0, ""))
        clean = 0.0 if track == ATTACK else 0.5
        return BenchmarkTask(name, track, place, payoff, kind, clean, tuple(map(match, opponents)), zero, one, best)

    for place in WATCHED:
        for label, detector in MONITORS.items():
            yield task(ATTACK, place, UNDETECTED, label, UNDETECTED, detector)
    for place, payoffs in PAYOFFS.items():
        for payoff in payoffs:
            for label, defender in ATTACKED[place].items():
                yield task(ATTACK, place, payoff, label, "duel", defender)
    for place, payoffs in PAYOFFS.items():
        attacks = (*SCRIPTED, *(f"policy:{name}" for name in LEARNED[place]))
        for payoff in payoffs:
            yield task(DEFEND, place, payoff, HELD_OUT, HELD_OUT, "held-out")
            yield task(DEFEND, place, payoff, WORST, WORST, *attacks)


def _places() -> Iterator[Place]:
    scenarios = {DRIVE: "foi-drive", FLIGHT: "liu-flight", TACTICAL: "liu-flight:horizon=250,imu=tactical"}
    for name, scenario in scenarios.items():
        thresholds = SHARED_THRESHOLDS | THRESHOLDS[name]
        yield Place(name, scenario, WORLD, tuple(sorted(thresholds.items())))


V1 = Benchmark(
    name="spoofgym-bench v1",
    places=tuple(_places()),
    tasks=tuple(_tasks()),
    arl0=1e5,
    fidelity="linear",
    outage=0.15,
    multipath=0.15,
    agents=AGENTS,
    attackers=ATTACKERS,
    defenders=DEFENDERS,
    resamples=2000,
)
