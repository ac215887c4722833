"""Small positive definite systems, solved within kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner

ROUNDING = 1e-12  # share of a diagonal element below which elimination leaves nothing but rounding


@inner(error_model="numpy")
def solve_in_place(
    N: NDArray[np.float64], b: NDArray[np.float64], share: float = ROUNDING
) -> bool:  # pragma: no cover  compiled
    """Solve ``N x = b`` by Cholesky's method, x into b; False, with b spoilt, where N is singular.

    Only the lower triangle of N is read; its factor is left there. N is singular where elimination leaves no more than
    that `share` of a diagonal element.
    """
    n = len(b)
    for i in range(n):
        least = share * N[i, i]
        for j in range(i + 1):
            s = N[i, j]
            for k in range(j):
                s -= N[i, k] * N[j, k]
            if j < i:
                N[i, j] = s / N[j, j]
            elif s > least:
                N[i, i] = np.sqrt(s)
            else:
                return False
    for i in range(n):
        for k in range(i):
            b[i] -= N[i, k] * b[k]
        b[i] /= N[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= N[k, i] * b[k]
        b[i] /= N[i, i]
    return True
