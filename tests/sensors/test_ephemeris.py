"""The broadcast ephemeris against RTKLIB, and against its own derivatives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

from spoofgym.geodesy import geodetic_to_ecef
from spoofgym.sensors.ephemeris import COLUMNS, WEEK, Ephemeris, read_csv, time_between
from spoofgym.sensors.geometry import lines_of_sight, received_states

RECORDED = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw" / "ephemeris.csv"
RTKLIB_NAMES = {
    "e": "e",
    "m0": "M0",
    "delta_n": "deln",
    "omega": "omg",
    "omega0": "OMG0",
    "omega_dot": "OMGd",
    "i0": "i0",
    "idot": "idot",
    "cuc": "cuc",
    "cus": "cus",
    "crc": "crc",
    "crs": "crs",
    "cic": "cic",
    "cis": "cis",
    "af0": "f0",
    "af1": "f1",
    "af2": "f2",
    "toe": "toes",
}


def synthetic(number=12, largest_eccentricity=0.03, toe=302_400.0):
    """Satellites with corrections as large as real ones."""
    rng = np.random.default_rng(5)

    def around(centre, width):
        return centre + width * rng.uniform(-1.0, 1.0, number)

    return Ephemeris(
        satellites=np.arange(1, number + 1, dtype=np.int64),
        toe=np.full(number, toe),
        sqrt_a=around(5153.6, 0.5),
        e=rng.uniform(0.0, largest_eccentricity, number),
        m0=around(0.0, np.pi),
        delta_n=around(4.5e-9, 1e-9),
        omega=around(0.0, np.pi),
        omega0=around(0.0, np.pi),
        omega_dot=around(-8e-9, 5e-10),
        i0=around(0.96, 0.03),
        idot=around(0.0, 3e-10),
        cuc=around(0.0, 8e-6),
        cus=around(0.0, 1e-5),
        crc=around(200.0, 150.0),
        crs=around(0.0, 120.0),
        cic=around(0.0, 3e-7),
        cis=around(0.0, 3e-7),
        toc=np.full(number, toe - 16.0),
        af0=around(0.0, 5e-4),
        af1=around(0.0, 1e-11),
        af2=around(0.0, 1e-18),
        tgd=around(0.0, 1e-8),
    )


WEEK_NUMBER = 2132


def write_message(rtklib, message, ephemeris, j):
    """Fill an ``eph_t`` with satellite j."""
    message.sat = int(ephemeris.satellites[j])
    message.A = float(ephemeris.sqrt_a[j]) ** 2
    message.toe, message.toc = (rtklib.gpst2time(WEEK_NUMBER, float(t[j])) for t in (ephemeris.toe, ephemeris.toc))
    message.ttr, message.week, message.svh, message.sva, message.iode = message.toe, WEEK_NUMBER, 0, 0, 1
    message.tgd[0] = float(ephemeris.tgd[j])
    for ours, theirs in RTKLIB_NAMES.items():
        setattr(message, theirs, float(getattr(ephemeris, ours)[j]))


def of_rtklib(ephemeris, time):
    """Positions (E, n, 3) and clocks (E, n) by RTKLIB."""
    rtklib = pytest.importorskip("pyrtklib")
    position, clock = np.empty((len(time), len(ephemeris.satellites), 3)), np.empty((len(time), len(ephemeris.toe)))
    for j in range(len(ephemeris.satellites)):
        message = rtklib.eph_t()
        write_message(rtklib, message, ephemeris, j)
        place, offset, variance = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)
        for k, moment in enumerate(time):
            rtklib.eph2pos(rtklib.gpst2time(WEEK_NUMBER, float(moment)), message, place, offset, variance)
            position[k, j], clock[k, j] = [place[i] for i in range(3)], offset[0]
    return position, clock


def assert_like_rtklib(ephemeris, time):
    position, clock = of_rtklib(ephemeris, time)
    np.testing.assert_allclose(ephemeris.states(time)[0], position, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(ephemeris.clock(time), clock, rtol=0.0, atol=1e-15)


def test_orbits_and_clocks_are_those_of_rtklib():
    assert_like_rtklib(synthetic(), 302_400.0 + np.linspace(-7_200.0, 7_200.0, 25))


def test_long_orbits_are_those_of_rtklib():
    assert_like_rtklib(synthetic(largest_eccentricity=0.49), 302_400.0 + np.linspace(-43_200.0, 43_200.0, 49))


@pytest.mark.skipif(not RECORDED.is_file(), reason="../shared/data, real logs for tests, is absent")
def test_recorded_satellites_are_those_of_rtklib():
    ephemeris = read_csv(RECORDED)
    assert 14 not in ephemeris.satellites  # not yet in service on that day
    assert_like_rtklib(ephemeris, np.linspace(570_400.0, 572_100.0, 18))


def test_rtklib_finds_the_receiver_from_our_ranges():
    """Its single-point positioning, from messages and pseudoranges; it turns the Earth to first order, within 1 mm."""
    rtklib = pytest.importorskip("pyrtklib")
    ephemeris, receiver_clock = synthetic(24), 1_500.0
    place, moment = np.array([[0.7, -1.5, 300.0]]), np.array([303_000.0])
    position, _, flight_time = received_states(ephemeris, place, moment)
    seen = np.flatnonzero(lines_of_sight(position, place)[0, :, 2] > 0.1)
    offset = ephemeris.clock(moment - flight_time) - ephemeris.tgd
    receiver = geodetic_to_ecef(place)[0]
    pseudorange = np.linalg.norm(position[0] - receiver, axis=1) + receiver_clock - speed_of_light * offset[0]

    messages, number = rtklib.nav_t(), len(ephemeris.satellites)
    messages.n = messages.nmax = number
    messages.eph = rtklib.Arr1Deph_t(number)
    for j in range(number):
        write_message(rtklib, messages.eph[j], ephemeris, j)
    measured = rtklib.Arr1Dobsd_t(len(seen))
    for i, j in enumerate(seen):
        measured[i].time = rtklib.gpst2time(WEEK_NUMBER, moment[0] + receiver_clock / speed_of_light)
        measured[i].sat, measured[i].rcv = int(ephemeris.satellites[j]), 1
        measured[i].P[0], measured[i].code[0], measured[i].SNR[0] = pseudorange[j], rtklib.CODE_L1C, 45_000
    options, solution = rtklib.prcopt_t(), rtklib.sol_t()
    options.mode, options.navsys, options.nf, options.maxgdop = rtklib.PMODE_SINGLE, rtklib.SYS_GPS, 1, 100.0
    options.err[0], options.err[1], options.err[2] = 100.0, 0.003, 0.003
    directions, text = rtklib.Arr1Ddouble(2 * len(seen)), rtklib.Arr1Dchar(256)
    assert rtklib.pntpos(measured.ptr, len(seen), messages, options, solution, directions, None, text) == 1
    np.testing.assert_allclose([solution.rr[i] for i in range(3)], receiver, rtol=0.0, atol=3e-3)
    assert solution.dtr[0] * speed_of_light == pytest.approx(receiver_clock, abs=3e-3)


def test_a_week_later_is_the_same_moment():
    """Reference times at the end of a week used at the beginning of the next, and the other way round."""
    late, early = synthetic(toe=WEEK - 3_600.0), synthetic(toe=3_600.0)
    after, before = np.array([1_800.0]), np.array([WEEK - 1_800.0])
    for ephemeris, time, same in ((late, after, after + WEEK), (early, before, before - WEEK)):
        np.testing.assert_array_equal(ephemeris.states(time)[0], ephemeris.states(same)[0])
        np.testing.assert_array_equal(ephemeris.clock(time), ephemeris.clock(same))
    position, clock = of_rtklib(late, after + WEEK)
    np.testing.assert_allclose(late.states(after)[0], position, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(late.clock(after), clock, rtol=0.0, atol=1e-15)
    assert time_between(np.array([10.0]), np.array([WEEK - 20.0])) == 30.0


def test_velocity_is_the_derivative_of_position():
    ephemeris, time, step = synthetic(largest_eccentricity=0.3), np.linspace(300_000.0, 306_000.0, 13), 4.0
    near, far = (ephemeris.states(time + h)[0] - ephemeris.states(time - h)[0] for h in (step, 2.0 * step))
    derivative = (8.0 * near - far) / (12.0 * step)
    np.testing.assert_allclose(ephemeris.states(time)[1], derivative, rtol=0.0, atol=2e-6)


def test_a_satellite_and_an_epoch_do_not_depend_on_the_others():
    ephemeris, time = synthetic(), np.linspace(300_000.0, 306_000.0, 13)
    alone = Ephemeris(satellites=ephemeris.satellites[3:4], **{name: getattr(ephemeris, name)[3:4] for name in COLUMNS})
    for k in (0, 12):
        for whole, one in zip(ephemeris.states(time), alone.states(time[k : k + 1]), strict=True):
            np.testing.assert_array_equal(whole[k, 3], one[0, 0])
        np.testing.assert_array_equal(ephemeris.clock(time)[k, 3], alone.clock(time[k : k + 1])[0, 0])


def write_table(path, ephemeris, health, columns=None):
    names = ["svid", "sv_health", *COLUMNS.values()] if columns is None else columns
    values = {column: getattr(ephemeris, name) for name, column in COLUMNS.items()}
    values |= {"svid": ephemeris.satellites, "sv_health": health}
    rows = [",".join(repr(values[name][j].item()) for name in names) for j in range(len(health))]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")


def test_a_table_gives_its_healthy_satellites_in_ascending_order(tmp_path):
    ephemeris = synthetic(4)
    shuffled = Ephemeris(
        satellites=np.array([9, 2, 30, 4], dtype=np.int64), **{name: getattr(ephemeris, name) for name in COLUMNS}
    )
    write_table(tmp_path / "table.csv", shuffled, np.array([0, 0, 63, 0]))
    read = read_csv(tmp_path / "table.csv")
    np.testing.assert_array_equal(read.satellites, [2, 4, 9])
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(read, name), getattr(ephemeris, name)[[1, 3, 0]])


def test_a_table_that_is_not_one_is_refused(tmp_path):
    ephemeris = synthetic(2)
    write_table(tmp_path / "short.csv", ephemeris, np.array([0, 0]), ["svid", "sv_health", "toe_s"])
    with pytest.raises(ValueError, match=r"columns sqrta, ecc, .* are missing"):
        read_csv(tmp_path / "short.csv")
    write_table(tmp_path / "ill.csv", ephemeris, np.array([1, 63]))
    with pytest.raises(ValueError, match="one satellite or more"):
        read_csv(tmp_path / "ill.csv")
    write_table(tmp_path / "good.csv", ephemeris, np.array([0, 0]))
    lines = (tmp_path / "good.csv").read_text().splitlines()
    for bad in ("x", "", "nan"):
        cells = lines[2].split(",")
        cells[3] = bad
        (tmp_path / "bad.csv").write_text("\n".join([*lines[:2], ",".join(cells)]))
        with pytest.raises(ValueError, match=rf"bad\.csv, line 3: {lines[0].split(',')[3]} must be a finite number"):
            read_csv(tmp_path / "bad.csv")


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("ecc", "1e300", "ecc must be between 0 and 0.49, got 1e[+]300"),
        ("ecc", "0.99", "ecc must be between 0 and 0.49, got 0.99"),
        ("ecc", "0.5", "ecc must be between 0 and 0.49, got 0.5"),
        ("svid", "1.5", "svid must be a whole number, got 1.5"),
        ("sqrta", "0", "sqrta must be between 2530 and 8192, got 0.0"),
        *((name, "1e300", f"{name} must be between .* got 1e[+]300") for name in ("svid", *COLUMNS.values())),
    ],
)
def test_a_value_that_no_message_has_is_named(tmp_path, column, value, message):
    path = tmp_path / "table.csv"
    write_table(path, synthetic(3), np.array([0, 0, 63]))
    lines = path.read_text().splitlines()
    place = lines[0].split(",").index(column)
    for line in (3, 4):
        cells = lines[line - 1].split(",")
        cells[place] = value
        path.write_text("\n".join([*lines[: line - 1], ",".join(cells), *lines[line:]]))
        if line == 4:  # nothing is made of a satellite that is not healthy
            assert len(read_csv(path).satellites) == 2
            continue
        with pytest.raises(ValueError, match=rf"table\.csv, line 3: {message}"):
            read_csv(path)


def test_a_table_with_a_satellite_twice_no_text_and_one_too_large(tmp_path):
    path = tmp_path / "table.csv"
    write_table(path, synthetic(2), np.array([0, 0]))
    text = path.read_text()
    path.write_text(text + "\n" + text.splitlines()[1])
    with pytest.raises(ValueError, match=r"table\.csv, line 5: satellite \d+ is there twice, first in line 2"):
        read_csv(path)
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(ValueError, match=r"table\.csv: cannot be read: it is no text in UTF-8"):
        read_csv(path)
    path.write_text(text + 200_000 * "1")
    with pytest.raises(ValueError, match=r"table\.csv, line 3: cannot be read: field larger than field limit"):
        read_csv(path)
    path.write_text(text + 1_000_000 * "1")
    with pytest.raises(ValueError, match=r"table\.csv: has \d+ bytes; valid are 1000000 at most"):
        read_csv(path)


def test_a_table_with_a_byte_order_mark(tmp_path):
    ephemeris = synthetic(2)
    write_table(tmp_path / "table.csv", ephemeris, np.array([0, 0]))
    text = (tmp_path / "table.csv").read_text()
    (tmp_path / "table.csv").write_bytes(text.replace("\n", "\r\n").encode("utf-8-sig"))
    np.testing.assert_array_equal(read_csv(tmp_path / "table.csv").m0, ephemeris.m0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"satellites": np.array([3, 3])}, r"every satellite must be there once, got \[3, 3\]"),
        ({"e": np.array([0.01, 0.5])}, "e must be from 0 to less than 0.5"),
        ({"sqrt_a": np.array([5153.0, 0.0])}, "sqrt_a must be greater than 0"),
        ({"m0": np.array([0.0, np.nan])}, "m0 must be 2 finite numbers"),
        ({"m0": np.zeros(3)}, "m0 must be 2 finite numbers"),
    ],
)
def test_refusals_name_the_value(change, message):
    with pytest.raises(ValueError, match=message):
        replace(synthetic(2), **change)
