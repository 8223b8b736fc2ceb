"""What a spoofer adds to the fixes: profiles laid down in advance."""

from __future__ import annotations

from collections.abc import Callable

from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import Jump, JumpRamp, NoAttack, Ramp, SlowChange
from spoofgym.specification import build

ATTACKS: dict[str, Callable[..., Attack]] = {
    "none": NoAttack,
    "jump": Jump,
    "ramp": Ramp,
    "jump-ramp": JumpRamp,
    "slow-change": SlowChange,
}


def make_attack(attack: str | Attack) -> Attack:
    """The attack that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    return attack if isinstance(attack, Attack) else build(attack, ATTACKS, "attack")
