"""The broadcast model of the ionosphere: against RTKLIB, and its values at night and at its noon."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

from spoofgym.sensors.klobuchar import Klobuchar

MODEL = Klobuchar((1.211e-08, 1.49e-08, -5.96e-08, -1.192e-07), (96260.0, 81920.0, -196600.0, -393200.0))
"""Of 14 September 2012."""


def delays(place: np.ndarray, elevation: np.ndarray, azimuth: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Of one satellite at each place."""
    return MODEL.delay(place, elevation[:, None], azimuth[:, None], time)[:, 0]


def test_it_is_that_of_rtklib() -> None:
    library = pytest.importorskip("pyrtklib")
    generator = np.random.default_rng(0)
    n = 200
    place = np.column_stack(
        [generator.uniform(-1.4, 1.4, n), generator.uniform(-np.pi, np.pi, n), generator.uniform(0.0, 5000.0, n)]
    )
    elevation, azimuth = generator.uniform(0.09, 1.5, n), generator.uniform(0.0, 2.0 * np.pi, n)
    time = generator.uniform(0.0, 604_800.0, n)

    def array(values: np.ndarray) -> object:
        filled = library.Arr1Ddouble(len(values))
        for place, value in enumerate(values):
            filled[place] = float(value)
        return filled

    parameters = array(np.array([*MODEL.alpha, *MODEL.beta]))
    expected = [
        library.ionmodel(library.gpst2time(1705, t), parameters, array(p), array(np.array([a, e])))
        for t, p, a, e in zip(time.tolist(), place, azimuth, elevation, strict=True)
    ]
    np.testing.assert_allclose(delays(place, elevation, azimuth, time), expected, rtol=1e-6)


def test_at_night_it_is_five_nanoseconds_along_the_slant() -> None:
    """Local midnight at Greenwich; 1 + 16 (0.53 - E)^3 with E in semicircles."""
    elevation = np.array([np.pi / 2.0, np.pi / 6.0])
    expected = speed_of_light * 5e-9 * (1.0 + 16.0 * (0.53 - elevation / np.pi) ** 3)
    given = delays(np.zeros((2, 3)), elevation, np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(given, expected, rtol=1e-12)
