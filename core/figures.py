"""What `--json` writes: the figures of every result as plain numbers, texts and lists, under the interchange names."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from core.geometry import Pose, held_axes, lens_of, orientation_variances, pair_of
from core.model import (
    UNJUDGED,
    AdjustedDevice,
    Adjustment,
    Array,
    DepthCalibration,
    Figures,
    PhaseMap,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    TargetSet,
    Verdict,
)


def device_figures(device: AdjustedDevice) -> Figures:
    """Interior orientation with the sigma of each parameter."""
    lens = lens_of(device.interior)
    figures: Figures = {"model": lens.name}
    for key, value, sigma in zip(lens.keys, device.interior.vector, device.sigma, strict=True):
        figures[key] = {"value": float(value), "sigma": float(sigma)}
    if lens.referred is not None:
        figures["r0_mm"] = device.interior.r0_mm
    figures["residual_rms_um"] = [plain(r) for r in device.residual_rms_um]
    figures["image_points"] = device.image_points
    return figures


def adjustment_figures(adjustment: Adjustment) -> Figures:
    """The bundle adjustment of a network."""
    bases = adjustment.network.bases
    return {
        **picked(adjustment, "sigma0 redundancy iterations"),
        "devices": {name: device_figures(device) for name, device in adjustment.devices.items()},
        "object_sigma_rms_um": object_sigma_rms_um(adjustment),
        "stations": len(adjustment.network.station_names),
        "image_points": len(adjustment.residuals),
        "object_points": len(adjustment.points_mm),
        "variance_factors": dict(adjustment.variance_factors),
        "orientations": {
            name: {"from": bases[name], **_known_pose(pose, orientation_variances(adjustment, name))}
            for name, pose in adjustment.relative.items()
        },
        "poses": {
            name: pose_figures(pose)
            for name, pose in zip(adjustment.network.station_names, adjustment.station_from_object, strict=True)
        },
        "points": {
            name: {"xyz_mm": [float(x) for x in xyz], "sigma_um": [plain(1e3 * math.sqrt(v)) for v in np.diag(cov)]}
            for name, xyz, cov in zip(
                adjustment.network.point_names, adjustment.points_mm, adjustment.point_cov_mm2, strict=True
            )
            if np.isfinite(xyz).all()
        },
        "verdict": verdict_figures(adjustment.verdict),
        "warnings": list(adjustment.warnings),
    }


def object_sigma_rms_um(adjustment: Adjustment) -> list[float]:
    """Root mean square of the object points' sigmas along X, Y and Z, in µm."""
    variances = np.einsum("nii->ni", adjustment.point_cov_mm2)
    return [float(s) for s in 1e3 * np.sqrt(np.nanmean(variances, axis=0))]


def depth_figures(calibration: DepthCalibration) -> Figures:
    """The depth calibration."""
    return {
        "depths_mm": [float(z) for z in calibration.depths_mm],
        "degree": calibration.degree,
        "residual_rms_mm": plain(calibration.residual_rms_mm),
        "valid_pixels": calibration.valid_pixels,
        "axis": calibration.axis,
    }


def photogrammetric_figures(calibration: PhotogrammetricCalibration) -> Figures:
    """The photogrammetric calibration."""
    return {
        **picked(calibration, "sigma0 stations image_points object_points redundancy"),
        "camera": device_figures(calibration.camera),
        "devices": {name: device_figures(device) for name, device in calibration.devices.items()},
        "orientations": {
            name: {
                "from": known.base,
                **_known_pose(known.device_from_base, orientation_variances(calibration, name)),
            }
            for name, known in calibration.orientations.items()
        },
        "object_sigma_rms_um": [plain(s) for s in calibration.object_sigma_rms_um],
        **(_pair_figures(calibration) if calibration.projectors else {}),
    }


def _pair_figures(calibration: PhotogrammetricCalibration) -> Figures:
    """The projector that is meant where none is named, and how it stands to that camera."""
    pair = pair_of(calibration)
    return {
        "projector": device_figures(calibration.projector),
        "projector_from_camera": _known_pose(pair.projector_from_camera, np.diagonal(pair.covariance)[-6:]),
    }


