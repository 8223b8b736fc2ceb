"""Oscillators of receivers by their class: what a clock may do by itself."""

from __future__ import annotations

from typing import NamedTuple


class Oscillator(NamedTuple):
    """Noise of the frequency of an oscillator.

    Attributes:
        h0: white, s.
        h2: h₋₂, of its random walk, 1/s.
    """

    h0: float
    h2: float


OSCILLATORS = {
    "tcxo": Oscillator(2e-19, 2e-20),
    "ocxo": Oscillator(8e-20, 4e-23),
    "rubidium": Oscillator(2e-20, 4e-29),
}
"""Typical coefficients (Brown and Hwang 2012, table 9.3): a temperature-compensated crystal, as in most receivers, an
ovenized one, rubidium. Flicker noise (h₋₁), which no filter of two states has, is left out."""

