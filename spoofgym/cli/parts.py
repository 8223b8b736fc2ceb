"""What there is to play with, as its own documentation tells it: scenarios, aids, detectors, attacks, responses.

Nothing is written twice: what a part does and where it comes from stands in the docstring of its class or function, its
options and their defaults in its signature.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections import ChainMap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from spoofgym.attacks import ATTACKS
from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.envs.opponents import FITTED, make_spoofer
from spoofgym.navigation.aids import AIDS
from spoofgym.responses import RESPONSES, make_response
from spoofgym.scenarios import SCENARIOS, make_scenario
from spoofgym.specification import unknown_name, write

REGISTRIES: dict[str, Mapping[str, Callable[..., Any]]] = {
    "scenarios": SCENARIOS,
    "detectors": DETECTORS,
    "attacks": ChainMap(FITTED, ATTACKS),  # a view: attacks of one's own are registered later
    "responses": RESPONSES,
    "aids": AIDS,
}
GIVEN = {
    "ramp": "ramp:0.5",
    "jump-ramp": "jump-ramp:0.2,jump=10",
    "exponential": "exponential:0.1",
    "circle": "circle:30",
    "meaconing": "meaconing:0.5",
    "fusion-ripper": "fusion-ripper:0.5",
    "azimuth": "azimuth:10",
    "liu-spoofer": "liu-spoofer:0.2",
    "tracking-error": "tracking-error:ramp:0.2,sigma=0.3",
    "position-only": "position-only:ramp:0.2",
    "velocity-only": "velocity-only:ramp:0.2",
    "partial": "partial:ramp:0.3,satellites=2",
    "code-only": "code-only:ramp:0.3",
    "unseen": "unseen:16",
    "closed-form": "closed-form:16",
    "recorded": "recorded:FOLDER",
}
"""Examples of parts that are spelled with a value."""
PLACES = ("foi-drive", "liu-flight", "kujur-flight", "song-robot", "foi-drive:aids=wheel-speed+barometer")
"""Where an example is played: the first that offers what the part needs."""
UNITS = r"m/s²|m/√s|m/s|deg/√s|m²|deg/h|deg/s|degrees|deg|rad|µg|Hz|m|s|epochs|fixes|standard deviations"
UNIT = re.compile(rf"(?:^|, )({UNITS})(?=[,;:.]|$)|^(epochs)\b")
"""Where a description names the unit of its value: "radius of the circle, m; ..."."""
UNTOLD = "It has no docstring that would tell what it is"
YEAR = r"\(?(?:19|20)\d\d\)?"
WHERE = r"(?:,? (?:eqs?|sections?|chapters?|tables?|appendix) [\w.]+(?:(?:, | and | to )[\d.]+)*)*"
CITED = re.compile(
    rf"FOI-R-5687{WHERE}|PX4|ArduPilot|[A-Z]\w[\w-]*(?:,? et al\.|,? (?:and )?[A-Z]\w+)*,? {YEAR}{WHERE}"
)


@dataclass(frozen=True)
class Option:
    """An option of a part.

    Attributes:
        name: as it is spelled.
        default: as it is spelled; empty = it must be given.
        unit: of its value; empty where it has none or its text does not say.
        told: what it is.
    """

    name: str
    default: str
    unit: str
    told: str


@dataclass(frozen=True)
class Part:
    """What a part's documentation says.

    Attributes:
        kind: "scenarios", "detectors", "attacks", "responses" or "aids".
        name: registered.
        told: the first sentence.
        text: paragraphs that follow.
        options: in the order in which they may be given.
        source: where it comes from, as far as the text cites it.
        example: a specification.
        module: where it is written.
    """

    kind: str
    name: str
    told: str
    text: tuple[str, ...]
    options: tuple[Option, ...]
    source: str
    example: str
    module: str

    @property
    def command(self) -> str:
        """A command that plays it; of one's own part it names the module to import."""
        own = "" if self.module.split(".")[0] == "spoofgym" else f" --import {self.module}"
        return self._played() + own

    def _played(self) -> str:
        if self.kind == "scenarios":
            return f"spoofgym play --scenario {self.example}"
        if self.kind == "aids":
            return f"spoofgym play --scenario foi-drive:aids={self.example}"
        try:
            if self.kind == "attacks" and _needs_a_log(self.example):
                return f"spoofgym evaluate recorded FOLDER --attack {self.example}"
            place = next((text for text in PLACES if self._fits(text)), PLACES[0])
        except ValueError:  # one's own part that is spelled with a value which nobody can guess
            place = PLACES[0]
        return f"spoofgym play --scenario {place} --{self.kind[:-1]} {self.example}"

    def _fits(self, place: str) -> bool:
        if self.kind == "detectors":
            needs = make_detector(self.example).needs
        elif self.kind == "responses":
            needs = make_response(self.example).needs
        else:
            return not make_spoofer(self.example).needs_ranges or make_scenario(place).slots > 0
        return set(needs) <= set(make_scenario(place).offers)


