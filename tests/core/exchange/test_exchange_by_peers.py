"""pycolmap and mrcal, where they are installed, open what was written for them and project the same points."""

import numpy as np
import pytest

from core.exchange import FORMATS, fit_pair
from core.geometry import Pose, matrix_from_rotation_vector, project
from core.model import AdjustedDevice, DeviceSpec, Interior
from tests.calibrated import calibration_of_pair

SPECS = DeviceSpec(748, 576, (0.008, 0.008), 12.0), DeviceSpec(640, 600, (0.09, 0.09), 182.0)
INTERIORS = (
    Interior(12.1, -0.08, -0.11, (-0.6e-3, 0.3e-5, -0.0143, 0.3e-4, -0.12e-3, -0.75e-4), 2.5),
    Interior(181.9, 1.2, 0.33, (0.56e-6, -0.27e-9, 0.2e-3, 0.13e-3, 0.2e-5, 0.98e-5), 27.0),
)
POSE = Pose(matrix_from_rotation_vector([0.01, -0.42, 0.02]), np.array([-244.0, 3.0, -52.0]))
POINTS = np.random.default_rng(1).uniform([-90, -70, -660], [90, 70, -540], (400, 3))


def written(name, folder):
    devices = [AdjustedDevice(s, i, np.zeros(9), (0.0, 0.0), 0) for s, i in zip(SPECS, INTERIORS, strict=True)]
    calibration = calibration_of_pair(*devices, POSE, np.zeros((24, 24)))
    return FORMATS[name].write(fit_pair(calibration, FORMATS[name].free), folder / f"cameras{FORMATS[name].endings[0]}")


def left_px(theirs, k: int) -> float:
    """What pixels of device k differ by; ours count from the centre of the first pixel."""
    ours = project(SPECS[k], INTERIORS[k], POINTS, POSE if k else None)
    seen = np.all((ours > 0) & (ours < [SPECS[k].width - 1, SPECS[k].height - 1]), axis=1)
    assert seen.sum() > 100
    return float(np.sqrt(np.mean(np.sum((theirs - ours)[seen] ** 2, axis=1))))


def test_pycolmap_sees_the_same(tmp_path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    written("colmap", tmp_path)
    model = pycolmap.Reconstruction(tmp_path)
    for k, image in enumerate(sorted(model.images.values(), key=lambda image: image.image_id)):
        turned = image.cam_from_world() * (POINTS * (1, -1, -1))
        pixels = np.array([image.camera.img_from_cam(p) for p in turned]) - 0.5  # from the corner of the first pixel
        assert left_px(pixels, k) < 0.035  # A4, which no pinhole has


def test_mrcal_sees_the_same(tmp_path) -> None:
    mrcal = pytest.importorskip("mrcal")
    for k, path in enumerate(written("mrcal", tmp_path)):
        model = mrcal.cameramodel(str(path))
        turned = mrcal.transform_point_rt(model.extrinsics_rt_fromref(), POINTS * (1, -1, -1) / 1000)
        assert left_px(mrcal.project(turned, *model.intrinsics()), k) < 0.035
