"""Loops over pixels: sampling along rays, and weighted moments in the window of a dot; small inverses for more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit
from core.parallel import run_in_bands

jit: Callable[..., Any] = njit(cache=True, nogil=True)


@jit
def sample_rays(
    image: NDArray[np.float32],
    centre: NDArray[np.float64],
    unit: NDArray[np.float64],
    radius: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Bilinear values at centre + radius * unit into out (m, rays, k); NaN outside the image and next to a NaN."""
    height, width = image.shape
    for m in range(radius.shape[0]):
        for r in range(radius.shape[1]):
            for k in range(radius.shape[2]):
                u = centre[m, 0] + radius[m, r, k] * unit[m, r, 0]
                v = centre[m, 1] + radius[m, r, k] * unit[m, r, 1]
                if not (u >= 0 and v >= 0 and u <= width - 1 and v <= height - 1):
                    out[m, r, k] = np.nan
                    continue
                i, j = min(int(u), width - 2), min(int(v), height - 2)
                a, b = np.float32(u - i), np.float32(v - j)
                top = image[j, i] + a * (image[j, i + 1] - image[j, i])
                bottom = image[j + 1, i] + a * (image[j + 1, i + 1] - image[j + 1, i])
                out[m, r, k] = top + b * (bottom - top)


@jit
def weighted_moments(
    image: NDArray[np.float32],
    centre: NDArray[np.float64],
    inverse: NDArray[np.float64],
    taper: NDArray[np.float64],
    plane: NDArray[np.float64],
    gradient: NDArray[np.float64],
    noise: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Sums over the window of every dot with weight w = g (I - background) / light.

    Per dot: `centre` (2) px, `inverse` (2, 2) the map from pixel offsets to the unit disc, `taper` (2) the radii in
    that disc between which g falls from 1 to 0, `plane` (3) the background's value and slopes, `gradient` (2) the
    light's relative change per px, `noise` (2) the variance of a grey value as noise[0] + noise[1] (I - background).
    `out` (9): what the sums of w du and w dv lose for each px that the centre moves, and these sums; the noise's part
    in them, variances uu, uv, vv; sum of g du², g du dv, g dv², by which the background's slopes enter.
    """
    height, width = image.shape
    for k in range(centre.shape[0]):
        a, b, c, d = inverse[k, 0, 0], inverse[k, 0, 1], inverse[k, 1, 0], inverse[k, 1, 1]
        det = abs(a * d - b * c)
        # the half sides of the ellipse's bounding box follow from the rows of the inverse map's inverse
        start, stop = taper[k, 0], taper[k, 1]
        ru = stop * np.sqrt(d * d + b * b) / det
        rv = stop * np.sqrt(a * a + c * c) / det
        u0, v0 = centre[k, 0], centre[k, 1]
        s0 = s1 = s2 = q0 = q1 = q2 = a0 = a1 = a2 = 0.0
        for j in range(max(int(np.ceil(v0 - rv)), 0), min(int(np.floor(v0 + rv)), height - 1) + 1):
            dv = j - v0
            for i in range(max(int(np.ceil(u0 - ru)), 0), min(int(np.floor(u0 + ru)), width - 1) + 1):
                du = i - u0
                x, y = a * du + b * dv, c * du + d * dv
                rho = np.sqrt(x * x + y * y)
                if rho >= stop:
                    continue
                t = max((rho - start) / (stop - start), 0.0)
                g, falls = 1.0 - t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (stop - start)
                above = image[j, i] - plane[k, 0] - plane[k, 1] * du - plane[k, 2] * dv
                light = max(1.0 + gradient[k, 0] * du + gradient[k, 1] * dv, 0.1)
                w = above / light
                s0 += w * (g - 0.5 * rho * falls)
                s1 += g * w * du
                s2 += g * w * dv
                var = g * g * max(noise[k, 0] + noise[k, 1] * above, 0.0) / (light * light)
                q0 += var * du * du
                q1 += var * du * dv
                q2 += var * dv * dv
                a0 += g * du * du
                a1 += g * du * dv
                a2 += g * dv * dv
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5] = s0, s1, s2, q0, q1, q2
        out[k, 6], out[k, 7], out[k, 8] = a0, a1, a2


@inner
def inverted(N: NDArray[np.float64]) -> bool:  # pragma: no cover  compiled
    """Replace a positive definite matrix by its inverse; False where it is not one."""
    n = len(N)
    for k in range(n):
        pivot = N[k, k]
        if not pivot > 1e-300:
            return False
        N[k, k] = 1.0
        for j in range(n):
            N[k, j] /= pivot
        for i in range(n):
            if i != k:
                factor = N[i, k]
                N[i, k] = 0.0
                for j in range(n):
                    N[i, j] -= factor * N[k, j]
    return True


def in_bands(kernel: Callable[..., None], image: NDArray[np.float32], *of_dots: NDArray[Any]) -> None:
    """Call a kernel for bands of dots on threads; the arrays' first axis counts the dots."""
    run_in_bands(lambda a, b: kernel(image, *(array[a:b] for array in of_dots)), len(of_dots[0]), least=32)