def _needs_a_log(attack: str) -> bool:
    """Whether an attack needs a log's own attack, or a receiver that gives velocity, which no simulated one does."""
    return attack == RECORDED or make_spoofer(attack).needs_velocity


def part(kind: str, name: str) -> Part:
    """What is known of a part.

    Args:
        kind: a key of `REGISTRIES`.
        name: of the part, or a specification that begins with it.

    Raises:
        ValueError: there is none of this name; the message tells the nearest.
    """
    name = re.split("[:,]", name, maxsplit=1)[0].strip()
    registry = REGISTRIES[kind]
    if name not in registry:
        raise ValueError(unknown_name(kind[:-1], name, registry))
    factory = registry[name]
    module = factory.__module__ if hasattr(factory, "__module__") else ""
    paragraphs, _ = _read(_doc(factory))
    above, _ = _read(inspect.getdoc(sys.modules.get(module)) or "")
    if kind == "scenarios" or not paragraphs:  # a scenario's module says what is flown, its function how it is a game
        paragraphs = above[:1] + paragraphs
    told, *rest = re.split(r"(?<!al)\. ", paragraphs[0] if paragraphs else UNTOLD, maxsplit=1)
    text = tuple(paragraph for paragraph in (*rest, *paragraphs[1:]) if paragraph)
    return Part(
        kind, name, told.rstrip("."), text, _options(factory), _source([*paragraphs, *above]),
        name if (kind, name) == ("attacks", RECORDED) else GIVEN.get(name, name), module,
    )


def _doc(factory: Callable[..., Any]) -> str:
    """The factory's own docstring: a class would otherwise tell what its base class is."""
    return inspect.cleandoc(factory.__doc__ or "")


def parts(kind: str) -> list[Part]:
    """All parts of a kind, in the order of their registry."""
    return [part(kind, name) for name in REGISTRIES[kind]]


def _read(doc: str) -> tuple[list[str], dict[str, str]]:
    """The paragraphs of a docstring before its sections, and what its ``Args`` tell of each."""
    before, _, rest = re.sub(r"\n(Args|Attributes|Raises|Returns):\n", "\n\0\\1:\n", f"\n{doc}\n").partition("\0")
    paragraphs = [_plain(paragraph) for paragraph in re.split(r"\n\s*\n", before) if paragraph.strip()]
    arguments = next((part for part in rest.split("\0") if part.startswith("Args:")), "")
    found = re.findall(r"^    (\w+): (.*(?:\n     +.*)*)", arguments, flags=re.MULTILINE)
    return paragraphs, {name: _plain(told) for name, told in found}


def _plain(text: str) -> str:
    """Text without the marks of reStructuredText; a formula on lines of its own stays one."""
    return " ".join(text.replace("``", "").replace("`", "").split())


def _options(factory: Callable[..., Any]) -> tuple[Option, ...]:
    told: dict[str, str] = {}
    for above in reversed(inspect.getmro(factory) if inspect.isclass(factory) else (factory,)):
        told |= _read(inspect.getdoc(above) or "")[1]
    options = []
    for name, parameter in inspect.signature(factory).parameters.items():
        text = told.get(name, "")
        unit = UNIT.search(text)
        default = "" if parameter.default is inspect.Parameter.empty else _spelled(parameter.default)
        options.append(Option(name, default, "" if unit is None else unit[1] or unit[2], text))
    return tuple(options)


def _spelled(default: object) -> str:
    return "none" if default is None else write(default)


def _source(paragraphs: list[str]) -> str:
    for paragraph in paragraphs:
        if (found := CITED.search(paragraph)) is not None:
            return re.sub("[()]", "", found[0])
    return ""
