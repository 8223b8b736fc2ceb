"""Reads a log and checks it before it is believed.

Errors stop, warnings are told once in a program; ``spoofgym check-log`` prints all findings.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.checks.fixes import check_fixes, check_status, check_zero_velocity
from spoofgym.logs.checks.inertial import check_inertial, check_sample_times
from spoofgym.logs.checks.ranges import check_ranges
from spoofgym.logs.checks.resting import is_resting, resting_findings
from spoofgym.logs.checks.times import check_fix_times, check_steps
from spoofgym.logs.checks.turning import check_turning
from spoofgym.logs.checks.velocity import check_velocity
from spoofgym.logs.log import Log, Tables, as_fixes, log_of, read_tables
from spoofgym.logs.log_warning import LogWarning, warn
from spoofgym.logs.reference import checked_reference

ORDER = {"error": 0, "warning": 1, "note": 2}
"""In which findings are told."""


def checked_log(folder: str | Path) -> Log:
    """Read a log that nothing contradicts.

    Args:
        folder: as for `spoofgym.logs.log.read_log`.

    Raises:
        ValueError: the log cannot be read, or a check found an error; the message names the first one.

    Warns:
        LogWarning: each further finding.
    """
    tables = read_tables(folder)
    _stop(tables.folder, list(table_findings(tables)))
    log = log_of(tables)
    findings = list(log_findings(log))
    _stop(log.folder, findings)
    for finding in findings:
        if finding.severity == "warning":
            warn(log.folder, str(finding), finding.line or 1)
    return log


def check_ranges_of(folder: str | Path) -> None:
    """Refuse a log whose ranges are to be used and contradict themselves.

    Raises:
        ValueError: naming the first error.
    """
    _stop(Path(folder), list(check_ranges(Path(folder))))


def _stop(folder: Path, findings: list[Finding]) -> None:
    errors = [finding for finding in findings if finding.severity == "error"]
    if errors:
        more = f" ({len(errors) - 1} more: spoofgym check-log {folder})" if len(errors) > 1 else ""
        raise ValueError(f"{folder / str(errors[0])}{more}")


def table_findings(tables: Tables) -> Iterator[Finding]:
    """What the tables show before the log is made of them."""
    yield from check_sample_times(tables.imu["t_s"], tables.gnss["t_s"])
    yield from check_fix_times(tables.gnss["t_s"])
    start = tables.notes.seconds("start_s", None)
    for name, table in (("gnss.csv", tables.gnss), ("reference.csv", tables.reference)):
        if table is not None:
            yield from check_zero_velocity(as_fixes(table), start, name)
            yield from check_velocity(as_fixes(table), start, name)


def log_findings(log: Log) -> Iterator[Finding]:
    """What the parts of a log say of each other; the first errors are likely the cause of later ones."""
    yield from check_inertial(log)
    yield from check_turning(log)
    yield from check_steps(log.fixes, log.start)
    yield from check_fixes(log)


def all_findings(folder: str | Path) -> list[Finding]:
    """Every finding about a log, errors first; a log that cannot be read is one of them, and ends the list."""
    folder = Path(folder)
    found: list[Finding] = []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            if is_resting(folder):
                return sorted([*resting_findings(folder)], key=lambda finding: ORDER[finding.severity])
            tables = read_tables(folder)
            found += table_findings(tables)
            log = log_of(tables)
            found += [*log_findings(log), *file_findings(folder)]
            checked_reference(log)
        except ValueError as error:
            found.append(Finding("error", folder.name, str(error)))
    warned = [Finding("warning", folder.name, str(each.message)) for each in told if each.category is LogWarning]
    return sorted(found + warned, key=lambda finding: ORDER[finding.severity])


def file_findings(folder: Path) -> Iterator[Finding]:
    """What only ``spoofgym check-log`` looks at: columns and tables that the filter does not use."""
    yield from check_status(folder)
    yield from check_ranges(folder)
