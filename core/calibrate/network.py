"""From measured targets to a network: one station per capture and device, one point per target of the board."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.errors import InputError
from core.model import DeviceSpec, Network, NetworkDevice, NetworkScale, ScaleBar, TargetSet, Testfield

LEAST_SIGMA_PX = 1e-4  # a sigma told smaller than this is a fault of the measurement, not a weight


def network_from_targets(
    camera: DeviceSpec,
    projector: DeviceSpec,
    testfield: Testfield,
    targets: Sequence[TargetSet],
    *,
    scale: ScaleBar | None,
    rigid: bool = True,
    use: Sequence[str] = ("camera", "projector"),
) -> Network:
    """Make the network of a set of captures, in the board's frame.

    The board is what moved: each capture is one pose, seen by camera and projector. The board's true shape is to be
    estimated, its nominal one serves as approximation and datum.

    Parameters
    ----------
    camera, projector : DeviceSpec
    testfield : Testfield
        Nominal targets.
    targets : sequence of TargetSet
        One per capture; rows with NaN camera coordinates are passed over, a NaN projector coordinate is one not
        observed.
    scale : ScaleBar or None
        Measured distance between two targets; without it the nominal field gives the scale.
    rigid : bool
        One orientation of the projector relative to the camera for all captures; otherwise every station is free.
    use : sequence of str
        The devices to adjust: "camera", "projector" or both.

    Raises
    ------
    InputError
        If a target or an end of the scale is not in the testfield, or a target appears twice in a capture.
    """
    index = testfield.index()
    devices = {"camera": camera, "projector": projector}
    stations: list[tuple[str, str, int]] = []
    rows: list[tuple[np.ndarray, ...]] = []
    for k, target_set in enumerate(targets):
        point = _points_of(target_set, index)
        for name in use:
            if name == "camera":
                uv = target_set.camera_uv
                sigma = np.sqrt(np.diagonal(target_set.camera_cov, axis1=1, axis2=2))
            else:
                uv, sigma = target_set.projector_uv, target_set.projector_sigma
            seen = np.isfinite(uv).any(axis=1) & np.isfinite(target_set.camera_uv).all(axis=1)
            if not seen.any():
                continue
            pose = k if rigid else len(stations)
            number = np.full(np.count_nonzero(seen), len(stations))
            stations.append((f"{target_set.capture or k + 1}/{name}", name, pose))
            rows.append((number, point[seen], uv[seen], np.maximum(sigma[seen], LEAST_SIGMA_PX)))
    if not rows:
        raise InputError("the targets", "hold no measured target", "measure at least two captures of the testfield")
    station, point, uv, sigma = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    used, point = np.unique(point, return_inverse=True)
    names = [f"{testfield.row[i]}/{testfield.col[i]}" for i in used]
    return Network(
        devices={name: NetworkDevice(devices[name]) for name in devices if name in use},
        station_names=tuple(s[0] for s in stations),
        station_device=tuple(s[1] for s in stations),
        station_pose=tuple(s[2] for s in stations),
        point_names=tuple(names),
        point_xyz_mm=np.asarray(testfield.xyz_mm, dtype=np.float64)[used],
        observation_station=station.astype(np.int64),
        observation_point=point.astype(np.int64),
        observation_uv=np.asarray(uv, dtype=np.float64),
        observation_sigma=np.asarray(sigma, dtype=np.float64),
        scale=_scale(scale, index, {int(i): k for k, i in enumerate(used)}),
    )


def _points_of(targets: TargetSet, index: dict[tuple[int, int], int]) -> np.ndarray:
    """Position in the testfield of every target of a capture."""
    keys = [(int(r), int(c)) for r, c in zip(targets.row, targets.col, strict=True)]
    for key in keys:
        if key not in index:
            raise InputError(f"capture {targets.capture}", f"has target {key}", "name targets of its testfield only")
    if len(set(keys)) < len(keys):
        twice = next(key for key in keys if keys.count(key) > 1)
        raise InputError(f"capture {targets.capture}", f"has target {twice} twice", "measure it again")
    return np.array([index[key] for key in keys], dtype=np.int64)


def _scale(scale: ScaleBar | None, index: dict[tuple[int, int], int], used: dict[int, int]) -> NetworkScale | None:
    if scale is None:
        return None
    ends = []
    for end in (scale.start, scale.stop):
        if end not in index:
            raise InputError("scale", f"names target {end}", "name two targets of the testfield")
        if index[end] not in used:
            raise InputError("scale", f"target {end} was measured in no capture", "choose an end that is seen")
        ends.append(used[index[end]])
    return NetworkScale(ends[0], ends[1], scale.length_mm, scale.sigma_mm)
