"""Ranges of a log: fixes from ranges made in closed form, faults, bad input, and a phone in a city."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light
from scipy.spatial.transform import Rotation

from spoofgym.geodesy import displace, ecef_to_enu_rotation, geodetic_to_ecef, position_difference
from spoofgym.logs.log import interpolate, read_log
from spoofgym.logs.range_fixes import range_fixes, solve_ranges
from spoofgym.logs.ranges_log import CODE_SIGMA, Ranges, correct, read_ranges, zenith_troposphere
from spoofgym.sensors.ephemeris import COLUMNS, read_csv
from spoofgym.sensors.ranging import troposphere_mapping

PHONE = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw"
START = np.array([math.radians(48.8), math.radians(9.2), 300.0])
VELOCITY = np.array([9.0, -6.0, 0.5])
FIRST = 400_000.0
CLOCK = -2.2e7
DRIFT = 250.0
EPOCHS = 40
EARTH_RATE = 7.2921151467e-5


def write_ephemeris(path: Path, *, toe: float = FIRST) -> None:
    """32 satellites all around in orbits of GPS, their clocks and group delays off."""
    generator = np.random.default_rng(5)
    rows = []
    for svid in range(1, 33):
        values = dict.fromkeys(COLUMNS, 0.0)
        values |= {"toe": toe, "toc": toe, "sqrt_a": 5153.7, "e": 0.01, "i0": math.radians(55.0), "omega": 0.4}
        values |= {"omega0": svid * math.pi / 3.0, "m0": svid * 0.83, "omega_dot": -8e-9, "tgd": -1e-8}
        values |= {"af0": generator.uniform(-4e-4, 4e-4), "af1": 1e-11 * generator.standard_normal()}
        health = 63.0 if svid == 9 else 0.0
        rows.append([svid, health, *(values[name] for name in COLUMNS)])
    header = ",".join(["svid", "sv_health", *COLUMNS.values()])
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.17g")


def pseudoranges(folder: Path, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From the time of flight in a frame that does not turn, (E, S), m, and the satellites' elevation."""
    ephemeris = read_csv(folder / "ephemeris.csv")
    place = displace(START, VELOCITY * (time[:, None] - FIRST))
    receiver = geodetic_to_ecef(place)
    flight = np.full((len(time), len(ephemeris.satellites)), 0.07)
    for _ in range(8):
        satellite, _ = ephemeris.states(time[:, None] - flight)
        turn = np.outer(-EARTH_RATE * flight.ravel(), [0.0, 0.0, 1.0])
        turned = Rotation.from_rotvec(turn).apply(satellite.reshape(-1, 3))
        sight = turned.reshape(satellite.shape) - receiver[:, None]
        flight = np.linalg.norm(sight, axis=2) / speed_of_light
    up = np.einsum("ej,esj->es", ecef_to_enu_rotation(place)[:, 2], sight)
    elevation = np.arcsin(up / np.linalg.norm(sight, axis=2))
    delay = zenith_troposphere(place)[:, None] * troposphere_mapping(np.maximum(elevation, 0.05))
    satellite_clock = ephemeris.clock(time[:, None] - flight) - ephemeris.tgd
    receiver_clock = CLOCK + DRIFT * (time[:, None] - FIRST)
    return speed_of_light * (flight - satellite_clock) + receiver_clock + delay, elevation


