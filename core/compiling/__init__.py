"""Compiled kernels, kept between processes; numba is imported only to compile one.

`njit` compiles what Python calls, `inner` marks what only kernels call, `intrinsic` what writes machine code itself.
A kernel takes numbers, arrays and (named) tuples of them, by position; it fills arrays that it is given, and returns
nothing, a number or a tuple of numbers.

    kernel.py   what Python calls: arguments in a row of slots, versions by their kinds
    content.py  what a kernel is made from, as a hash
    kept.py     the folders of compiled kernels
    native.py   kept machine code, loaded and called by llvmlite alone
    build.py    numba, for what is not kept
"""

from core.compiling.content import inner, intrinsic
from core.compiling.kernel import njit

__all__ = ["inner", "intrinsic", "njit"]
