"""Values that nobody would give on purpose, or hardly."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import numpy as np

NUMBERS: tuple[Any, ...] = (
    float("nan"), float("inf"), float("-inf"), 0, 0.0, -0.0, -1, -1.0, 0.5, 1.5, 1, 2, 3.0, 1e-300, -1e-300, 5e-324,
    1e300, -1e300, 1.7e308, 1e160, 1e19, 1e9, -1e9, 10**30, -(10**30), 10**400, 99999999, 2**63, 2**64, 100001,
    np.float64("nan"), np.float32(1e30), np.float16(2.0), np.int64(-3), np.int64(2), np.uint64(2**63), np.longdouble(2),
    np.array(2.0), np.array(float("nan")), np.array([1.0, 2.0]), np.array([]), Decimal("2"), Decimal("NaN"),
)  # fmt: skip
OTHERS: tuple[Any, ...] = (
    True, False, np.bool_(True), None, "", " ", "x", "90", "nan", "1e300", "\0", "x" * 10_000, "9" * 5000, b"5", [],
    [1], [[]], (), (1, 2), {}, {"a": 1}, set(), 1j, np.complex128(1 + 1j), np.array(1j), np.array(["x"]),
    np.array([None, 1], dtype=object), object(), int, range(3), len, np.datetime64("2020-01-01"), Ellipsis,
)  # fmt: skip
TEXTS = (
    "nan", "inf", "-inf", "1e300", "-1e300", "1e-300", "5e-324", "1e400", "-1", "-0", "0", "0.5", "1", "2", "1e9",
    "1e19", "99999999", "100001", "9" * 5000, "0x10", "1_0", "true", "false", "none", "x", "é", "٣", "x" * 5000, "1+1",
    "5+20", "a/b", "~", "+", "/", "ramp/1", "ramp:nan", "ramp:1e300", "ramp:1/onset=1e9",
    "snapshot+windowed", "'", "\\", "\t", "",
)  # fmt: skip
EXPONENTS = ((-300, 300), (-12, 12), (-6, 6), (-2, 2))
ACTIONS: tuple[Any, ...] = (
    None, "x", "", b"1", object(), [], {}, True, 1j, 1e19, 1e300, float("nan"), float("inf"), 10**30, -1, 0.5, 99,
    np.float32(np.inf), np.longdouble("1e4000"), np.uint64(2**63),
)  # fmt: skip


def hostile(rng: np.random.Generator) -> Any:
    """A value that nobody would give on purpose, or hardly."""
    kind = rng.random()
    if kind < 0.35:
        return NUMBERS[int(rng.integers(len(NUMBERS)))]
    if kind < 0.55:
        return OTHERS[int(rng.integers(len(OTHERS)))]
    if kind < 0.75:
        return float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(*EXPONENTS[int(rng.integers(len(EXPONENTS)))]))
    if kind < 0.9:
        return float(10.0 ** rng.uniform(-9, 9))
    return int(rng.integers(-10, 1000))


def hostile_text(rng: np.random.Generator) -> str:
    """A text that nobody would write after ``key=``."""
    if rng.random() < 0.6:
        return TEXTS[int(rng.integers(len(TEXTS)))]
    if rng.random() < 0.3:
        return str(int(rng.integers(-2, 1000)))
    return repr(float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(*EXPONENTS[int(rng.integers(len(EXPONENTS)))])))


def shown(value: object) -> str:
    try:
        return repr(value)[:60]
    except ValueError:
        return f"a {type(value).__name__}"
