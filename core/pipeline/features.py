"""Beside the road: edges of the evenly lit image on the measured surface."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from core.digits import fixed
from core.errors import InputError
from core.figures import picked
from core.geometry import camera_for
from core.model import Feature, Figures, Project
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.reconstruct import reconstruct_capture
from core.progress import SILENT, Progress

SURE_PX = 0.03  # sigma of a place that nobody named: ends of the light and shadings are less clear


def measure_features(
    project: Project,
    name: str,
    places: Sequence[tuple[str, str]],
    *,
    camera: str = "",
    projector: str = "",
    orient: bool = False,
    progress: Progress = SILENT,
) -> tuple[list[Feature], list[InputError]]:
    """Measure features of a capture, each a kind and its place as text, such as ("circle", "210,140,12").

    Without a place everything round is looked for; what has no sharp edge, or no surface round it, is left out.
    With `orient` the projector stands where a kept orientation of this capture has it.

    Returns
    -------
    found : list of Feature
    untold : list of InputError
        Why others that were named could not be measured; where none could, the first of these is raised.

    Raises
    ------
    InputError
        If a place is not well said, no edge is seen at any, or there is no photogrammetric calibration.
    """
    from core.measure import checked_place, find_circles, measure_feature

    given = [(kind, _numbers(text), f"--{kind} {text}") for kind, text in places]
    for each in given:
        checked_place(*each)  # before the capture is decoded
    calibration = photogrammetric_calibration(project)
    phase, cloud = reconstruct_capture(
        project, name, "photogrammetric", progress=progress, orient=orient, camera=camera, projector=projector
    )
    seen_by = camera_for(phase, calibration)
    found: list[Feature] = []
    untold: list[InputError] = []
    for kind, numbers, where in given or [("circle", place, name) for place in find_circles(phase.image)]:
        progress.check()
        try:
            found.append(measure_feature(kind, numbers, phase, cloud, seen_by, where))
        except InputError as error:
            untold.append(error)
    if places:
        if not found:
            raise untold[0]
        return found, untold
    sure = [feature for feature in found if np.diagonal(feature.uv_cov).max() < SURE_PX**2]
    if not sure:
        why = Counter(error.seen for error in untold)
        seen = "".join(f"; of most places: {text}" for text, _ in why.most_common(1))
        raise InputError(name, f"nothing round was found in it{seen}", "give --circle U,V,RADIUS or --line U,V,U,V")
    return sure, []


def feature_figures(feature: Feature) -> Figures:
    """What `features --json` writes of one."""
    return {
        **picked(feature, "kind blur_px pixels"),
        "uv": feature.uv.tolist(),
        "uv_sigma": np.sqrt(np.diagonal(feature.uv_cov)).tolist(),
        "centre_mm": feature.centre_mm.tolist(),
        "cov_mm2": feature.cov_mm2.tolist(),
        "axes_mm": feature.axes_mm.tolist(),
        "lengths_mm": np.linalg.norm(feature.axes_mm, axis=1).tolist(),
        "lengths_sigma_mm": feature.sigma_mm.tolist(),
        "size_mm": {"value": feature.size_mm[0], "sigma": feature.size_mm[1]},
        "normal": feature.normal.tolist(),
    }


def feature_words(feature: Feature) -> str:
    """The same in one line."""
    sigmas = np.sqrt(np.diagonal(feature.cov_mm2))
    centre = " ".join(_with_sigma(x, s) for x, s in zip(feature.centre_mm, sigmas, strict=True))
    size = _with_sigma(*feature.size_mm)
    if feature.kind == "circle":
        axes = zip(np.linalg.norm(feature.axes_mm, axis=1), feature.sigma_mm, strict=True)
        size = f"radius {size} mm, semi-axes " + " and ".join(_with_sigma(x, s) for x, s in axes)
    else:
        size = f"half its length {size}"
    (u, v), (su, sv) = feature.uv, np.sqrt(np.diagonal(feature.uv_cov))
    return f"{feature.kind} at {u:.3f} ± {su:.3f}, {v:.3f} ± {sv:.3f} px: centre {centre} mm, {size} mm"


def _with_sigma(length_mm: float, sigma_mm: float) -> str:
    """Write both with as many digits."""
    sigma = fixed(sigma_mm, 4)
    return f"{length_mm:.{len(sigma.partition('.')[2])}f} ± {sigma}"


def _numbers(text: str) -> np.ndarray:
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        return np.zeros(0)
