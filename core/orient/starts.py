"""Approximate poses of views of one object: from targets that they share, or from places that look alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector, pair_for, project, similarity
from core.model import Array, Pair, PhotogrammetricCalibration
from core.orient.register import Targets, View, target_points
from core.progress import SILENT, Progress

FEWEST_TARGETS, FEWEST_PLACES = 3, 12
DISTINCT = 0.8  # distance of the most alike place over that of the next (Lowe, doi:10.1023/B:VISI.0000029664.99615.94)
TRIES, WITHIN_PX = 300, 4.0
ASIDE = np.radians(28.0)  # views are also compared as seen from beside: a descriptor stands some 25 degrees
TURNS = tuple(ASIDE * np.array(axis) for axis in ((0, 0, 0), (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0)))
SPLAT_PX = 0.8  # of points drawn as an image
BRIGHT = 255 / 4  # grey value to which the median is brought


def starts_of(
    views: Sequence[View], calibration: PhotogrammetricCalibration, progress: Progress = SILENT
) -> list[Pose]:
    """Give ``view_from_first`` of all views.

    InputError if one has neither three targets nor enough places of its image in common with the others.
    """
    pair = pair_for(views[0].phase, calibration)
    seen = [_Shown(view, target_points(view, pair), pair) for view in views]
    poses: dict[int, Pose] = {0: Pose()}
    for find in (_by_targets, _by_images):
        found = True
        while found and len(poses) < len(views):
            found = False
            for k in [k for k in range(len(views)) if k not in poses]:
                progress(len(poses) / len(views), "looking for what the views share")
                for known in sorted(poses, key=lambda other: abs(other - k)):
                    progress.check()
                    pose = find(seen[known], seen[k])
                    if pose is not None:
                        poses[k], found = pose @ poses[known], True
                        break
    for k, view in enumerate(views):
        if k not in poses:
            alone = f"shares neither {FEWEST_TARGETS} targets nor enough places that look alike with the other views"
            raise InputError(view.name, alone, "put targets where both see them, or take views closer together")
    return [poses[k] for k in range(len(views))]


@dataclass
class _Shown:
    """A view, its targets, and what was found in its images: as taken, and as seen from beside."""

    view: View
    targets: Targets
    pair: Pair
    found: dict[int, tuple[Array, Array]] = field(default_factory=dict)

    def places(self, turn: int) -> tuple[Array, Array]:
        """Points (n, 3) of places of an image that can be told again, and what describes them (n, 128)."""
        if turn not in self.found:
            self.found[turn] = _places(*self.image(TURNS[turn]))
        return self.found[turn]

    def image(self, turn: Array) -> tuple[NDArray[np.uint8], Array]:
        """The view as it looks with the object turned, in radians, and the points (H, W, 3) that its pixels see."""
        X, grey = self.view.cloud.xyz_mm.astype(np.float64), np.nan_to_num(self.view.phase.image)
        known = np.isfinite(X).all(axis=2)
        bright = BRIGHT / max(float(np.median(grey[known])) if known.any() else 1.0, 1e-6)
        if not np.any(turn) or not known.any():
            return np.clip(grey * bright, 0, 255).astype(np.uint8), X
        points, greys, camera = X[known], grey[known], self.pair.camera
        middle = np.median(points, axis=0)
        there = (points - middle) @ matrix_from_rotation_vector(turn).T + middle
        column, row = np.rint(project(camera.spec, camera.interior, there)).astype(int).T
        inside = (there[:, 2] < 0) & (row >= 0) & (row < grey.shape[0]) & (column >= 0) & (column < grey.shape[1])
        order = np.flatnonzero(inside)[np.argsort(there[inside, 2])]  # the nearest last: what is written stays
        at = row[order], column[order]
        seen, drawn, drawn_at = np.full_like(X, np.nan), np.zeros_like(grey), np.zeros_like(grey)
        seen[at], drawn[at], drawn_at[at] = points[order], greys[order], 1
        smooth, weight = (cv2.GaussianBlur(a, (0, 0), SPLAT_PX) for a in (drawn, drawn_at))
        shown = np.where(weight > 0.05, smooth / np.maximum(weight, 1e-6), 0.0)
        return np.clip(shown * bright, 0, 255).astype(np.uint8), seen


def _by_targets(one: _Shown, two: _Shown) -> Pose | None:
    common = sorted(one.targets.keys() & two.targets.keys())
    if len(common) < FEWEST_TARGETS:
        return None
    here, there = (np.array([seen.targets[name][0] for name in common]) for seen in (one, two))
    if np.linalg.svd(here - here.mean(axis=0), compute_uv=False)[1] < 1e-2 * np.ptp(here, axis=0).max():
        return None  # in one line
    return Pose(*similarity(here, there, scaled=False)[1:])


def _by_images(one: _Shown, two: _Shown) -> Pose | None:
    """Match places of two images, as taken and as seen from beside, until one movement takes enough to each other."""
    order = sorted(np.ndindex(len(TURNS), len(TURNS)), key=lambda turns: np.count_nonzero(turns))
    for i, k in order:
        pose = _by_places(one.places(i), two.places(k), one.pair)
        if pose is not None:
            return pose
    return None


def _by_places(one: tuple[Array, Array], two: tuple[Array, Array], pair: Pair) -> Pose | None:
    """Find the movement that most matched places agree on (Fischler and Bolles 1981), of those that keep distances."""
    (at, describing), (other_at, other) = one, two
    if min(len(at), len(other_at)) < FEWEST_PLACES:
        return None
    near = [m for m in cv2.BFMatcher().knnMatch(describing, other, k=2) if len(m) == 2]
    matched = np.array([(m.queryIdx, m.trainIdx) for m, n in near if m.distance < DISTINCT * n.distance])
    if len(matched) < FEWEST_PLACES:
        return None
    here, there = at[matched[:, 0]], other_at[matched[:, 1]]
    within = WITHIN_PX * float(np.median(-here[:, 2])) * pair.camera.spec.pitch_mm[0] / pair.camera.interior.c_mm
    apart = [np.linalg.norm(X[:, None] - X[None], axis=2) for X in (here, there)]
    kept = (np.abs(apart[0] - apart[1]) < 2 * within) & (apart[0] > 2 * within)
    many = np.flatnonzero(kept.sum(axis=1) >= FEWEST_PLACES - 1)
    if len(many) < FEWEST_PLACES:
        return None
    rng, best = np.random.default_rng(0), np.zeros(len(here), bool)
    for _ in range(TRIES):
        first = rng.choice(many)
        three = [first, *rng.choice(np.flatnonzero(kept[first]), 2, replace=False)]
        R, shift = similarity(here[three], there[three], scaled=False)[1:]
        agree = np.linalg.norm(here @ R.T + shift - there, axis=1) < within
        if np.count_nonzero(agree) > np.count_nonzero(best):
            best = agree
    if np.count_nonzero(best) < FEWEST_PLACES:
        return None
    return Pose(*similarity(here[best], there[best], scaled=False)[1:])


def _places(grey: NDArray[np.uint8], X: Array) -> tuple[Array, Array]:
    found, describing = cv2.SIFT_create(nfeatures=4000, contrastThreshold=0.02).detectAndCompute(grey, None)  # type: ignore[attr-defined]
    if not found:
        return np.zeros((0, 3)), np.zeros((0, 128), np.float32)
    column, row = np.rint([place.pt for place in found]).astype(int).T
    at = X[np.clip(row, 0, grey.shape[0] - 1), np.clip(column, 0, grey.shape[1] - 1)]
    known = np.isfinite(at).all(axis=1)
    return at[known], describing[known]
