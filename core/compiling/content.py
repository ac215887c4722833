"""What a kernel is made from, as a hash.

numba's own cache keeps a kernel until the file of its outermost function changes, and does not notice changes in the
files of what that calls: after an update an old kernel would run. Here a kernel's entry is named by the content of all
it is made from: its own code, that of every function it calls, their constants, how they are compiled, numba's version.
An edit elsewhere, a comment or another checkout compiles nothing anew.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from core.compiling.native import numbas

_FOREIGN = {"numba", "numpy", "llvmlite", "math", "builtins"}  # signed by their versions
marked: list[Any] = []  # functions of kernels, in the order of their definitions


def inner(function: Any = None, **how: Any) -> Any:
    """Mark what only kernels call: `numba.extending.register_jitable`; how it is compiled is part of what it is.

    Without wrappers through which Python could call it, and in one version for constants and variables alike, it costs
    a third less to compile than by `njit`.
    """
    if function is None:
        return partial(inner, **how)
    function.__compiled__ = how
    marked.append(function)
    return function


class intrinsic:  # noqa: N801  as numba's
    """Mark what writes a kernel's code itself: `numba.extending.intrinsic`, which is asked when one is compiled."""

    def __init__(self, definition: Callable[..., Any]) -> None:
        self.definition = definition

    def __call__(self, *arguments: Any) -> Any:
        """Never from Python; here for those who check types."""
        raise TypeError(f"{self.definition.__name__}: only kernels call it")


def content(kernel: Any) -> str:
    """Sign all that a kernel is made from."""
    seen: dict[int, Any] = {}
    parts = [
        numbas("_version").get_versions()["version"],
        *np.__version__.split(".")[:2],
        str(sys.version_info[:2]),
        *_parts(kernel, seen),
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _parts(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """Say what a function or a constant is, and all that a function refers to; never by address or place."""
    if id(value) in seen:
        return
    if hasattr(value, "targetoptions"):
        yield _ordered(value.targetoptions)
        value = value.py_func
    value = getattr(value, "definition", value)
    if isinstance(value, FunctionType):
        if value.__module__.split(".")[0] in _FOREIGN:
            yield f"{value.__module__}.{value.__qualname__}"
            return
        seen[id(value)] = value
        yield f"{value.__qualname__} {_ordered(getattr(value, '__compiled__', {}))} {value.__defaults__!r}"
        names = list(_code(value.__code__, seen))
        yield from names
        closed = zip(value.__code__.co_freevars, value.__closure__ or (), strict=True)
        known = {**value.__globals__, **{name: cell.cell_contents for name, cell in closed}}
        for name in sorted(_names(value.__code__) & known.keys()):
            yield name
            found = known[name]
            if isinstance(found, ModuleType) and found.__name__.split(".")[0] not in _FOREIGN:
                for other in sorted(_names(value.__code__) & vars(found).keys()):
                    yield from _parts(vars(found)[other], seen)
            else:
                yield from _parts(found, seen)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _parts(item, seen)
    elif isinstance(value, int | float | complex | str | bytes | np.generic | None):
        yield f"{type(value).__name__} {value!r}"
    else:
        yield getattr(value, "__qualname__", type(value).__qualname__)


def _ordered(how: Mapping[str, Any]) -> str:
    """Say how something is compiled, in one order for every process."""
    return repr(sorted((name, sorted(v) if isinstance(v, set | frozenset) else v) for name, v in how.items()))


def _code(code: CodeType, seen: dict[int, Any]) -> Iterator[str]:
    """Say what a function does, but not where it stands nor how it is explained."""
    yield f"{code.co_code!r} {code.co_names} {code.co_varnames} {code.co_freevars} {code.co_flags}"
    documented = code.co_consts[:1] if code.co_consts and isinstance(code.co_consts[0], str) else ()
    for constant in code.co_consts[len(documented) :]:
        if isinstance(constant, CodeType):
            yield from _code(constant, seen)
        else:
            yield from _parts(constant, seen)


def _names(code: CodeType) -> set[str]:
    """Give all names a function and those within it look up outside of themselves."""
    within = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return {*code.co_names, *code.co_freevars}.union(*map(_names, within))
