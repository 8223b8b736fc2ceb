"""The aids by their names, and how several of them are spelled: ``barometer+wheel-speed:sigma=0.2/rate=10``."""

from __future__ import annotations

import re
from collections.abc import Callable

from spoofgym import validation
from spoofgym.navigation.aids.aid import Aid
from spoofgym.navigation.aids.barometer import Barometer
from spoofgym.navigation.aids.magnetometer import Magnetometer
from spoofgym.navigation.aids.wheel_speed import WheelSpeed
from spoofgym.navigation.aids.zero_velocity import ZeroVelocity
from spoofgym.specification import build, nest, unknown_name, unnest

AIDS: dict[str, Callable[..., Aid]] = {
    "barometer": Barometer,
    "magnetometer": Magnetometer,
    "wheel-speed": WheelSpeed,
    "zero-velocity": ZeroVelocity,
}
IN_THE_AIR = ("barometer", "magnetometer")
ON_THE_ROAD = tuple(AIDS)
BETWEEN = re.compile(r"(?<!\d[eE])\+")
"""The plus between two aids, not that of an exponent as in 1e+04."""


def make_aids(owner: str, text: str | None, valid: tuple[str, ...] = ON_THE_ROAD) -> tuple[Aid, ...]:
    """The aids that the option ``aids`` of a scenario names, in this order.

    Args:
        owner: the scenario, for messages.
        text: ``aid+aid``, each with ``/`` in place of the commas between its options; None = none.
        valid: names of those that this vehicle can have.

    Raises:
        ValueError: unknown name or option, an aid that the vehicle cannot have, or one that is there twice.
    """
    if text is None:
        return ()
    aids: list[Aid] = []
    for piece in BETWEEN.split(validation.text(owner, "aids", text)):
        spelled = unnest(piece)
        name = re.split("[:,]", spelled, maxsplit=1)[0].strip()
        if name not in valid:
            raise ValueError(f"{owner}: aids: {unknown_name('aid', name, valid)}")
        aid = build(spelled, AIDS, "aid")
        if any(other.kind == aid.kind for other in aids):
            raise ValueError(f"{owner}: aids: {aid.kind!r} is there twice")
        aids.append(aid)
    return tuple(aids)


def spell_aids(aids: tuple[Aid, ...]) -> str | None:
    """How these aids are spelled as the value of an option; None = there are none."""
    return "+".join(nest(aid.name) for aid in aids) or None
