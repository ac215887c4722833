"""Machine code, loaded and called without numba, whose import takes longer than most commands work.

A version of a kernel is two pieces of object code: what numba compiled, and an entry that takes one address. There lie,
8 bytes each, the state, the place of an exception, what is returned, and the arguments (`kernel.py`). Compiled code
asks numba's runtime for memory; that is an extension module of its own.
"""

from __future__ import annotations

import ctypes
import os
import struct
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any, NamedTuple

from llvmlite import binding

C, F, ALIGNED, WRITEABLE = 0x1, 0x2, 0x100, 0x400  # numpy's flags of an array
RETURNED = 2  # slots before what is returned


class Native(NamedTuple):
    """A compiled version of a kernel.

    `kinds` of its arguments; `arguments`, the formats of their slots ("q" whole numbers and addresses, "d" others);
    `returned`, the format of each number that is returned, and whether they are a tuple; the name of the `entry`, and
    those that it `needs` from elsewhere; both pieces of object `code`.
    """

    kinds: tuple[Any, ...]
    arguments: str
    returned: tuple[tuple[str, ...], bool]
    entry: str
    needs: tuple[str, ...]
    code: tuple[bytes, bytes]


class Version:
    """What runs a kernel with arguments of certain kinds."""

    def __init__(self, native: Native, address: int) -> None:
        self._run = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)  # releases the interpreter lock
        values, self._several = native.returned
        self._values = struct.Struct(f"={''.join(values)}")
        self._format = struct.Struct(f"={native.arguments}")
        self._at = 8 * (RETURNED + len(values))
        self._room = ctypes.c_int64 * (RETURNED + len(values) + len(native.arguments))
        self._name = native.entry

    def __call__(self, slots: Sequence[Any]) -> Any:
        """Run it; MemoryError where it found no memory: kernels raise nothing else."""
        room = self._room()
        self._format.pack_into(room, self._at, *slots)
        self._run(room)
        if room[0]:
            raise MemoryError(f"{self._name} ended with {room[0]}")
        if not self._values.size:
            return None
        values = self._values.unpack_from(room, 8 * RETURNED)
        return values if self._several else values[0]


def load(native: Native) -> Version:
    """Make what was compiled run; LookupError where something that it needs is not there."""
    engine = _engine()  # with it all symbols of this process are known
    if missing := [name for name in native.needs if not binding.address_of_symbol(name)]:
        raise LookupError(f"{native.entry} needs {missing}")
    for code in native.code:
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return Version(native, engine.get_function_address(native.entry))


@cache
def processor() -> tuple[str, str, str]:
    """Name the system, the processor and its features; as numba is told by NUMBA_CPU_NAME and NUMBA_CPU_FEATURES."""
    name, features = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    if features is None:
        features = "" if name else binding.get_host_cpu_features().flatten()
    return binding.get_process_triple(), name or binding.get_host_cpu_name(), features


@cache
def machine() -> Any:
    """What object code is made and loaded for."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_triple(binding.get_process_triple()).create_target_machine(codemodel="jitdefault")


@cache
def _engine() -> Any:
    _offer_runtime()
    return binding.create_mcjit_compiler(binding.parse_assembly(""), machine())


def numbas(name: str) -> Any:
    """Import a module of numba without the rest of it, where its file is found; ImportError where there is no numba."""
    package = find_spec("numba")
    *folder, _ = name.split(".")
    places = [os.path.join(place, *folder) for place in (package and package.submodule_search_locations) or ()]
    spec = PathFinder.find_spec(f"numba.{name}", places)
    if spec is None or spec.loader is None:
        return import_module(f"numba.{name}")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def _offer_runtime() -> None:
    """Name to LLVM what compiled code asks of numba's runtime."""
    for module, prefix in (("core.runtime._nrt_python", "NRT_"), ("_helperlib", "numba_")):
        for name, address in numbas(module).c_helpers.items():
            binding.add_symbol(name if name.startswith("_") else prefix + name, address)
