"""pycolmap: bundle adjustment of its OPENCV camera model with default options, then all covariances it offers."""

from __future__ import annotations

import numpy as np
import pycolmap
from serving import Arrays, serve


def prepare(data: Arrays):
    """Give the work: build the reconstruction from starting values, adjust it, estimate the covariances."""
    return lambda: adjusted(data)


def adjusted(data: Arrays) -> Arrays:
    """Adjust once, from the starting values."""
    scene = reconstruction(data)
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_principal_point = True
    options.print_summary = False
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in scene.images:
        config.add_image(image_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(options, config, scene)
    adjuster.solve()
    wanted = pycolmap.BACovarianceOptions()
    wanted.params = pycolmap.BACovarianceOptionsParams.ALL
    covariance = pycolmap.estimate_ba_covariance(wanted, scene, adjuster)
    if covariance is None:
        raise RuntimeError("pycolmap gave no covariance")
    ids = sorted(scene.points3D)
    return {
        "points": np.array([scene.points3D[i].xyz for i in ids]),
        "interior": np.array([scene.cameras[i].params for i in sorted(scene.cameras)]),
        "sigma": np.array([np.sqrt(np.diag(covariance.get_point_cov(i))) for i in ids]),
    }


def reconstruction(data: Arrays) -> pycolmap.Reconstruction:
    """Put starting values and observations into pycolmap's own structures."""
    scene = pycolmap.Reconstruction()
    for k, (params, size) in enumerate(zip(data["interior"], data["sizes"], strict=True)):
        width, height = (int(n) for n in size)
        camera = pycolmap.Camera(model="OPENCV", width=width, height=height, params=params, camera_id=k + 1)
        scene.add_camera_with_trivial_rig(camera)
    for xyz in data["points"]:
        scene.add_point3D(xyz, pycolmap.Track(), np.zeros(3, np.uint8))
    first = np.searchsorted(data["station"], np.arange(len(data["rotation"]) + 1))
    for k, (R, t) in enumerate(zip(data["rotation"], data["shift"], strict=True)):
        own = slice(first[k], first[k + 1])
        image = pycolmap.Image(
            name=str(k), keypoints=data["uv"][own] + 0.5, camera_id=int(data["device"][k]) + 1, image_id=k + 1
        )
        scene.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(R), t))
        for i, point in enumerate(data["point"][own]):
            scene.add_observation(int(point) + 1, pycolmap.TrackElement(k + 1, i))
    return scene


if __name__ == "__main__":
    serve(prepare, lambda result: result)
