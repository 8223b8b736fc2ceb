"""Every setting of a learner as an option of its program: recipes give all of them, the help shows none."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields
from typing import Any


def add_settings(parser: argparse.ArgumentParser, settings: type, shown: Mapping[str, str] | None = None) -> None:
    """Add an option for each setting.

    Args:
        parser: of a program that trains.
        settings: a data class whose attributes have defaults.
        shown: the help of settings that a user is told of, by name.
    """
    for field in fields(settings):
        flag, told = f"--{field.name.replace('_', '-')}", (shown or {}).get(field.name, argparse.SUPPRESS)
        if isinstance(field.default, bool):
            parser.add_argument(flag, type=switch, nargs="?", const=True, metavar="true|false", help=told)
        else:
            parser.add_argument(flag, type=type(field.default), help=told)


def switch(text: str) -> bool:
    """A truth value on a command line.

    Raises:
        argparse.ArgumentTypeError: it is neither true nor false.
    """
    if text not in ("true", "false"):
        raise argparse.ArgumentTypeError(f"expected true or false, got {text!r}")
    return text == "true"


def given_settings(given: Mapping[str, Any], settings: type) -> dict[str, Any]:
    """The settings among given options."""
    return {field.name: given[field.name] for field in fields(settings) if field.name in given}
