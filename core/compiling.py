"""Compiled kernels and their cache.

numba keeps a kernel until the file of its outermost function changes, and does not notice changes in the files of
what that calls: after an update an old kernel would run, or fail to load. Here a kernel's entry is named by the content
of all it is made from: its own code, that of every function it calls, their constants, how they are compiled, numba's
version, the kinds of its arguments and the processor. An edit elsewhere, a comment or another checkout compiles
nothing anew. Only kernels of this package are kept so: nothing of numba's own settings is touched.

A bundle or a wheel may bring kernels along, compiled for a level of processors that nearly all reach
(`packaging/kernels.py`). They bear the same names: what does not fit versions or sources is not found, and compiled.

`njit` compiles what Python calls. What only kernels call is marked `inner`: without wrappers through which Python could
call it, and in one version for constants and variables alike, it costs a third less to compile.

numba offers no public way to name entries or to load them quicker. Its private parts are asked for where they are used;
where another version has them no more, kernels run all the same and are compiled by every process.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import sys
import time
from collections.abc import Iterator, Mapping
from functools import cache, cached_property, partial
from io import BytesIO
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from llvmlite.binding import add_symbol, parse_assembly, parse_bitcode
from numba import types
from numba.extending import is_jitted, register_jitable

from core.atomic import atomic_write
from core.progress import announce

__all__ = ["inner", "kinds_of_arguments", "njit"]

_KEPT_DAYS, _KEPT_BYTES = 60, 256_000_000
_BROUGHT = Path(__file__).parent / "kernels"
_LEVEL, _LEVEL_HAS = "x86-64-v3", {"+avx2", "+bmi", "+bmi2", "+f16c", "+fma", "+lzcnt", "+movbe"}
_FOREIGN = {"numba", "numpy", "llvmlite", "math", "builtins"}  # signed by numba's version


def njit(function: Any = None, *, cache: bool = False, **how: Any) -> Any:
    """`numba.njit`, whose cache holds what belongs to the present sources and nothing else."""
    if function is None:
        return partial(njit, cache=cache, **how)
    compiled: Any = numba.njit  # its types know no wrappers to be left out
    kernel = compiled(function, no_cfunc_wrapper=True, **how)
    if cache and is_jitted(kernel):  # not where numba is told to compile nothing
        vars(kernel)["_cache"] = _KernelCache(kernel)
    return kernel


def inner(function: Any = None, **how: Any) -> Any:
    """`numba.extending.register_jitable`; how it is compiled is part of what it is."""
    if function is None:
        return partial(inner, **how)
    function.__compiled__ = how
    return register_jitable(**how)(function) if how else register_jitable(function)


class _KernelCache:
    """The compiled versions of one kernel, a file each; numba asks it for them."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    @cached_property
    def _made_from(self) -> str:
        """The content of the kernel; asked for when it is called, when all that it calls is there."""
        return content(self._kernel)

    @property
    def cache_path(self) -> str | None:
        return str(kernel_folder() or "") or None

    def flush(self) -> None: ...

    def _name(self, signature: Any, processor: tuple[str, ...]) -> str:
        made_for = repr((list(_described(signature)), processor))
        name = hashlib.sha256(f"{self._made_from} {made_for}".encode()).hexdigest()[:24]
        return f"{self._kernel.py_func.__module__}.{self._kernel.py_func.__name__}-{name}.kernel"

    def _kept(self, signature: Any, processor: tuple[str, str, str]) -> bytes:
        """Read what this user's processor compiled, else what was brought along."""
        system, _, features = processor
        if (folder := kernel_folder()) is not None:
            own = folder / self._name(signature, processor)
            if own.exists():
                if time.time() - own.stat().st_mtime > 86400:
                    os.utime(own)  # what is in use stays
                return own.read_bytes()
        if not set(features.split(",")) >= _LEVEL_HAS:
            raise FileNotFoundError
        return (_BROUGHT / self._name(signature, (system, _LEVEL, ""))).read_bytes()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            kept = self._kept(sig, target_context.codegen().magic_tuple())
            _offer_runtime()
            return _loaded(target_context, *_Entry(BytesIO(kept)).load())
        except Exception:  # absent, cut off, or written by something else: compiled anew
            target_context.refresh()
        announce("compiling for this processor, once")
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            from numba.core.serialize import dumps

            folder, library = kernel_folder(), data.library
            if folder is None or library.has_dynamic_globals or any(not part.can_cache for part in data.lifted):
                return
            _sweep(folder)
            with atomic_write(folder / self._name(sig, data.codegen.magic_tuple()), durable=False) as file:
                # the seventh part is a listing that tells the path of the source and addresses in memory; none reads it
                file.write(dumps((*(parts := data._reduce())[:6], "", *parts[7:])))
        except Exception:  # a full disk, or another numba, takes nothing from the result
            pass


