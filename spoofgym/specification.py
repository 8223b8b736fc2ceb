"""The one spelling of a part: ``name[:value][,key=value...]``.

Command line, environment arguments, opponent pools, tables and files all name a detector, an attack, a response or a
scenario this way: ``snapshot``, ``windowed:n=20,arl0=1e5``, ``ramp:0.5,direction=135``,
``recorded:PATH,grade=tactical``. A part within a part has ``/`` in place of its commas
and ``~`` in place of ``+``: ``ensemble:snapshot+windowed:n=20/threshold=115+window-bank:lengths=5~20,arl0=1e4``.
"""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from spoofgym.validation import nearest, shown

Part = TypeVar("Part")

KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
WORDS = {int: "a whole number", float: "a number"}
"""What a value must be, in words."""


@dataclass(frozen=True)
class Specification:
    """A parsed specification.

    Attributes:
        name: the part's registered name.
        value: the positional value after the colon, if any.
        options: the ``key=value`` pairs in the order written.
    """

    name: str
    value: str | None = None
    options: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> Specification:
        """Read ``name[:value][,key=value...]``; blanks around a piece do not count.

        Raises:
            ValueError: empty name or piece, a key given twice, or a piece that is neither the first value nor
                ``key=value``.
        """
        name, separator, rest = text.strip().partition(":")
        if "," in name:
            name, separator, rest = text.strip().partition(",")
        name = name.rstrip()
        if not name or "=" in name:
            raise ValueError(f"specification {shown(text)}: expected name[:value][,key=value...]")
        value: str | None = None
        options: dict[str, str] = {}
        pieces = [piece.strip() for piece in rest.split(",")] if separator else []
        for position, piece in enumerate(pieces):
            key, equals, content = (part.strip() for part in piece.partition("="))
            if position == 0 and separator == ":" and piece and not (equals and (not key or KEY.fullmatch(key))):
                value = piece
            elif not equals or not key or not content:
                raise ValueError(f"specification {shown(text)}: {shown(piece)} is not key=value")
            elif key in options:
                raise ValueError(f"specification {shown(text)}: {shown(key)} is given twice")
            else:
                options[key] = content
        return cls(name, value, options)

    def __str__(self) -> str:
        pieces = [] if self.value is None else [self.value]
        pieces += [f"{key}={value}" for key, value in self.options.items()]
        return self.name + (":" + ",".join(pieces) if pieces else "")


NESTED = str.maketrans(",+", "/~")
UNNESTED = str.maketrans("/~", ",+")


def nest(text: str) -> str:
    """A specification as the value of another one: ``/`` stands for the comma between its options, ``~`` for ``+``."""
    return text.translate(NESTED)


def unnest(text: Any) -> Any:
    """The specification that `nest` wrote; what is no text stays as it is, and is refused where it is built."""
    return text.translate(UNNESTED) if isinstance(text, str) else text


def spell(name: str, value: object = None, **options: object) -> str:
    """Write the specification of a part from Python values; None is left out.

    Numbers are written as shortly as they can be read back exactly: 1e5 as ``100000``, 0.5 as ``0.5``.
    """
    written = {key: write(content) for key, content in options.items() if content is not None}
    return str(Specification(name, None if value is None else write(value), written))


def spell_changed(name: str, factory: Callable[..., object], **options: object) -> str:
    """Write the specification of a part from the options of its factory; those that have their default are left out."""
    parameters = inspect.signature(factory).parameters
    return spell(name, **{key: value for key, value in options.items() if value != parameters[key].default})


def write(content: object) -> str:
    """A value as it is spelled after ``key=``."""
    if isinstance(content, bool):
        return str(content).lower()
    if isinstance(content, float):
        short = f"{content:g}"
        return short if float(short) == content else repr(float(content))
    return str(content)


def build(text: str, registry: Mapping[str, Callable[..., Part]], kind: str) -> Part:
    """Make the part that a specification names.

    The value fills the factory's first parameter, options fill the others by name; strings are converted by the
    parameter's annotation (``float``, ``int``, ``bool``, ``str``, or one of them ``| None``).

    Args:
        text: the specification.
        registry: factory (class or function) of every known name.
        kind: what is built, for error messages ("detector", "attack", ...).

    Raises:
        TypeError: not a text.
        ValueError: unknown name or option (the message lists the valid ones), or a value of the wrong type.
    """
    if not isinstance(text, str):
        valid = ", ".join(sorted(registry))
        raise TypeError(f"{kind} must be a specification ({valid}) or an object of its class, got {shown(text)}")
    specification = Specification.parse(text)
    if specification.name not in registry:
        raise ValueError(unknown_name(kind, specification.name, registry))
    factory = registry[specification.name]
    parameters = inspect.signature(factory).parameters
    hints = typing.get_type_hints(factory.__init__ if inspect.isclass(factory) else factory)
    arguments = dict(specification.options)
    if specification.value is not None:
        if not parameters:
            raise ValueError(f"{kind} {specification.name!r} takes no value, got {shown(specification.value)}")
        first = next(iter(parameters))
        if first in arguments:
            raise ValueError(f"{kind} {shown(text)}: {first!r} is given twice")
        arguments[first] = specification.value
    unknown = [key for key in arguments if key not in parameters]
    if unknown:
        valid = ", ".join(parameters) or "none"
        nested = specification.value is not None and ":" in specification.value
        hint = "; for an option of the part within, write '/' in place of ','" if nested else ""
        close = nearest(unknown[0], parameters) or ";"
        told = f"{kind} {specification.name!r} has no option {shown(unknown[0])}{close}"
        raise ValueError(f"{told} valid options: {valid}{hint}")
    missing = [p.name for p in parameters.values() if p.default is inspect.Parameter.empty and p.name not in arguments]
    if missing:
        example = f"{specification.name}:{missing[0]}=..."
        raise ValueError(f"{kind} {specification.name!r} needs {missing[0]!r}, e.g. {example}")
    converted = {key: _convert(text, key, value, hints.get(key, str)) for key, value in arguments.items()}
    try:
        return factory(**converted)
    except ValueError as error:
        if specification.name in str(error):
            raise
        raise ValueError(f"{kind} {specification.name!r}: {error}") from error


def registered_by_others(registry: Mapping[str, Callable[..., Any]]) -> tuple[str, ...]:
    """The names of parts that somebody else has registered, as far as they can be spelled without a value.

    They stand beside ours in the defaults of programs.
    """
    return tuple(
        name
        for name, factory in registry.items()
        if not getattr(factory, "__module__", "").startswith("spoofgym.")
        and all(each.default is not each.empty for each in inspect.signature(factory).parameters.values())
    )


def unknown_name(kind: str, name: str, valid: Iterable[str]) -> str:
    """The message about a part whose name is unknown: the nearest valid name, if any is near, and all of them."""
    names = sorted(valid)
    return f"unknown {kind} {shown(name)}{nearest(name, names) or ';'} valid names: {', '.join(names)}"


def _convert(text: str, key: str, value: str, annotation: Any) -> Any:
    union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    choices = typing.get_args(annotation) if union else (annotation,)
    if bool in choices:
        if value.lower() not in ("true", "false"):
            raise ValueError(f"{shown(text)}: {key} must be true or false, got {shown(value)}")
        return value.lower() == "true"
    for kind in (int, float):
        if kind in choices:
            try:
                return kind(value)
            except ValueError:
                continue
    if str in choices:
        return value
    wanted = " or ".join(WORDS.get(choice, choice.__name__) for choice in choices if choice is not type(None))
    raise ValueError(f"{shown(text)}: {key} must be {wanted}, got {shown(value)}")
