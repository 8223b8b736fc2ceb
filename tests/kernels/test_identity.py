import importlib
import pkgutil
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import spoofgym
from spoofgym.kernels.identity import identity, variant
from spoofgym.kernels.storage import KernelStorage

FAR = """
import spoofgym.far as far_module

HEIGHT = 2.0
TABLE = np.array([1.0, 2.0])
ROWS = slice(0, 2)

@njit(error_model="numpy")
def far(x, power=2):
    return HEIGHT * x**power + TABLE[ROWS].sum()
"""
NEAR = """
OFFSET = 1

@njit(nogil=True)
def near(x):
    def shifted(y):
        return y + OFFSET
    return shifted(far(x)) + far_module.HEIGHT if x > 0 else near(-x)
"""


@pytest.fixture
def house(monkeypatch):
    """Builds the kernel ``near`` of one file, which uses the kernel and constants of another; each text may differ."""

    def build(change=("", ""), file="spoofgym/far.py"):
        far = ModuleType("spoofgym.far")
        monkeypatch.setitem(sys.modules, "spoofgym.far", far)
        vars(far).update(njit=numba.njit, np=np)
        exec(compile(FAR.replace(*change), file, "exec"), vars(far))
        near = {"njit": numba.njit, "far": far.far, "far_module": far, "__name__": "spoofgym.near"}
        exec(compile(NEAR.replace(*change), "near.py", "exec"), near)
        return near["near"]

    return build


@pytest.mark.parametrize(
    "change",
    [
        ("HEIGHT = 2.0", "HEIGHT = 2.5"),
        ("HEIGHT = 2.0", "HEIGHT = 2"),
        ("[1.0, 2.0]", "[1.0, 2.5]"),
        ("slice(0, 2)", "slice(0, 1)"),
        ("power=2", "power=3"),
        ("HEIGHT * x", "HEIGHT / x"),
        ('error_model="numpy"', 'error_model="python"'),
        ("OFFSET = 1", "OFFSET = 2"),
        ("y + OFFSET", "y - OFFSET"),
        ("near(-x)", "near(-2 * x)"),
    ],
)
def test_whatever_is_compiled_into_a_kernel_changes_its_identity(house, change):
    assert identity(house(change)) != identity(house())


@pytest.mark.parametrize(
    "change",
    [("HEIGHT = 2.0", "HEIGHT = 2.00  # m"), ("OFFSET = 1", "\n\nOTHER, OFFSET = [5], 1"), ("\n\n@", "\n\n\n@")],
)
def test_what_is_not_compiled_does_not(house, change):
    assert identity(house(change)) == identity(house())
    assert identity(house(file="elsewhere.py")) == identity(house())


def test_a_function_that_moves_to_another_module_changes_it(house, monkeypatch):
    """Compiled code imports the modules of the functions that it was made of."""
    here, there = house(), house()
    monkeypatch.setattr(there.py_func.__globals__["far"].py_func, "__module__", "spoofgym.moved")
    assert identity(there) != identity(here)


def test_a_named_tuple_that_moves_to_another_module_changes_the_variant():
    def signature(module):
        class Point(NamedTuple):
            x: float

        Point.__module__ = module
        return (numba.typeof((Point(1.0),)),)

    assert variant(signature("spoofgym.here"), "cpu") != variant(signature("spoofgym.there"), "cpu")


def test_a_global_without_a_digest_is_refused_by_name(house):
    with pytest.raises(TypeError, match=r"^near: .* uses a global of type list cannot be kept on disk"):
        identity(house(("OFFSET = 1", "OFFSET = [1]")))


def test_named_tuples_differ_by_their_fields():
    def signature(*names):
        point = NamedTuple("Point", [(name, float) for name in names])
        return (numba.typeof((point(1.0, 2.0),)),)

    assert variant(signature("x", "y"), "cpu") == variant(signature("x", "y"), "cpu")
    assert variant(signature("x", "y"), "cpu") != variant(signature("y", "x"), "cpu")
    assert variant(signature("x", "y"), "cpu") != variant(signature("x", "y"), "other cpu")


def test_every_kernel_of_the_package_is_kept_by_its_identity():
    modules = [each.name for each in pkgutil.walk_packages(spoofgym.__path__, "spoofgym.")]
    kernels = {
        value
        for name in modules
        for value in vars(importlib.import_module(name)).values()
        if isinstance(value, Dispatcher)
    }
    assert len(kernels) > 100
    assert all(isinstance(kernel._cache, KernelStorage) for kernel in kernels)
    assert len({identity(kernel) for kernel in kernels}) > 100


def test_no_file_takes_the_decorators_of_numba():
    package = Path(spoofgym.__file__).parent
    taken = re.compile(
        r"from numba import .*\b(jit|njit|vectorize|guvectorize|stencil|cfunc)\b|numba\.(jit|njit|vectorize)\("
    )
    files = {path for path in package.rglob("*.py") if taken.search(path.read_text(encoding="utf-8"))}
    assert files == {package / "kernels" / "__init__.py"}
