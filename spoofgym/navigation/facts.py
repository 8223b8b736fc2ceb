"""What is known of a filter before any epoch: to a monitor that watches it, to a spoofer who has a copy of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel

AIDS = "aids"
COASTING = "coasting on inertia alone"
INERTIAL_SOLUTION = "inertial solution"
LINEAR_MODEL = "linear model"
ODOMETER = "odometer"
RANGES = "ranges to satellites"


@dataclass(frozen=True)
class FilterFacts:
    """The filter of a scenario, as its designer knows it.

    Attributes:
        scenario: its name, for messages.
        interval: between epochs, s.
        bias_sigma: data-sheet biases of gyros and accelerometers, (6,), rad/s and m/s².
        offers: what a monitor can ask for beside innovations.
        model: burn-in -> the linear model of epochs -burn_in..K, every fix used.
        fix_sigma: 1 sigma of a fix per horizontal axis, m; None = not told.
        auxiliary_sigma: 1 sigma of what the odometer's solution goes wrong in an epoch at the end of the game, m; None
            = there is no odometer.
        range_model: burn-in -> the model of a filter on ranges (`TightModel`), every range used; None = it takes fixes.
        observable: what a receiver of ranges measures beside the code, ``carrier`` or ``rate``; None = it gives fixes.
        matched: whether clean innovations before epoch 0 are drawn, white, as of epoch 0; else the filter has really
            been there.
        aids: what corrects the filter beside GNSS, by name, and the rows of a measurement of each.
    """

    scenario: str
    interval: float
    bias_sigma: Floats
    offers: tuple[str, ...]
    model: Callable[[int], LinearModel]
    fix_sigma: float | None = None
    auxiliary_sigma: float | None = None
    range_model: Callable[[int], object] | None = None
    observable: str | None = None
    matched: bool = True
    aids: tuple[tuple[str, int], ...] = ()

    def refuse_aids(self, owner: str) -> None:
        """Refuse a part whose equations leave out what aids do between two fixes.

        Args:
            owner: the part, for the message.

        Raises:
            ValueError: the filter has aids.
        """
        if self.aids:
            named = ", ".join(name for name, _ in self.aids)
            raise ValueError(f"{owner} knows no aids, and scenario {self.scenario!r} has: {named}")

    def require(self, owner: str, needs: tuple[str, ...], remedy: str = "") -> None:
        """Refuse a part that needs something the scenario does not offer.

        Args:
            owner: the part, for the message.
            needs: of the part.
            remedy: what the caller can do about it, for the message.

        Raises:
            ValueError: naming the part, what it needs, and what there is.
        """
        missing = [need for need in needs if need not in self.offers]
        if missing:
            raise ValueError(
                f"{owner} needs {' and '.join(missing)}, which scenario {self.scenario!r} does not give; it gives: "
                f"{', '.join(self.offers)}" + (f"; {remedy}" if remedy else "")
            )
