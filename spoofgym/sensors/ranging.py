"""Ranges to satellites: pseudorange, carrier phase and range rate, and the budget of their errors.

Every satellite has five errors of its own (satellite clock and ephemeris, ionosphere, code and carrier multipath, and
the carrier's ambiguity); the zenith troposphere and the receiver's clock are common to all. The slow errors
are first-order Gauss-Markov processes, and the other errors are white (Kujur 2024, appendix A).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.constants import speed_of_light

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.geodesy import geodetic_to_ecef
from spoofgym.kernels import njit
from spoofgym.sensors.geometry import SatelliteGeometry
from spoofgym.sensors.imu import gauss_markov_step

EARTH_RADIUS = 6_378_136.3
"""That of the ionosphere's thin shell, m (DO-229, A.4.4.10.4)."""

SHELL_HEIGHT = 350_000.0
"""Of the ionosphere's thin shell above it, m."""

SIGMAS = (
    "ephemeris_sigma",
    "ionosphere_sigma",
    "troposphere_sigma",
    "code_multipath_sigma",
    "carrier_multipath_sigma",
    "code_noise",
    "carrier_noise",
    "rate_noise",
    "clock_h0",
    "clock_h2",
    "ambiguity_sigma",
)
TIMES = ("ephemeris_time", "ionosphere_time", "troposphere_time", "code_multipath_time", "carrier_multipath_time")


@dataclass(frozen=True, kw_only=True)
class RangeErrors:
    """The errors of the ranges, one sigma; correlation times of first-order Gauss-Markov processes.

    A time may be infinite: the error is then drawn once per satellite and stays.

    Attributes:
        ephemeris_sigma: what the broadcast leaves of satellite clock and orbit, m.
        ephemeris_time: s.
        ionosphere_sigma: what the broadcast model leaves of the vertical delay, m; `obliquity` makes it slant. It
            delays the code and advances the carrier.
        ionosphere_time: s.
        troposphere_sigma: what the model leaves of the zenith delay, m; `troposphere_mapping` makes it slant.
        troposphere_time: s.
        code_multipath_sigma: m.
        code_multipath_time: s.
        carrier_multipath_sigma: m.
        carrier_multipath_time: s.
        code_noise: white, m.
        carrier_noise: white, m.
        rate_noise: white, of the range rate, m/s.
        clock_h0: white frequency noise of the receiver's oscillator, s.
        clock_h2: its random walk of the frequency, h₋₂, 1/s.
        ambiguity_sigma: prior of an ambiguity that is not resolved to whole cycles, m.
    """

    ephemeris_sigma: float = 0.0
    ephemeris_time: float = math.inf
    ionosphere_sigma: float = 0.0
    ionosphere_time: float = math.inf
    troposphere_sigma: float = 0.0
    troposphere_time: float = math.inf
    code_multipath_sigma: float = 0.0
    code_multipath_time: float = math.inf
    carrier_multipath_sigma: float = 0.0
    carrier_multipath_time: float = math.inf
    code_noise: float
    carrier_noise: float = 0.003
    rate_noise: float = 0.05
    clock_h0: float = 0.0
    clock_h2: float = 0.0
    ambiguity_sigma: float = 0.0

    def __post_init__(self) -> None:
        for name in SIGMAS:
            validation.non_negative("range errors", name, getattr(self, name))
        for name in TIMES:
            if getattr(self, name) != math.inf:
                validation.above("range errors", name, getattr(self, name))


KUJUR = RangeErrors(
    ephemeris_sigma=1.8,
    ephemeris_time=5.0 * 3600.0,
    ionosphere_sigma=4.5,
    ionosphere_time=40.0 * 3600.0,
    troposphere_sigma=0.09,
    troposphere_time=20.0 * 3600.0,
    code_multipath_sigma=5.0,
    code_multipath_time=25.0,
    carrier_multipath_sigma=0.02,
    carrier_multipath_time=25.0,
    code_noise=0.36,
    carrier_noise=0.003,
    rate_noise=0.05,
    clock_h0=2e-19,
    clock_h2=2e-20,
    ambiguity_sigma=100.0,
)
"""Kujur 2024, appendix A. We read its 1.8 m of satellite clock and ephemeris as the stationary sigma (as driving noise
of a process of 5 h it would make hundreds of metres). The ionosphere's sigma is that of DO-229, J.2.3, at the
start of the flight, geomagnetic latitude 53 degrees. The noise of the range rate and the prior of an ambiguity are
ours: 5 cm/s is usual, and 100 m stands for knowing nothing: far above every error of the code, from which a receiver
starts its ambiguity, yet small enough to leave a covariance its digits."""

