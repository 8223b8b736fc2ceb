"""The furthest attack that keeps the mean of every linear test below a share of its threshold: a linear programme.

A test that keeps the signs of the innovations is a set of rows r on the mean whitened innovations u, one per epoch and
axis, and the final horizontal error is linear in u, too (`response.error_response`). So along a direction d

    maximise  Σ_k d' G_k u_k      subject to  |r · u| <= share · threshold   for every row,

in the mean: what is left of the threshold is for the victim's own noise ("zero-alarm" attacks: Murguia and Ruths 2017,
arXiv 1710.04407; tests with memory limit them: Umsonst and others 2021, arXiv 2111.03407). Where the offset's rate is
limited, its increments are rows as well. The errors that can be reached form a convex polygon around zero. Each
direction gives one of its corners and one line that it does not cross; the next direction is that of the furthest
point that no line yet excludes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import check_position_fix, offsets_of
from spoofgym.optimum.linear_tests import LinearTest
from spoofgym.optimum.ramp import axis_limits
from spoofgym.optimum.response import azimuth_of, error_response, half_circle_sign, horizontal_unit, increment_maps

SHARE = 0.3
START_AZIMUTHS = (0.0, 45.0, 90.0, 135.0)
TOLERANCE = 1e-4
"""Largest gap between the error found and what no direction can exceed, relative."""
MAX_PROGRAMMES = 100
BINDING = 1e-7
"""Distance from its limit, relative, at which a row counts as binding."""
RATE = "drag-off rate"


@dataclass(frozen=True)
class ZeroAlarm:
    """The furthest attack inside a set of linear tests.

    Attributes:
        final_error: horizontal error after the last epoch, m.
        bound: no attack inside the tests has a larger one, m; within 1e-4 of it.
        azimuth: direction of the error, degrees clockwise from north, in [0, 180).
        whitened: mean whitened innovations, (K, 3).
        offsets: (K, 3), m ENU.
        binding: names of the tests that bind, with their epochs, 1..K; the rate limit as "drag-off rate".
    """

    final_error: float
    bound: float
    azimuth: float
    whitened: Floats
    offsets: Floats
    binding: dict[str, Runs]


SHARES = (1e-6, 1e3)
"""Least and largest share of the limits that a mean may use."""


def zero_alarm(
    model: LinearModel,
    tests: Sequence[LinearTest],
    share: float = SHARE,
    drag_off_rate: Floats | float | None = None,
) -> ZeroAlarm:
    """The attack over all epochs with the largest final horizontal error inside ``share`` of every test's limit.

    Args:
        model: the filter along the scenario.
        tests: of the whitened innovations; together they must bound them.
        share: of the limits that the mean may use.
        drag_off_rate: largest rate of the offset, (3,) ENU or one for all axes, m/s; None = no limit.

    Raises:
        ValueError: m is not 3, no test, one of another dimension, a value that is not positive, or tests that leave the
            error unbounded.
        RuntimeError: a programme is not solved, or the directions do not come together.
    """
    check_position_fix(model, "a zero-alarm attack")
    share = validation.between("zero_alarm", "share", share, *SHARES)
    rows = _rows(model, tests, share, axis_limits(drag_off_rate))
    gain = error_response(model, model.num_epochs).reshape(2, -1)
    error, whitened, bound = _furthest(gain, sparse.vstack([part for _, part in rows]).tocsr())
    sign = half_circle_sign(error)
    profile = sign * whitened.reshape(-1, 3)
    return ZeroAlarm(
        final_error=float(np.hypot(*error)),
        bound=bound,
        azimuth=azimuth_of(sign * error),
        whitened=profile,
        offsets=offsets_of(model, profile),
        binding=_binding(rows, whitened),
    )


def _rows(
    model: LinearModel, tests: Sequence[LinearTest], share: float, rates: Floats
) -> list[tuple[str, sparse.csr_matrix]]:
    """Every limit as named rows on u, (K, K * 3) each, divided by what they may reach: |row · u| <= 1."""
    if not tests:
        raise ValueError("zero_alarm needs at least one test")
    rows = [(test.name, test.rows(model.num_epochs, model.dimension) / (share * test.limit)) for test in tests]
    if np.isfinite(rates).any():
        innovations, _ = increment_maps(model)
        increments = np.linalg.inv(innovations).reshape(model.num_epochs, 3, -1)
        for axis in np.flatnonzero(np.isfinite(rates)):
            step = rates[axis] * np.diff(model.time)
            rows.append((RATE, sparse.csr_matrix(increments[:, axis] / step[:, None])))
    return rows


def _furthest(gain: Floats, rows: sparse.csr_matrix) -> tuple[Floats, Floats, float]:
    """The error of largest norm with |rows · u| <= 1.

    Args:
        gain: map from u to the horizontal error, (2, q), m.
        rows: (r, q).

    Returns:
        the error (2,), m, the u (q,) that reaches it, and the norm that no error exceeds, m.
    """
    reached: dict[float, tuple[float, Floats]] = {}
    for azimuth in START_AZIMUTHS:
        reached[azimuth] = _programme(horizontal_unit(np.array(azimuth)) @ gain, rows)
    for _ in range(MAX_PROGRAMMES):
        errors = [gain @ whitened for _, whitened in reached.values()]
        best = int(np.argmax(np.hypot(*np.transpose(errors))))
        corner = _furthest_corner(reached)
        if np.hypot(*corner) <= (1.0 + TOLERANCE) * np.hypot(*errors[best]):
            whitened = list(reached.values())[best][1]
            return errors[best], whitened, float(max(np.hypot(*corner), np.hypot(*errors[best])))
        azimuth = azimuth_of(corner) % 180.0
        reached[azimuth] = _programme(horizontal_unit(np.array(azimuth)) @ gain, rows)
    raise RuntimeError(f"zero_alarm: {MAX_PROGRAMMES} directions leave more than {TOLERANCE:g} between error and bound")


def _programme(gain: Floats, rows: sparse.csr_matrix) -> tuple[float, Floats]:
    """The largest gain · u with |rows · u| <= 1, m, and the u (q,) that reaches it.

    Raises:
        ValueError: there is no largest.
        RuntimeError: the programme is not solved.
    """
    solution = linprog(
        -gain,
        A_ub=sparse.vstack([rows, -rows]).tocsr(),
        b_ub=np.ones(2 * rows.shape[0]),
        bounds=(None, None),
        method="highs",
    )
    if solution.status == 3:
        raise ValueError("zero_alarm: the tests do not bound the error; every axis needs a test that binds each epoch")
    if solution.status != 0:
        raise RuntimeError(f"zero_alarm: {solution.message}")
    return -float(solution.fun), solution.x


def _furthest_corner(reached: dict[float, tuple[float, Floats]]) -> Floats:
    """The furthest corner of the polygon d' e <= value over all directions reached and their opposites, (2,), m."""
    azimuths = np.array(sorted(reached))
    values = np.array([reached[azimuth][0] for azimuth in azimuths.tolist()])
    normals = horizontal_unit(np.append(azimuths, azimuths[0] + 180.0))
    values = np.append(values, values[0])
    corners = np.array([np.linalg.solve(normals[i : i + 2], values[i : i + 2]) for i in range(len(azimuths))])
    return corners[np.argmax(np.hypot(*corners.T))]


def _binding(rows: list[tuple[str, sparse.csr_matrix]], whitened: Floats) -> dict[str, Runs]:
    """Epochs, 1..K, in which each named limit binds; names that never bind are left out."""
    epochs: dict[str, Runs] = {}
    for name, part in rows:
        bound = 1 + np.flatnonzero(np.abs(part @ whitened) >= 1.0 - BINDING)
        if len(bound):
            epochs[name] = np.union1d(epochs.get(name, bound), bound)
    return epochs
