"""What Python calls: arguments in a row of slots, versions of a kernel by the kinds of its arguments."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from ctypes import c_size_t
from functools import cached_property, partial
from threading import RLock
from typing import Any

import numpy as np

from core.compiling.content import content
from core.compiling.kept import compiled_by_one, find, keep, name_of
from core.compiling.native import ALIGNED, WRITEABLE, C, F, Version, load
from core.progress import announce

_BUILDING = RLock()  # numba compiles one at a time; and whoever waits finds it kept
_MATTERS = C | F | ALIGNED | WRITEABLE
_DATA = object.__basicsize__  # where numpy keeps an array's address: the first field of its C interface


def njit(function: Any = None, *, cache: bool = False, **how: Any) -> Any:
    """`numba.njit`, compiled at the first call with arguments of a kind; kept with `cache`.

    As told by NUMBA_DISABLE_JIT=1, nothing is compiled.
    """
    if function is None:
        return partial(njit, cache=cache, **how)
    return function if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0") else Kernel(function, cache, how)


class Kernel:
    """A function and its compiled versions. `py_func` and `targetoptions` are what numba calls these."""

    def __init__(self, function: Callable[..., Any], cache: bool, how: dict[str, Any]) -> None:
        self.py_func, self.targetoptions, self._cache = function, how, cache
        self.name = f"{function.__module__}.{function.__name__}"
        self.compiled = 0  # versions that were found nowhere
        self._versions: dict[tuple[Any, ...], Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Run it."""
        kinds: list[Any] = []
        slots: list[Any] = []
        _lay(arguments, kinds, slots)
        key = tuple(kinds)
        version = self._versions.get(key) or self._version(key)
        return version(slots) if isinstance(version, Version) else version(*arguments)

    def compile(self, kinds: tuple[Any, ...]) -> None:
        """Compile it for arguments of given kinds, as a kept kernel names them."""
        self._version(kinds)

    @cached_property
    def made_from(self) -> str:
        """The content of the kernel; asked for when it is called, when all that it calls is there."""
        return content(self)

    def _version(self, kinds: tuple[Any, ...]) -> Callable[..., Any]:
        with _BUILDING:
            if kinds not in self._versions:
                self._versions[kinds] = self._kept(kinds) if self._cache else self._built(kinds)
            return self._versions[kinds]

    def _kept(self, kinds: tuple[Any, ...]) -> Callable[..., Any]:
        name = name_of(self.name, self.made_from, kinds)
        with suppress(Exception):  # absent, cut off, or written by something else
            return load(find(name))
        announce("compiling for this processor, once")
        with compiled_by_one(name):
            with suppress(Exception):  # another process was about it
                return load(find(name))
            return self._built(kinds)

    def _built(self, kinds: tuple[Any, ...]) -> Callable[..., Any]:
        from core.compiling.build import build, plain

        self.compiled += 1
        try:
            native = build(self, kinds)
            version = load(native)
        except (AttributeError, ImportError, LookupError):  # a numba with other private parts
            return plain(self)
        if self._cache:
            keep(name_of(self.name, self.made_from, kinds), native)
        return version


def _lay(arguments: tuple[Any, ...], kinds: list[Any], slots: list[Any]) -> None:
    """Append the kinds of arguments, and what compiled code is given of each: 5 slots and 2 an axis of an array."""
    for value in arguments:
        kind = type(value)
        if kind is int or kind is float or kind is bool:
            kinds.append(kind)
            slots.append(value)
        elif isinstance(value, np.ndarray):
            flags, element = value.flags.num & _MATTERS, value.dtype
            kinds.append((element, value.ndim, flags & ~F if flags & C else flags))
            # numpy's `ctypes.data` says the same after five times as long
            address = c_size_t.from_address(id(value) + _DATA).value
            slots += (0, 0, value.size, element.itemsize, address, *value.shape, *value.strides)
        elif isinstance(value, tuple):
            within: list[Any] = [kind]
            _lay(value, within, slots)
            kinds.append(tuple(within))
        elif isinstance(value, np.generic):
            kinds.append(value.dtype)
            slots.append(value.item())
        else:
            raise TypeError(f"a kernel takes numbers, arrays and tuples, not {kind.__name__}")
