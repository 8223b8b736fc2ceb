"""An attack that captures only some of the satellites; it wraps another attack."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Runs
from spoofgym.attacks.around import AroundAttack
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import nest, spell

DEFAULT_SATELLITES = 1
DIGITS = 4


class Partial(AroundAttack):
    """An attack that moves the ranges of some satellites, and leaves those of the others true.

    The receiver has kept its lock on part of the authentic signals, or the spoofer sends too few. The ranges then
    contradict each other, which a test of their residual sees (`spoofgym.detectors.raim`) and the filter takes in part
    for errors of these satellites. It needs a receiver of ranges: a fix has no parts.

    Args:
        attack: the attack inside.
        satellites: how many are captured: those in the first slots that hold one; 1 with nothing given.
        numbers: of the satellites that are captured instead, whenever they are in view, with ``+`` between.

    Raises:
        ValueError: both of the last two are given, one is not as it must be, or the attack inside is partial itself.
    """

    kind = "partial"

    def __init__(self, attack: Attack, satellites: int | None = None, numbers: str | None = None) -> None:
        if isinstance(attack, Partial):
            raise ValueError(f"partial: attack must not be partial itself, got {attack.name!r}")
        validation.at_most_one("partial", satellites=satellites, numbers=numbers)
        super().__init__(attack)
        self.needs_ranges = True
        count = DEFAULT_SATELLITES if satellites is None else satellites
        self.satellites = validation.whole("partial", "satellites", count, 1)
        self.numbers = None if numbers is None else _numbers(numbers)

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        satellites = None if self.satellites == DEFAULT_SATELLITES else self.satellites
        numbers = None if self.numbers is None else "+".join(map(str, self.numbers))
        return spell("partial", nest(self.attack.name), satellites=satellites, numbers=numbers)

    def captured(self, clock: Clock, satellites: Runs) -> Flags:
        """Which satellites are captured, of those that the attack inside captures, (N, S)."""
        inside = self.attack.captured(clock, satellites)
        present = satellites >= 0 if inside is None else (satellites >= 0) & inside
        if self.numbers is not None:
            return present & np.isin(satellites, self.numbers)
        return present & (np.cumsum(present, axis=1) <= self.satellites)

    def meet(self, satellites: Runs) -> None:
        """See the numbers of the satellites in the game.

        Raises:
            ValueError: a satellite to be captured is not among them.
        """
        super().meet(satellites)
        missing = sorted(set(self.numbers or ()) - set(satellites.tolist()))
        if missing:
            raise ValueError(
                f"attack {self.name!r}: numbers must be those of satellites in the game, "
                f"{'+'.join(map(str, satellites.tolist()))}, got {'+'.join(map(str, missing))}"
            )


def _numbers(text: object) -> tuple[int, ...]:
    """Numbers of satellites spelled ``3+17``.

    Raises:
        ValueError: they are not whole numbers, each once.
    """
    pieces = text.split("+") if isinstance(text, str) else [""]
    numbers = tuple(int(piece) for piece in pieces if piece.isascii() and piece.isdigit() and len(piece) <= DIGITS)
    if len(numbers) < len(pieces) or len(set(numbers)) < len(numbers):
        raise ValueError(
            f"partial: numbers must be those of satellites, each once, with + between, e.g. 3+17; got "
            f"{validation.shown(text)}"
        )
    return numbers
