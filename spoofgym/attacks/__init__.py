"""What a spoofer adds to the fixes, one file per idea."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from spoofgym import validation
from spoofgym.attacks.azimuth import FOI_ATTACKS, Azimuth
from spoofgym.attacks.base import Attack
from spoofgym.attacks.circle import Circle
from spoofgym.attacks.code_only import CodeOnly
from spoofgym.attacks.exponential import Exponential
from spoofgym.attacks.families import (
    ClimbingSpiral,
    DecayingJump,
    RandomGrowth,
    RandomJump,
    RandomRamp,
    SignChangingRamp,
    TwoStageRamp,
)
from spoofgym.attacks.frozen import Frozen
from spoofgym.attacks.fusion_ripper import FusionRipper
from spoofgym.attacks.meaconing import Meaconing
from spoofgym.attacks.noise_matched import NoiseMatched
from spoofgym.attacks.partial import Partial
from spoofgym.attacks.pool import POPULATIONS
from spoofgym.attacks.position_only import PositionOnly
from spoofgym.attacks.profiles import Jump, JumpRamp, NoAttack, Ramp, SlowChange
from spoofgym.attacks.range_attack import LiuSpoofer
from spoofgym.attacks.song_mix import SongMix
from spoofgym.attacks.time_only import TimeOnly
from spoofgym.attacks.tracking_error import SIGMA, TrackingError
from spoofgym.attacks.velocity_only import VelocityOnly
from spoofgym.specification import build, unnest

Inside = Callable[[str], Attack]
"""Makes the attack within another one from its nested specification: ``/`` stands for its commas, ``~`` for ``+``."""


def _nested(attack: str) -> Attack:
    return make_attack(unnest(attack))


def _around(make: Inside) -> dict[str, Callable[..., Attack]]:
    """The attacks that wrap another attack, which ``make`` makes."""

    def inside(owner: str, attack: str) -> Attack:
        with validation.argument(owner, "attack"):
            return make(attack)

    def tracking_error(attack: str, sigma: float = SIGMA, time: float = 0.0, axis: str | None = None) -> Attack:
        """Another attack with the spoofer's own error in tracking the victim.

        Args:
            attack: the other one; "/" stands for its commas.
            sigma: of the error per axis, m.
            time: its correlation time, s; 0 = white.
            axis: ``east``, ``north`` or ``up``, on which alone the spoofer errs; None = on all three.
        """
        return TrackingError(inside("tracking-error", attack), sigma, time, axis)

    def position_only(attack: str) -> Attack:
        """Another attack that spoofs positions and leaves the velocity of a fix as it is.

        Args:
            attack: the other one; "/" stands for its commas.
        """
        return PositionOnly(inside("position-only", attack))

    def velocity_only(attack: str) -> Attack:
        """Another attack that spoofs the velocity of a fix and leaves its position as it is.

        Args:
            attack: the other one; "/" stands for its commas.
        """
        return VelocityOnly(inside("velocity-only", attack))

    def partial(attack: str, satellites: int | None = None, numbers: str | None = None) -> Attack:
        """Another attack that captures some satellites only.

        Args:
            attack: the other one; "/" stands for its commas.
            satellites: how many are captured: those in the first slots that hold one; 1 with nothing given.
            numbers: of the satellites that are captured instead, with "+" between.
        """
        return Partial(inside("partial", attack), satellites, numbers)

    def code_only(attack: str) -> Attack:
        """Another attack that moves the codes of satellites and leaves carriers and range rates as they are.

        Args:
            attack: the other one; "/" stands for its commas.
        """
        return CodeOnly(inside("code-only", attack))

    return {
        "tracking-error": tracking_error,
        "position-only": position_only,
        "velocity-only": velocity_only,
        "partial": partial,
        "code-only": code_only,
    }


ATTACKS: dict[str, Callable[..., Attack]] = {
    "none": NoAttack,
    "jump": Jump,
    "ramp": Ramp,
    "jump-ramp": JumpRamp,
    "slow-change": SlowChange,
    "song-mix": SongMix,
    "exponential": Exponential,
    "circle": Circle,
    "meaconing": Meaconing,
    "frozen": Frozen,
    "fusion-ripper": FusionRipper,
    "noise-matched": NoiseMatched,
    "azimuth": Azimuth,
    "liu-spoofer": LiuSpoofer,
    "time-only": TimeOnly,
    **FOI_ATTACKS,
    "random-ramp": RandomRamp,
    "random-jump": RandomJump,
    "random-growth": RandomGrowth,
    "two-stage-ramp": TwoStageRamp,
    "sign-changing-ramp": SignChangingRamp,
    "decaying-jump": DecayingJump,
    "climbing-spiral": ClimbingSpiral,
    **POPULATIONS,
    **_around(_nested),
}


def make_attack(
    attack: str | Attack, inside: Inside = _nested, further: Mapping[str, Callable[..., Attack]] | None = None
) -> Attack:
    """The attack that a specification names; an object is returned as it is.

    Args:
        attack: a specification or an object.
        inside: makes the attack within one that wraps another; by default from the attacks named here.
        further: attacks beside those named here.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    if isinstance(attack, Attack):
        return attack
    return build(attack, {**ATTACKS, **_around(inside), **(further or {})}, "attack")
