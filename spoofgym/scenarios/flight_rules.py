"""Rules of a game in flight: how fast a spoofer may pull, and from which error on the navigation is hazardous."""

from __future__ import annotations

from dataclasses import dataclass

from spoofgym import validation
from spoofgym.navigation.family import FilterFamily
from spoofgym.scenario import Scenario

ERROR_SCALE = 10.0
"""Error that counts as 1 to a spoofer, m."""
DEFENDER_SCALE = 50.0
"""Error that counts as 1 to a defender, m."""


@dataclass(frozen=True)
class FlightRules:
    """Rules of a game in flight.

    Attributes:
        fastest: largest rate of the spoofed position per axis, and of the spoofed clock, m/s.
        alert_limits: horizontal and vertical error from which the navigation is hazardous, m.
    """

    fastest: float
    alert_limits: tuple[float, float]

    def scenario(self, family: FilterFamily) -> Scenario:
        """The game on a filter."""
        return Scenario(
            family=family,
            drag_off_rate=(self.fastest,) * 3,
            error_scale=ERROR_SCALE,
            defender_scale=DEFENDER_SCALE,
            clock_rate=self.fastest,
            alert_limits=self.alert_limits,
        )


def flight_rules(
    owner: str,
    drag_off_rate: float | None,
    usual: float,
    horizontal_alert_limit: float,
    vertical_alert_limit: float,
) -> FlightRules:
    """Check the options of a scenario that are of its rules.

    Args:
        owner: name of the scenario, for messages.
        drag_off_rate: m/s; None = ``usual``.
        usual: m/s.
        horizontal_alert_limit: m.
        vertical_alert_limit: m.

    Raises:
        ValueError: a number that is not above zero.
    """
    limits = (
        validation.above(owner, "horizontal_alert_limit", horizontal_alert_limit),
        validation.above(owner, "vertical_alert_limit", vertical_alert_limit),
    )
    fastest = usual if drag_off_rate is None else validation.above(owner, "drag_off_rate", drag_off_rate)
    return FlightRules(fastest, limits)
