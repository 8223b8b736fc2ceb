"""A small report of each kind, as the programs write them, by their own functions where these need no games."""

from typing import Any

import numpy as np

from spoofgym.evaluation.integrity import integrity
from spoofgym.evaluation.matrix import detection_curve, exact_interval
from spoofgym.evaluation.metrics import AttackerScore
from spoofgym.evaluation.report import SCHEMA_VERSION, attacker_row, attackers_report, defenders_report, detector_entry
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario

SCENARIO = "liu-flight:horizon=20"


def scenario() -> Scenario:
    return make_scenario(SCENARIO)


def attackers() -> dict[str, Any]:
    score = AttackerScore(100, 42.0, (40.0, 44.0), 0.25, 31.0, 12.0)
    rows = [
        attacker_row("none", "blind", AttackerScore(100, 0.8, (0.7, 0.9), 0.0, None, None), None, 57.25),
        attacker_row("optimum", "shadow", score, 57.25, 57.25),
        attacker_row("upper-bound", "shadow", None, 57.37, 57.25),
        attacker_row("runs/x", "full", score, None, 57.25),
    ]
    return attackers_report(scenario(), "linear", [], rows)


def recorded() -> dict[str, Any]:
    row = {"clean_error_median_m": None, "clean_error_p95_m": None, "mean_nis": 2.9, "false_alarms": 0}
    row |= {"clean_epochs": 90, "error_at_detection_m": None, "error_epochs": 80}
    found = {"attack": "ramp:0.5", "detected": True, "time_to_detect_s": 12.5, "max_error_m": 40.0}
    missed = {"attack": "none", "detected": False, "time_to_detect_s": None, "max_error_m": 1.5}
    head = {"schema_version": SCHEMA_VERSION, "kind": "recorded", "scenario": "recorded:drive", "fidelity": "strapdown"}
    head |= {"alignment": "by the fixes, at 12 s", "detector": detector_entry([], scenario())}
    return {**head, "rows": [row | found, row | missed]}


def defenders() -> dict[str, Any]:
    rows = [
        _defender_row(name, attack, held_out, mean)
        for name, mean in (("never", 13.9), ("tuned-onset", 1.7), ("runs/d", 1.5))
        for held_out, pooled in ((False, "all-training"), (True, "all-held-out"))
        for attack in (pooled, "none", "random-ramp")
    ]
    pairs = [
        {"defender": "runs/d", "baseline": name, "kind": "tuned", "held_out": held_out, "difference_m": gain,
         "ci95_m": [gain - 0.1, gain + 0.1]}
        for name, gain in (("never", -12.4), ("tuned-onset", -0.2))
        for held_out in (False, True)
    ]
    gaps = [{"defender": "runs/d", "held_out": False, "from": "tuned-depth", "to": "oracle-depth", "closed": 0.4}]
    kinds = {"never": "yardstick", "tuned-onset": "tuned", "runs/d": "learned"}
    return defenders_report(scenario(), "linear", kinds, rows, pairs, gaps)


def _defender_row(name: str, attack: str, held_out: bool, mean: float) -> dict[str, Any]:
    clean = attack == "none"
    return {
        "defender": name, "attack": attack, "held_out": held_out, "episodes": 50, "mean_error_m": mean,
        "ci95_m": [0.9 * mean, 1.1 * mean], "rmse_m": 2 * mean, "max_error_m": 5 * mean,
        "detection_probability": None if clean else 0.9, "median_time_to_detect_s": None if clean else 4.0,
        "error_at_detection_m": None if clean else 3.0, "median_time_to_reuse_s": None, "never_reused_fraction": None,
        "clean_exclusion_fraction": 0.01, "false_alarms_per_epoch": 1e-4,
    }  # fmt: skip


def matrix(detectors: int = 3, attacks: int = 4) -> dict[str, Any]:
    names = [f"windowed:n={n + 1},arl0=10000" for n in range(detectors)]
    stream = np.random.default_rng(0)
    kinds = ["none", "ramp:0.1", *(f"jump:{size}" for size in range(attacks - 2))]
    rows, curves = [], []
    for name in names:
        clean = stream.chisquare(3, 400)
        for attack in kinds:
            games = clean if attack == "none" else stream.chisquare(3, 400) * 2.0
            found = int((games > 12.0).sum())
            rows.append(
                {"detector": name, "attack": attack, "detection_probability": found / 400,
                 "ci95": list(exact_interval(found, 400)), "median_time_to_detect_s": 3.0 if found > 200 else None,
                 "error_at_detection_m": 2.0, "mean_undetected_error_m": 10.0 * (1 - found / 400)}
            )
            if attack != "none":
                curves.append({"detector": name, "attack": attack, "points": detection_curve(clean, games)})
    listed = [{"name": name, "threshold": 12.0, "arl0": 1e4, "arl0_ci95": None} for name in names]
    return {
        "schema_version": 1, "kind": "matrix", "scenario": SCENARIO, "fidelity": "linear", "arl0": 1e4,
        "episodes": 400, "detectors": listed, "rows": rows, "curves": curves, "learned": [],
    }  # fmt: skip


