"""Least squares matching of windows in the images of two cameras, compiled.

The surface in a window is ``q(x, y) = q0 + Σ p φ(x, y)``, an inverse depth along the rays of the one camera with the
six terms of a parabola. It says where the other camera sees every pixel of the window, along its epipolar line; gain
and offset of its grey values are the two other unknowns (Grün and Baltsavias 1988, geometrically constrained matching).
The other image is read between pixels by Keys' cubic convolution, doi:10.1109/TASSP.1981.1163711.
"""

from __future__ import annotations

import numpy as np

from core.compiling import inner, njit
from core.numerics.small import solve_in_place

# q, its variance, that in px, what was explained, misfit (grey values²), grey, px from the seed, rival, two bends
FOUND = 10
REACH_PX = 3.0  # from the seed along the epipolar line
RIVALS_PX = 6.0  # as far as another place that looks alike is looked for
SEARCH_PX = 0.5
APART_PX = 1.5  # places closer than this are the same one
SAME_PX = 2.0  # points of the window that are known and farther off belong to another surface
TERMS, UNKNOWNS = 6, 8
STEPS, SETTLED_PX = 15, 0.003
TOGETHER, MOST_LEVERAGE = 3, 0.9  # px each way whose misfits may hang together
LEAST_SHARE = 0.6  # of the window that both cameras see
SINGULAR = 1e-9  # share of a normal equation's diagonal that tells nothing any more


@inner(error_model="numpy")
def _cubic(f, weight, slope):  # type: ignore[no-untyped-def]
    """Weights of four neighbours at a fraction of a pixel, and how they change with it."""
    weight[0] = f * (-0.5 + f * (1.0 - 0.5 * f))
    weight[1] = 1.0 + f * f * (-2.5 + 1.5 * f)
    weight[2] = f * (0.5 + f * (2.0 - 1.5 * f))
    weight[3] = f * f * (-0.5 + 0.5 * f)
    slope[0] = -0.5 + f * (2.0 - 1.5 * f)
    slope[1] = f * (-5.0 + 4.5 * f)
    slope[2] = 0.5 + f * (4.0 - 4.5 * f)
    slope[3] = f * (-1.0 + 1.5 * f)


@inner(error_model="numpy")
def _place(x, y, q, turn, shift, table, grid):  # type: ignore[no-untyped-def]
    """Where the other camera sees a ray's point at inverse depth q, and how that changes with q; NaN behind it."""
    w = -1.0 / (turn[2, 0] * x + turn[2, 1] * y - turn[2, 2] + shift[2] * q)
    a = (turn[0, 0] * x + turn[0, 1] * y - turn[0, 2] + shift[0] * q) * w
    b = (turn[1, 0] * x + turn[1, 1] * y - turn[1, 2] + shift[1] * q) * w
    i, j = (a - grid[0]) * grid[2], (b - grid[1]) * grid[3]
    if not (w > 0 and i >= 0 and j >= 0 and i < table.shape[1] - 1 and j < table.shape[0] - 1):
        return np.nan, np.nan, np.nan, np.nan
    m, n = int(i), int(j)
    i, j = i - m, j - n
    da, db = (shift[0] + a * shift[2]) * w * grid[2], (shift[1] + b * shift[2]) * w * grid[3]
    u0, u1, u2, u3 = table[n, m, 0], table[n, m + 1, 0], table[n + 1, m, 0], table[n + 1, m + 1, 0]
    v0, v1, v2, v3 = table[n, m, 1], table[n, m + 1, 1], table[n + 1, m, 1], table[n + 1, m + 1, 1]
    u = (1 - j) * ((1 - i) * u0 + i * u1) + j * ((1 - i) * u2 + i * u3)
    v = (1 - j) * ((1 - i) * v0 + i * v1) + j * ((1 - i) * v2 + i * v3)
    du = ((1 - j) * (u1 - u0) + j * (u3 - u2)) * da + ((1 - i) * (u2 - u0) + i * (u3 - u1)) * db
    dv = ((1 - j) * (v1 - v0) + j * (v3 - v2)) * da + ((1 - i) * (v2 - v0) + i * (v3 - v1)) * db
    return u, v, du, dv


@inner(error_model="numpy")
def _alike(c, r, seed, more, half, own, other, rays, turn, shift, table, grid, known, same):  # type: ignore[no-untyped-def]
    """Correlation of every other pixel of a window with the other image, the seed's plane moved by `more`."""
    n, s1, s2, s11, s12, s22 = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for dy in range(-half, half + 1, 2):
        for dx in range(-half, half + 1, 2):
            i, j = r + dy, c + dx
            q = seed[0] + seed[1] * dx + seed[2] * dy
            if i < 0 or j < 0 or i >= own.shape[0] or j >= own.shape[1] or abs(known[i, j] - q) > same:
                continue
            u, v, _, _ = _place(rays[i, j, 0], rays[i, j, 1], q + more, turn, shift, table, grid)
            if not (u >= 1 and v >= 1 and u < other.shape[1] - 2 and v < other.shape[0] - 2):
                continue
            m, k = int(u), int(v)
            u, v = u - m, v - k
            one = own[i, j]
            two = (1 - v) * ((1 - u) * other[k, m] + u * other[k, m + 1]) + v * (
                (1 - u) * other[k + 1, m] + u * other[k + 1, m + 1]
            )
            if not abs(one - two) < np.inf:
                continue
            n, s1, s2, s11, s12, s22 = n + 1, s1 + one, s2 + two, s11 + one * one, s12 + one * two, s22 + two * two
    if n < LEAST_SHARE * (half + 1) ** 2:
        return np.nan
    return (n * s12 - s1 * s2) / np.sqrt(max((n * s11 - s1 * s1) * (n * s22 - s2 * s2), 1e-12))


