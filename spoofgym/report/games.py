"""The section of one played game."""

from __future__ import annotations

import numpy as np

from spoofgym.evaluation.game_trace import ALARM, BACKTRACK, EXCLUSION, LEFT, ONSET, REUSE, GameTrace, Statistic
from spoofgym.report.figures import GameFigure, Section


def game_section(game: GameTrace) -> Section:
    """A game, who played it and with which seed, and its story."""
    players = game.players
    detectors = "; ".join(map(_watching, game.statistics))
    attack = players.attack or "nobody"
    facts = [
        ("Scenario", players.scenario),
        ("Fidelity", players.fidelity),
        ("Spoofer", attack if players.drawn is None else f"{players.drawn}, drawn from {attack}"),
        ("Detectors", detectors or "none"),
        ("Defender", players.response or "none: every fix is used"),
        ("Seed", str(players.seed)),
    ]
    title = f"{_spoofer(game)} against {players.response or 'no defender'} on {players.scenario}"
    figure = GameFigure(title="The game, epoch by epoch", summary=game_story(game), game=game.to_json())
    return Section(title, facts, [figure])


def _watching(part: Statistic) -> str:
    rate = "" if part.arl0 is None else f" (one false alarm in {part.arl0:,.0f} epochs)"
    return f"{part.name} above {part.threshold:.4g}{rate}"


def game_story(game: GameTrace) -> str:
    """What happened, in plain sentences."""
    sentences = [_spoofing(game), _alarms(game), *_decisions(game), _errors(game), _driven(game)]
    if game.diverged:
        sentences.append(f"The filter diverged at {_time(game, len(game.time) - 1)}.")
    return " ".join(sentence for sentence in sentences if sentence)


def _spoofer(game: GameTrace) -> str:
    return game.players.drawn or game.players.attack or "Nobody"


def _time(game: GameTrace, epoch: int) -> str:
    return f"{game.time[epoch]:.10g} s"


def _spoofing(game: GameTrace) -> str:
    onset = game.first(ONSET)
    span = f"{len(game.time) - 1} epochs from {_time(game, 0)} to {_time(game, -1)}"
    if onset is None:
        return f"{span}; no fix is spoofed."
    offset = np.linalg.norm(game.spoofed - game.true, axis=1)
    epochs = int(np.count_nonzero(game.attacked))
    return (
        f"{span}; {epochs} fixes are spoofed, the first at {_time(game, onset.epoch)}; the largest offset is "
        f"{offset.max():.1f} m."
    )


def _alarms(game: GameTrace) -> str:
    onset, first = game.first(ONSET), game.first(ALARM)
    if first is None:
        return "No detector alarms."
    text = f"The first alarm comes at {_time(game, first.epoch)} from {first.detail}"
    if onset is None or first.epoch < onset.epoch:
        return f"{text}, a false one."
    delay = game.time[first.epoch] - game.time[onset.epoch]
    return f"{text}, {delay:.10g} s after the onset; the error is {game.error[first.epoch]:.1f} m then."


def _decisions(game: GameTrace) -> list[str]:
    excluded, taken = int(np.count_nonzero(~game.used)), int(np.sum(game.backtracked))
    sentences = []
    first = game.first(EXCLUSION)
    if first is not None:
        sentences.append(f"{excluded} fixes are excluded, the first at {_time(game, first.epoch)}.")
    back = [event for event in game.events if event.kind == BACKTRACK]
    if back:
        sentences.append(f"{taken} fixes are taken back, first at {_time(game, back[0].epoch)}.")
    reuse = [event for event in game.events if event.kind == REUSE]
    if reuse:
        sentences.append(f"GNSS is used again {'once' if len(reuse) == 1 else f'{len(reuse)} times'}.")
    return sentences


def _driven(game: GameTrace) -> str:
    if game.departure is None:
        return ""
    most, width = float(game.departure.deviation.max()), game.departure.corridor
    left = game.first(LEFT)
    corridor = f"its corridor of {width:g} m"
    where = f"leaves {corridor} at {_time(game, left.epoch)}" if left else f"keeps within {corridor}"
    return f"The vehicle, which is steered by its estimate, {where}; it is {most:.1f} m off its path at most."


def _errors(game: GameTrace) -> str:
    worst = int(game.error.argmax())
    return (
        f"The horizontal error is {game.error.mean():.1f} m on average, {game.error[worst]:.1f} m at most (at "
        f"{_time(game, worst)}) and {game.error[-1]:.1f} m at the end."
    )