def write_ranges(folder: Path, *, noise: float = 0.0, seed: int = 0, epochs: int = EPOCHS) -> Path:
    """Satellites above 8 degrees, 45 dB-Hz; time stamps are those of the receiver's clock."""
    write_ephemeris(folder / "ephemeris.csv")
    numbers = read_csv(folder / "ephemeris.csv").satellites
    true = FIRST + np.arange(epochs)
    ranges, elevation = pseudoranges(folder, true)
    rates = pseudoranges(folder, true + 0.05)[0] - pseudoranges(folder, true - 0.05)[0]
    ranges = ranges + noise * np.random.default_rng(seed).standard_normal(ranges.shape)
    stamp = true + (CLOCK + DRIFT * np.arange(epochs)) / speed_of_light
    lines = ["svid,t_s,pseudorange_m,range_rate_mps,cn0_dbhz"]
    for k in range(epochs):
        lines += [
            f"{numbers[s]},{stamp[k]:.9f},{ranges[k, s]:.6f},{rates[k, s] / 0.1:.6f},45"
            for s in np.flatnonzero(elevation[k] > math.radians(8.0))
        ]
    (folder / "ranges.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ranges(tmp_path_factory.mktemp("ranges"))


@pytest.fixture(scope="module")
def ranges(folder: Path) -> Ranges:
    return read_ranges(folder)


def with_fault(ranges: Ranges, epoch: int, number: int, size: float) -> tuple[Ranges, int]:
    """One range of an epoch made longer; and only so many satellites."""
    satellite, pseudorange = ranges.satellite.copy(), ranges.pseudorange.copy()
    present = np.flatnonzero(satellite[epoch] >= 0)
    satellite[epoch, present[number:]] = -1
    pseudorange[epoch, present[1]] += size
    return replace(ranges, satellite=satellite, pseudorange=pseudorange), int(present[1])


def test_exact_ranges_give_the_true_motion(ranges: Ranges) -> None:
    solution = solve_ranges(ranges, displace(START, [3e4, -5e4, 200.0]))
    assert solution.solved.all()
    truth = displace(START, VELOCITY * np.arange(EPOCHS)[:, None])
    np.testing.assert_allclose(position_difference(solution.position, truth), 0.0, atol=1e-2)
    np.testing.assert_allclose(solution.clock, CLOCK + DRIFT * np.arange(EPOCHS), atol=1e-2)
    # the rate of the troposphere, as satellites rise and set, is not corrected: millimetres per second
    np.testing.assert_allclose(solution.velocity, np.tile(VELOCITY, (EPOCHS, 1)), atol=1e-2)
    np.testing.assert_allclose(solution.clock_drift, DRIFT, atol=1e-2)
    np.testing.assert_allclose(solution.corrected.geometry.time, FIRST + np.arange(EPOCHS), atol=1e-7)
    np.testing.assert_array_equal(solution.used, solution.corrected.geometry.present)
    assert 9 not in ranges.ephemeris.satellites


def test_one_faulty_range_is_left_out(ranges: Ranges) -> None:
    faulty, slot = with_fault(ranges, 7, 8, 80.0)
    solution = solve_ranges(faulty, START)
    out = solution.corrected.geometry.present & ~solution.used
    assert out[7, slot]
    assert out.sum() == 1
    assert solution.solved[7]
    # the troposphere was taken at the height of the faulty fix
    assert np.linalg.norm(position_difference(solution.position[7], displace(START, 7.0 * VELOCITY))) < 0.05


@pytest.mark.parametrize("number", [5, 6])
def test_with_few_ranges_a_fault_costs_the_fix(ranges: Ranges, number: int) -> None:
    solution = solve_ranges(with_fault(ranges, 7, number, 300.0)[0], START)
    assert np.flatnonzero(~solution.solved).tolist() == [7]
    np.testing.assert_array_equal(solution.used, solution.corrected.geometry.present)


def test_four_ranges_cannot_be_tested(ranges: Ranges) -> None:
    solution = solve_ranges(with_fault(ranges, 7, 4, 0.0)[0], START)
    assert np.flatnonzero(~solution.solved).tolist() == [7]


def test_ranges_without_fault_are_hardly_ever_left_out(tmp_path: Path) -> None:
    """1e-3 of the epochs: 12 or more of 600 have a probability below 1e-10."""
    solution = solve_ranges(read_ranges(write_ranges(tmp_path, noise=CODE_SIGMA, epochs=600)), START)
    assert (solution.corrected.geometry.present & ~solution.used).any(axis=1).sum() < 12
    error = position_difference(solution.position, displace(START, VELOCITY * np.arange(600)[:, None]))
    normalised = (error / solution.position_sigma) ** 2
    # mean of 600 chi-square variables of one degree: 7 standard deviations of 0.058
    np.testing.assert_allclose(normalised.mean(axis=0), 1.0, atol=0.41)


def test_weak_signals_count_less(ranges: Ranges) -> None:
    weak = replace(ranges, cn0=np.where(ranges.satellite >= 0, 25.0, 0.0))
    place, clock = np.tile(START, (EPOCHS, 1)), np.full(EPOCHS, CLOCK)
    sigma = [correct(each, place, clock).sigma for each in (ranges, weak)]
    present = sigma[0] > 0.0
    np.testing.assert_allclose(sigma[0][present], CODE_SIGMA)
    np.testing.assert_allclose(sigma[1][present], 10.0 * CODE_SIGMA)  # 20 dB


def test_troposphere_against_an_independent_library() -> None:
    rtklib = pytest.importorskip("pyrtklib", reason="the oracle for ranges is not installed")
    place, direction = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2)
    direction[0], direction[1] = 0.0, math.pi / 2.0
    for height in (0.0, 300.0, 3000.0):
        place[0], place[1], place[2] = 0.85, 0.16, height
        vertical = rtklib.tropmodel(rtklib.gtime_t(), place, direction, 0.5)
        assert zenith_troposphere(np.array([0.85, 0.16, height])) == pytest.approx(vertical, abs=0.002)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("cn0_dbhz", "cn0", r"ranges\.csv, line 1: column 'cn0_dbhz' is missing"),
        (",45\n", ",450\n", r"ranges\.csv, line 2: cn0_dbhz must be between 0 and 100"),
        (",-?[0-9.]+,45\n", ",1e300,45\n", r"ranges\.csv, line 2: range_rate_mps must be between"),
        (",-?[0-9.]+(,-?[0-9.]+,45\n)", r",1e300\1", r"ranges\.csv, line 2: pseudorange_m must be between"),
        (",45\n", ",x\n", r"ranges\.csv, line 2: cn0_dbhz must be a finite number"),
    ],
)
def test_bad_ranges_are_named(folder: Path, tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "ephemeris.csv").write_text((folder / "ephemeris.csv").read_text())
    (tmp_path / "ranges.csv").write_text(re.sub(old, new, (folder / "ranges.csv").read_text(), count=1))
    with pytest.raises(ValueError, match=message):
        read_ranges(tmp_path)


