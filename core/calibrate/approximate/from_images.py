"""Approximate points from the images alone, for networks whose approximate coordinates explain no image.

Two stations are oriented to each other by the essential matrix of the points that both saw, and these intersected; then
station after station is resected on what has been intersected, and shows more. The model that comes out is laid onto
the known points, or onto the approximate ones where fewer than three are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import cv2
import numpy as np

from core.calibrate.approximate.initial import intersections
from core.calibrate.approximate.resection import resect_despite_errors, residuals_of
from core.calibrate.selection import Warnings, known_points
from core.errors import AdjustmentError
from core.geometry import Pose, nominal, pixel_to_image, similarity, undistort
from core.model import Array, Ints, Network
from core.numerics import distinct

LEAST_COMMON = 8  # points of two stations: five orient them, the others tell which solution is the right one
PAIRS = 40  # of stations that are tried, those with most points in common first
LEAST_POINTS = 5  # of the model, on which a station is resected
ALONG = 1e-6  # share of their extent by which points may be off a line or plane
FLIP = np.diag([1.0, -1.0, -1.0])  # OpenCV's camera looks along +Z with Y down

Views = Mapping[int, tuple[Ints, Array]]  # of each station: points in their order, and tangents (-X/Z, -Y/Z)


def located_by_images(network: Network) -> tuple[Network, Warnings] | None:
    """Give a network the coordinates at which its images intersect, and say so; None where they tell too little.

    AdjustmentError if nothing tells then how large they are.
    """
    views, known = _views_of(network), known_points(network)
    pairs = [(np.intersect1d(views[a][0], views[b][0]), a, b) for a, b in combinations(views, 2)]
    pairs = sorted((pair for pair in pairs if len(pair[0]) >= LEAST_COMMON), key=lambda pair: -len(pair[0]))[:PAIRS]
    starts = [start for pair in pairs for start in _oriented_pairs(views, *pair)]
    if not starts:
        return None
    model = _grown(views, max(starts, key=lambda start: start[0])[1], len(network.point_names))
    seen = np.isfinite(model).all(axis=1)
    onto = seen & known if np.count_nonzero(seen & known) >= 3 else seen
    if dimensions(network.point_xyz_mm[onto]) < 2:
        raise AdjustmentError(
            "points.csv",
            f"coordinates of {np.count_nonzero(onto)} points lie on one line, or all at one place",
            "give coordinates of three points or more that form a triangle, or approximate ones of all",
        )
    scale, R, shift = similarity(model[onto], network.point_xyz_mm[onto])
    xyz = np.where((seen & ~known)[:, None], scale * model @ R.T + shift, network.point_xyz_mm)
    told = f"the approximate coordinates explain no images: {np.count_nonzero(seen & ~known)} points were intersected "
    told += f"from the images alone, and laid onto the {'known' if known[onto].all() else 'approximate'} ones"
    return replace(network, point_xyz_mm=xyz), [told]


def dimensions(xyz_mm: Array) -> int:
    """In how many directions points (n, 3) extend: 0 all at one place, 1 on a line, 2 on a plane."""
    sizes = np.linalg.svd(xyz_mm - xyz_mm.mean(axis=0), compute_uv=False)
    return int(np.count_nonzero(sizes > ALONG * sizes[0]))


def _views_of(network: Network) -> Views:
    tangents = np.full_like(network.observation_uv, np.nan)
    for name, own in network.made_by.items():
        spec, interior = network.devices[name].spec, nominal(network.devices[name].spec)
        tangents[own] = undistort(interior, pixel_to_image(spec, network.observation_uv[own])) / interior.c_mm
    views = {}
    for station in distinct(network.observation_station).tolist():
        rows = np.flatnonzero((network.observation_station == station) & np.isfinite(tangents).all(axis=1))
        rows = rows[np.argsort(network.observation_point[rows])]
        views[station] = network.observation_point[rows], tangents[rows]
    return views


def _oriented_pairs(views: Views, common: Ints, one: int, other: int) -> list[tuple[float, dict[int, Pose]]]:
    """Orient two stations to each other; how well rays intersect, by the sines of their angles, comes first."""
    a, b = (np.ascontiguousarray(views[s][1][np.isin(views[s][0], common)] * [1, -1]) for s in (one, other))
    found = []
    matrices, _ = cv2.findEssentialMat(a, b, np.eye(3), method=cv2.LMEDS, prob=0.9999)
    for E in [] if matrices is None else matrices.reshape(-1, 3, 3):
        _, turn, shift, before = cv2.recoverPose(E, a, b, np.eye(3))
        R, t = np.asarray(turn, np.float64), np.asarray(shift, np.float64).ravel()
        rays = (np.column_stack([xy, np.ones(len(xy))]) for xy in (a, b))
        first, second = (ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in rays)
        sines = np.linalg.norm(np.cross(first @ R.T, second), axis=1)[before.ravel() > 0]
        found.append((float(sines.sum()), {one: Pose(), other: Pose(FLIP @ R @ FLIP, FLIP @ t)}))
    return found


def _grown(views: Views, poses: dict[int, Pose], points: int) -> Array:
    """Resect the other stations one by one, that which sees most of the model first; give its points (n, 3)."""
    while True:
        model = _intersected(views, poses, points)
        seen = np.asarray(np.isfinite(model).all(axis=1))
        waiting = {s: int(seen[views[s][0]].sum()) for s in views if s not in poses}
        for station in sorted(waiting, key=lambda s: -waiting[s]):
            point, tangents = views[station]
            use = seen[point]
            found = resect_despite_errors(model[point[use]], tangents[use]) if use.sum() >= LEAST_POINTS else []
            if found:
                off = [np.median(residuals_of(pose, model[point[use]], tangents[use])) for pose in found]
                poses = {**poses, station: found[int(np.argmin(off))]}
                break
        else:
            return model


def _intersected(views: Views, poses: Mapping[int, Pose], points: int) -> Array:
    """Intersect points (n, 3) from oriented stations; NaN where rays do not tell one."""
    count = [len(views[s][0]) for s in poses]
    R = np.repeat([p.rotation for p in poses.values()], count, axis=0)
    t = np.repeat([p.translation_mm for p in poses.values()], count, axis=0)
    point, tangents = (np.concatenate([views[s][i] for s in poses]) for i in (0, 1))
    xyz, sure = intersections(point, tangents, R, t, np.ones((len(point), 2)), points)
    return np.where(sure[:, None], xyz, np.nan)
