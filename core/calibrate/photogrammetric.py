"""Cameras and projectors calibrated together from the targets of moved boards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.algebra import on_own_threads
from core.calibrate.adjust import explained, solve_network
from core.calibrate.diagnosis.held import freed
from core.calibrate.diagnosis.parted import parted
from core.calibrate.diagnosis.rigid import mean_relative_poses, rigidity_warnings
from core.calibrate.diagnosis.weakness import MirroredError
from core.calibrate.network import network_from_targets
from core.calibrate.selection import Warnings
from core.calibrate.solution.shared import with_shared_errors
from core.calibrate.solution.solve import DOUBTED, AdjustOptions, Solved, result_of
from core.errors import AdjustmentError, InputError
from core.geometry import estimated
from core.geometry.pairs import names_of, orientation_names
from core.model import (
    Adjustment,
    Concern,
    Network,
    Orientation,
    PhotogrammetricCalibration,
    Rig,
    ScaleBar,
    TargetSet,
    Testfield,
)
from core.progress import SILENT, Progress

# of 5,000 good observations one is beyond in 350 adjustments; with 2,000 or more, none that stays casts doubt
CALIBRATION_OPTIONS = AdjustOptions(variance_components=True, reject_beyond=5.0)
CHANGED = (
    "between them camera or projector was moved, turned or refocused, or the camera's region of interest changed; "
    "leave one part out, or capture it again"
)


@on_own_threads()
def calibrate_photogrammetric(
    rig: Rig,
    testfield: Testfield,
    targets: Sequence[TargetSet],
    *,
    scale: ScaleBar | None,
    lengths: Sequence[ScaleBar] = (),
    rigid: bool = True,
    hold: Sequence[str] = (),
    options: AdjustOptions = CALIBRATION_OPTIONS,
    recentred: Callable[[Adjustment], Sequence[TargetSet]] | None = None,
    progress: Progress = SILENT,
) -> tuple[PhotogrammetricCalibration, Adjustment]:
    """Calibrate a stripe sensor as one photogrammetric system.

    Parameters
    ----------
    rig : Rig
        Devices with nominal focal lengths only, or with what is known of them before. Projectors that only label
        places are left out.
    testfield, targets, scale, lengths
        As of `network_from_targets`.
    rigid : bool
        True holds all devices fixed to the first over all captures and says so if they were not; False adjusts all
        stations freely and returns the weighted means of the captures' relative orientations.
    hold : sequence of str
        Parameters that are not estimated, such as "projector.A3": c stays at its nominal value, all others at zero.
    options : AdjustOptions
        By default with one variance factor per device, and observations beyond five sigma rejected and counted.
    recentred : callable, optional
        Gives the targets that are adjusted in place of `targets`, once these have told the camera and its poses.

    Returns
    -------
    calibration : PhotogrammetricCalibration
    adjustment : Adjustment
        The network with residuals, redundancy numbers and all covariances.

    Raises
    ------
    InputError, AdjustmentError
        As `core.calibrate.adjust`; also if no captures tie the devices to each other.
    """

    use = [name for name, spec in rig.devices.items() if not spec.labels_only]
    if len(use) < 2:
        seen = f"{' and '.join(rig.projectors)} without pitch_mm and nominal_c_mm, and one camera"
        raise InputError(
            "project.json", seen, "give both of the projector: beside a single camera it is calibrated too"
        )

    def solved_by(
        targets: Sequence[TargetSet], progress: Progress, near: Solved | None = None
    ) -> tuple[Solved, Warnings, dict[str, int]]:
        network = network_from_targets(rig, testfield, targets, scale=scale, lengths=lengths, rigid=True, use=use)
        network = _holding(network, hold)
        groups = dict(zip(network.station_names, network.station_pose, strict=True))
        if not rigid:
            network = replace(network, station_pose=tuple(range(len(network.station_names))))
        return *_solved_or_parted(network, groups, options, progress, near), groups

    first: Solved | None = None
    if recentred is not None:
        first, warnings, _ = solved_by(targets, progress.part(0.0, 0.5))
        targets = recentred(result_of(first, warnings))
        progress = progress.part(0.5, 1.0)
    solved, warnings, groups = solved_by(targets, progress.part(0.0, 0.8), first)
    kept = [groups[name] for name in solved.network.station_names]
    bases = replace(solved.network, station_pose=tuple(kept)).bases
    _check_tied(bases)
    if len(kept) - len(set(kept)) > 1:
        progress(0.8, "was the rig rigid?")
        remedy = "adjust with free stations, and mount the devices firmly" if rigid else ""
        warnings += rigidity_warnings(solved, kept, remedy, progress.part(0.8, 1.0))
    solved = with_shared_errors(solved, targets)
    adjustment = result_of(solved, warnings)
    others = [name for name, base in bases.items() if base != name]
    if rigid:
        poses, covariance = [adjustment.relative[name] for name in others], adjustment.parameter_cov
    else:
        numbers = [list(bases).index(name) for name in others]
        poses, covariance = mean_relative_poses(solved, kept, numbers)
    object_variance = np.mean(np.diagonal(adjustment.point_cov_mm2, axis1=1, axis2=2), axis=0)
    x, y, z = (float(s) for s in np.sqrt(object_variance) * 1e3)
    interior_names = [n for name, device in adjustment.devices.items() for n in names_of(name, device)]
    calibration = PhotogrammetricCalibration(
        devices=adjustment.devices,
        cameras=tuple(rig.cameras),
        orientations={n: Orientation(bases[n], pose) for n, pose in zip(others, poses, strict=True)},
        covariance=covariance,
        parameter_names=(*interior_names, *(p for name in others for p in orientation_names(name))),
        sigma0=adjustment.sigma0,
        stations=len(kept),
        image_points=len(adjustment.residuals),
        object_points=len(adjustment.points_mm),
        redundancy=adjustment.redundancy,
        object_sigma_rms_um=(x, y, z),
        warnings=adjustment.warnings,
    )
    return calibration, adjustment


def _solved_or_parted(
    network: Network, groups: Mapping[str, int], options: AdjustOptions, progress: Progress, near: Solved | None
) -> tuple[Solved, Warnings]:
    """Adjust; where that fails or fits badly, say whether something changed between the captures."""

    def told() -> str:
        if (free := freed(network)) is not None and explained(free, options):  # what is held is wrong, no capture
            return ""
        rigid = replace(network, station_pose=tuple(groups[name] for name in network.station_names))
        return parted(rigid, lambda part: explained(part, options))

    try:
        solved, warnings = solve_network(network, options, progress, near)
    except MirroredError:  # of all captures alike
        raise
    except AdjustmentError as error:
        if parts := told():
            raise AdjustmentError("the captures", parts, CHANGED) from None
        raise error
    if max(solved.factors.values()) > DOUBTED**2 and (parts := told()):
        warnings = [*warnings, Concern("failed", f"{parts}: {CHANGED}", about="captures")]
    return solved, warnings


def _check_tied(bases: dict[str, str]) -> None:
    """See that every device shares captures with another one, so that one rig comes out."""
    first = next(iter(bases))
    if loose := [name for name, base in bases.items() if base != bases[first]]:
        raise AdjustmentError(
            "the captures",
            f"none shows enough targets to {first} and {' or '.join(loose)} at once",
            "capture the board where both fields of view overlap",
        )


def _holding(network: Network, hold: Sequence[str]) -> Network:
    devices = {
        name: replace(device, estimate=tuple(p for p in estimated(device) if f"{name}.{p}" not in hold))
        for name, device in network.devices.items()
    }
    return replace(network, devices=devices)