def test_missing_stale_and_muddled_input(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "ranges.csv").read_text().splitlines()
    (tmp_path / "ranges.csv").write_text("\n".join(lines))
    with pytest.raises(ValueError, match=r"ephemeris\.csv is missing"):
        read_ranges(tmp_path)
    write_ephemeris(tmp_path / "ephemeris.csv", toe=FIRST + 50_000.0)
    with pytest.raises(ValueError, match="50000 s from the ranges; valid is at most 14400 s"):
        read_ranges(tmp_path)
    write_ephemeris(tmp_path / "ephemeris.csv")
    (tmp_path / "ranges.csv").write_text("\n".join([*lines[:2], lines[1], *lines[2:]]))
    with pytest.raises(ValueError, match="is there twice at"):
        read_ranges(tmp_path)
    (tmp_path / "ranges.csv").write_text("\n".join([lines[0], lines[-1], lines[1]]))
    with pytest.raises(ValueError, match="line 3: t_s must not decrease"):
        read_ranges(tmp_path)


@pytest.mark.skipif(not PHONE.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_fixes_of_a_phone_lie_beside_its_own() -> None:
    """Metres in a city. The phone's fix is no reference: it is made from the same signals, by another estimator."""
    log = read_log(PHONE)
    fixes = range_fixes(log)
    assert fixes.velocity is not None
    gap = np.flatnonzero(np.diff(log.fixes.time) > 1.5)
    first, last = log.fixes.time[gap[0] + 1], log.fixes.time[gap[1]]
    inside = (fixes.time > first) & (fixes.time < last)
    assert inside.sum() > 600
    place, velocity = interpolate(log.fixes, fixes.time[inside])
    error = position_difference(fixes.position[inside], place)
    assert np.median(np.hypot(error[:, 0], error[:, 1])) < 4.0
    difference = fixes.velocity[inside] - velocity
    assert np.median(np.hypot(difference[:, 0], difference[:, 1])) < 0.3