LIU = RangeErrors(
    ephemeris_sigma=math.hypot(0.5, 4.0, 0.2),
    code_noise=math.hypot(0.67, 0.94),
    carrier_noise=KUJUR.carrier_noise,
    rate_noise=KUJUR.rate_noise,
    carrier_multipath_sigma=KUJUR.carrier_multipath_sigma,
    carrier_multipath_time=KUJUR.carrier_multipath_time,
    clock_h0=KUJUR.clock_h0,
    clock_h2=KUJUR.clock_h2,
    ambiguity_sigma=KUJUR.ambiguity_sigma,
)
"""Liu 2018, table 1. Its figures are root mean squares of the ranges, whatever the elevation, and it gives no times.
Ours: satellite clock and ephemeris (0.5 m), ionosphere (4 m) and troposphere (0.2 m) change over hours, so in a flight
of 18 minutes they are one constant per satellite; tracking noise (0.67 m) and short-range multipath (0.94 m) are white
at 1 Hz. The carrier and the clock, which the paper does not use, are those of `KUJUR`."""


def obliquity(elevation: Floats) -> Floats:
    """Slant ionospheric delay over the vertical one, by the thin shell at 350 km (DO-229, A.4.4.10.4).

    Args:
        elevation: of the satellite, rad, any shape.
    """
    reach = EARTH_RADIUS * np.cos(elevation) / (EARTH_RADIUS + SHELL_HEIGHT)
    return np.asarray(1.0 / np.sqrt(1.0 - reach * reach))


def troposphere_mapping(elevation: Floats) -> Floats:
    """Slant tropospheric delay over that at the zenith, for elevations of 5 degrees or more (DO-229, A.4.2.4).

    Args:
        elevation: of the satellite, rad, any shape.
    """
    return np.asarray(1.001 / np.sqrt(0.002001 + np.sin(elevation) ** 2))


def code_variance(errors: RangeErrors, elevation: Floats) -> Floats:
    """Variance of a pseudorange without the receiver's clock, all errors together, m².

    Args:
        errors: their budget.
        elevation: of the satellite, rad, any shape.
    """
    slant = (obliquity(elevation) * errors.ionosphere_sigma) ** 2
    slant += (troposphere_mapping(elevation) * errors.troposphere_sigma) ** 2
    return slant + errors.ephemeris_sigma**2 + errors.code_multipath_sigma**2 + errors.code_noise**2


def clock_noise(h0: float, h2: float, interval: float) -> Floats:
    """Process noise of the receiver's clock over an interval, (2, 2), m and m/s: offset, then drift.

    With S_f = h0 / 2 and S_g = 2 π² h₋₂ (Brown and Hwang, section 9.3).

    Args:
        h0: white frequency noise, s.
        h2: h₋₂, random walk of the frequency, 1/s.
        interval: s.
    """
    white, walk = 0.5 * h0, 2.0 * math.pi**2 * h2
    corner = 0.5 * walk * interval**2
    noise = np.array([[white * interval + walk * interval**3 / 3.0, corner], [corner, walk * interval]])
    return noise * speed_of_light**2


class DrawnErrors(NamedTuple):
    """Errors of the ranges at E epochs on S slots, measured minus true; zero on empty slots.

    Attributes:
        code: (E, S), m, without the receiver's clock, as the next two.
        carrier: (E, S), m, with the ambiguity.
        rate: (E, S), m/s.
        clock: offset, m, and drift, m/s, of the receiver's clock, (E, 2).
    """

    code: Floats
    carrier: Floats
    rate: Floats
    clock: Floats


def draw_range_errors(
    errors: RangeErrors,
    geometry: SatelliteGeometry,
    stream: np.random.Generator,
    clock: tuple[float, float] = (0.0, 0.0),
) -> DrawnErrors:
    """Errors of the ranges along a flight, for one run; a satellite that rises brings new ones.

    The processes are stationary: what is drawn at the first epoch, or for a new satellite, has their stationary sigma.

    Args:
        errors: their budget.
        geometry: satellites in view at equidistant epochs.
        stream: source of randomness; as many numbers are taken whatever the budget.
        clock: of the receiver at the first epoch: offset, m, and drift, m/s.
    """
    epochs, slots = geometry.present.shape
    interval = float(geometry.time[1] - geometry.time[0]) if epochs > 1 else 1.0
    normals = stream.standard_normal((8, epochs, slots))
    zenith = stream.standard_normal((epochs, 1))

    def process(normals: Floats, sigma: float, time: float, started: Flags) -> Floats:
        width = normals.shape[1]
        decay = np.full(width, math.exp(-interval / time))
        return gauss_markov(normals, np.full(width, sigma), decay, started, np.zeros(width))

    started = geometry.started
    ephemeris = process(normals[0], errors.ephemeris_sigma, errors.ephemeris_time, started)
    ionosphere = process(normals[1], errors.ionosphere_sigma, errors.ionosphere_time, started)
    ionosphere *= obliquity(geometry.elevation)
    code_multipath = process(normals[2], errors.code_multipath_sigma, errors.code_multipath_time, started)
    carrier_multipath = process(normals[3], errors.carrier_multipath_sigma, errors.carrier_multipath_time, started)
    ambiguity = process(normals[4], errors.ambiguity_sigma, math.inf, started)
    first = np.arange(epochs)[:, None] == 0
    troposphere = process(zenith, errors.troposphere_sigma, errors.troposphere_time, first)
    common = ephemeris + troposphere * troposphere_mapping(geometry.elevation)
    code = common + ionosphere + code_multipath + errors.code_noise * normals[5]
    carrier = common - ionosphere + carrier_multipath + ambiguity + errors.carrier_noise * normals[6]
    return DrawnErrors(
        code * geometry.present,
        carrier * geometry.present,
        errors.rate_noise * normals[7] * geometry.present,
        draw_clock(errors, interval, stream.standard_normal((epochs, 2)), clock),
    )


