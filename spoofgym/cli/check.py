"""Say what a bug report needs: versions, machine, folders of caches, whether kernels compile, what is installed.

    spoofgym check
    spoofgym check --json -

The exit status is 1 where something that every game needs does not work.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import spoofgym
from spoofgym import cache_folder
from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.console import console
from spoofgym.program import FAILURE, do_all, give_json, program

EXAMPLES = ("spoofgym check", "spoofgym check --json bug.json")
NEEDED = ("numpy", "scipy", "numba", "gymnasium", "pymap3d", "filelock", "rich")
OPTIONAL = {
    "matplotlib": "report",
    "torch": "train",
    "stable-baselines3": "train",
    "tensorboard": "train",
    "pettingzoo": "multiagent",
    "onnx": "onnx",
    "ray": "ray",
    "pyrtklib": "logs",
    "pyulog": "logs",
    "rosbags": "logs",
    "argcomplete": "completion",
}
"""By the extra that installs each."""
VARIABLES = (
    *("SPOOFGYM_CACHE", "SPOOFGYM_QUIET", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT"),
    *("OMP_NUM_THREADS", "COLUMNS"),
)
GOOD, BAD, ABSENT = "ok", "FAILS", "-"


@dataclass(frozen=True)
class Finding:
    """One line of the report.

    Attributes:
        section: under which it stands.
        name: what was looked at.
        value: what was found.
        state: "ok", "FAILS" (something that is needed does not work), or "-" (nothing that is needed).
    """

    section: str
    name: str
    value: str
    state: str = ABSENT


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym check",
        description="Say what a bug report needs: versions, machine, caches, and whether a game can be played.",
        examples=EXAMPLES,
    )
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    found = [*machine(), *packages(), *folders(), *work()]
    do_all(
        lambda: terminal.print("\n".join(_lines(found)), soft_wrap=True),
        partial(give_json, {"kind": "check", "findings": [asdict(each) for each in found]}, options.json),
    )
    return FAILURE if any(each.state == BAD for each in found) else 0


def machine() -> list[Finding]:
    """Python, operating system, processor and variables that change what spoofgym does."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    rows = {
        "spoofgym": f"{spoofgym.__version__} in {_home(Path(spoofgym.__file__).parent)}",
        "python": f"{platform.python_version()} ({platform.python_implementation()}) in {_home(Path(sys.prefix))}",
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
        "processor": f"{_processor()}, {cores} cores may be used",
    }
    rows |= {name: os.environ[name] for name in VARIABLES if name in os.environ}
    return [Finding("machine", name, value) for name, value in rows.items()]


def packages() -> list[Finding]:
    """The versions of what is needed and of what extras install."""
    found = []
    for name in NEEDED:
        version = _version(name)
        found.append(Finding("packages", name, version or "missing", GOOD if version else BAD))
    for name, extra in OPTIONAL.items():
        version = _version(name)
        told, state = (version, GOOD) if version else (f"not installed: pip install 'spoofgym[{extra}]'", ABSENT)
        found.append(Finding("packages", name, told, state))
    return found


def folders() -> list[Finding]:
    """Where compiled kernels and thresholds are kept, whether files can be written there, and how much lies there."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        from spoofgym.kernels.place import place

        kernels = place()
    rows = [Finding("caches", "compiled kernels", _folder(kernels), GOOD if kernels is not None else BAD)]
    rows += [Finding("caches", "note", " ".join(str(each.message).split())) for each in told]
    thresholds = cache_folder.folder()
    rows.append(Finding("caches", "thresholds", _folder(thresholds), GOOD if _writable(thresholds) else ABSENT))
    rows.append(Finding("caches", "this folder", str(_home(Path.cwd())), GOOD if _writable(Path.cwd()) else ABSENT))
    return rows


def work() -> list[Finding]:
    """Whether a kernel compiles, a short game is played, and published agents can be read."""
    return [_tried("numba compiles", _compile), _tried("a game is played", _play), _tried("published agents", _agents)]


def _tried(name: str, what: Callable[[], str]) -> Finding:
    begun = time.perf_counter()
    try:
        told = what()
    except Exception as error:  # whatever it is, the report must tell it
        return Finding("work", name, " ".join(f"{type(error).__name__}: {error}".split()), BAD)
    return Finding("work", name, f"{told} in {time.perf_counter() - begun:.1f} s", GOOD)


def _compile() -> str:
    import numba

    @numba.njit
    def double(x: float) -> float:
        return 2.0 * x

    found: Any = double(2.0)
    if found != 4.0:
        raise ArithmeticError(f"2 times 2 is {found}")
    return "a function"


def _play() -> str:
    import gymnasium

    env = gymnasium.make("spoofgym/Spoofer-v0", scenario="liu-flight:horizon=10", knowledge="blind")
    env.reset(seed=0)
    error = env.step(env.action_space.sample() * 0.0)[4]["error"]
    env.close()
    return f"a step of Spoofer-v0 with an error of {error:.3f} m"


def _agents() -> str:
    from spoofgym.policies.learned import load_policy
    from spoofgym.policies.published import published_folder, published_names

    names = published_names()
    for name in names:
        load_policy(published_folder(name))
    return f"{len(names)} read"


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        found = importlib.util.find_spec(package.replace("-", "_"))
        return None if found is None else "of unknown version"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or "unknown")


def _folder(folder: Path | None) -> str:
    if folder is None:
        return "none can be written"
    if not folder.is_dir():
        return f"{_home(folder)}, not there yet" + ("" if _writable(folder) else ", cannot be written")
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    closed = "" if _writable(folder) else ", cannot be written"
    return f"{_home(folder)}, {len(sizes):,} files, {sum(sizes) / 1e6:.1f} MB{closed}"


def _writable(folder: Path | None) -> bool:
    """Whether a file can be made in the folder, or in the nearest one above it that exists."""
    while folder is not None and not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return folder is not None


def _home(path: Path) -> str:
    """The path, without the name of the user."""
    try:
        return f"~/{path.relative_to(Path.home())}"
    except (ValueError, RuntimeError):
        return str(path)


def _lines(found: Sequence[Finding]) -> list[str]:
    width = max(len(each.name) for each in found)
    lines: list[str] = []
    section = ""
    for each in found:
        if each.section != section:
            section = each.section
            lines += ["", f"{section}:"] if lines else [f"{section}:"]
        lines.append(f"  {each.state:<5} {each.name:<{width}}  {each.value}")
    bad = [each.name for each in found if each.state == BAD]
    return [*lines, "", f"does not work: {', '.join(bad)}" if bad else "All that a game needs works."]
