"""Centres of dots by the fit of a blurred ellipse, integrated over pixels, with their covariance.

Notes
-----
The grey value of a pixel is the mean over its square of ``B + g x + L C F(d / s)``: a background plane, and the dot's
contrast C under the light L across it, with d the distance inwards from an ellipse and F the Gaussian distribution of
the edge's blur s. Centre, shape (3), s, C, B and g are adjusted by the pixels' variances. No threshold cuts weights, so
nothing depends on where in its pixel a dot lies; a weighted centroid keeps 0.002 to 0.005 px of that at 12 px
diameter. A wrong blur or contrast is even about the centre and does not move it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit
from core.measure.centres.centroid import centroids
from core.measure.centres.defocus import EDGES, undrawn
from core.measure.centres.kernels import in_bands, inverted
from core.measure.centres.profile import Profiles
from core.measure.centres.rays import Rays
from core.model import Array
from core.numerics import inverse_2x2

UNKNOWNS = 10  # centre 2, shape 3, blur, contrast, background 3
ITERATIONS = 12
SETTLED_PX = 2e-3  # steps shrink a hundredfold from one to the next: what is left is far below that
LEAST_BLUR, MOST_BLUR = 0.12, 4.0  # px; a sharper edge is all pixel
MOST_MOVED_PX = 1.0  # from the centroid; further off it is not this dot that was fitted
LEAST_PIXELS = 30
FLOOR_PX = 0.0005  # what is left on noise-free renderings
REACH = 3.5  # sigmas of blur from the edge at which a pixel is evenly bright or dark
# Gauss's rule with three points over a pixel of width one
NODES = (-0.5 * math.sqrt(0.6), 0.0, 0.5 * math.sqrt(0.6))
SHARES = (5 / 18, 8 / 18, 5 / 18)


def ellipse_centres(
    image: NDArray[np.float32], rays: Rays, profile: Profiles, light: Array, noise: tuple[float, float]
) -> tuple[Array, Array]:
    """Centres (m, 2) and covariances (m, 2, 2), px, of fitted ellipses; arguments as of `centroids`.

    A dot that no ellipse fits keeps its centroid.
    """
    centre, cov = centroids(image, rays, profile, light, noise)
    start = np.where(np.isfinite(centre), centre, rays.centre)
    shape = np.ascontiguousarray(inverse_2x2(rays.ellipse * profile.contour[:, 0, None, None]))
    background = profile.plane[:, 0] + np.sum(profile.plane[:, 1:] * (start - rays.centre), axis=1)
    model = np.concatenate([background[:, None], profile.plane[:, 1:], profile.contrast[:, None]], axis=1)
    sharp = np.sqrt(np.maximum(profile.spread - 1 / 12, LEAST_BLUR**2))
    variance = np.broadcast_to(np.array([max(noise[0], 0.0), noise[1]]), (len(start), 2)).copy()
    reach = profile.window / profile.contour[:, 0] + 1.0 / rays.minor  # with the background around
    out = np.empty((len(start), 5))
    in_bands(_fit, image, start, shape, reach, model, sharp, np.ascontiguousarray(light), variance, out)
    out[:, :2] += light * sharp[:, None] ** 2  # the light was there before the blur
    moved = np.hypot(np.linalg.norm(out[:, :2] - start, axis=1), np.sqrt(np.abs(out[:, 2] + out[:, 4])))  # or may have
    fitted = np.isfinite(out).all(axis=1) & (moved < MOST_MOVED_PX)
    whole, keep = out[:, [2, 3, 3, 4]].reshape(-1, 2, 2) + FLOOR_PX**2 * np.eye(2), fitted[:, None]
    fits, whole = undrawn(out[:, :2], whole, profile.spread, EDGES)
    return np.where(keep, fits, centre), np.where(keep[..., None], whole, cov)


@inner
def _pixel(  # pragma: no cover  compiled
    du: float, dv: float, M: Array, s: float, light: Array, contrast: float, points: int, row: Array
) -> float:
    """Mean over one pixel at (du, dv) from the centre of the dot's brightness; its derivatives into `row` (7)."""
    for j in range(7):
        row[j] = 0.0
    a, b, c, d = M[0, 0], M[0, 1], M[1, 0], M[1, 1]
    x, y = a * du + b * dv, c * du + d * dv
    rho = math.sqrt(x * x + y * y)
    if rho > 1e-6:
        gu, gv = (a * x + c * y) / rho, (b * x + d * y) / rho
        away = (1.0 - rho) / math.sqrt(gu * gu + gv * gv)
        if away < -(REACH * s + 0.75):
            return 0.0
    bright = 1.0 + light[0] * du + light[1] * dv
    if rho <= 1e-6 or away > REACH * s + 0.75:
        row[6] = bright
        return contrast * bright
    value = 0.0
    for i in range(points):
        for j in range(points):
            pu, pv, share = du, dv, 1.0
            if points > 1:
                pu, pv, share = du + NODES[i], dv + NODES[j], SHARES[i] * SHARES[j]
            x, y = a * pu + b * pv, c * pu + d * pv
            rho = max(math.sqrt(x * x + y * y), 1e-6)
            gu, gv = (a * x + c * y) / rho, (b * x + d * y) / rho
            g = math.sqrt(gu * gu + gv * gv)
            t = (1.0 - rho) / g / s
            bright = share * (1.0 + light[0] * pu + light[1] * pv)
            inside = 0.5 * math.erfc(-t * 0.7071067811865476) * bright
            slope = contrast * bright * 0.3989422804014327 * math.exp(-0.5 * t * t) / s
            value += inside * contrast
            row[0] += slope * gu / g
            row[1] += slope * gv / g
            along = slope / (rho * g)
            row[2] -= along * x * x
            row[3] -= along * 2.0 * x * y
            row[4] -= along * y * y
            row[5] -= slope * t
            row[6] += inside
    return value


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(  # pragma: no cover  compiled
    image: NDArray[np.float32],
    centre: Array,
    shape: Array,
    reach: Array,
    model: Array,
    blur: Array,
    light: Array,
    noise: Array,
    out: Array,
) -> None:
    """Fit dots: centre (2), covariance (uu, uv, vv); else NaN."""
    height, width = image.shape
    n = UNKNOWNS
    N, b, step, J, M, old = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n), np.empty((2, 2)), np.empty((2, 2))
    for k in range(len(centre)):
        out[k, :] = np.nan
        u, v, s, contrast = centre[k, 0], centre[k, 1], blur[k], model[k, 3]
        base, slope_u, slope_v = model[k, 0], model[k, 1], model[k, 2]
        M[:] = shape[k]
        det = abs(M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0])
        # the half sides of the ellipse's bounding box follow from the rows of the map's inverse
        ru = reach[k] * math.sqrt(M[1, 1] ** 2 + M[0, 1] ** 2) / det
        rv = reach[k] * math.sqrt(M[0, 0] ** 2 + M[1, 0] ** 2) / det
        if not (ru < 1e4 and rv < 1e4 and contrast > 0.0):
            continue
        u0, v0, limit = u, v, reach[k] ** 2
        A, B, C, D = M[0, 0], M[0, 1], M[1, 0], M[1, 1]  # the window stays where it is
        first_v, last_v = max(math.ceil(v0 - rv), 0), min(math.floor(v0 + rv), height - 1)
        first_u, last_u = max(math.ceil(u0 - ru), 0), min(math.floor(u0 + ru), width - 1)
        points, good = 1, False  # the last steps integrate over pixels, the first do without
        s = math.sqrt(s * s + 1 / 12)
        for _ in range(ITERATIONS):
            N[:] = 0.0
            b[:] = 0.0
            count = 0
            for j in range(first_v, last_v + 1):
                for i in range(first_u, last_u + 1):
                    fu, fv = i - u0, j - v0
                    if (A * fu + B * fv) ** 2 + (C * fu + D * fv) ** 2 > limit:
                        continue
                    above = _pixel(i - u, j - v, M, s, light[k], contrast, points, J)
                    J[7], J[8], J[9] = 1.0, fu, fv
                    level = base + slope_u * fu + slope_v * fv + above
                    var = max(noise[k, 0] + noise[k, 1] * level, 1e-6 * contrast * contrast)
                    rest = image[j, i] - level
                    count += 1
                    even = J[5] == 0.0 and J[0] == 0.0
                    for r in range(6 if even else 0, n):
                        value = J[r] / var
                        b[r] += value * rest
                        for t in range(6 if even else 0, r + 1):
                            N[r, t] += value * J[t]
            if count < LEAST_PIXELS:
                break
            for r in range(n):
                for t in range(r):
                    N[t, r] = N[r, t]
            if not inverted(N):
                break
            for r in range(n):
                step[r] = 0.0
                for t in range(n):
                    step[r] += N[r, t] * b[t]
            most = max(abs(step[0]), abs(step[1]), abs(step[5]))
            share = 1.0 if most < 0.5 else 0.5 / most
            u, v = u + share * step[0], v + share * step[1]
            old[:] = M
            for r in range(2):
                M[0, r] += share * (step[2] * old[0, r] + step[3] * old[1, r])
                M[1, r] += share * (step[3] * old[0, r] + step[4] * old[1, r])
            s = min(max(s + share * step[5], LEAST_BLUR), MOST_BLUR)
            contrast += share * step[6]
            base, slope_u, slope_v = base + share * step[7], slope_u + share * step[8], slope_v + share * step[9]
            if not (contrast > 0.0 and abs(u - u0) < 3.0 and abs(v - v0) < 3.0):
                break
            if points == 1 and most < 0.03:
                points, s = 3, math.sqrt(max(s * s - 1 / 12, LEAST_BLUR**2))
            elif points == 3 and most < SETTLED_PX:
                good = True
                break
        if not good:
            continue
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = u, v, N[0, 0], N[0, 1], N[1, 1]