def draw_clock(errors: RangeErrors, interval: float, normals: Floats, start: tuple[float, float]) -> Floats:
    """Offset and drift of the receiver's clock, (E, 2), m and m/s.

    Args:
        errors: gives h0 and h₋₂.
        interval: between epochs, s.
        normals: standard normals, (E, 2); those of the first epoch are not used.
        start: offset, m, and drift, m/s, at the first epoch.
    """
    (white, corner), (_, walk) = clock_noise(errors.clock_h0, errors.clock_h2, interval)
    shared = corner / math.sqrt(walk) if walk > 0.0 else 0.0
    steps = np.zeros_like(normals)
    steps[1:, 0] = shared * normals[1:, 1] + math.sqrt(max(white - shared**2, 0.0)) * normals[1:, 0]
    steps[1:, 1] = math.sqrt(walk) * normals[1:, 1]
    drift = start[1] + np.cumsum(steps[:, 1])
    steps[1:, 0] += interval * drift[:-1]
    return np.column_stack([start[0] + np.cumsum(steps[:, 0]), drift])


@njit(cache=True, nogil=True)
def gauss_markov(normals: Floats, sigma: Floats, decay: Floats, started: Flags, before: Floats) -> Floats:
    """First-order Gauss-Markov processes, (E, C), each begun anew with its stationary sigma where ``started``.

    Args:
        normals: standard normals, (E, C).
        sigma: stationary, (C,).
        decay: from one epoch to the next, (C,).
        started: (E, C).
        before: values one epoch before the first, (C,).
    """
    values = np.empty_like(normals)
    for k in range(normals.shape[0]):
        for c in range(normals.shape[1]):
            last = before[c] if k == 0 else values[k - 1, c]
            if started[k, c]:
                values[k, c] = sigma[c] * normals[k, c]
            else:
                values[k, c] = gauss_markov_step(last, sigma[c], decay[c], normals[k, c])
    return values


class Ranges(NamedTuple):
    """What a receiver measures at E epochs on S slots; zero on empty slots.

    Attributes:
        code: pseudorange, (E, S), m, corrected for the satellite's clock.
        carrier: carrier phase, (E, S), m.
        rate: range rate, the Doppler shift in m/s, (E, S), positive while the satellite recedes.
    """

    code: Floats
    carrier: Floats
    rate: Floats


def pseudoranges(geometry: SatelliteGeometry, position: Floats, velocity: Floats, drawn: DrawnErrors) -> Ranges:
    """Raw measurements: true ranges, the receiver's clock, and errors.

    Args:
        geometry: satellites in view, as this receiver sees them.
        position: of the receiver, (E, 3), latitude rad, longitude rad, height m.
        velocity: of the receiver, (E, 3), ENU, m/s.
        drawn: the errors.
    """
    separation = geometry.position - geodetic_to_ecef(position)[:, None]
    distance = np.sqrt(_dot(separation, separation))
    receding = _dot(separation, geometry.velocity) / distance - _dot(geometry.line_of_sight, velocity[:, None])
    offset, drift = drawn.clock[:, :1], drawn.clock[:, 1:]
    return Ranges(
        (distance + offset + drawn.code) * geometry.present,
        (distance + offset + drawn.carrier) * geometry.present,
        (receding + drift + drawn.rate) * geometry.present,
    )


def _dot(first: Floats, second: Floats) -> Floats:
    """Of vectors along the last axis."""
    return np.asarray(first[..., 0] * second[..., 0] + first[..., 1] * second[..., 1] + first[..., 2] * second[..., 2])
