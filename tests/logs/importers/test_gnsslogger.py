"""Android's GNSSLogger text: the drive comes back in GPS time, and pseudoranges are those of the definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.importers import gnsslogger
from spoofgym.logs.importers.recording import C, Options
from tests.logs.importers.drive import ABSENT, DATA, drive, imported

WEEK = 2300
START = 100_000.0
"""GPS time of week of the drive's 0, s."""
UTC = 315_964_800 + WEEK * 604_800 + START - 18.0
BOOT = 5_000.0
RAW = (
    "utcTimeMillis,TimeNanos,FullBiasNanos,BiasNanos,HardwareClockDiscontinuityCount,Svid,TimeOffsetNanos,State,"
    "ReceivedSvTimeNanos,ReceivedSvTimeUncertaintyNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,"
    "PseudorangeRateUncertaintyMetersPerSecond,CarrierFrequencyHz,ConstellationType,ChipsetElapsedRealtimeNanos"
)
FIX = (
    "Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,"
    "SpeedAccuracyMps,BearingAccuracyDegrees,elapsedRealtimeNanos,VerticalAccuracyMeters"
)
SENSOR = "utcTimeMillis,elapsedRealtimeNanos,{0}X{1},{0}Y{1},{0}Z{1},BiasX,BiasY,BiasZ"
FULL_BIAS = -(WEEK * 604_800 + 99_000) * 10**9 - 123_456_789
FLIGHT = 0.0712345678


def text(raw: list[str]) -> str:
    """The drive, sensors in the phone's axes = forward, right, down, accelerations 3 ms after the rates."""
    true = drive()
    lines = ["# Version: v3.0.6.4", "#", f"# Raw,{RAW}", f"# Fix,{FIX}"]
    for kind, unit in (("UncalAccel", "Mps2"), ("UncalGyro", "RadPerSec")):
        lines.append(f"# {kind},{SENSOR.format(kind, unit)}")
    force = np.column_stack([np.interp(true.time + 0.003, true.time, true.force[:, k]) for k in range(3)])
    for k, time in enumerate(true.time):
        for kind, late, values in (("UncalGyro", 0.0, true.rate[k]), ("UncalAccel", 0.003, force[k])):
            nano = round(1e9 * (BOOT + time + late))
            lines.append(f"{kind},{round(1e3 * (UTC + time))},{nano},{','.join(map(repr, values.tolist()))},0,0,0")
    for k, time in enumerate(true.fix_time):
        place = ",".join(map(repr, true.place[k].tolist()))
        told = f"{float(true.speed[k])!r},3.03,{float(true.course[k])!r},{round(1e3 * (UTC + time))},0.2,5.0"
        lines.append(f"Fix,GPS,{place},{told},{round(1e9 * (BOOT + time))},2.5")
        lines.append(f"Fix,FLP,{place},{told},{round(1e9 * (BOOT + time))},2.5")
    return "\n".join(lines + raw) + "\n"


def raw_line(tick: int, *, svid: int = 7, state: int = 16_431, system: int = 1, carrier: str = "1575420030") -> str:
    """A measurement whose signal took `FLIGHT`, by a clock that is 123456789 ns and 99 000 s behind its ticks."""
    received = tick - FULL_BIAS - WEEK * 604_800 * 10**9
    sent = received - round(FLIGHT * 1e9)
    return f"Raw,0,{tick},{FULL_BIAS},0.0,0,{svid},0.0,{state},{sent},12,44.5,-312.5,0.1,{carrier},{system},0"


def test_a_drive_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "phone.txt"
    path.write_text(text([]))
    recording, log = imported(path, tmp_path / "log", axes="frd")
    inside = slice(1, -1)  # no specific force before the first
    np.testing.assert_allclose(log.imu_time - START, drive().time[1:], atol=2e-6)
    np.testing.assert_allclose(log.angular_rate[:, 1], drive().rate[1:, 0], atol=1e-9)
    np.testing.assert_allclose(log.specific_force[inside, 1], drive().force[2:-1, 0], atol=2e-3)
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, :2], drive().velocity[:, [1, 0]], atol=1e-3)
    np.testing.assert_allclose(np.degrees(log.fixes.position[:, 0]), drive().place[:, 0], atol=1e-9)
    np.testing.assert_allclose(log.fixes.time - START, drive().fix_time, atol=1e-3)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], [2.0, 2.0, 2.5])  # 68 % lie within 1.515 sigma
    assert f"{len(drive().fix_time)} fixes of other providers (FLP)" in recording.problems[0]


def test_ranges_are_times_of_flight(tmp_path: Path) -> None:
    """GPS L1 in ranges, L5 and Galileo beside; no time of week, no range; the clock runs on until a discontinuity."""
    ticks = [10**9, 2 * 10**9]
    lines = [raw_line(tick) for tick in ticks]
    lines += [raw_line(ticks[0], carrier="1176450050", svid=8), raw_line(ticks[0], system=6, svid=3)]
    lines += [raw_line(ticks[0], state=3, svid=9), raw_line(ticks[0], system=3, state=32_995, svid=2)]
    path = tmp_path / "phone.txt"
    path.write_text(text(lines))
    recording = gnsslogger.read(path, Options())
    ranges, other = recording.tables["ranges"], recording.tables["ranges_other"]
    np.testing.assert_array_equal(ranges["svid"], [7, 7])
    np.testing.assert_allclose(ranges["pseudorange_m"], round(FLIGHT * 1e9) * 1e-9 * C, atol=1e-3)
    np.testing.assert_allclose(ranges["range_rate_mps"], -312.5)
    np.testing.assert_allclose(ranges["t_s"], 99_000 + 0.123456789 + np.array([1.0, 2.0]), atol=1e-6)
    np.testing.assert_array_equal(other["svid"], [8, 3])
    assert "2 of 6 have no time of week of GPS" in " ".join(recording.problems)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("# Fix,", "# Fox,", "no format is recognised|has Fix lines, but no line"),
        ("UncalGyro,1", "Gyro,1", "has no UncalGyro lines"),
        ("UnixTimeMillis", "Time", "tell a time"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = tmp_path / "phone.txt"
    path.write_text(text([]).replace(old, new))
    with pytest.raises(ValueError, match=told):
        imported(path, tmp_path / "log")


def test_a_line_that_is_cut_is_told(tmp_path: Path) -> None:
    whole = text([])
    path = tmp_path / "phone.txt"
    path.write_text(whole[: whole.rindex(",") - 40] + "\n")
    recording, _ = imported(path, tmp_path / "log", axes="frd")
    assert f"the first is line {len(whole.splitlines())}" in recording.problems[0]


@pytest.mark.skipif(not (DATA / "gnsslogger").is_dir(), reason=ABSENT)
def test_a_real_file(tmp_path: Path) -> None:
    """Its source has thinned it: ranges and fixes can be used, inertial samples are told to be too few."""
    recording = gnsslogger.read(DATA / "gnsslogger" / "pixel6.txt", Options())
    assert len(recording.tables["gnss"]["t_s"]) == 94
    ranges = recording.tables["ranges"]
    assert len(np.unique(ranges["t_s"])) == 31
    assert np.all((ranges["pseudorange_m"] > 1.9e7) & (ranges["pseudorange_m"] < 2.7e7))
    assert "too seldom for a filter" in " ".join(recording.problems)