def league() -> dict[str, Any]:
    def played(number: int, spoofers: list[str], defenders: list[str]) -> dict[str, Any]:
        mean = np.add.outer(np.arange(len(spoofers)), np.arange(len(defenders))) + 2.0
        gain = {"gain": 0.5 / (1 + number), "gain_ci95": [0.1, 0.9], "joins": True}
        return {
            "number": number, "spoofers": spoofers, "defenders": defenders, "mean": mean.tolist(),
            "half_width": (0.1 * mean).tolist(), "games": np.full(mean.shape, 50).tolist(),
            "spoofer_mixture": [1.0, *[0.0] * (len(spoofers) - 1)],
            "defender_mixture": [*[0.0] * (len(defenders) - 1), 1.0],
            "value": 3.0 + number, "value_ci95": [2.5 + number, 3.5 + number], "nash_conv": 0.0,
            "worst": mean.max(axis=0).tolist(), "weights": {},
            "gains": {"spoofer": gain, "defender": gain} if number == 0 else {},
        }  # fmt: skip

    first = played(0, ["ramp:0.5", "training"], ["snapshot > exclude"])
    second = played(1, ["ramp:0.5", "training", "policy:runs/league/spoofer/0"], ["snapshot > exclude", "always-use"])
    duel = {"scenario": SCENARIO, "payoff": "error"}
    settings = {"duel": duel, "meta": "nash", "games": 50, "seed": 0}
    return {"kind": "league", "schema_version": 1, **settings, "results": [first, second]}


def exploit() -> dict[str, Any]:
    def cell(name: str, harm: float) -> dict[str, Any]:
        return {"spoofer": name, "harm": harm, "ci95": [harm - 1, harm + 1]}

    rows = [
        {"defender": name, "fixed": [cell("none", 1.0)], "learned": [cell("policy:runs/e/0/best", worst)],
         "learned_mean": worst, "learned_spread": 0.0, "worst": cell("policy:runs/e/0/best", worst)}
        for name, worst in (("snapshot > exclude", 30.0), ("always-use", 60.0))
    ]
    settings = {"scenario": SCENARIO, "payoff": "error", "clean": 0.5, "games": 50, "steps": 1000, "seeds": [0]}
    return {"schema_version": 1, "kind": "exploit", **settings, "rows": rows}


def bayesian(population: str = "training") -> dict[str, Any]:
    harm = {"harm": 0.6, "harm_ci95": [0.5, 0.7]}
    row = {"population": population, "bayesian": harm, "trusting": {"harm": 9.0, "harm_ci95": [8.0, 10.0]}}
    row["defenders"] = [{"defender": "tuned-onset", "harm": 1.9, "harm_ci95": [1.7, 2.1]}]
    settings = {"scenario": SCENARIO, "clean": 0.5, "games": 20, "seed": 0, "resolution": "coarse"}
    return {"schema_version": 1, "kind": "bayesian-bound", **settings, "rows": [row]}


def duel() -> dict[str, Any]:
    row = {"payoff": "error", "value": 1.2, "ci95": [1.1, 1.3], "clean": 0.3, "attacked": 2.1}
    row |= {"shares": {"drift": 0.5}, "rate_m_per_s": None}
    settings = {"scenario": SCENARIO, "clean": 0.5, "games": 30, "seed": 0}
    return {"schema_version": 1, "kind": "duel-bound", **settings, "rows": [row]}


def benchmark() -> dict[str, Any]:
    scored = {"value": 0.8, "ci95": [0.7, 0.9]}
    counts = {"tasks": 1, "all_tasks": 22}
    task = {
        "task": "liu-flight/snapshot", "kind": "undetected", "unit": "m", "score": scored, "normalised": scored,
        "references": {"zero": 0.0, "one": 57.0, "best": "optimum"}, "matches": [], "worst": "snapshot",
    }  # fmt: skip
    summary = {"interquartile_mean": counts, "mean": scored, "groups": {"liu-flight": {**scored, **counts}}}
    return {
        "schema_version": 1, "kind": "benchmark", "benchmark": "bench v1", "digest": "0", "version": "0.1.0",
        "track": "attack", "policies": [{"policy": "policy:x"}], "resamples": 10, "summary": summary, "tasks": [task],
        "refused": [],
    }  # fmt: skip


def integrity_study() -> dict[str, Any]:
    stream = np.random.default_rng(0)
    error, level = stream.normal(0.0, 20.0, (5, 200)), stream.uniform(20.0, 60.0, (5, 200))
    found = integrity(error, level, 50.0, error > 70.0)
    rows = [{"signals": "clean", "user": user, "level_m": 40.0, **found.content()} for user in ("filter", "bank")]
    settings = {"scenario": SCENARIO, "direction": "vertical", "epochs": 200, "runs": 5, "seed": 0}
    return {"schema_version": 1, "kind": "integrity", **settings, "rows": rows}


def tuning() -> dict[str, Any]:
    rows = [{"detector": "snapshot", "response": "exclude", "mean_error_m": 3.0, "ci95_m": [2.0, 4.0]}]
    return {"schema_version": 1, "kind": "tuning", "scenario": SCENARIO, "rows": rows}


REPORTS = {
    "attackers": attackers,
    "recorded": recorded,
    "defenders": defenders,
    "matrix": matrix,
    "league": league,
    "exploit": exploit,
    "bayesian-bound": bayesian,
    "duel-bound": duel,
    "benchmark": benchmark,
    "integrity": integrity_study,
    "tuning": tuning,
}
