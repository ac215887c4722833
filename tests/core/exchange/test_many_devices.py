"""Calibrations of three devices, each written here by its format's own definition; what they reconstruct is known."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.cli import main
from core.model import Array, PhaseMap
from core.pipeline import load_calibrations
from core.pipeline.views import joint_clouds
from core.project import read_project

SIZE = 96, 72
FOCAL = 110.0  # px
NAMES = ("a", "b", "c")
# where they stand and how they are turned: R, t of each from the world, in OpenCV's axes, mm
POSES = {
    name: (cv2.Rodrigues(np.array(turn))[0], np.array(shift))
    for name, turn, shift in (
        ("a", [0.02, -0.25, 0.01], [110.0, 4.0, 12.0]),
        ("b", [-0.01, 0.24, 0.03], [-108.0, -6.0, 9.0]),
        ("c", [0.2, 0.02, -0.02], [3.0, 95.0, 14.0]),
    )
}
NORMAL, OFFSET = np.array([0.1, -0.2, 0.97]) / np.linalg.norm([0.1, -0.2, 0.97]), 600.0  # the object, a plane


def from_a(name: str) -> tuple[Array, Array]:
    (R1, t1), (R2, t2) = POSES["a"], POSES[name]
    return R2 @ R1.T, t2 - R2 @ R1.T @ t1


def kalibr(folder: Path, names: tuple[str, ...]) -> Path:
    """A chain: each device's pose is from the one before it, in metres."""
    data, before = {}, np.eye(4)
    for k, name in enumerate(names):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = from_a(name)
        pose[:3, 3] /= 1000
        data[f"cam{k}"] = {
            "camera_model": "pinhole",
            "distortion_model": "none",
            "distortion_coeffs": [],
            "intrinsics": [FOCAL, FOCAL, 47.5, 35.5],
            "resolution": list(SIZE),
            "T_cn_cnm1": (pose @ np.linalg.inv(before)).tolist(),
        }
        before = pose
    (folder / "chain.yaml").write_text(json.dumps(data))
    return folder / "chain.yaml"


def colmap(folder: Path, names: tuple[str, ...]) -> Path:
    """World to camera; pixels from the corner of the first one, so that the middle is at 48, 36."""
    cameras = "".join(f"{k} PINHOLE 96 72 {FOCAL} {FOCAL} 48 36\n" for k in range(1, len(names) + 1))
    images = ""
    for k, name in enumerate(names, 1):
        R, t = POSES[name]
        w = np.sqrt(1 + np.trace(R)) / 2
        x, y, z = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w)
        images += f"{k} {w} {x} {y} {z} {t[0]} {t[1]} {t[2]} {k} {name}.png\n\n"
    (folder / "cameras.txt").write_text(cameras)
    (folder / "images.txt").write_text(images)
    return folder / "cameras.txt"


def mrcal(folder: Path, names: tuple[str, ...]) -> Path:
    """A file of each device, from a reference to the device, in metres."""
    for k, name in enumerate(names):
        R, t = POSES[name]
        rt = [*cv2.Rodrigues(R)[0].ravel().tolist(), *(t / 1000).tolist()]
        model = {"lensmodel": "LENSMODEL_PINHOLE", "intrinsics": [FOCAL, FOCAL, 47.5, 35.5], "extrinsics": rt}
        path = folder / f"rig{'' if k == 0 else '-' + name}.cameramodel"
        path.write_text(repr({**model, "imagersize": list(SIZE)}))
    return folder / "rig.cameramodel"


def agisoft(folder: Path, names: tuple[str, ...]) -> Path:
    """A file of each device; the further ones with their transform to the first, in metres."""
    for k, name in enumerate(names):
        R, t = from_a(name)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R.T, -R.T @ t / 1000
        more = "" if k == 0 else f"<transform>{' '.join(map(str, pose.ravel()))}</transform>"
        text = f"<calibration><width>96</width><height>72</height><f>{FOCAL}</f>{more}</calibration>"
        (folder / f"rig{'' if k == 0 else '-' + name}.xml").write_text(text)
    return folder / "rig.xml"


