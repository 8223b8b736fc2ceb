"""The house stands as it was designed: who may import whom, and how long files, functions and signatures may be."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import spoofgym

PACKAGE = Path(spoofgym.__file__).parent
ROOMS = (
    *("geodesy", "mechanization", "timeline", "trajectory", "truth", "guidance", "sensors", "navigation", "attacks"),
    *("detectors", "responses", "scenario", "clean_starts", "fitting", "simulation", "logs", "scenarios"),
    *("calibration", "optimum", "policies", "envs", "duel", "evaluation", "studies", "report", "learning"),
    *("cli", "__main__"),
)
"""In the order of docs/inside/architecture.md. What is not named is the ground floor, which knows no room."""
FILTERS = ("aids", "loose", "tight", "credible", "separation")
"""In order, too: a filter may use those before it."""
LEARNERS = ("torch", "stable_baselines3", "tensorboard")
TAKE_LEARNERS = ("learning", "envs/sb3.py")
LONGEST_FILE = 400
LONGEST_FUNCTION = 60
MOST_KERNEL_PARAMETERS = 8
LONG_FUNCTIONS: dict[str, str] = {}
"""Functions that may be longer, each with the reason."""


@cache
def sources() -> dict[str, ast.Module]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def imported(tree: ast.Module) -> Iterator[str]:
    """The modules that a module imports, those within functions and for types alone included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in sources() else str(node.module)


def room(module: str) -> str:
    """The room of a module, or the module of the ground floor itself; empty for the package."""
    return module.partition(".")[2].partition(".")[0]


def place(module: str) -> int:
    """How far down a module stands; 0 is the ground floor."""
    return ROOMS.index(room(module)) + 1 if room(module) in ROOMS else 0


def test_every_room_is_there() -> None:
    rooms = {room(module) for module in sources()}
    assert set(ROOMS) - rooms == set()
    folders = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    assert folders - set(ROOMS) == {"kernels", "validation"} & folders, "a new folder needs its place in the order"


def test_imports_run_one_way() -> None:
    """A module imports its own room, what stands above it, and the ground floor."""
    backwards = [
        f"{module} imports {other}"
        for module, tree in sources().items()
        for other in imported(tree)
        if other in sources() and place(other) > place(module) and module != "spoofgym"
    ]
    assert backwards == []


def test_filters_import_those_before_them() -> None:
    def filter_of(module: str) -> int:
        parts = module.split(".")
        return FILTERS.index(parts[2]) + 1 if len(parts) > 2 and parts[2] in FILTERS else 0

    backwards = [
        f"{module} imports {other}"
        for module, tree in sources().items()
        for other in imported(tree)
        if room(module) == room(other) == "navigation" and filter_of(other) > filter_of(module)
    ]
    assert backwards == []


def test_no_circle_of_modules() -> None:
    graph = {
        module: {other for other in imported(tree) if other in sources() and other not in (module, "spoofgym")}
        for module, tree in sources().items()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def test_only_learners_import_torch() -> None:
    takers = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if any(name.partition(".")[0] in LEARNERS for name in imported(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert [name for name in takers if not name.startswith(TAKE_LEARNERS)] == []
    users = {
        room(module)
        for module, tree in sources().items()
        if any(other.startswith("spoofgym.learning") for other in imported(tree))
    }
    assert users <= {"learning", "cli"}


def test_files_are_short() -> None:
    """Those of tests and programs, too."""
    root = PACKAGE.parent
    files = [path for room in ("spoofgym", "tests", "train", "benchmarks") for path in (root / room).rglob("*.py")]
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {str(path.relative_to(root)): n for path, n in lengths.items() if n > LONGEST_FILE} == {}


def functions() -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for module, tree in sources().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield f"{module}.{node.name}", node


def test_functions_fit_on_a_screen() -> None:
    """Docstrings do not count: they are the documentation."""
    long = {}
    for name, node in functions():
        body = node.body[1:] if ast.get_docstring(node) else node.body
        length = body[-1].end_lineno - body[0].lineno + 1 if body else 0
        if length > LONGEST_FUNCTION:
            long[name] = length
    assert {name: length for name, length in long.items() if name not in LONG_FUNCTIONS} == {}
    assert set(LONG_FUNCTIONS) <= set(long), "an exception that is needed no more"


def test_kernels_have_few_parameters() -> None:
    def compiled(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
        return any("njit" in ast.unparse(decorator) for decorator in node.decorator_list)

    wide = {
        name: len(node.args.args)
        for name, node in functions()
        if compiled(node) and len(node.args.args) > MOST_KERNEL_PARAMETERS
    }
    assert wide == {}
