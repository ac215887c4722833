"""Approximate poses of views of one object: from targets that they share, or from places that look alike."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from core.errors import InputError
from core.geometry import Pose, pair_for, similarity
from core.model import Array, Pair, PhotogrammetricCalibration
from core.orient.register import Targets, View, target_points
from core.progress import SILENT, Progress

FEWEST_TARGETS, FEWEST_PLACES = 3, 12
DISTINCT = 0.8  # distance of the most alike place over that of the next (Lowe, doi:10.1023/B:VISI.0000029664.99615.94)
TRIES, WITHIN_PX = 3000, 4.0
BRIGHT = 255 / 4  # grey value to which the median is brought


def starts_of(
    views: Sequence[View], calibration: PhotogrammetricCalibration, progress: Progress = SILENT
) -> list[Pose]:
    """Give ``view_from_first`` of all views.

    Raises
    ------
    InputError
        If a view has neither three targets nor enough places of its image in common with the others.
    """
    pair = pair_for(views[0].phase, calibration)
    targets = [target_points(view, pair) for view in views]
    poses: dict[int, Pose] = {0: Pose()}
    for find in (_by_targets, _by_images):
        found = True
        while found and len(poses) < len(views):
            found = False
            for k in [k for k in range(len(views)) if k not in poses]:
                progress.check()
                progress(len(poses) / len(views), "looking for what the views share")
                for known in list(poses):
                    pose = find((views[known], views[k]), (targets[known], targets[k]), pair)
                    if pose is not None:
                        poses[k], found = pose @ poses[known], True
                        break
    for k, view in enumerate(views):
        if k not in poses:
            seen = f"shares neither {FEWEST_TARGETS} targets nor enough places that look alike with the other views"
            raise InputError(view.name, seen, "put targets where both see them, or take views closer together")
    return [poses[k] for k in range(len(views))]


def _by_targets(_views: tuple[View, View], targets: tuple[Targets, Targets], _pair: Pair) -> Pose | None:
    common = sorted(targets[0].keys() & targets[1].keys())
    if len(common) < FEWEST_TARGETS:
        return None
    one, two = (np.array([own[name][0] for name in common]) for own in targets)
    if np.linalg.svd(one - one.mean(axis=0), compute_uv=False)[1] < 1e-2 * np.ptp(one, axis=0).max():
        return None  # in one line
    return Pose(*similarity(one, two, scaled=False)[1:])


def _by_images(views: tuple[View, View], _targets: tuple[Targets, Targets], pair: Pair) -> Pose | None:
    """Match places of two images, and find the movement that most of them agree on (Fischler and Bolles 1981)."""
    (at, describing), (other_at, other) = (_places(view) for view in views)
    if min(len(at), len(other_at)) < FEWEST_PLACES:
        return None
    near = [m for m in cv2.BFMatcher().knnMatch(describing, other, k=2) if len(m) == 2]
    matched = np.array([(m.queryIdx, m.trainIdx) for m, n in near if m.distance < DISTINCT * n.distance])
    if len(matched) < FEWEST_PLACES:
        return None
    one, two = at[matched[:, 0]], other_at[matched[:, 1]]
    within = WITHIN_PX * float(np.median(-one[:, 2])) * pair.camera.spec.pitch_mm[0] / pair.camera.interior.c_mm
    rng, best = np.random.default_rng(0), np.zeros(len(one), bool)
    for _ in range(TRIES):
        three = rng.choice(len(one), 3, replace=False)
        R, shift = similarity(one[three], two[three], scaled=False)[1:]
        agree = np.linalg.norm(one @ R.T + shift - two, axis=1) < within
        if np.count_nonzero(agree) > np.count_nonzero(best):
            best = agree
    if np.count_nonzero(best) < FEWEST_PLACES:
        return None
    return Pose(*similarity(one[best], two[best], scaled=False)[1:])


def _places(view: View) -> tuple[Array, Array]:
    """Points (n, 3) of places of the image that can be told again, and what describes them (n, 128)."""
    image = view.phase.image * (BRIGHT / max(float(np.nanmedian(view.phase.image)), 1e-6))
    grey = np.clip(np.nan_to_num(image), 0, 255).astype(np.uint8)
    found, describing = cv2.SIFT_create(nfeatures=4000, contrastThreshold=0.02).detectAndCompute(grey, None)  # type: ignore[attr-defined]
    if not found:
        return np.zeros((0, 3)), np.zeros((0, 128), np.float32)
    column, row = np.rint([place.pt for place in found]).astype(int).T
    X = view.cloud.xyz_mm[np.clip(row, 0, grey.shape[0] - 1), np.clip(column, 0, grey.shape[1] - 1)].astype(np.float64)
    known = np.isfinite(X).all(axis=1)
    return X[known], describing[known]