def ros(folder: Path, names: tuple[str, ...]) -> Path:
    """A file of each device; the further ones with their pose from the first, in metres."""
    for k, name in enumerate(names):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = from_a(name)
        pose[:3, 3] /= 1000
        data = {
            "image_width": 96,
            "image_height": 72,
            "camera_matrix": {"rows": 3, "cols": 3, "data": [FOCAL, 0, 47.5, 0, FOCAL, 35.5, 0, 0, 1]},
            "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
            "T_projector_camera": {"rows": 4, "cols": 4, "data": pose.ravel().tolist()},
        }
        (folder / f"rig{'' if k == 0 else '-' + name}.yaml").write_text(json.dumps(data))
    return folder / "rig.yaml"


WRITERS = {"kalibr": kalibr, "colmap": colmap, "mrcal": mrcal, "agisoft": agisoft, "ros": ros}


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    device = {"width": SIZE[0], "height": SIZE[1], "pitch_mm": [0.05, 0.05], "nominal_c_mm": 5.5}
    data = {"format": "stripe-project", "version": 2, "cameras": dict.fromkeys(NAMES, device), "projector": device}
    (tmp_path / "project.json").write_text(json.dumps(data))
    return tmp_path


def seen(name: str) -> tuple[PhaseMap, Array]:
    """What a camera sees of the plane: labels that a projector of whatever kind gave to it, and points in its frame."""
    R, t = POSES[name]
    u, v = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([(u - 47.5) / FOCAL, (v - 35.5) / FOCAL, np.ones(u.shape)], axis=-1)
    start, along = -R.T @ t, rays @ R
    world = start + ((OFFSET - start @ NORMAL) / (along @ NORMAL))[..., None] * along
    labels = (2.0 * world[..., :2] + 0.2 * world[..., 1:2] + 300).astype(np.float32)
    sigma = np.full(u.shape, 0.01, np.float32)
    phase = PhaseMap(
        labels[..., 0], labels[..., 1], sigma, sigma, np.full(u.shape, 80.0, np.float32), np.zeros(u.shape, np.float32),
        np.zeros(u.shape, np.uint8), camera=name,
    )  # fmt: skip
    return phase, (world @ R.T + t) * (1, -1, -1)


@pytest.mark.parametrize("form", WRITERS)
def test_three_cameras_of_another_program_reconstruct(rig: Path, form: str, capsys) -> None:
    """Files of more than two were refused or cut. The plane comes back in each camera's frame but
    for the bend of its labels between pixels 5 mm apart, 0.006 px."""
    path = WRITERS[form](rig, NAMES)
    assert main(["import", str(path), "--from", form, str(rig), "--cameras", *NAMES]) == 0
    assert "of cameras alone" in capsys.readouterr().out
    calibration = load_calibrations(read_project(rig))["photogrammetric"]
    assert calibration.cameras == NAMES
    true = {name: seen(name) for name in NAMES}
    clouds = joint_clouds([phase for phase, _ in true.values()], calibration)
    for name, cloud in clouds.items():
        known = np.isfinite(cloud.xyz_mm[..., 2])
        assert known.mean() > 0.5
        assert np.abs(cloud.xyz_mm - true[name][1])[known].max() < 0.05


@pytest.mark.parametrize("form", ["kalibr", "ros"])
def test_two_cameras_and_a_projector(rig: Path, form: str) -> None:
    data = json.loads((rig / "project.json").read_text())
    (rig / "project.json").write_text(
        json.dumps({**data, "projector": None, "projectors": {"c": data["cameras"].pop("c")}})
    )
    path = WRITERS[form](rig, NAMES)
    assert main(["import", str(path), "--from", form, str(rig), "--cameras", "a", "b", "--projector", "c"]) == 0
    calibration = load_calibrations(read_project(rig))["photogrammetric"]
    assert (calibration.cameras, calibration.projectors) == (("a", "b"), ("c",))


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("--cameras", "a", "b"), "holds 3 devices, and 2 are wanted: a, b"),
        (("--cameras", "a", "b", "x"), "no camera 'x'"),
        (("--cameras", "a", "b", "b"), "names b twice"),
        ((), "holds 3 devices, and 2 are wanted: a, projector"),
    ],
)
def test_names_that_do_not_fit_are_told(rig: Path, names: tuple[str, ...], told: str, capsys) -> None:
    path = kalibr(rig, NAMES)
    assert main(["import", str(path), "--from", "kalibr", str(rig), *names]) == 2
    assert told in capsys.readouterr().err
    assert not (rig / "results").exists()
