"""Mutated logs: each is refused by an error that names it, or played with finite numbers.

``fuzz(seed, tries, folder)`` changes bytes, rows and fields of a good log in a scratch folder and gives the broken
promises, one text each.
"""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.logs.range_drive import write_drive

FIELDS = (
    "", "nan", "NaN", "inf", "-inf", "1e300", "-1e300", "1e-300", "0", "-1", "4294967.295", "9999", "x", "é", "1,2",
    "0x1", " ", "1e9", "-90", "181", "true", '"', "1_000", "٣",
)  # fmt: skip
SETTINGS = (
    "", "start_s = 'x'", "start_s = nan", "start_s = 1e300", "start_s = -5", "imu_delay = 3", "IMU_DELAY_S = 3",
    "imu_to_body_frd = 5", "imu_to_body_frd = [[1,0,0],[0,1,0]]", "imu_to_body_frd = [[0,0,0],[0,0,0],[0,0,0]]",
    "imu_delay_s = inf", "imu_delay_s = []", "name = 5", "antenna_lever_arm_m = [1, 2]",
    "antenna_lever_arm_m = [1e9, 0, 0]", "[gnss]\nx = 1", "\0", "=", "start_s = 1\nstart_s = 2",
)  # fmt: skip
EPOCHS = 15


def fuzz(seed: int, tries: int, folder: Path) -> list[str]:
    """Mutate and play ``tries`` logs in ``folder``; the broken promises."""
    rng, good = np.random.default_rng(seed), folder / "good"
    if not good.exists():
        write_drive(good, turns=3)
    broken = []
    for _ in range(tries):
        mutated = folder / "mutated"
        shutil.rmtree(mutated, ignore_errors=True)
        shutil.copytree(good, mutated)
        words = []
        for _ in range(int(rng.integers(1, 3))):
            change = CHANGES[int(rng.integers(len(CHANGES)))]
            paths = sorted(path for path in mutated.iterdir() if path.is_file())
            if change is _set:
                paths = [path for path in paths if path.name == "log.toml"]
            if paths:
                path = paths[int(rng.integers(len(paths)))]
                words.append(f"{path.name}: {change(path, rng)}")
        options = str(rng.choice(["", ",coupling=tight", ",fixes=ranges"]))
        wrong = _play(mutated, options)
        if wrong is not None:
            broken.append(f"seed {seed}, {'; '.join(words)}{options}: {wrong}")
    return broken


def _play(folder: Path, options: str) -> str | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # NumPy's; a warning about the log is an answer
            warnings.simplefilter("ignore", UserWarning)
            scenario = make_scenario(f"recorded:{folder}{options}")
            detector = make_detector("snapshot:threshold=1e9")
            simulation = Simulation(scenario, make_attack("ramp:1"), [detector], seed=0, fidelity="strapdown")
            simulation.reset()
            for _ in range(min(EPOCHS, scenario.timeline.num_epochs)):
                simulation.resolve()
                epoch = simulation.observe()
                for values in (simulation.error, epoch.innovation.nis, *epoch.statistics.values()):
                    assert np.isfinite(values).all(), "a number that is not finite"
    except (ValueError, OSError, ArithmeticError) as error:
        text = str(error)
        named = str(folder) in text or any(path.name in text for path in folder.iterdir()) or "recorded" in text
        return None if named else f"{type(error).__name__} that does not name the log: {text[:300]}"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return f"{type(error).__name__}: {str(error)[:300]}"
    return None


# --- changes: each changes a file and says how ------------------------------------------------------------------------


def _lines(path: Path) -> list[bytes]:
    return path.read_bytes().splitlines(keepends=True)


def _cut(path: Path, rng: np.random.Generator) -> str:
    data = path.read_bytes()
    length = int(rng.integers(len(data) + 1))
    path.write_bytes(data[:length])
    return f"cut to {length} bytes"


def _flip(path: Path, rng: np.random.Generator) -> str:
    data = bytearray(path.read_bytes())
    places = rng.integers(len(data), size=int(rng.integers(1, 6))).tolist() if data else []
    for place in places:
        data[place] ^= 1 << int(rng.integers(8))
    path.write_bytes(bytes(data))
    return f"bits flipped at {places}"


def _remove(path: Path, rng: np.random.Generator) -> str:
    path.unlink()
    return "removed"


def _empty(path: Path, rng: np.random.Generator) -> str:
    path.write_bytes(b"")
    return "emptied"


def _drop_rows(path: Path, rng: np.random.Generator) -> str:
    lines = _lines(path)
    first = int(rng.integers(len(lines) + 1))
    count = int(rng.choice([1, 2, 10, 1000]))
    path.write_bytes(b"".join(lines[:first] + lines[first + count :]))
    return f"{count} lines dropped from line {first + 1} on"


def _repeat_row(path: Path, rng: np.random.Generator) -> str:
    lines = _lines(path)
    if lines:
        place = int(rng.integers(len(lines)))
        lines.insert(int(rng.integers(len(lines) + 1)), lines[place])
    path.write_bytes(b"".join(lines))
    return "a line repeated"


def _swap_rows(path: Path, rng: np.random.Generator) -> str:
    lines = _lines(path)
    if lines:
        one, other = rng.integers(len(lines), size=2).tolist()
        lines[one], lines[other] = lines[other], lines[one]
    path.write_bytes(b"".join(lines))
    return "two lines swapped"


def _put(path: Path, rng: np.random.Generator) -> str:
    lines = _lines(path)
    text = str(FIELDS[int(rng.integers(len(FIELDS)))])
    if not lines:
        return "nothing put"
    places = rng.integers(len(lines), size=int(rng.choice([1, 1, 5, 50])))
    column = int(rng.integers(8))
    for place in places.tolist():
        parts = lines[place].rstrip(b"\r\n").split(b",")
        parts[min(column, len(parts) - 1)] = text.encode()
        lines[place] = b",".join(parts) + b"\n"
    path.write_bytes(b"".join(lines))
    return f"{text!r} put into column {column + 1} of lines {(places + 1).tolist()[:5]}"


def _drop_column(path: Path, rng: np.random.Generator) -> str:
    column = int(rng.integers(8))
    rows = [line.rstrip(b"\r\n").split(b",") for line in _lines(path)]
    path.write_bytes(b"".join(b",".join(row[:column] + row[column + 1 :]) + b"\n" for row in rows))
    return f"column {column + 1} dropped"


def _mark(path: Path, rng: np.random.Generator) -> str:
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    return "written with a byte-order mark and CRLF"


def _set(path: Path, rng: np.random.Generator) -> str:
    line = str(SETTINGS[int(rng.integers(len(SETTINGS)))])
    kept = path.read_text() if rng.random() < 0.5 else ""
    path.write_text(f"{line}\n{kept}" if "[" in line[:1] else f"{kept}\n{line}\n")
    return f"{line!r} {'added' if kept else 'alone'}"


CHANGES: tuple[Callable[[Path, np.random.Generator], str], ...] = (
    _cut, _flip, _remove, _empty, _drop_rows, _repeat_row, _swap_rows, _put, _put, _put, _drop_column, _mark, _set,
    _set,
)  # fmt: skip
