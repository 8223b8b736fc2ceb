"""Make and compare golden episodes.

    python -m tests.golden make runs/golden               # before a change, on this machine
    python -m tests.golden compare runs/golden            # after it: bit for bit
    python -m tests.golden commit                         # new arrays of the repository, and their tolerances

Arrays that are in the repository stay as they are; delete a file to make its arrays anew. `commit` adds what is new:
whole episodes, and what episodes show more of, such as the statistic of a new detector. It plays what is new again in
other arithmetic (code of OpenBLAS, NumPy and numba for older processors) and with all random numbers moved by one unit
in the last place, and allows each quantity ten times the largest difference.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import streams
from tests.golden import calibration, store
from tests.other_kernels import other_kernels

MARGIN = 10.0
VARIATIONS: dict[str, dict[str, str]] = {
    "oldest processor": other_kernels(),
    "another BLAS": {"OPENBLAS_CORETYPE": "Haswell"},
    "moved up": {"GOLDEN_NUDGE": "1"},
    "moved down": {"GOLDEN_NUDGE": "-1"},
}


class Nudged(np.random.Generator):
    """A generator whose normal numbers are moved by one unit in the last place, up or down."""

    toward = np.inf

    def standard_normal(self, *arguments: Any, **options: Any) -> Any:
        """As that of the base class, moved."""
        drawn = super().standard_normal(*arguments, **options)
        if options.get("out") is not None:
            return np.nextafter(drawn, self.toward, out=options["out"])
        return np.nextafter(drawn, self.toward)


def nudge(direction: float) -> None:
    """Move the random numbers of all streams from now on."""
    Nudged.toward = direction * np.inf
    streams._generator = lambda sequence: Nudged(np.random.SFC64(sequence))  # type: ignore[assignment]


def make(folder: Path, kinds: Sequence[str]) -> None:
    """Play all episodes of some kinds and write them to a folder."""
    if "GOLDEN_NUDGE" in os.environ:
        nudge(float(os.environ["GOLDEN_NUDGE"]))
    for kind in kinds:
        store.write(folder, kind, {name: play() for name, play in store.ALL_KINDS[kind]().items()})


def compare(folder: Path, kinds: Sequence[str]) -> int:
    """Play all episodes of some kinds and compare them with a folder, bit for bit; the number that differ."""
    differing = 0
    for kind in kinds:
        expected = store.read(folder, kind)
        for name, play in store.ALL_KINDS[kind]().items():
            told = store.differences(expected.pop(name, {}), play())
            differing += bool(told)
            if told:
                print(f"{name}\n  " + "\n  ".join(told))
        differing += len(expected)
        for name in expected:
            print(f"{name}\n  is played no more")
    print("all golden episodes are equal" if not differing else f"{differing} golden episodes differ")
    return differing


def commit(kinds: Sequence[str]) -> None:
    """Make the arrays for the repository of what is new in some kinds and measure their tolerances."""
    if not calibration.FILE.exists():
        with tempfile.TemporaryDirectory() as cache:
            calibration.write(Path(cache))
    new = {kind: _make_new(kind) for kind in kinds}
    made = {name: keys for news in new.values() for name, keys in news.items()}
    everyone = {name for episodes in store.KINDS.values() for name in episodes()}
    allowed = {
        name: {key: gap for key, gap in gaps.items() if key not in made.get(name, set())}
        for name, gaps in store.tolerances().items()
        if name in everyone
    }
    for label, variables in VARIATIONS.items() if made else ():
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
            command = [sys.executable, "-m", "tests.golden", "make", folder, "--kinds", *(k for k in kinds if new[k])]
            # thresholds, too, are calibrated in this arithmetic
            subprocess.run(command, env={**os.environ, **variables, "SPOOFGYM_CACHE": cache}, check=True)
            largest = _widen(allowed, Path(folder), new)
        print(f"{label}: largest difference {largest:.3g}")
    wide = {name: gaps for name, gaps in sorted(allowed.items()) if gaps}
    kept = {name: {key: float(f"{gap:.2g}") for key, gap in gaps.items()} for name, gaps in wide.items()}
    store.TOLERANCES.write_text(json.dumps(kept, indent=0, sort_keys=True) + "\n")


def _make_new(kind: str) -> dict[str, set[str]]:
    """Play what the repository does not hold of the episodes of a kind, and forget what is played no more.

    Returns:
        Names of the new quantities of every episode that has some.
    """
    held = store.read(store.FOLDER, kind) if (store.FOLDER / f"{kind}.npz").exists() else {}
    made, new = {}, {}
    for name, play in store.KINDS[kind]().items():
        found, old = play(), held.get(name, {})
        made[name] = {key: old.get(key, array) for key, array in found.items()}
        if found.keys() - old.keys():
            new[name] = set(found.keys() - old.keys())
    if {name: arrays.keys() for name, arrays in made.items()} != {name: arrays.keys() for name, arrays in held.items()}:
        store.write(store.FOLDER, kind, made)
    return new


def _widen(allowed: dict[str, dict[str, float]], folder: Path, new: dict[str, dict[str, set[str]]]) -> float:
    """Allow what a variation made of the new quantities; the largest difference of all."""
    largest = 0.0
    for kind in (kind for kind, names in new.items() if names):
        varied, held = store.read(folder, kind), store.read(store.FOLDER, kind)
        for name, keys in new[kind].items():
            for key in sorted(keys):
                gap = store.distance(held[name][key], varied[name][key])
                largest = max(largest, gap)
                if not np.isfinite(gap):
                    raise SystemExit(f"{name}: {key}: a variation changes what must be equal: choose another episode")
                if gap:
                    gaps = allowed.setdefault(name, {})
                    gaps[key] = max(gaps.get(key, 0.0), MARGIN * gap)
    return largest


def main() -> int:
    """Do what the command line asks; its exit status."""
    parser = argparse.ArgumentParser("python -m tests.golden", description="Make and compare golden episodes.")
    parser.add_argument("command", choices=("make", "compare", "commit"))
    parser.add_argument("folder", nargs="?", type=Path, default=Path("runs/golden"), help="default: %(default)s")
    parser.add_argument("--kinds", nargs="+", choices=tuple(store.ALL_KINDS), help="default: all")
    given = parser.parse_args()
    if given.command == "compare":
        return min(compare(given.folder, given.kinds or tuple(store.ALL_KINDS)), 1)
    if given.command == "make":
        make(given.folder, given.kinds or tuple(store.ALL_KINDS))
    else:
        commit(given.kinds or tuple(store.KINDS))
    return 0


if __name__ == "__main__":
    sys.exit(main())
