"""Mistakes that people make with logs, each as a change of a good one, and what must be said of it."""

from __future__ import annotations

import numpy as np

from spoofgym.logs.log import IMU_COLUMNS, POSITION_SIGMA_COLUMNS, VELOCITY_COLUMNS, VELOCITY_SIGMA_COLUMNS
from tests.logs.spoilt import (
    Change,
    added,
    both,
    cell,
    column,
    doubled,
    less,
    noted,
    put,
    rounded,
    scaled,
    single,
    swapped,
    text,
    turned,
    without,
)

GYRO, FORCE = IMU_COLUMNS[1:4], IMU_COLUMNS[4:]
PLACE, SIGMAS = ("lat_deg", "lon_deg"), (*POSITION_SIGMA_COLUMNS, *VELOCITY_SIGMA_COLUMNS)
KNOTS = 3600.0 / 1852.0
MIDDLE = slice(80, 81)
OK = ""
"""Nothing is wrong, and nothing is said."""

MUTANTS: dict[str, tuple[Change, str]] = {
    # inertial samples: units and axes
    "gyro in degrees": (scaled("imu", GYRO, 57.29578), "angular rate is in degrees per second"),
    "gyro in milliradians": (scaled("imu", GYRO, 1000.0), "must be between -1000|times the course rate"),
    "gyro in turns": (scaled("imu", GYRO, 1 / (2 * np.pi)), "times the course rate"),
    "force in g": (scaled("imu", FORCE, 1 / 9.80665), r"seems to be in g \(multiply it by 9\.80"),
    "force in mg": (scaled("imu", FORCE, 1e3 / 9.80665), "or milli-g"),
    "force in feet": (scaled("imu", FORCE, 1 / 0.3048), "seems to be in ft/s²"),
    "force in cm": (scaled("imu", FORCE, 100.0), "seems to be in cm/s² "),
    "linear acceleration": (added("imu", "az_mps2", 9.8), "gravity (is|seems to be) taken away"),
    "acceleration in place of force": (scaled("imu", FORCE, -1.0), "specific force points down"),
    "force 8 % too large": (scaled("imu", FORCE, 1.08), "median specific force is 10.[67]"),
    "gyro of the opposite sign": (scaled("imu", GYRO, -1.0), "turns to the other side"),
    "gz of the opposite sign": (scaled("imu", ("gz_radps",), -1.0), "turns to the other side"),
    "sensor up, said to be down": (scaled("imu", ("gy_radps", "gz_radps", "ay_mps2", "az_mps2"), -1.0), "points down"),
    "mounting turned by 90": (turned(90.0), "turned by .*90 degrees about the vertical"),
    "mounting turned by 180": (turned(180.0), "turned by .*180 degrees about the vertical"),
    "mounting turned by 40": (turned(40.0), "turned by .*40 degrees about the vertical"),
    "mounting turned by 4": (turned(4.0), OK),
    "unknown mounting": (noted("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "[]"), OK),
    "mounting no rotation": (noted("[1, 0, 0]", "[2, 0, 0]"), "must be a rotation"),
    "mounting left-handed": (noted("[1, 0, 0]", "[-1, 0, 0]"), "must be a rotation"),
    "a frozen sensor": (
        lambda f: put("imu", {n: float(f.tables["imu"][n][1000]) for n in IMU_COLUMNS[1:]}, slice(1000, 1050))(f),
        "samples repeat",
    ),
    # times
    "IMU in milliseconds": (scaled("imu", ("t_s",), 1e3), "t_s is in milliseconds"),
    "IMU in microseconds": (scaled("imu", ("t_s",), 1e6), "t_s is in microseconds"),
    "fixes in milliseconds": (scaled("gnss", ("t_s",), 1e3), "t_s seems to be in milliseconds"),
    "all in milliseconds": (
        both(*(scaled(t, ("t_s",), 1e3) for t in ("imu", "gnss", "reference"))),
        "t_s is in millisec",
    ),
    "a sample each 20 s": (
        lambda f: f.tables.update(imu={name: values[::500] for name, values in f.tables["imu"].items()}),
        "a sample comes each 20 s, too seldom",
    ),
    "fixes 18 s late": (added("gnss", "t_s", 18.0), "UTC against GPS time differ by 18 s"),
    "fixes 18 s early": (added("gnss", "t_s", -18.0), "UTC against GPS time differ by 18 s"),
    "fixes 1 s late": (added("gnss", "t_s", 1.0), "fixes are 1.0 s later than the IMU"),
    "fixes 0.6 s early": (added("gnss", "t_s", -0.6), "fixes are 0.6 s earlier than the IMU"),
    "fixes 0.05 s late": (added("gnss", "t_s", 0.05), OK),
    "a wrong delay of the fixes": (noted("", "gnss_delay_s = 2.0"), "add -2.0 to gnss_delay_s"),
    "a wrong delay of the IMU": (noted("", "imu_delay_s = 3.0"), "fixes are 3.0 s later than the IMU"),
    "Unix against boot": (added("gnss", "t_s", 1.7e9), "no overlap"),
    "reference 18 s late": (added("reference", "t_s", 18.0), "UTC against GPS time: 18 s"),
    "a leap second": (added("gnss", "t_s", 1.0, slice(100, None)), r"t_s steps by 1\.\d+ s where the way took"),
    "a step back": (added("gnss", "t_s", -1.0, slice(100, None)), "clock was set back by"),
    "a doubled fix": (doubled("gnss", 90), "line 93: t_s must increase.*there twice"),
    "a fix in the wrong order": (doubled("gnss", 90, backward=True), "line 93: t_s must increase"),
    "a doubled sample": (doubled("imu", 900), "line 903: t_s must increase.*there twice"),
    "a sample in the wrong order": (doubled("imu", 900, backward=True), "line 903: t_s must increase"),
    "times with one digit": (rounded("imu", ("t_s",), 1), "t_s must increase.*too few digits"),
    "times in single precision": (
        both(
            added("imu", "t_s", 1e6),
            added("gnss", "t_s", 1e6),
            added("reference", "t_s", 1e6),
            single("imu", ("t_s",)),
            noted("1002.0", "1001002.0"),
        ),
        "t_s must increase.*too few digits",
    ),
    "a hole in the IMU": (without("imu", slice(1500, 1600)), "hole.* of more than 0.5 s|IMU has a gap"),
    "a hole in the fixes": (without("gnss", slice(100, 120)), "holes of more than"),
    "a hole in the reference": (without("reference", slice(200, 260)), OK),
    "start after the end": (noted("1002.0", "5002.0"), "no overlap"),
    "no start": (noted("start_s = 1002.0\n", ""), "start_s is missing"),
    # fixes: units, columns, rows
    "velocity in knots": (scaled("gnss", VELOCITY_COLUMNS, KNOTS), "velocity is in knots"),
    "velocity in km/h": (scaled("gnss", VELOCITY_COLUMNS, 3.6), "velocity is in km/h"),
    "velocity in mph": (scaled("gnss", VELOCITY_COLUMNS, 1 / 0.44704), "velocity is in mph"),
    "velocity in cm/s": (scaled("gnss", VELOCITY_COLUMNS, 100.0), "velocity is in cm/s"),
    "velocity in mm/s": (scaled("gnss", VELOCITY_COLUMNS, 1000.0), "velocity is in mm/s|must be between"),
    "velocity swapped": (swapped("gnss", "vn_mps", "ve_mps"), "vn_mps and ve_mps are swapped"),
    "velocity swapped and in knots": (
        both(swapped("gnss", "vn_mps", "ve_mps"), scaled("gnss", VELOCITY_COLUMNS, KNOTS)),
        "swapped and in knots",
    ),
    "velocity to the west": (scaled("gnss", ("ve_mps",), -1.0), "ve_mps has the wrong sign"),
    "velocity to the south": (scaled("gnss", ("vn_mps",), -1.0), "vn_mps has the wrong sign"),
    "velocity backwards": (scaled("gnss", ("vn_mps", "ve_mps"), -1.0), "vn_mps and ve_mps have the wrong sign"),
    "velocity of body axes": (
        lambda f: f.tables["gnss"].update(
            vn_mps=np.hypot(f.tables["gnss"]["vn_mps"], f.tables["gnss"]["ve_mps"]),
            ve_mps=np.zeros(len(f.tables["gnss"]["t_s"])),
        ),
        "velocity does not fit the differences",
    ),
    "velocity zero": (scaled("gnss", VELOCITY_COLUMNS, 0.0), "vn_mps and ve_mps are 0 in every fix"),
    "no velocity": (less("gnss", (*VELOCITY_COLUMNS, *VELOCITY_SIGMA_COLUMNS)), OK),
    "a velocity column missing": (less("gnss", ("vd_mps",)), "column 'vd_mps' is missing"),
    "latitude and longitude swapped": (swapped("gnss", *PLACE), "lat_deg and lon_deg are swapped"),
    "the same without a velocity": (
        both(less("gnss", (*VELOCITY_COLUMNS, *VELOCITY_SIGMA_COLUMNS)), swapped("gnss", *PLACE)),
        "lat_deg and lon_deg are swapped",
    ),
    "longitude west as latitude": (
        both(put("gnss", {"lon_deg": -122.0}, slice(None)), swapped("gnss", *PLACE)),
        "lat_deg and lon_deg swapped",
    ),
    "positions in radians": (scaled("gnss", PLACE, np.radians(1.0)), "lat_deg and lon_deg are in radians"),
    "positions in 1e-7 degrees": (scaled("gnss", PLACE, 1e7), "1e-7 degrees"),
    "positions as ddmm": (scaled("gnss", PLACE, 100.0), "degrees and minutes"),
    "positions with four digits": (rounded("gnss", PLACE, 4), "too few digits|innovations are|does not fit"),
    "positions in single precision": (single("gnss", PLACE), OK),
    "heights in feet": (
        scaled("gnss", ("h_m",), 1 / 0.3048),
        "heights of the fixes are in feet|those of the fixes are in feet",
    ),
    "heights in millimetres": (scaled("gnss", ("h_m",), 1e3), "millimetres|heights of the fixes lie"),
    "heights above the sea": (added("gnss", "h_m", -47.0), "above sea level"),
    "a row of zeros": (put("gnss", {name: 0.0 for name in PLACE}, MIDDLE), "lat_deg = lon_deg = 0, no fix"),
    "a row with half a zero": (put("gnss", {"lon_deg": 0.0}, MIDDLE), "lat_deg = 0 or lon_deg = 0"),
    "a wild fix": (put("gnss", {"lat_deg": 47.5}, MIDDLE), "rows around make impossible"),
    "a wild velocity": (put("gnss", {"vn_mps": 300.0}, MIDDLE), "rows around make impossible"),
    "a fix 60 m away": (added("gnss", "lat_deg", 60.0 / 111e3, MIDDLE), "innovations are|rows around"),
    "a wild reference": (
        put("reference", {"lat_deg": 47.5}, slice(300, 301)),
        "reference.*rows around make impossible",
    ),
    "frozen fixes": (
        lambda f: put("gnss", {n: float(f.tables["gnss"][n][60]) for n in PLACE}, slice(60, 75))(f),
        "repeat the position",
    ),
    "each fix three times": (
        lambda f: f.tables["gnss"].update(
            {n: np.repeat(f.tables["gnss"][n][::3], 3)[: len(f.tables["gnss"]["t_s"])] for n in PLACE}
        ),
        "repeat the position|does not fit",
    ),
    "sigmas of 0": (put("gnss", {name: 0.0 for name in SIGMAS}, slice(None)), "sigma of 0"),
    "sigmas of 9999": (
        put("gnss", {name: 9999.0 for name in POSITION_SIGMA_COLUMNS}, MIDDLE),
        "horizontal sigma of 99 m or more",
    ),
    "all sigmas of 9999": (
        put("gnss", {name: 9999.0 for name in POSITION_SIGMA_COLUMNS}, slice(None)),
        "must be a fix, 0 are",
    ),
    "sigmas in millimetres": (scaled("gnss", POSITION_SIGMA_COLUMNS, 1e3), "must be a fix, 0 are"),
    "sigmas of micrometres": (scaled("gnss", POSITION_SIGMA_COLUMNS, 1e-6), "sigma of less than 1 mm"),
    "a negative sigma": (put("gnss", {"sd_n_m": -1.0}, MIDDLE), "line 82: sd_n_m must be 0 or more"),
    "a status of 0 in some rows": (column("fix_q", lambda n: (np.arange(n) % 7 > 0).astype(float)), "fix_q = 0"),
    "a status of 1 in all rows": (column("fix_q", lambda n: np.ones(n)), OK),
    "the reference in knots": (
        scaled("reference", VELOCITY_COLUMNS, KNOTS),
        "reference.csv, line 1: the velocity is in knots",
    ),
    "the reference swapped": (swapped("reference", *PLACE), "reference.csv, line 1: lat_deg and lon_deg are swapped"),
    # text
    "a byte order mark": (text("gnss.csv", lambda t: "\ufeff" + t), OK),
    "carriage returns": (text("imu.csv", lambda t: t.replace("\n", "\r\n")), OK),
    "carriage returns alone": (
        text("gnss.csv", lambda t: t.replace("\n", "\r")),
        "carriage return without a line feed",
    ),
    "decimal commas": (
        text("gnss.csv", lambda t: t.partition("\n")[0] + "\n" + t.partition("\n")[2].replace(".", ",")),
        "decimal point, no comma",
    ),
    "semicolons": (text("gnss.csv", lambda t: t.replace(",", ";")), "separated by semicolons"),
    "semicolons and decimal commas": (
        text("imu.csv", lambda t: t.replace(",", ";").replace(".", ",")),
        "separated by semicolons",
    ),
    "tabs": (text("imu.csv", lambda t: t.replace(",", "\t")), "separated by tabs"),
    "no header": (text("gnss.csv", lambda t: t.partition("\n")[2]), "first line must name the columns"),
    "another name": (text("gnss.csv", lambda t: t.replace("lat_deg", "latitude_deg")), "is it 'latitude_deg'"),
    "capitals": (text("gnss.csv", lambda t: t.replace("h_m", "H_m", 1)), "is it 'H_m'"),
    "quotes": (text("imu.csv", lambda t: t.replace("t_s", '"t_s"', 1)), "is it '\"t_s\"'"),
    "an empty cell": (text("gnss.csv", lambda t: cell(t, 50, 1, "")), "line 51: lat_deg must be a finite number"),
    "not a number": (text("gnss.csv", lambda t: cell(t, 50, 3, "nan")), "line 51: h_m must be a finite number"),
    "a cut line": (text("imu.csv", lambda t: t.rstrip()[:-30]), "is missing, the line has|must be a finite"),
    "a spreadsheet's UTF-16": (
        lambda f: setattr(
            f, "after", lambda d: (d / "gnss.csv").write_bytes((d / "gnss.csv").read_text().encode("utf-16"))
        ),
        "no text in UTF-8|cannot be read|is missing",
    ),
    "no gnss.csv": (
        lambda f: setattr(f, "after", lambda d: (d / "gnss.csv").unlink()),
        r"gnss\.csv \(or \.csv\.gz\) is missing",
    ),
    "an unknown key": (noted("", "gnss_delay = 0.1"), "did you mean 'gnss_delay_s'"),
    "a key under notes": (noted("start_s = 1002.0\n", "[notes]\nstart_s = 1002.0\n"), "must stand above all tables"),
    "a lever arm in millimetres": (noted("", "antenna_lever_arm_m = [1200, 0, -900]"), "antenna_lever_arm_m must be"),
}

SEEN = "innovations are|imu_to_body_frd does not fit|the filter diverges"
FILTERED: dict[str, tuple[Change, str]] = {
    "gyro axes in another order": (swapped("imu", "gx_radps", "gz_radps"), SEEN),
    "force axes in another order": (swapped("imu", "ax_mps2", "az_mps2"), SEEN),
    "gyro bias of 6 degrees": (added("imu", "gz_radps", 0.1), SEEN),
    "a spike": (put("imu", {"ax_mps2": 900.0}, slice(1500, 1501)), "innovations are"),
}
"""Mistakes that only a run of the filter shows."""
