"""Parts of one's own: modules that register scenarios, detectors, attacks and responses when they are imported.

A module adds to the registries of the package, as in::

    from spoofgym.detectors import DETECTORS
    DETECTORS["largest"] = Largest

Programs take such modules with ``--import MODULE``. A process that computes a part of the work takes the same modules.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Iterable

_TAKEN: list[str] = []


def take(module: str) -> str:
    """Import a module of parts, also from the working directory; returns its name.

    ``folder/my_parts.py`` is understood as ``my_parts`` of that folder.

    Raises:
        argparse.ArgumentTypeError: it cannot be imported; the message says why.
    """
    folder, name = os.path.split(module)
    name = name.removesuffix(".py")
    place = os.path.abspath(folder) if folder else os.getcwd()
    if place not in sys.path:
        sys.path.insert(0, place)
    try:
        importlib.import_module(name)
    except Exception as error:
        told = " ".join(str(error).split()) or type(error).__name__
        raise argparse.ArgumentTypeError(f"{module!r} cannot be imported: {type(error).__name__}: {told}") from error
    if module not in _TAKEN:
        _TAKEN.append(os.path.join(place, name) if folder else name)
    return name


def taken() -> tuple[str, ...]:
    """The modules that this process has taken, for others to take, too."""
    return tuple(_TAKEN)


def take_all(modules: Iterable[str]) -> None:
    """Import the modules that another process has taken."""
    for module in modules:
        take(module)