@inner(error_model="numpy")
def _equations(  # type: ignore[no-untyped-def]
    c, r, seed, p, scale, half, own, other, rays, turn, shift, table, grid, known, N, b, work, sums, each
):
    """Normal equations of a window. `sums`: pixels, r'r, own grey values and their squares, noise shares.

    `each` (window, window, unknowns + 1) are the rows of its pixels and what remains, zero where one does not count.
    """
    N[:], b[:], sums[:], each[:] = 0.0, 0.0, 0.0, 0.0
    wu, su, wv, sv = work[0], work[1], work[2], work[3]
    for dy in range(-half, half + 1):
        for dx in range(-half, half + 1):
            i, j = r + dy, c + dx
            if i < 0 or j < 0 or i >= own.shape[0] or j >= own.shape[1]:
                continue
            x, y = dx / half, dy / half
            bend = p[0] + x * (p[1] + p[3] * x + p[4] * y) + y * (p[2] + p[5] * y)
            q = seed[0] + seed[1] * dx + seed[2] * dy + bend / scale
            if abs(known[i, j] - q) * scale > SAME_PX:
                continue
            u, v, du, dv = _place(rays[i, j, 0], rays[i, j, 1], q, turn, shift, table, grid)
            if not (u >= 1 and v >= 1 and u < other.shape[1] - 2 and v < other.shape[0] - 2):
                continue
            m, k = int(u), int(v)
            _cubic(u - m, wu, su)
            _cubic(v - k, wv, sv)
            grey, gu, gv, share, by_u, by_v = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for e in range(4):
                line, along = 0.0, 0.0
                for f in range(4):
                    value = other[k - 1 + e, m - 1 + f]
                    line += wu[f] * value
                    along += su[f] * value
                    share += (wv[e] * wu[f]) ** 2
                    by_u += (wv[e] * su[f]) ** 2
                    by_v += (sv[e] * wu[f]) ** 2
                grey += wv[e] * line
                gu += wv[e] * along
                gv += sv[e] * line
            one = own[i, j]
            rest = one - (p[6] * grey + p[7])
            if not abs(rest) < np.inf:
                continue
            slope = p[6] * (gu * du + gv * dv) / scale
            J = each[dy + half, dx + half]
            J[8] = rest
            J[0], J[1], J[2] = slope, slope * x, slope * y
            J[3], J[4], J[5], J[6], J[7] = slope * x * x, slope * x * y, slope * y * y, grey, 1.0
            for e in range(UNKNOWNS):
                b[e] += J[e] * rest
                for f in range(e + 1):
                    N[e, f] += J[e] * J[f]
            sums[0] += 1
            sums[1] += rest * rest
            sums[2] += one
            sums[3] += one * one
            sums[4] += share
            sums[5] += p[6] ** 2 * (by_u * du * du + by_v * dv * dv) / scale**2  # of noise, in slope squared
            sums[6] += slope * slope


@inner(error_model="numpy")
def _scatter(N, each, g):  # type: ignore[no-untyped-def]
    """Variances of the first unknown from the residuals: by 1 / N of white ones, and by what is left, as it lies.

    The second one is the sandwich form of White with Bartlett's kernel over `TOGETHER` pixels each way: where images
    differ by more than noise they do so at edges, which tell most, and several pixels of an edge alike. Such pixels
    draw the fit towards them; what remains is set larger by their leverage (Bell and McCaffrey 2002). N holds the
    factor of the normal equations; g is scratch.
    """
    k, size, white = g.shape[0], each.shape[0], 0.0
    for i in range(k):
        total = 1.0 if i == 0 else 0.0
        for m in range(i):
            total -= N[i, m] * g[m]
        g[i] = total / N[i, i]
        white += g[i] * g[i]
    for i in range(size):
        for j in range(size):
            row, pull, leverage = each[i, j], 0.0, 0.0
            for m in range(k):
                for e in range(m):
                    row[m] -= N[m, e] * row[e]
                row[m] /= N[m, m]
                pull += g[m] * row[m]
                leverage += row[m] * row[m]
            row[0], row[1] = pull * row[k], leverage
    total = 0.0
    for i in range(1 - TOGETHER, size):
        for j in range(1 - TOGETHER, size):
            block, leverage = 0.0, 0.0
            for y in range(max(i, 0), min(i + TOGETHER, size)):
                for x in range(max(j, 0), min(j + TOGETHER, size)):
                    block += each[y, x, 0]
                    leverage += each[y, x, 1]
            total += block * block / (1 - min(leverage, MOST_LEVERAGE))
    return white, total / TOGETHER**2


