"""Writes a page: one HTML file with everything in it, which asks for nothing from the network."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator, Sequence
from importlib.resources import files as resources
from pathlib import Path
from string import Template
from typing import Any

import spoofgym
from spoofgym import files
from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.report.figures import Figure, Section
from spoofgym.report.sources import Source, sections_of

ASSETS = "assets"
LIBRARY, LICENCE = "uplot/uPlot.iife.min.js", "uplot/LICENSE"
STYLES = ("uplot/uPlot.min.css", "page.css", "game.css")
SCRIPTS = (
    *("page.js", "theme.js", "svg.js", "scales.js", "numbers.js", "downloads.js", "sorting.js"),
    *("bars.js", "matrix.js", "curves.js", "lines.js", "stanford.js", "table.js"),
    *("panel.js", "panels.js", "track.js", "decisions.js", "transport.js", "game.js", "start.js"),
)
"""In the order in which they are run; the last one draws."""


def write_page(path: str | Path, sources: Sequence[Source | GameTrace], title: str | None = None) -> None:
    """Write a page of games and results.

    Args:
        path: of the HTML file, which is written whole or not at all.
        sources: games, reports of programs as `json.loads` gives them, or paths: JSON files, run folders.
        title: of the page; None = that of its first section.

    Raises:
        ValueError: there is no source, or one is not what a page can show; the message names it.
        OSError: a file cannot be read or written.
    """
    files.check_file(path)
    sections = sections_of(sources)
    files.write_text(path, page(sections, title or sections[0].title))


def page(sections: Sequence[Section], title: str) -> str:
    """The HTML of a page.

    Args:
        sections: in order.
        title: above all of them.
    """
    figures = [figure for section in sections for figure in section.figures]
    places = iter(range(len(figures)))
    alone = len(sections) == 1 and sections[0].title == title
    body = "\n".join(_section(number, section, places, alone) for number, section in enumerate(sections))
    return Template(_asset("page.html")).substitute(
        title=html.escape(title),
        heading=_breakable(title),
        styles="\n".join(_asset(name) for name in STYLES),
        licence=_asset(LICENCE).strip(),
        library=_asset(LIBRARY),
        scripts="\n".join(f"<script>\n{_asset(name)}</script>" for name in SCRIPTS),
        data=script_json([figure.content() for figure in figures]),
        contents=_contents(sections),
        sections=body,
        version=html.escape(spoofgym.__version__),
    )


def script_json(value: Any) -> str:
    """JSON that can stand within a script element: no text of a user ends it."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _asset(name: str) -> str:
    return resources("spoofgym.report").joinpath(ASSETS, name).read_text(encoding="utf-8")


def _breakable(text: str) -> str:
    """Text whose specifications break between their options rather than within a word."""
    return re.sub(r"([,:/+])(?=[^\s\d])", r"\1<wbr>", html.escape(text, quote=False))


def _contents(sections: Sequence[Section]) -> str:
    """Links to the sections, where there are several."""
    if len(sections) < 2:
        return ""
    links = "".join(
        f'<li><a href="#section-{number}">{html.escape(section.title)}</a></li>'
        for number, section in enumerate(sections)
    )
    return f'<nav aria-label="Contents"><ol>{links}</ol></nav>'


def _section(number: int, section: Section, places: Iterator[int], alone: bool) -> str:
    """A section; the title of one that is ``alone`` is that of the page, and is not shown twice."""
    facts = "".join(
        f"<div><dt>{html.escape(name)}</dt><dd>{_breakable(text)}</dd></div>" for name, text in section.facts
    )
    figures = "\n".join(_figure(next(places), figure) for figure in section.figures)
    heading = f'<h2 id="section-{number}"{" class=alone" if alone else ""}>{_breakable(section.title)}</h2>'
    return (
        f'<section aria-labelledby="section-{number}">\n{heading}\n'
        + (f'<dl class="facts">{facts}</dl>\n' if facts else "")
        + f"{figures}\n</section>"
    )


def _figure(place: int, figure: Figure) -> str:
    title, summary = html.escape(figure.title), html.escape(figure.summary)
    return (
        f'<figure id="figure-{place}" class="figure {figure.type}" aria-labelledby="title-{place}" '
        f'aria-describedby="summary-{place}">\n'
        f'<figcaption><h3 id="title-{place}">{title}</h3></figcaption>\n'
        f'<div class="drawing"></div>\n'
        f'<p class="summary" id="summary-{place}">{summary}</p>\n'
        f'<div class="tools"></div>\n</figure>'
    )
