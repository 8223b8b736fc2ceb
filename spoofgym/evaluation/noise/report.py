"""Noises of logs as reports: what was estimated, and blind figures of the filter that believes in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spoofgym.evaluation.noise.estimate import Estimate, clean_stretch, estimate_on, log_of_fixes
from spoofgym.evaluation.noise.honesty import honesty
from spoofgym.evaluation.noise.parameters import UNITS, first_guess
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.scenario import Scenario
from spoofgym.scenarios.recorded_loose import RecordedFixes

TWO_SIDED = 1.959964
"""Standard errors of a 95 % interval."""
UNDETERMINED = 1.0
"""Standard error of a logarithm from which the stretch tells nothing of a noise."""


def estimate_report(log: RecordedFixes, estimate: Estimate) -> dict[str, Any]:
    """An estimate as a report.

    Returns:
        log; begin_s, end_s, epochs; log_likelihood_gain; converged; noises, a row each: field, axis, name, unit,
        before, value, interval (95 %, None where it ran into a bound), note (``least`` or ``most``: the bound;
        ``undetermined``: the stretch does not tell; else empty).
    """
    before = np.exp(first_guess(log, list(estimate.asked)))
    rows = []
    for each, start, value, error, bound in zip(
        estimate.asked, before, estimate.value, estimate.error, estimate.bound, strict=True
    ):
        spread = np.exp(np.minimum(TWO_SIDED * error, 50.0))
        rows.append({
            "field": each.field,
            "axis": each.axis,
            "name": each.name,
            "unit": UNITS[each.field],
            "before": float(start),
            "value": float(value),
            "interval": None if bound else [float(value / spread), float(value * spread)],
            "note": bound or ("undetermined" if error > UNDETERMINED else ""),
        })  # fmt: skip
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "noise-estimate",
        "log": log.name,
        "begin_s": estimate.begin,
        "end_s": estimate.end,
        "epochs": estimate.epochs,
        "log_likelihood_gain": estimate.gain,
        "converged": estimate.converged,
        "noises": rows,
    }


def blind_reports(
    scenarios: Sequence[Scenario], of: Scenario | None = None, progress: Progress = silent
) -> Iterator[dict[str, Any]]:
    """Figures of the filters of logs, with and without estimated noises, on fixes that no estimate has seen.

    Args:
        scenarios: the logs.
        of: another log, on the whole of which the noises are estimated, and all of each log is judged; None = they are
            estimated on the first half of each log, and its second half is judged.
        progress: shows what is done.

    Yields:
        The report after each log: rows with log, noise (``as it is``, ``first half``, or the name of the other log) and
        what `honesty` gives.

    Raises:
        ValueError: a log that is too short, on which the filter diverges, or that has no fixes.
    """
    rows: list[dict[str, Any]] = []
    other = None
    if of is not None:
        with progress(f"{of.name}: noises"):
            source = log_of_fixes(of)
            other = estimate_on(source, clean_stretch(source)).noise
    for scenario in scenarios:
        log = log_of_fixes(scenario)
        stretch = clean_stretch(log)
        with progress(scenario.name):
            if other is None:
                middle = (stretch.start + stretch.stop) // 2
                noise = estimate_on(log, slice(stretch.start, middle)).noise
                stretch, name = slice(middle, stretch.stop), "first half"
            else:
                noise, name = other, log_of_fixes(of).log.folder.name  # type: ignore[arg-type]
            for label, believed in (("as it is", None), (name, noise)):
                rows.append({"log": log.log.folder.name, "noise": label, **honesty(log, believed, stretch)})
        yield {"schema_version": SCHEMA_VERSION, "kind": "blind-noise", "rows": list(rows)}
