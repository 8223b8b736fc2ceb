"""What compiled code is made of, as one digest: equal digests, equal code.

numba compiles into a kernel its own code and, as constants, the globals that it names: numbers, arrays and other
kernels, with what these name in turn. All of it is read from memory and not from files, so it does not matter whether a
file has been changed since the program began. The name of each function's module counts: compiled code imports the
modules of the functions it was made of, so it is lost when one of them moves.
"""

from __future__ import annotations

import dis
import functools
import hashlib
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import types
from numba.core.dispatcher import Dispatcher

PACKAGE = __name__.partition(".")[0]
LENGTH = 16
"""Digits of a digest: 64 bits."""


def identity(kernel: Dispatcher) -> str:
    """Digest of all that decides the compiled code of a kernel, except its signature and the processor.

    Raises:
        TypeError: the kernel names a global of a kind that has no digest.
    """
    return digest(_kernel(kernel, ()))


def variant(signature: Any, processor: Any) -> str:
    """Digest of the types of a kernel's arguments and of the processor that its code is for."""
    return digest((str(signature), [_fields(each) for each in signature], processor))


def digest(content: object) -> str:
    """Digest of nested tuples and lists of numbers and text."""
    return hashlib.sha256(repr(content).encode()).hexdigest()[:LENGTH]


def _fields(argument: Any) -> object:
    """Where a named tuple is defined, and its fields, with those within: numba's name of the type leaves them out."""
    members: Any = argument if isinstance(argument, types.BaseTuple) else ()
    defined: Any = getattr(argument, "instance_class", None)
    place = None if defined is None else (defined.__module__, defined.__qualname__)
    return (place, getattr(argument, "fields", None), [_fields(each) for each in members])


def _kernel(kernel: Dispatcher, callers: tuple[object, ...]) -> object:
    options = sorted((name, repr(value)) for name, value in kernel.targetoptions.items())
    return (options, repr(kernel.locals), _function(kernel.py_func, callers))


def _function(function: Any, callers: tuple[object, ...]) -> object:
    """Its code and what that names; one of its own callers is told by its place among them."""
    if function in callers:
        return ("caller", callers.index(function))
    callers = (*callers, function)
    code = function.__code__
    named = [(name, function.__globals__[name]) for name in _globals(code) if name in function.__globals__]
    closed = zip(code.co_freevars, (cell.cell_contents for cell in function.__closure__ or ()), strict=True)
    return (
        function.__module__,
        _code(code),
        _value(function.__defaults__, code, callers),
        [(name, _value(value, code, callers)) for name, value in [*named, *closed]],
    )


def _value(value: object, code: CodeType, callers: tuple[object, ...]) -> object:
    """A constant as text, a function of this package by what it is made of, others by name; ``code`` names it."""
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | slice | range):
        return repr(value)
    if isinstance(value, tuple):
        return [_value(each, code, callers) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        return (type(value).__name__, array.dtype.str, array.shape, array.tobytes().hex())
    if isinstance(value, Dispatcher):
        return _kernel(value, callers)
    if isinstance(value, ModuleType):
        return (value.__name__, _attributes(value, code, callers))
    if isinstance(value, type):
        return (value.__module__, value.__qualname__, getattr(value, "_fields", None))
    if isinstance(value, FunctionType) and _ours(str(value.__module__)):
        return _function(value, callers)
    if callable(value) and not _ours(str(value.__module__)):
        return (value.__module__, getattr(value, "__name__", repr(value)))
    kind = type(value).__name__
    raise TypeError(f"{code.co_name}: the code of a kernel that uses a global of type {kind} cannot be kept on disk")


def _ours(module: str) -> bool:
    return module.partition(".")[0] == PACKAGE


def _attributes(module: ModuleType, code: CodeType, callers: tuple[object, ...]) -> object:
    """What a code may take from a module of this package: the attributes that have a name in it."""
    if module in callers or not _ours(module.__name__):
        return None
    names = sorted(name for name in code.co_names if hasattr(module, name))
    return [(name, _value(getattr(module, name), code, (*callers, module))) for name in names]


@functools.cache
def _globals(code: CodeType) -> tuple[str, ...]:
    """Names of the globals that a code loads, and the codes within it."""
    return tuple(sorted(set(_loaded(code))))


def _loaded(code: CodeType) -> Iterator[str]:
    yield from (str(each.argval) for each in dis.get_instructions(code) if "GLOBAL" in each.opname)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _loaded(constant)


def _code(code: CodeType) -> object:
    """A code without what tells where it stands: its file and the numbers of its lines."""
    constants = [_code(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars)
    return (code.co_name, counts, names, code.co_code.hex(), getattr(code, "co_exceptiontable", b"").hex(), constants)
