"""The model that a spoofer's shadow filter has: the victim's own, or that of a scenario it takes the victim for."""

from __future__ import annotations

from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.mean import MeanFilter
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario


def require_fitting(victim: Scenario, shadow: Scenario) -> None:
    """Refuse a shadow filter that cannot run beside the victim's.

    Args:
        victim: scenario of the game.
        shadow: the scenario that the spoofer believes in.

    Raises:
        ValueError: another timeline, coupling or dimension of the fix than the victim's.
    """
    mine, theirs = victim.timeline, shadow.timeline
    pairs: dict[str, tuple[object, object]] = {
        "start, s": (theirs.start, mine.start),
        "interval, s": (theirs.interval, mine.interval),
        "epochs": (theirs.num_epochs, mine.num_epochs),
        "coupling": (shadow.family.coupling, victim.family.coupling),
    }
    if not shadow.slots and not victim.slots:
        pairs["dimension of the fix"] = (shadow.dimension, victim.dimension)
    differing = [f"{name}: {has} instead of {needs}" for name, (has, needs) in pairs.items() if has != needs]
    if differing:
        raise ValueError(f"shadow {shadow.name!r} does not fit the game {victim.name!r}: {'; '.join(differing)}")


def shadow_model(victim: Scenario, shadow: Scenario) -> LinearModel:
    """The linear model that a spoofer runs in place of the victim's: that of the scenario it takes the victim for.

    Args:
        victim: scenario of the game.
        shadow: the scenario that the spoofer believes in.

    Raises:
        ValueError: as `require_fitting`, or a scenario without a linear model.
    """
    require_fitting(victim, shadow)
    return shadow.linear_model()


def shadow_filter(victim: Scenario, shadow: Scenario, num_runs: int, slices: RunSlices) -> MeanFilter:
    """The filter of the scenario for which the spoofer takes the victim's, run in expectation.

    Args:
        victim: scenario of the game.
        shadow: the scenario that the spoofer believes in.
        num_runs: N.
        slices: the threads to use.

    Raises:
        ValueError: as `require_fitting`, or a scenario without a model.
    """
    require_fitting(victim, shadow)
    return shadow.family.mean_filter(num_runs, slices)