class _Entry(pickle.Unpickler):
    """What was kept, without the modules of numba it was compiled from: they are its compiler's, and long to import."""

    def find_class(self, module: str, name: str) -> Any:
        return _rebuild_env if name == _rebuild_env.__name__ else super().find_class(module, name)


def kinds_of_arguments(kernel: Path) -> Any:
    """Say what a kept kernel was compiled for, as its dispatcher's `compile` takes it."""
    return _Entry(BytesIO(kernel.read_bytes())).load()[3].args


def _loaded(target_context: Any, library: Any, function: Any, *rest: Any) -> Any:
    """Make a kernel of what was kept, without the bitcode for those that would be linked with it.

    Parsing that takes longer than all the rest, and only a kernel that is compiled and calls this one asks for it.
    """
    from numba.core.compiler import CompileResult

    name, kind, (code, bitcode) = library
    target_context.codegen()._engine._defined_symbols |= {function.llvm_func_name, function.llvm_cpython_wrapper_name}
    without = name, kind, (code, parse_assembly("").as_bitcode())
    found = CompileResult._rebuild(target_context, without, function, *rest)
    assert callable(found.library._get_module_for_linking)
    found.library._get_module_for_linking = cache(lambda: parse_bitcode(bitcode))
    return found


def _rebuild_env(module: str, constants: list[Any], name: str) -> Any:
    """Do what numba's function of this name does; compiled code asks for the constants, not for the module."""
    from numba.core import environment

    if module in sys.modules or not module.startswith("numba."):
        return environment._rebuild_env(module, constants, name)
    if (found := environment.lookup_environment(name)) is None:
        environment.Environment._memo[name] = found = environment.Environment({"__name__": module})
        found.consts[:], found.env_name = constants, name
    return found


@cache
def _offer_runtime() -> None:
    """Name to LLVM what compiled code asks of numba's runtime.

    numba itself loads a kernel only when the whole compiler is ready to work, which takes half a second.
    """
    from numba.core.runtime import nrt

    for name, address in nrt._nrt.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def content(kernel: Any) -> str:
    """Sign all that a kernel is made from."""
    seen: dict[int, Any] = {}
    parts = [numba.__version__, *np.__version__.split(".")[:2], str(sys.version_info[:2]), *_parts(kernel, seen)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _parts(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """Say what a function or a constant is, and all that a function refers to; never by address or place."""
    if id(value) in seen:
        return
    if is_jitted(value):
        yield _ordered(value.targetoptions)
        value = value.py_func
    value = getattr(value, "_defn", value)  # an intrinsic
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
    elif isinstance(value, int | float | complex | str | bytes | np.generic | types.Type | None):
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


def _described(kind: Any) -> Iterator[str]:
    """Say the kinds of the arguments with the names of their fields, which numba's own words leave out."""
    parts = kind if isinstance(kind, tuple) else getattr(kind, "types", ())
    yield f"{kind} {getattr(kind, 'fields', '')}"
    for part in parts:
        yield from _described(part)


@cache
def kernel_folder() -> Path | None:
    """The folder of compiled kernels: the user's cache, else beside the sources, else none.

    The bundle and an installed package stay as they are, and all checkouts of one user share what is the same.
    """
    asked_for = getattr(numba.config, "CACHE_DIR", "") or os.environ.get("XDG_CACHE_HOME")
    of_the_user = Path(asked_for or os.path.expanduser("~/.cache"))
    for base in (of_the_user / "stripe-workbench", Path(__file__).parent / "__pycache__"):
        folder = base / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


@cache
def _sweep(folder: Path) -> None:
    """Delete what nobody has used for long, and the oldest beyond a size; once a process, when something is added."""
    for old in (*folder.parent.glob("kernels-*"), *(Path(__file__).parent / "__pycache__").glob("kernels-*")):
        shutil.rmtree(old, ignore_errors=True)  # of earlier versions, a folder for every state of the sources
    entries = sorted(((e.stat().st_mtime, e.stat().st_size, e) for e in folder.glob("*.kernel*")), reverse=True)
    size = 0
    for used, room, entry in entries:
        size += room
        if size > _KEPT_BYTES or time.time() - used > _KEPT_DAYS * 86400:
            entry.unlink(missing_ok=True)
