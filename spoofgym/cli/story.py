"""A played game as a story for the terminal: who plays, what happens when, and how it ends."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.departures import Departure
from spoofgym.evaluation.game_trace import (
    ALARM,
    BACK,
    BACKTRACK,
    DIVERGENCE,
    END,
    EXCLUSION,
    LEFT,
    ONSET,
    RESET,
    REUSE,
    GameEvent,
    GameTrace,
)

BARS, PLAIN_BARS = "▁▂▃▄▅▆▇█", "_.-=+*%#"
"""From little to much; the second where a terminal knows no others."""
USED, LEFT_OUT, TAKEN_BACK = ".", "x", "<"
MOST_EVENTS = 14
"""Lines of events; a fix that is left out and used again in turn would fill pages."""
LABEL = 22
"""Columns of what stands before a sparkline."""
LEAST_SPARKS = 10
EVENT = 31
"""Columns of what stands before an event, which is told below them in a narrow terminal."""
LEAST_TOLD = 30
SEAT = 10
"""Columns of what stands before a player."""


def story(game: GameTrace, columns: int, blocks: bool = True) -> Iterator[str]:
    """The lines of the story.

    Args:
        game: that was played.
        columns: of the terminal.
        blocks: whether it can print block characters.
    """
    yield from _folded(_who(game), columns, SEAT)
    yield ""
    yield from _events(game, columns)
    yield ""
    yield from _sparklines(game, columns, BARS if blocks else PLAIN_BARS)
    yield ""
    yield from _folded(_ending(game), columns, 0)


def _folded(lines: Iterable[str], columns: int, label: int) -> Iterator[str]:
    """Lines folded after words; the label before them stays with the first word, and paths stay whole."""
    for line in lines:
        yield from textwrap.wrap(
            line[label:], columns, initial_indent=line[:label], subsequent_indent=" " * SEAT, break_long_words=False,
            break_on_hyphens=False,
        )


def _who(game: GameTrace) -> Iterator[str]:
    players = game.players
    span = f"{len(game.time) - 1} epochs, {game.time[0]:.6g} to {game.time[-1]:.6g} s"
    yield f"scenario  {players.scenario} ({players.fidelity}), seed {players.seed}: {span}"
    drawn = "" if players.drawn is None else f", which draws {players.drawn}"
    yield f"spoofer   {players.attack or 'nobody'}{drawn}"
    for part in game.statistics:
        rate = "" if part.arl0 is None else f", one false alarm in {part.arl0:,.0f} epochs"
        yield f"detector  {part.name} (alarms above {part.threshold:.4g}{rate})"
    yield f"defender  {players.response or 'nobody: every fix is used'}"


def _events(game: GameTrace, columns: int) -> Iterator[str]:
    happened = game.events
    if not happened:
        yield "Nothing happens: no attack, no alarm."
        return
    header = f"{'time, s':>9}  {'error, m':>8}  {'pull, m':>8}"
    yield header if columns - EVENT < LEAST_TOLD else f"{header}  what happens"
    pull = np.linalg.norm(game.spoofed - game.true, axis=1)
    for event in happened[:MOST_EVENTS]:
        k = event.epoch
        told, before = _told(event, game), f"{game.time[k]:>9.6g}  {game.error[k]:>8.2f}  {pull[k]:>8.2f}  "
        if columns - EVENT < LEAST_TOLD:
            yield before.rstrip()
            yield from textwrap.wrap(told, columns, initial_indent=" " * 4, subsequent_indent=" " * 4)
        else:
            yield from textwrap.wrap(told, columns, initial_indent=before, subsequent_indent=" " * EVENT)
    if len(happened) > MOST_EVENTS:
        yield f"{'...':>9}  and {len(happened) - MOST_EVENTS} more; --csv and --page have all of them"


def _told(event: GameEvent, game: GameTrace) -> str:
    onset = game.first(ONSET)
    if event.kind == ALARM:
        if onset is None or event.epoch < onset.epoch:
            return f"false alarm of {event.detail}"
        late = f", {game.time[event.epoch] - game.time[onset.epoch]:.4g} s after the onset"
        first = next(each for each in game.events if each.kind == ALARM and each.epoch >= onset.epoch)
        return f"alarm of {event.detail}{late if event is first else ''}"
    return {
        ONSET: "the spoofer begins",
        END: "the spoofer ends",
        EXCLUSION: "fixes are left out from here on",
        BACKTRACK: f"{event.detail} taken back",
        REUSE: "fixes are used again",
        RESET: "the filter is reset to the fix",
        DIVERGENCE: "the filter diverges, and the game ends",
        LEFT: "the vehicle leaves its corridor",
        BACK: "the vehicle is back in its corridor",
    }[event.kind]


def _sparklines(game: GameTrace, columns: int, bars: str) -> Iterator[str]:
    width = max(columns - LABEL - 1, LEAST_SPARKS)
    rows: list[tuple[str, Floats]] = [
        ("error, m", game.error),
        ("pull, m", np.linalg.norm(game.spoofed - game.true, axis=1)),
    ]
    if game.departure is not None:
        rows.append(("off the path, m", game.departure.deviation))
    for part in game.statistics:
        rows.append((f"{part.name.partition(':')[0]}/threshold", part.values / part.threshold))
    for label, values in rows:
        finite = np.where(np.isfinite(values), values, np.nan)
        most = float(np.nanmax(finite)) if np.isfinite(finite).any() else 0.0
        yield f"{_short(label)} {sparkline(finite, width, bars)}"
        yield f"{'':<{LABEL}} 0 to {most:.3g}"
    yield f"{'GNSS':<{LABEL}} {decisions(game, width)}"
    legend = f"{USED} used  {LEFT_OUT} left out  {TAKEN_BACK} taken back"
    yield f"{'':<{LABEL}} {legend}" if LABEL + 1 + len(legend) <= columns else legend.rjust(columns)


def _short(label: str) -> str:
    return f"{label:<{LABEL}}" if len(label) <= LABEL else label[:LABEL]


def sparkline(values: Floats, width: int, bars: str = BARS) -> str:
    """A line of bars: of each stretch of the series the largest value, from 0 to the largest of all.

    Args:
        values: (T,); not a number = there is none.
        width: columns, at most.
        bars: from little to much.
    """
    parts = [part for part in np.array_split(values, min(width, len(values))) if len(part)]
    highest = [float(np.nanmax(part)) if np.isfinite(part).any() else 0.0 for part in parts]
    top = max(highest, default=0.0)
    if top <= 0.0:
        return bars[0] * len(highest)
    return "".join(bars[min(int(max(value, 0.0) / top * len(bars)), len(bars) - 1)] for value in highest)


def decisions(game: GameTrace, width: int) -> str:
    """A line of letters: whether fixes were taken back, left out, or all used in each stretch of the game."""
    places = np.array_split(np.arange(len(game.time)), min(width, len(game.time)))
    return "".join(_letter(game, place) for place in places)


def _letter(game: GameTrace, place: np.ndarray | Sequence[int]) -> str:
    if game.backtracked[place].any():
        return TAKEN_BACK
    return USED if game.used[place].all() else LEFT_OUT


def _driven(game: GameTrace, departure: Departure) -> str:
    worst, outside = int(departure.deviation.argmax()), int(np.count_nonzero(departure.outside))
    return (
        f"vehicle: at most {departure.deviation[worst]:.2f} m off its path (at {game.time[worst]:.6g} s), outside its "
        f"corridor of {departure.corridor:g} m at {outside} of {len(game.time)} epochs"
    )


def _ending(game: GameTrace) -> Iterator[str]:
    worst = int(game.error.argmax())
    yield (
        f"horizontal error: mean {game.error.mean():.2f} m, at most {game.error[worst]:.2f} m (at "
        f"{game.time[worst]:.6g} s), {game.error[-1]:.2f} m at the end"
    )
    if game.departure is not None:
        yield _driven(game, game.departure)
    left_out, taken = int(np.count_nonzero(~game.used)), int(game.backtracked.sum())
    onset = game.first(ONSET)
    clean = game.alarm if onset is None else game.alarm[: onset.epoch]
    yield f"fixes: {left_out} of {len(game.used)} left out, {taken} taken back; {int(clean.sum())} false alarms"
    if onset is not None:
        yield "the spoofer stays undetected" if game.undetected else "the spoofer is detected"
