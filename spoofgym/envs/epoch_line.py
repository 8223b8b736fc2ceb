"""One lane of a game as a line of text: what the render mode "ansi" gives at every epoch."""

from __future__ import annotations

from typing import TYPE_CHECKING

from spoofgym.geodesy import horizontal

if TYPE_CHECKING:
    from spoofgym.envs.duel_game import DuelGame
    from spoofgym.envs.view import OneSeatGame


def epoch_line(game: OneSeatGame | DuelGame, lane: int) -> str:
    """The present epoch of a lane, for example.

        ``  39/230  offset  20.7 m  error   9.3 m  20 back   windowed:n=5 1.42 ALARM``

    In order: the epoch and the last one of the game; how far the fix is pulled away, horizontally; the horizontal error
    of the estimate when last resolved; how far the vehicle is off its path, where it is steered by its estimate; what
    became of the fix before; the largest statistic over its threshold; and what is to be known of the present fix.
    """
    simulation = game.simulation
    epoch, last = simulation.epoch, game.scenario.timeline.num_epochs
    offset, error = float(horizontal(simulation.offset[lane])), float(game.error[lane])
    ratios = {
        name: float(epoch.statistics[name][lane] / detector.threshold)
        for name, detector in simulation.detectors.items()
    }
    parts = [f"{epoch.index[lane]:>4}/{last:<4}", f"offset {offset:5.1f} m", f"error {error:5.1f} m"]
    if simulation.steering is not None:
        parts.append(f"off path {simulation.steering.distance[lane]:5.1f} m")
    parts.append(f"{_fate(game, lane):<8}")
    if ratios:
        largest = max(ratios, key=ratios.__getitem__)
        parts.append(f"{largest} {ratios[largest]:.2f}")
    line = "  ".join(parts)
    if epoch.available is not None and not epoch.available[lane]:
        line += " NO FIX"
    elif epoch.index[lane] > 0 and any(ratio > 1.0 for ratio in ratios.values()):
        line += " ALARM"
    return line


def _fate(game: OneSeatGame | DuelGame, lane: int) -> str:
    """What became of the fix of the epoch before; nothing at the start of a game, which has none."""
    simulation = game.simulation
    if simulation.epoch.index[lane] == 0:
        return ""
    depth = int(simulation.navigator.backtracked[lane])
    if depth:
        return f"{depth} back"
    return "used" if simulation.used[lane] else "not used"
