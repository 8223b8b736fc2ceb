"""Checks of what a player does, cheap enough for every step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Floats, Runs


def as_numbers(what: str, given: Any, shape: tuple[int, ...] | None) -> NDArray[Any]:
    """An action, or actions, as an array of real numbers, of the type that they have.

    Args:
        what: for the message.
        given: by the player.
        shape: that it must have.

    Raises:
        ValueError: it is no array of real numbers (text, truth values, complex numbers and objects are none), or has
            another shape.
    """
    array = validation.real_array(given)
    if array is None:
        raise ValueError(f"{what} must be an array of real numbers of shape {shape}, got {validation.shown(given)}")
    if array.shape != shape:
        raise ValueError(f"{what} must have shape {shape}, got {array.shape}")
    return array


def rates(player: str, given: Any, shape: tuple[int, int]) -> Floats:
    """Continuous actions of N lanes as finite numbers of double precision; they may lie outside [-1, 1].

    Args:
        player: whose they are, for the message.
        given: by the player.
        shape: that they must have.

    Raises:
        ValueError: they are not finite, or what `as_numbers` refuses.
    """
    actions = as_numbers(f"the actions of the {player}", given, shape)
    if not np.isfinite(actions).all():
        lane = int(np.flatnonzero(~np.isfinite(actions).all(axis=1))[0])
        raise ValueError(
            f"action of the {player} in lane {lane} is not finite: {actions[lane]}; valid are numbers from -1 to 1"
        )
    if actions.dtype.itemsize > np.dtype(np.float64).itemsize:  # numbers that double precision does not reach
        actions = np.clip(actions, -1.0, 1.0)
    return np.asarray(actions, dtype=np.float64)


def choices(player: str, given: Any, num_lanes: int, numbers: Runs, valid: str) -> Runs:
    """Discrete actions of N lanes as whole numbers.

    Args:
        player: whose they are, for the message.
        given: by the player.
        num_lanes: N.
        numbers: of values that each part of an action has, from 0 on, (D,).
        valid: what is, for the message.

    Raises:
        ValueError: one is no whole number or not among the values, or what `as_numbers` refuses.
    """
    actions = as_numbers(f"the actions of the {player}", given, (num_lanes, len(numbers)))
    right = (actions >= 0) & (actions < numbers)
    if actions.dtype.kind == "f":
        right &= np.trunc(actions) == actions
    if not right.all():
        lane = int(np.flatnonzero(~right.all(axis=1))[0])
        raise ValueError(
            f"action of the {player} in lane {lane} must be whole numbers, {valid}, got {actions[lane]}"
        )
    return actions.astype(np.int64)
