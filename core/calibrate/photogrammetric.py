"""Camera and projector calibrated together from the targets of moved boards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.calibrate.adjust import result_of, solve_network
from core.calibrate.network import network_from_targets
from core.calibrate.options import AdjustOptions
from core.calibrate.rigid import mean_relative_pose, rigidity_of
from core.errors import AdjustmentError
from core.model import Adjustment, DeviceSpec, Network, PhotogrammetricCalibration, ScaleBar, TargetSet, Testfield
from core.progress import SILENT, Progress

CALIBRATION_OPTIONS = AdjustOptions(variance_components=True, reject_beyond=6.0)


def calibrate_photogrammetric(
    camera: DeviceSpec,
    projector: DeviceSpec,
    testfield: Testfield,
    targets: Sequence[TargetSet],
    *,
    scale: ScaleBar | None,
    rigid: bool = True,
    hold: Sequence[str] = (),
    options: AdjustOptions = CALIBRATION_OPTIONS,
    progress: Progress = SILENT,
) -> tuple[PhotogrammetricCalibration, Adjustment]:
    """Calibrate a stripe sensor as one photogrammetric system.

    Parameters
    ----------
    camera, projector : DeviceSpec
        With nominal focal lengths only.
    testfield : Testfield
        Nominal board; its true shape is estimated.
    targets : sequence of TargetSet
        One per capture of the board.
    scale : ScaleBar or None
        Measured distance on the board; without it the nominal board gives the scale.
    rigid : bool
        True holds the projector fixed to the camera over all captures and says so if it was not; False adjusts all
        stations freely and returns the weighted mean of the captures' relative orientations.
    hold : sequence of str
        Parameters that are not estimated, such as "projector.A3": c stays at its nominal value, all others at zero.
    options : AdjustOptions
        By default with one variance factor per device, and observations beyond six sigma rejected and counted.
    progress : Progress

    Returns
    -------
    calibration : PhotogrammetricCalibration
    adjustment : Adjustment
        The network with residuals, redundancy numbers and all covariances.

    Raises
    ------
    InputError, AdjustmentError
        As `core.calibrate.adjust`; also if no capture shows targets to both devices.
    """
    network = network_from_targets(camera, projector, testfield, targets, scale=scale, rigid=True)
    network = _holding(network, hold)
    groups = dict(zip(network.station_names, network.station_pose, strict=True))
    if not rigid:
        network = replace(network, station_pose=tuple(range(len(network.station_names))))
    solved, warnings = solve_network(network, options, progress.part(0.0, 0.8))
    kept = [groups[name] for name in solved.network.station_names]
    if len(set(kept)) == len(kept):
        raise AdjustmentError(
            "the captures",
            "none shows enough targets to camera and projector at once",
            "capture the board where both fields of view overlap",
        )
    if len(kept) - len(set(kept)) > 1:
        progress(0.8, "was the rig rigid?")
        test = rigidity_of(solved, kept, progress.part(0.8, 1.0))
        if not test.rigid:
            advice = "" if not rigid else "; adjust with free stations, and mount the devices firmly"
            warnings.append(f"{test}{advice}")
    adjustment = result_of(solved, warnings)
    names = list(solved.problem.device_names)
    if rigid:
        projector_from_camera, covariance = adjustment.relative["projector"], adjustment.parameter_cov
    else:
        projector_from_camera, covariance = mean_relative_pose(solved, kept, names.index("projector"))
    object_variance = np.mean(np.diagonal(adjustment.point_cov_mm2, axis1=1, axis2=2), axis=0)
    x, y, z = (float(s) for s in np.sqrt(object_variance) * 1e3)
    calibration = PhotogrammetricCalibration(
        camera=adjustment.devices["camera"],
        projector=adjustment.devices["projector"],
        projector_from_camera=projector_from_camera,
        covariance=covariance,
        sigma0=adjustment.sigma0,
        stations=len(kept),
        image_points=len(adjustment.residuals),
        object_points=len(adjustment.points_mm),
        redundancy=adjustment.redundancy,
        object_sigma_rms_um=(x, y, z),
        warnings=adjustment.warnings,
    )
    return calibration, adjustment


def _holding(network: Network, hold: Sequence[str]) -> Network:
    devices = {
        name: replace(device, estimate=tuple(p for p in device.estimate if f"{name}.{p}" not in hold))
        for name, device in network.devices.items()
    }
    return replace(network, devices=devices)
