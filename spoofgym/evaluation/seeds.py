"""Learned spoofers of a matrix, those that differ in their seed alone taken together: their mean and their spread."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym.detectors import make_detector
from spoofgym.policies.learned import LearnedSpoofer


def seed_rows(rows: Sequence[dict[str, Any]], policies: Sequence[LearnedSpoofer]) -> list[dict[str, Any]]:
    """What the spoofers that were trained on one environment did to the detector that they were trained against.

    Args:
        rows: of `spoofgym.evaluation.matrix.matrix_rows`, of all attacks.
        policies: whose games are among them. Those of one configuration are seeds of one training; one that was trained
            against several detectors, or against none of the matrix (at its false-alarm rate), is left out.
    """
    found = {(row["detector"], row["attack"]): row for row in rows}
    detectors = list(dict.fromkeys(detector for detector, _ in found))
    learned = {policy.name for policy in policies}
    groups: dict[str, list[LearnedSpoofer]] = {}
    for policy in policies:
        groups.setdefault(json.dumps(dict(policy.configuration), sort_keys=True, default=str), []).append(policy)
    result = []
    for group in groups.values():
        own = _trained_against(group[0])
        if own not in detectors:
            continue
        errors = [found[own, policy.name]["mean_undetected_error_m"] for policy in group]
        others = [row for row in rows if row["detector"] == own and row["attack"] not in learned]
        best = max(others, key=lambda row: row["mean_undetected_error_m"])
        result.append(
            {
                "trained_against": own,
                "policies": [policy.name for policy in group],
                "mean_undetected_error_m": float(np.mean(errors)),
                "least_m": min(errors),
                "most_m": max(errors),
                "best_other_attack": best["attack"],
                "best_other_m": best["mean_undetected_error_m"],
                "detection": {
                    detector: [found[detector, policy.name]["detection_probability"] for policy in group]
                    for detector in detectors
                },
            }
        )
    return result


def _trained_against(policy: LearnedSpoofer) -> str | None:
    """The name of the only detector of its environment."""
    given = policy.configuration.get("detector")
    texts = [given] if isinstance(given, str) else list(given or ())
    return make_detector(texts[0]).name if len(texts) == 1 else None