@inner(error_model="numpy")
def _density(c, r, seed, p, scale, half, rays, turn, shift, table, grid):  # type: ignore[no-untyped-def]
    """Pixels of the other image to one of the window."""
    right, down = 1 if c + half < rays.shape[1] else -1, 1 if r + half < rays.shape[0] else -1
    q = seed[0] + p[0] / scale
    by_x, by_y = half * seed[1] + p[1] / scale, half * seed[2] + p[2] / scale
    i, j = r + down * half, c + right * half
    u, v, _, _ = _place(rays[r, c, 0], rays[r, c, 1], q, turn, shift, table, grid)
    u1, v1, _, _ = _place(rays[r, j, 0], rays[r, j, 1], q + right * by_x, turn, shift, table, grid)
    u2, v2, _, _ = _place(rays[i, c, 0], rays[i, c, 1], q + down * by_y, turn, shift, table, grid)
    return abs((u1 - u) * (v2 - v) - (v1 - v) * (u2 - u)) / half**2


@njit(cache=True, nogil=True, error_model="numpy")
def match_windows(  # type: ignore[no-untyped-def]
    first, last, at, seeds, half, own, other, rays, turn, shift, table, grid, known, found
):
    """Match the windows of pixels first to last - 1.

    `at` (n, 2) columns and rows; `seeds` (n, 3), inverse depth and its change by column and row; `own`, `other` grey
    values (H, W), of which NaN is left out; `rays` (H, W, 2) of the one camera; `turn` (3, 3) and `shift` (3,), the
    other camera from it; `table` of the other camera's pixels (n, m, 2) over its directions, whose corner and cells by
    unit of direction `grid` (4,) holds; `known` (H, W) inverse depths, NaN where none; `found` (n, `FOUND`), NaN where
    nothing was matched.
    """
    N, inverse, b, p = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    work, sums = np.empty((4, 4)), np.empty(7)
    each = np.empty((2 * half + 1, 2 * half + 1, UNKNOWNS + 1))
    tries = int(2 * RIVALS_PX / SEARCH_PX) + 1
    likeness = np.empty(tries)
    for n in range(first, last):
        found[n, :] = np.nan
        c, r, seed = at[n, 0], at[n, 1], seeds[n]
        _, _, du, dv = _place(rays[r, c, 0], rays[r, c, 1], seed[0], turn, shift, table, grid)
        scale = np.sqrt(du * du + dv * dv)
        if not scale > 0:
            continue
        best, top = -1, 0.0
        for k in range(tries):
            more = (k * SEARCH_PX - RIVALS_PX) / scale
            likeness[k] = _alike(
                c, r, seed, more, half, own, other, rays, turn, shift, table, grid, known, SAME_PX / scale
            )
            if abs(k * SEARCH_PX - RIVALS_PX) <= REACH_PX and likeness[k] > top:
                best, top = k, likeness[k]
        if best < 0:
            continue
        rival = 0.0
        for k in range(tries):
            if abs(k - best) * SEARCH_PX > APART_PX and likeness[k] > rival:
                rival = likeness[k]
        p[:] = 0.0
        p[0], p[6] = best * SEARCH_PX - RIVALS_PX, 1.0
        settled = False
        for step in range(STEPS):
            _equations(
                c, r, seed, p, scale, half, own, other, rays, turn, shift, table, grid, known, N, b, work, sums, each
            )
            if sums[0] < LEAST_SHARE * (2 * half + 1) ** 2 or not solve_in_place(N, b, SINGULAR):
                break
            for k in range(UNKNOWNS):
                p[k] += b[k]
            if step > 0 and abs(b[0]) < SETTLED_PX:
                settled = True
                break
            if abs(p[0]) > RIVALS_PX:
                break
        if not settled:
            continue
        freedom, gain = sums[0] - UNKNOWNS, p[6] ** 2
        misfit = sums[1] / freedom
        share = sums[4] / sums[0]
        noise = misfit / (1 + gain * share)  # of a pixel of either image
        density = _density(c, r, seed, p, scale, half, rays, turn, shift, table, grid)
        white, scatter = _scatter(N, each, inverse)
        # slopes of a noisy image are too steep by those of its noise
        steep = max(1 - noise * sums[5] / sums[6], 1e-3)
        variance = max(noise * (1 + gain * max(1 / density, share)) * white, scatter) / steep**2
        total = sums[3] - sums[2] ** 2 / sums[0]
        found[n, 0] = seed[0] + p[0] / scale
        found[n, 1] = variance / scale**2
        found[n, 2] = variance
        found[n, 3] = 1 - sums[1] / total
        found[n, 4] = misfit
        found[n, 5] = sums[2] / sums[0]
        found[n, 6] = abs(p[0])
        found[n, 7] = (1 - rival * rival) / max(1 - top * top, 1e-9)
        found[n, 8] = (p[3] + p[5]) / scale
        found[n, 9] = p[4] / scale
