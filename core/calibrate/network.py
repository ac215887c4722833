"""From measured targets to a network: one station per capture and device, one point per target of the board."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from core.errors import InputError
from core.model import Network, NetworkDevice, NetworkScale, Rig, ScaleBar, StationId, TargetId, TargetSet, Testfield

LEAST_SIGMA_PX = 1e-4  # a sigma told smaller than this is a fault of the measurement, not a weight


def network_from_targets(
    rig: Rig,
    testfield: Testfield,
    targets: Sequence[TargetSet],
    *,
    scale: ScaleBar | None,
    lengths: Sequence[ScaleBar] = (),
    rigid: bool = True,
    use: Sequence[str] | None = None,
) -> Network:
    """Make the network of a set of captures, in the board's frame.

    The board is what moved: each capture is one pose, seen by cameras and projectors. The board's true shape is to be
    estimated, its nominal one serves as approximation and datum. A projector that was matched by several cameras has a
    station for each: what they say of it are different measurements.

    Parameters
    ----------
    targets : sequence of TargetSet
        One per capture, camera and projector; rows with NaN camera coordinates are passed over, a NaN projector
        coordinate is one not observed.
    scale, lengths
        Measured distances between two targets; without any the nominal field gives the scale.
    rigid : bool
        One orientation of every device relative to the first for all captures; otherwise every station is free.
    use : sequence of str, optional
        Names of the devices to adjust, all of them by default.

    Raises
    ------
    InputError
        If a target or an end of the scale is not in the testfield, or a target appears twice in a capture.
    """
    index = testfield.index()
    devices = {name: spec for name, spec in rig.devices.items() if use is None or name in use}
    matched = [(t.capture, name) for t in targets for name in (t.camera, t.projector)]
    poses: dict[str, int] = {}
    stations: list[tuple[StationId, int]] = []
    rows: list[tuple[np.ndarray, ...]] = []
    for k, target_set in enumerate(targets):
        point = _points_of(target_set, index)
        capture = target_set.capture or str(k + 1)
        for name, other in ((target_set.camera, target_set.projector), (target_set.projector, target_set.camera)):
            if name not in devices:
                continue
            if name == target_set.camera:
                uv = target_set.camera_uv
                sigma = np.sqrt(np.diagonal(target_set.camera_cov, axis1=1, axis2=2))
            else:
                uv, sigma = target_set.projector_uv, target_set.projector_sigma
            seen = np.isfinite(uv).any(axis=1) & np.isfinite(target_set.camera_uv).all(axis=1)
            if not seen.any():
                continue
            pose = poses.setdefault(capture, len(poses)) if rigid else len(stations)
            number = np.full(np.count_nonzero(seen), len(stations))
            several = matched.count((target_set.capture, name)) > 1 and target_set.capture
            stations.append((StationId(capture, name, other if several else ""), pose))
            rows.append((number, point[seen], uv[seen], np.maximum(sigma[seen], LEAST_SIGMA_PX)))
    if not rows:
        reasons = [m.reason for t in targets for m in t.missing]
        why = "".join(f": {reason}" for reason in sorted(set(reasons), key=reasons.count)[-1:])
        remedy = "measure at least two captures of the testfield"
        raise InputError("the targets", f"hold no measured target{why}", remedy)
    station, point, uv, sigma = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    used, point = np.unique(point, return_inverse=True)
    ids = tuple(TargetId(int(testfield.row[i]), int(testfield.col[i])) for i in used)
    places = {int(i): k for k, i in enumerate(used)}
    return Network(
        devices={name: NetworkDevice(spec) for name, spec in devices.items()},
        station_names=tuple(str(s) for s, _ in stations),
        station_device=tuple(s.device for s, _ in stations),
        station_pose=tuple(pose for _, pose in stations),
        station_ids=tuple(s for s, _ in stations),
        point_names=tuple(map(str, ids)),
        point_ids=ids,
        point_xyz_mm=np.asarray(testfield.xyz_mm, dtype=np.float64)[used],
        observation_station=station.astype(np.int64),
        observation_point=point.astype(np.int64),
        observation_uv=np.asarray(uv, dtype=np.float64),
        observation_sigma=np.asarray(sigma, dtype=np.float64),
        scale=None if scale is None else _distance("scale", scale, index, places),
        lengths=tuple(_distance(f"lengths, entry {i}", bar, index, places) for i, bar in enumerate(lengths)),
    )


def _points_of(targets: TargetSet, index: Mapping[tuple[int, int], int]) -> np.ndarray:
    """Position in the testfield of every target of a capture."""
    keys = targets.keys
    for key in keys:
        if key not in index:
            raise InputError(f"capture {targets.capture}", f"has target {key}", "name targets of its testfield only")
    if len(set(keys)) < len(keys):
        twice = next(key for key in keys if keys.count(key) > 1)
        raise InputError(f"capture {targets.capture}", f"has target {twice} twice", "measure it again")
    return np.array([index[key] for key in keys], dtype=np.int64)


def _distance(where: str, bar: ScaleBar, index: Mapping[tuple[int, int], int], used: dict[int, int]) -> NetworkScale:
    ends = []
    for end in (bar.start, bar.stop):
        if end not in index:
            raise InputError(where, f"names target {end}", "name two targets of the testfield")
        if index[end] not in used:
            raise InputError(where, f"target {end} was measured in no capture", "choose an end that is seen")
        ends.append(used[index[end]])
    return NetworkScale(ends[0], ends[1], bar.length_mm, bar.sigma_mm)