def _known_pose(pose: Pose, variances: Array) -> Figures:
    """A pose with sigmas: null along an axis along which the place was held, which `held` then names."""
    held, sigmas = held_axes(pose, variances), np.sqrt(variances)
    return {
        **pose_figures(pose),
        "rotation_sigma_rad": [plain(s) for s in sigmas[:3]],
        "translation_sigma_mm": [None if a in held else plain(s) for a, s in zip("xyz", sigmas[3:], strict=True)],
        **({"held": [f"t{axis}" for axis in held]} if held else {}),
    }


def verdict_figures(verdict: Verdict | None) -> Figures:
    """A verdict; what nobody judged is doubtful."""
    return picked(verdict or UNJUDGED, "state because")


def evaluation_figures(evaluations: Sequence[PlaneEvaluation]) -> Figures:
    """Every plane by every method."""
    names = "capture angle_deg method n rms_mm max_mm min_mm predicted_rms_mm form_pv_um excluded excluded_rule"
    rows = [{**picked(e, names), "verdict": verdict_figures(e.verdict)} for e in evaluations]
    for row, e in zip(rows, evaluations, strict=True):
        row["camera"], row["projector"] = e.devices
    return {"planes": rows}


def targets_figures(targets: Sequence[TargetSet]) -> Figures:
    """Every measured target, and why the others are missing."""
    return {"captures": [_target_set_figures(t) for t in targets]}


def _target_set_figures(t: TargetSet) -> Figures:
    sigma = np.sqrt(np.einsum("nii->ni", t.camera_cov))
    measured = [
        {
            "row": int(t.row[i]),
            "col": int(t.col[i]),
            "u": float(t.camera_uv[i, 0]),
            "v": float(t.camera_uv[i, 1]),
            "sigma_u": float(sigma[i, 0]),
            "sigma_v": float(sigma[i, 1]),
            "projector_u": plain(t.projector_uv[i, 0]),
            "projector_v": plain(t.projector_uv[i, 1]),
            "projector_sigma_u": plain(t.projector_sigma[i, 0]),
            "projector_sigma_v": plain(t.projector_sigma[i, 1]),
        }
        for i in range(len(t.row))
    ]
    missing = [picked(m, "row col reason") for m in t.missing]
    told = picked(t, "capture camera projector notes row_shift_px")
    if t.response is not None:
        told["response"] = t.response.tolist()
    return {**told, "targets": measured, "missing": missing}


def phase_figures(phase: PhaseMap) -> Figures:
    """What a decoded capture holds, in numbers."""
    figures: Figures = {"height": phase.u.shape[0], "width": phase.u.shape[1]}
    for name, values, sigma in (("u", phase.u, phase.sigma_u), ("v", phase.v, phase.sigma_v)):
        valid = np.isfinite(values)
        count = int(valid.sum())
        figures[name] = {
            "valid_pixels": count,
            "least": plain(float(values[valid].min())) if count else None,
            "greatest": plain(float(values[valid].max())) if count else None,
            "median_sigma": plain(float(np.median(sigma[valid]))) if count else None,
        }
    lit = np.isfinite(phase.u) | np.isfinite(phase.v)
    figures["median_modulation"] = plain(float(np.median(phase.modulation[lit]))) if lit.any() else None
    if phase.response is not None:
        figures["response"] = phase.response.tolist()
    figures["notes"] = list(phase.notes)
    return figures


def picked(value: object, names: str) -> Figures:
    """Give attributes of a result under their own names, tuples as lists."""
    found = {name: getattr(value, name) for name in names.split()}
    return {name: list(item) if isinstance(item, tuple) else item for name, item in found.items()}


def pose_figures(pose: Pose) -> Figures:
    """A pose as two lists."""
    return {"rotation": pose.rotation.tolist(), "translation_mm": pose.translation_mm.tolist()}


def plain(value: float) -> float | None:
    """Give a number as JSON can hold it: null for what is not finite."""
    return float(value) if math.isfinite(value) else None
