"""Two cameras 255 mm either side of a projector, by the foreign renderer: frames, code and lenses are not the bench's.

The calibration is exact, so that errors are those of decoding and intersecting alone.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.geometry import Pose
from core.model import AdjustedDevice, DeviceSpec, Interior, Orientation, PhotogrammetricCalibration, PointCloud
from core.pipeline.decode import phase_maps
from core.pipeline.folders import find_capture
from core.project import read_project
from core.reconstruct import Sight, intersect_all
from tests.foreign.optics import Optics, Placed, looking, optics, turned
from tests.foreign.projects import FLIP, Laboratory, between

Clouds = tuple[PointCloud, PointCloud, PointCloud]


def laboratory() -> Laboratory:
    target, lens = np.array([0.0, 0.0, 600.0]), (-0.06, 0.03, -2e-4, 3e-4)
    cameras = {
        name: optics(240, 180, 0.0134, 7.5, looking(np.array([x, y, 0.0]), target, roll), lens, (-2.1, 1.4))
        for name, x, y, roll in (("left", -255.0, 4.0, 0.8), ("right", 255.0, -6.0, -1.1))
    }
    shine = optics(640, 400, 0.009, 14.0, looking(np.zeros(3), target), (0.02, 0, 0, 0), (1.0, 5.0))
    return Laboratory(cameras, {"projector": shine}, 600.0, samples=2)


def device(one: Optics) -> AdjustedDevice:
    spec = DeviceSpec(one.width, one.height, (one.pitch_mm, one.pitch_mm), 1.0)
    c, x0, y0, *terms = one.interior(spec.zero_radius_mm).values()
    return AdjustedDevice(spec, Interior(c, x0, y0, tuple(terms), spec.zero_radius_mm), np.zeros(9), (0.0, 0.0), 0)


def calibration(lab: Laboratory) -> PhotogrammetricCalibration:
    devices, base = lab.cameras | lab.projectors, lab.cameras["left"]
    names = [f"{n}.{p}" for n in devices for p in ("c", "x0", "y0", *(f"A{k}" for k in range(1, 7)))]
    names += [f"{n}.{p}" for n in ("right", "projector") for p in ("rx", "ry", "rz", "tx", "ty", "tz")]
    return PhotogrammetricCalibration(
        {name: device(one) for name, one in devices.items()}, ("left", "right"),
        {n: Orientation("left", Pose(*between(base, devices[n]))) for n in ("right", "projector")},
        np.zeros((len(names), len(names))), tuple(names), 1.0, 1, 1, 1, 1, (0.0, 0.0, 0.0),
    )  # fmt: skip


def clouds_of(folder: Path, lab: Laboratory, known: PhotogrammetricCalibration) -> Clouds:
    """Of the left camera: with the projector, from all, from the cameras alone."""
    lab.record(folder / "captures" / "relief", lab.relief(), {"role": "object"}, 7)
    (folder / "project.json").write_text(json.dumps(lab.document(["relief"]) | {"scale": None}))
    project = read_project(folder)
    phases = [phase for _, phase in phase_maps(project, [find_capture(project, "relief")])]
    alone = [p for p in phases if p.camera == "left"]
    return (
        intersect_all(alone, known, "left"),
        intersect_all(phases, known, "left"),
        intersect_all(phases, known, "left", rays="cameras"),
    )


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> tuple[Clouds, Clouds, np.ndarray]:
    """With the projector as calibrated; with it turned by 0.1 mrad and its c longer by 50 µm; true depths."""
    lab = laboratory()
    known, one = calibration(lab), lab.projectors["projector"]
    turn = Placed(one.place.rotation @ turned(y=np.degrees(1e-4)), one.place.origin)
    longer = 0.05 / one.pitch_mm
    drifted_one = replace(one, fx=one.fx + longer, fy=one.fy + longer, place=turn)
    drifted = replace(lab, projectors={"projector": drifted_one}, seed=2)
    clouds = [clouds_of(tmp_path_factory.mktemp("sides"), each, known) for each in (lab, drifted)]
    true = lab.cameras["left"].place.to_own(lab.seen(lab.relief(), "left").points()) @ FLIP
    return clouds[0], clouds[1], true[..., 2]


def test_two_cameras_have_little_more_than_half_the_noise(seen: tuple[Clouds, Clouds, np.ndarray]) -> None:
    """Of 26,000 points; 0.525 of the pair's noise, errors over sigmas 0.99, 1.01, 1.00 when written."""
    (alone, joint, cameras), _, true = seen
    both = (joint.sight == Sight.JOINT) & (cameras.sight == Sight.JOINT)
    assert both.mean() > 0.55  # the relief fills three fifths of the image
    assert np.median(joint.sigma_depth_mm[both]) < 0.65 * np.median(alone.sigma_depth_mm[both])
    for cloud in (alone, joint, cameras):
        ratio = (cloud.xyz_mm[..., 2] - true)[both] / cloud.sigma_depth_mm[both]
        assert 0.95 < np.sqrt(np.mean(ratio**2)) < 1.05


def test_cameras_alone_do_not_follow_the_projector(seen: tuple[Clouds, Clouds, np.ndarray]) -> None:
    """The pair's depths move by three of its sigmas, the cameras' by less than a tenth: their mean is known to 0.01."""
    moved = []
    for before, after in zip(*seen[:2], strict=True):
        both = np.isfinite(before.xyz_mm[..., 2]) & np.isfinite(after.xyz_mm[..., 2])
        by = (after.xyz_mm[..., 2] - before.xyz_mm[..., 2])[both] / after.sigma_depth_mm[both]
        moved.append((abs(np.mean(by)), np.sqrt(np.mean(by**2))))
    (pair, _), _, (cameras, scatter) = moved
    assert pair > 2
    assert cameras < 0.1
    assert scatter < 1.3 * np.sqrt(2)  # two captures' noise; the projector's lines fall elsewhere on the pixels
