"""What it costs a spoofer to take the victim for another one.

A spoofer that sees no innovation plans with a shadow filter. Here that filter has another IMU grade than the victim's,
or another R, and the victim stays as it is. Two spoofers play: a learned policy, whose observations come from the wrong
filter, and the optimum that is computed on the wrong filter. Every row meets the same noise, so that the fraction of
the score with the right filter has a paired interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Snapshot
from spoofgym.envs.policy_players import PolicySpoofer
from spoofgym.envs.shadow import shadow_model
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.metrics import NORMAL_95, attacker_score, undetected_error
from spoofgym.evaluation.monte_carlo import Episodes
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION, detector_entry
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.optimum import bounded_optimum, expected_play
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.scripted import OffsetSequence
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import GRADES
from spoofgym.specification import Specification, spell

SIGMA_FACTORS = (0.5, 0.7, 1.4, 2.0)
"""On the sigma of the fix that the shadow filter believes in."""


@dataclass(frozen=True)
class Shadow:
    """What a spoofer takes the victim for.

    Attributes:
        label: in tables.
        scenario: its specification; None = the victim's own.
    """

    label: str
    scenario: str | None


RIGHT = Shadow("right", None)


@dataclass(frozen=True)
class Play:
    """What a spoofer with some shadow filter achieved.

    Attributes:
        episodes: its games.
        exact: its exact undetected error, m, where it is known.
    """

    episodes: Episodes
    exact: float | None


Player = Callable[[Shadow], Play]


def wrong_shadows(scenario: Scenario) -> list[Shadow]:
    """Shadows with each other IMU grade, then with each other R.

    Raises:
        ValueError: a scenario that is not simulated, or has no option ``imu`` or ``sigma``.
    """
    family = scenario.family
    if not isinstance(family, LooseFamily):
        raise ValueError(
            f"scenario {scenario.name!r} is none with simulated fixes (coupling=loose), on whose filter the optimum is "
            "known"
        )
    sigma = family.tuning.measurement_sigma[0]
    grades = [Shadow(f"imu {name}", _with(scenario, imu=name)) for name in GRADES if name != family.grade.name]
    factors = [Shadow(f"sigma x {factor:g}", _with(scenario, sigma=factor * sigma)) for factor in SIGMA_FACTORS]
    return grades + factors


def _with(scenario: Scenario, **options: object) -> str:
    """The name of a scenario with some options exchanged."""
    parsed = Specification.parse(scenario.name)
    changed = Specification.parse(spell(parsed.name, **options)).options
    return make_scenario(str(replace(parsed, options={**parsed.options, **changed}))).name


def check_trained_against_snapshot(policy: LearnedSpoofer) -> None:
    """Refuse a policy that another detector has taught to do something else.

    Raises:
        ValueError: telling what it was trained against.
    """
    given = spoofer_config(policy).detector
    trained = [make_detector(item) for item in ((given,) if isinstance(given, str | Detector) else given)]
    if len(trained) != 1 or not isinstance(trained[0], Snapshot):
        raise ValueError(
            f"policy {policy.name!r} was trained against {', '.join(detector.name for detector in trained)}; what a "
            "wrong shadow filter costs is told for policies that were trained against a snapshot test"
        )


def policy_player(evaluation: Evaluation, policy: LearnedSpoofer) -> Player:
    """A learned policy that reads its shadow filter."""

    def play(shadow: Shadow) -> Play:
        player = policy.with_shadow(shadow.scenario)
        games = evaluation.play(PolicySpoofer(player), evaluation.episodes)
        return Play(games, evaluation.exact(player))

    return play


def optimum_player(evaluation: Evaluation, threshold: float) -> Player:
    """The best attack on the shadow filter, under the victim's limits and threshold."""
    victim = evaluation.scenario

    def play(shadow: Shadow) -> Play:
        believed = victim if shadow.scenario is None else make_scenario(shadow.scenario)
        optimum = bounded_optimum(shadow_model(victim, believed), threshold, np.array(victim.drag_off_rate))
        offsets = optimum.outcome.offsets
        exact = float(expected_play(victim.linear_model(), offsets, threshold).score)
        return Play(evaluation.play(OffsetSequence("optimum", offsets), evaluation.episodes), exact)

    return play


def ratio_of_means(values: Floats, reference: Floats) -> tuple[float, tuple[float, float]] | None:
    """The ratio of two means over the same games and its 95 % interval (linearised); None where the reference is 0.

    Args:
        values: of each game, (n,).
        reference: of the same games, (n,).
    """
    base = float(np.mean(reference))
    if base == 0.0:
        return None
    ratio = float(np.mean(values)) / base
    spread = float(np.std(values - ratio * reference, ddof=1)) if len(values) > 1 else 0.0
    half = NORMAL_95 * spread / (base * math.sqrt(len(values)))
    return ratio, (ratio - half, ratio + half)


def player_rows(
    name: str, play: Player, shadows: list[Shadow], progress: Progress = silent
) -> Iterator[dict[str, Any]]:
    """A spoofer with the right shadow filter, then with each wrong one."""
    right = None
    for shadow in [RIGHT, *shadows]:
        with progress(f"{name}, {shadow.label}"):
            result = play(shadow)
        errors = undetected_error(result.episodes)
        right = errors if right is None else right
        score, fraction = attacker_score(result.episodes), ratio_of_means(errors, right)
        yield {
            "attacker": name,
            "shadow": shadow.label,
            "shadow_scenario": shadow.scenario,
            "episodes": score.episodes,
            "mean_undetected_error_m": score.mean_undetected_error,
            "ci95_m": list(score.interval),
            "exact_undetected_error_m": result.exact,
            "detection_probability": score.detection_probability,
            "fraction_of_right": None if fraction is None else fraction[0],
            "fraction_ci95": None if fraction is None else list(fraction[1]),
        }


def check_policies(evaluation: Evaluation, policies: list[LearnedSpoofer]) -> None:
    """Refuse policies that have no shadow filter, were not trained against a snapshot test, or see something else.

    Raises:
        ValueError: naming the policy.
    """
    for policy in policies:
        if spoofer_config(policy).knowledge == "blind":
            raise ValueError(f"policy {policy.name!r} is blind: it has no shadow filter that could be wrong")
        check_trained_against_snapshot(policy)
    evaluation.check_layouts(policies)


def wrong_shadow_reports(
    evaluation: Evaluation, threshold: float, policies: list[LearnedSpoofer], progress: Progress = silent
) -> Iterator[dict[str, Any]]:
    """The ``"wrong-shadow"`` report after every row.

    Args:
        evaluation: of the victim, whose only detector is a snapshot test.
        threshold: of the snapshot test.
        policies: that `check_policies` accepts; the optimum plays beside them.
        progress: shows what is played.
    """
    scenario, shadows = evaluation.scenario, wrong_shadows(evaluation.scenario)
    players = [(policy.name, policy_player(evaluation, policy)) for policy in policies]
    players.append(("optimum", optimum_player(evaluation, threshold)))
    head = {
        "schema_version": SCHEMA_VERSION,
        "kind": "wrong-shadow",
        "scenario": scenario.name,
        "fidelity": evaluation.fidelity,
        "detector": detector_entry(evaluation.detectors, scenario),
    }
    rows: list[dict[str, Any]] = []
    for name, play in players:
        for row in player_rows(name, play, shadows, progress):
            rows.append(row)
            yield {**head, "rows": list(rows)}
