"""numba, for what is not kept: object code of a kernel, and an entry by which it is called with one address.

numba offers no public way to the object code; its private parts are asked for in `build` and below. Where another
version has them no more, kernels run all the same and are compiled by every process.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numba
from llvmlite import binding, ir
from numba import types
from numba.extending import intrinsic as numbas_intrinsic
from numba.extending import register_jitable, typeof_impl

from core.compiling.content import intrinsic, marked
from core.compiling.native import ALIGNED, RETURNED, WRITEABLE, C, F, Native, machine

if TYPE_CHECKING:
    from core.compiling.kernel import Kernel

_SLOT = ir.IntType(64)


def plain(kernel: Kernel) -> Any:
    """Give numba's own."""
    _introduce(kernel)
    return numba.njit(kernel.py_func, **kernel.targetoptions)


def _introduce(kernel: Kernel) -> None:
    """Tell numba of functions that were marked since, and what it shall see in a kernel that another one calls."""
    typeof_impl.register(type(kernel), _of_kernel)
    while marked:
        function = marked.pop(0)
        how = function.__compiled__
        (register_jitable(**how) if how else register_jitable)(function)


@cache
def _dispatcher(kernel: Kernel) -> Any:
    """numba's, without wrappers through which Python would call it."""
    compiled: Any = numba.njit  # its types know no wrappers to be left out
    return compiled(kernel.py_func, no_cpython_wrapper=True, no_cfunc_wrapper=True, **kernel.targetoptions)


def _of_kernel(kernel: Kernel, context: Any) -> Any:
    return types.Dispatcher(_dispatcher(kernel))


@typeof_impl.register(intrinsic)
def _of_intrinsic(value: intrinsic, context: Any) -> Any:
    from numba.core.registry import cpu_target

    written = _written(value)
    cpu_target.typing_context.refresh()
    return cpu_target.typing_context.resolve_value_type(written)


@cache
def _written(value: intrinsic) -> Any:
    return numbas_intrinsic(value.definition)


def build(kernel: Kernel, kinds: tuple[Any, ...]) -> Native:
    """Compile a kernel for arguments of some kinds."""
    from numba.core.registry import cpu_target

    _introduce(kernel)
    signature = tuple(map(_type, kinds))
    dispatcher = _dispatcher(kernel)
    dispatcher.compile(signature)
    made = dispatcher.overloads[signature]
    code, entry = made.library._final_module, f"{made.fndesc.llvm_func_name}.slots"
    needs = {f.name for f in code.functions if f.is_declaration and not f.name.startswith("llvm.")}
    context = cpu_target.target_context
    arguments, opened = _entry(context.call_conv, made.fndesc, entry)
    kind = made.signature.return_type
    several = isinstance(kind, types.BaseTuple)
    returned = tuple(map(_format, kind if several else () if kind == types.none else (kind,)))
    pieces = context.codegen()._tm.emit_object(code), opened
    return Native(kinds, arguments, (returned, several), entry, tuple(sorted(needs)), pieces)


def _type(kind: Any) -> Any:
    """Give numba's type of a kind of argument."""
    from numba.np.numpy_support import from_dtype

    if isinstance(kind, type):
        return {int: types.intp, float: types.float64, bool: types.boolean}[kind]
    if not isinstance(kind, tuple):
        return from_dtype(kind)
    if not isinstance(kind[0], type):
        element, axes, flags = kind
        layout: Any = "C" if flags & C else "F" if flags & F else "A"
        readonly, aligned = not flags & WRITEABLE, bool(flags & ALIGNED)
        return types.Array(from_dtype(element), axes, layout, readonly=readonly, aligned=aligned)
    fields = [_type(item) for item in kind[1:]]
    return types.BaseTuple.from_types(fields, kind[0] if hasattr(kind[0], "_fields") else None)


def _format(kind: Any) -> str:
    """Tell how a returned number lies in its slot."""
    return "?7x" if kind == types.boolean else "d" if isinstance(kind, types.Float) else "q"


def _entry(convention: Any, function: Any, name: str) -> tuple[str, bytes]:
    """Compile what takes the address of the slots; give it after the format of the arguments."""
    kind = convention.get_function_type(function.restype, function.argtypes)
    place, _, *given = kind.args
    values = _values(place.pointee)
    module = ir.Module()
    module.triple = binding.get_process_triple()
    called = ir.Function(module, kind, function.llvm_func_name)
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [_SLOT.as_pointer()]), name)
    build = ir.IRBuilder(entry.append_basic_block())
    formats = ""

    def slot(k: int) -> Any:
        return build.gep(entry.args[0], [_SLOT(k)])

    arguments = []
    for k, wanted in enumerate(given, RETURNED + len(values)):
        loaded = build.load(slot(k))
        if isinstance(wanted, ir.PointerType):
            arguments.append(build.inttoptr(loaded, wanted))
        elif isinstance(wanted, ir.IntType):
            arguments.append(loaded if wanted == _SLOT else build.trunc(loaded, wanted))
        else:
            double = build.bitcast(loaded, ir.DoubleType())
            arguments.append(double if wanted == ir.DoubleType() else build.fptrunc(double, wanted))
        formats += "d" if isinstance(wanted, ir.DoubleType | ir.FloatType) else "q"
    returned = build.alloca(place.pointee)
    state = build.call(called, [returned, build.bitcast(slot(1), kind.args[1]), *arguments])
    build.store(build.sext(state, _SLOT), slot(0))
    for k, value in enumerate(values):
        whole = build.load(returned)
        part = build.extract_value(whole, k) if isinstance(place.pointee, ir.Aggregate) else whole
        _store(build, part, value, slot(RETURNED + k))
    build.ret_void()
    return formats, machine().emit_object(binding.parse_assembly(str(module)))


def _values(returned: Any) -> list[Any]:
    """Give the types of the numbers that are returned; none for what stands for nothing."""
    if isinstance(returned, ir.PointerType):
        return []
    return list(returned.elements) if isinstance(returned, ir.Aggregate) else [returned]


def _store(build: Any, part: Any, kind: Any, slot: Any) -> None:
    """Store a number as 8 bytes."""
    if isinstance(kind, ir.IntType):
        part = part if kind == _SLOT else build.zext(part, _SLOT) if kind.width <= 8 else build.sext(part, _SLOT)
    else:
        part = build.bitcast(part if kind == ir.DoubleType() else build.fpext(part, ir.DoubleType()), _SLOT)
    build.store(part, slot)
