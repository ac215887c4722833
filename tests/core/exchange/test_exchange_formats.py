"""Calibrations written for other programs show the same points at the same pixels, and come back as they were.

The judge is OpenCV's projection, and each format's own definition of pixel and axes written out here once more.
"""

import dataclasses
import json
import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import scipy.io

from core.errors import InputError
from core.exchange import FORMATS, fit_pair, pair_to_calibration
from core.geometry import Pose, matrix_from_rotation_vector, pair_of, perturbed, project
from core.model import AdjustedDevice, DeviceSpec, Interior, PhaseMap, PhotogrammetricCalibration, Verdict
from core.orient import find_motion
from core.pipeline.orient_words import motion_words
from tests.calibrated import calibration_of_pair
from tests.core.orient import views

CAMERA = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
PROJECTOR = DeviceSpec(640, 600, (0.09, 0.09), 182.0)
DEVICES = {"camera": CAMERA, "projector": PROJECTOR}
# the published interior orientations of the reference experiment, of size; A4 is what no pinhole model has
INTERIORS = (
    Interior(12.1, -0.08, -0.11, (-0.6e-3, 0.3e-5, -0.0143, 0.3e-4, -0.12e-3, -0.75e-4), 2.5),
    Interior(181.9, 1.2, 0.33, (0.56e-6, -0.27e-9, 0.2e-3, 0.13e-3, 0.2e-5, 0.98e-5), 27.0),
)
# what is left is A4, which bends no line and shears the image: 1.3e-4 of half the projector, 0.03 px r.m.s.
LEFT_PX = {"kalibr": 0.05}  # without k3


def device(spec: DeviceSpec, interior: Interior) -> AdjustedDevice:
    return AdjustedDevice(spec, interior, np.zeros(9), (0.0, 0.0), 0)


@pytest.fixture
def calibration() -> PhotogrammetricCalibration:
    pose = Pose(matrix_from_rotation_vector([0.01, -0.42, 0.02]), np.array([-244.0, 3.0, -52.0]))
    pair = device(CAMERA, INTERIORS[0]), device(PROJECTOR, INTERIORS[1])
    return calibration_of_pair(*pair, pose, np.zeros((24, 24)))


@pytest.fixture
def points() -> np.ndarray:
    rng = np.random.default_rng(1)
    return rng.uniform([-90, -70, -660], [90, 70, -540], (400, 3))


def opencv_pixels(p, points, R=None, t=(0.0, 0.0, 0.0)):
    K = np.array([[p["fx"], 0, p["cx"]], [0, p["fy"], p["cy"]], [0, 0, 1.0]])
    cv_points = points * (1, -1, -1)
    return cv2.projectPoints(
        cv_points, cv2.Rodrigues(np.eye(3) if R is None else np.array(R))[0], np.array(t), K, np.array(p["k"])
    )[0][:, 0]


def as_opencv(name: str, path: Path):
    """Read an exported file by its own definition, not by ours: camera, projector, R, t in mm."""
    second = path.with_name(f"{path.stem}-projector{path.suffix}")
    if name == "opencv":
        s = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        found = []
        for m, d in (
            ("camera_matrix", "distortion_coefficients"),
            ("projector_matrix", "projector_distortion_coefficients"),
        ):
            found.append((s.getNode(m).mat(), s.getNode(d).mat().ravel()))
        R, t = s.getNode("R").mat(), s.getNode("T").mat().ravel()
        return *({"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], "k": k} for K, k in found), R, t
    if name == "ros":
        import yaml

        found, data = [], None
        for file in (path, second):
            data = yaml.safe_load(file.read_text())
            K = np.reshape(data["camera_matrix"]["data"], (3, 3))
            k = data["distortion_coefficients"]["data"]
            found.append({"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], "k": k})
        T = np.reshape(data["T_projector_camera"]["data"], (4, 4))
        return *found, T[:3, :3], 1000 * T[:3, 3]
    if name == "kalibr":
        import yaml

        data = yaml.safe_load(path.read_text())
        found = []
        for key in ("cam0", "cam1"):
            fx, fy, cx, cy = data[key]["intrinsics"]
            found.append({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "k": data[key]["distortion_coeffs"]})
        T = np.array(data["cam1"]["T_cn_cnm1"])
        return *found, T[:3, :3], 1000 * T[:3, 3]
    if name == "colmap":  # the centre of the top-left pixel is (0.5, 0.5)
        found = []
        for line in path.read_text().splitlines()[1:]:
            v = [float(x) for x in line.split()[4:]]
            found.append({"fx": v[0], "fy": v[1], "cx": v[2] - 0.5, "cy": v[3] - 0.5, "k": v[4:12]})
        qw, qx, qy, qz, *t = (float(x) for x in path.with_name("images.txt").read_text().splitlines()[3].split()[1:8])
        R = np.array(
            [
                [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
                [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
                [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)],
            ]
        )
        return *found, R, np.array(t)
    if name == "matlab":  # the centre of the top-left pixel is (1, 1); row vectors
        s = scipy.io.loadmat(path, simplify_cells=True)["stereoParams"]
        found = []
        for key in ("CameraParameters1", "CameraParameters2"):
            c = s[key]
            K, (k1, k2, k3), (p1, p2) = c["IntrinsicMatrix"].T, c["RadialDistortion"], c["TangentialDistortion"]
            found.append(
                {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2] - 1, "cy": K[1, 2] - 1, "k": [k1, k2, p1, p2, k3]}
            )
        return *found, s["RotationOfCamera2"].T, s["TranslationOfCamera2"]
    if name == "mrcal":
        found, pose = [], None
        for file in (path, second):
            text = re.sub(r"#.*", "", file.read_text()).replace("'", '"')
            data = json.loads(text)
            assert data["lensmodel"] == "LENSMODEL_OPENCV5"
            fx, fy, cx, cy, *k = data["intrinsics"]
            found.append({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "k": k})
            pose = np.array(data["extrinsics"])
        return *found, cv2.Rodrigues(pose[:3])[0], 1000 * pose[3:]
    assert name == "agisoft"
    found, T = [], None
    for file in (path, second):
        root = ElementTree.fromstring(file.read_text())
        v = {e.tag: e.text for e in root}
        f, w, h = float(v["f"]), int(v["width"]), int(v["height"])
        k = [float(v[n]) for n in ("k1", "k2", "p2", "p1", "k3")]
        found.append(
            {
                "fx": f + float(v["b1"]),
                "fy": f,
                "cx": float(v["cx"]) + w / 2 - 0.5,
                "cy": float(v["cy"]) + h / 2 - 0.5,
                "k": k,
            }
        )
        T = v.get("transform")
    inverse = np.linalg.inv(np.reshape([float(x) for x in T.split()], (4, 4)))
    return *found, inverse[:3, :3], 1000 * inverse[:3, 3]


def test_all_formats_of_the_contract_are_there() -> None:
    assert set(FORMATS) == {"opencv", "ros", "kalibr", "colmap", "matlab", "mrcal", "agisoft"}


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_points_appear_at_the_same_pixels(name, calibration, points, tmp_path) -> None:
    form = FORMATS[name]
    pair = fit_pair(calibration, form.free)
    path = tmp_path / f"file{form.endings[0]}"
    form.write(pair, path)
    camera, projector, R, t = as_opencv(name, path)
    for found, spec, interior, pose in (
        (opencv_pixels(camera, points), CAMERA, INTERIORS[0], None),
        (opencv_pixels(projector, points, R, t), PROJECTOR, INTERIORS[1], calibration.projector_from_camera),
    ):
        ours = project(spec, interior, points, pose)
        seen = np.all((ours > 0) & (ours < [spec.width - 1, spec.height - 1]), axis=1)
        assert seen.sum() > 100
        off = np.hypot(*(found - ours)[seen].T)
        assert np.sqrt(np.mean(off**2)) < LEFT_PX.get(name, 0.035)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_what_was_written_comes_back(name, calibration, points, tmp_path) -> None:
    form = FORMATS[name]
    pair = fit_pair(calibration, form.free)
    path = tmp_path / f"file{form.endings[0]}"
    form.write(pair, path)
    back = pair_to_calibration(form.read(path), DEVICES, "file")
    for ours, theirs, pose in (
        (calibration.camera, back.camera, (None, None)),
        (calibration.projector, back.projector, (calibration.projector_from_camera, back.projector_from_camera)),
    ):
        before = project(ours.spec, ours.interior, points, pose[0])
        after = project(theirs.spec, theirs.interior, points, pose[1])
        seen = np.all((before > 0) & (before < [ours.spec.width - 1, ours.spec.height - 1]), axis=1)
        # the fit, and what our own lens model may leave of theirs
        assert np.sqrt(np.mean((before - after)[seen] ** 2)) < LEFT_PX.get(name, 0.035) + 0.005


@cache
def sheared() -> tuple[PhotogrammetricCalibration, list[PhaseMap]]:
    """The published rig, whose images are sheared, well calibrated; two of its captures."""
    known = views.calibration()
    devices = dict(known.devices)
    for (device, adjusted), shear in zip(devices.items(), ((-0.0143, 0.3e-4), (0.2e-3, 1.3e-4)), strict=True):
        a = adjusted.interior.a
        interior = dataclasses.replace(adjusted.interior, a=(*a[:2], *shear, *a[4:]))
        devices[device] = dataclasses.replace(adjusted, interior=interior)
    known = dataclasses.replace(known, devices=devices, covariance=0.04 * known.covariance)
    poses = views.station((10.0, 20.0, 0.0)), views.station((-20.0, 0.0, 90.0), 560.0)
    return known, [views.observe(pair_of(known), pose, np.random.default_rng(4)).phase for pose in poses]


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_what_a_model_leaves_is_no_movement(name, tmp_path) -> None:
    """Its sigmas hold the sheared image of the published projector: a capture of the rig itself raises no alarm."""
    known, phases = sheared()
    path = tmp_path / f"file{FORMATS[name].endings[0]}"
    FORMATS[name].write(fit_pair(known, FORMATS[name].free), path)
    back = pair_to_calibration(FORMATS[name].read(path), {"camera": views.CAMERA, "projector": views.PROJECTOR}, "file")
    for phase in phases:
        assert find_motion(phase, back).p > 0.05


def test_a_shear_that_no_parameter_holds_is_written_with_what_it_leaves(calibration) -> None:
    """A real projector of diamond pixels was refused in every format: 0.18 px were left, and 0.1 allowed."""
    projector = calibration.devices["projector"]
    a = projector.interior.a
    interior = dataclasses.replace(projector.interior, a=(*a[:3], a[3] + 2e-3, *a[4:]))
    devices = {**calibration.devices, "projector": dataclasses.replace(projector, interior=interior)}
    sheared = fit_pair(dataclasses.replace(calibration, devices=devices), ("k1", "k2", "p1", "p2", "k3"))
    assert 0.1 < sheared.projector.rms_px < 1.0
    assert sheared.covariance is None or np.isfinite(sheared.covariance).all()


def test_errors_of_a_calibration_without_sigmas_are_not_told_as_movement_alone() -> None:
    pair = dataclasses.replace(fit_pair(views.calibration(), ("k1", "k2")), covariance=None)
    bare = pair_to_calibration(pair, {"camera": views.CAMERA, "projector": views.PROJECTOR}, "file")
    true = views.draw(views.calibration(), np.random.default_rng(1))
    motion = find_motion(views.observe(true, views.station((10.0, 20.0, 0.0)), np.random.default_rng(4)).phase, bare)
    assert motion.moved
    assert "the calibration tells no sigmas: its own errors count as movement" in motion_words(motion)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_sigmas_go_there_and_come_back(name, calibration, points, tmp_path) -> None:
    """The scatter of points in the image, by a thousand draws of parameters, is the same before and after."""
    rng = np.random.default_rng(2)
    mixed = np.linalg.qr(rng.normal(size=(24, 24)))[0]  # strongly correlated, as parameters are
    size = [1e-2, 4e-3, 4e-3, 2e-6, 4e-8, 1e-5, 1e-5, 1e-6, 1e-6, 2e-1, 5e-2, 5e-2, 2e-8, 4e-12, 1e-5, 1e-5, 1e-7, 1e-7]
    L = np.array([*size, *[1e-4] * 3, *[2e-2] * 3])[:, None] * mixed * np.linspace(0.2, 2, 24)
    known = dataclasses.replace(calibration, covariance=L @ L.T)
    path = tmp_path / f"file{FORMATS[name].endings[0]}"
    FORMATS[name].write(fit_pair(known, FORMATS[name].free), path)
    back = pair_to_calibration(FORMATS[name].read(path), DEVICES, "file")
    assert back.verdict.state == "passed"
    failed = dataclasses.replace(known, verdict=Verdict("failed", ("its plates bend",)))
    FORMATS[name].write(fit_pair(failed, FORMATS[name].free), path)  # whose sigmas are none
    assert pair_to_calibration(FORMATS[name].read(path), DEVICES, "file").verdict.state == "doubtful"
    near = points[:30]

    def spread(of: PhotogrammetricCalibration) -> np.ndarray:
        pair, draws = pair_of(of), np.random.default_rng(3).normal(size=(200, len(of.covariance)))
        w, V = np.linalg.eigh(of.covariance)
        changes = draws * np.sqrt(np.maximum(w, 0)) @ V.T
        seen = []
        for change in changes:
            p = perturbed(pair, change)
            lit = project(PROJECTOR, p.projector.interior, near, p.projector_from_camera)
            seen.append(np.concatenate([project(CAMERA, p.camera.interior, near), lit]))
        return np.std(seen, axis=0)

    # draws of two numbers of parameters differ: 200 tell a spread to 5 %; kalibr's lens has no k3
    np.testing.assert_allclose(spread(back), spread(known), rtol=0.3 if name == "kalibr" else 0.25)
    assert np.all(back.camera.sigma[:3] > 0)


@pytest.mark.parametrize("ending", [".yml", ".xml", ".json"])
def test_opencv_opens_every_ending_and_so_do_we(ending, calibration, tmp_path) -> None:
    path, form = tmp_path / f"file{ending}", FORMATS["opencv"]
    form.write(fit_pair(calibration, form.free), path)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    K = storage.getNode("camera_matrix").mat()
    assert K[0, 0] == pytest.approx(12.1 / 0.008, rel=0.03)
    if ending == ".yml":
        path.write_text(path.read_text().replace("%YAML 1.2", "%YAML:1.0"))  # before OpenCV 5
    found = form.read(path)
    np.testing.assert_array_equal(found.camera.matrix, K)
    np.testing.assert_array_equal(found.camera.distortion[:5], storage.getNode("distortion_coefficients").mat()[0])
    np.testing.assert_array_equal(found.rotation, storage.getNode("R").mat())
    np.testing.assert_array_equal(found.translation_mm, storage.getNode("T").mat()[:, 0])
    np.testing.assert_array_equal(found.covariance, storage.getNode("parameter_covariance").mat())


K, k, TURN = (
    np.array([[580.0, 0, 315], [0, 577, 247], [0, 0, 1]]),
    [0.13, -0.31, 0.002, 0.003, 0.1],
    np.eye(3)[[1, 2, 0]],
)
OTHERS = {  # as cv2.FileStorage writes them: OpenCV's sample stereo_calib, procamcalib, kamino410/procam-calibration
    "sample.yml": ("M1", "D1", "M2", "D2", "R", "T"),
    "procamcalib.yml": ("cam_K", "cam_kc", "proj_K", "proj_kc", "R", "T"),
    "calibration_result.xml": ("cam_int", "cam_dist", "proj_int", "proj_dist", "roration", "translation"),
}


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_files_of_other_programs_are_read_without_image_sizes(name, tmp_path) -> None:
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
    values = K, np.array([k]), K + np.diag([9, 7, 0]), np.array([k[:4]]), TURN, np.array([[100.0], [2], [3]])
    for entry, value in zip(OTHERS[name], values, strict=True):
        storage.write(entry, value)
    storage.release()
    found = FORMATS["opencv"].read(tmp_path / name)
    np.testing.assert_array_equal(found.camera.matrix, K)
    np.testing.assert_array_equal(found.projector.matrix, values[2])
    assert found.camera.distortion == (*k, 0, 0, 0)
    assert found.projector.distortion == (*k[:4], 0, 0, 0, 0)
    np.testing.assert_array_equal(found.rotation, TURN)
    np.testing.assert_array_equal(found.translation_mm, [100, 2, 3])
    back = pair_to_calibration(found, DEVICES, "file")
    assert (back.camera.spec.width, back.projector.spec.height) == (748, 600)
    assert "gives no image sizes" in back.verdict.because[-1]


def test_what_is_no_pair_of_pinholes_is_refused(calibration) -> None:
    pair = fit_pair(calibration, FORMATS["opencv"].free)
    mirrored = dataclasses.replace(pair, camera=dataclasses.replace(pair.camera, fx=-pair.camera.fx))
    with pytest.raises(InputError, match="fx -"):
        pair_to_calibration(mirrored, DEVICES, "file")
    with pytest.raises(InputError, match="same place"):
        pair_to_calibration(dataclasses.replace(pair, translation_mm=np.zeros(3)), DEVICES, "file")


def test_matrices_written_by_hand_are_read(tmp_path) -> None:
    path = tmp_path / "hand.json"
    text = {"camera_matrix": K.tolist(), "distortion_coefficients": [k], "projector_matrix": K.tolist(),
            "projector_distortion_coefficients": k, "R": TURN.tolist(), "T": [100, 2, 3]}  # fmt: skip
    path.write_text(json.dumps(text))
    np.testing.assert_array_equal(FORMATS["opencv"].read(path).camera.matrix, K)
    camera = f"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  data: {K.ravel().tolist()}\ndistortion_coefficients: {k}\n"  # noqa: E501
    (tmp_path / "left.yaml").write_text(camera)
    (tmp_path / "left-projector.yaml").write_text(camera + f"T_projector_camera: {np.eye(4).tolist()}\n")
    found = FORMATS["ros"].read(tmp_path / "left.yaml")
    np.testing.assert_array_equal(found.camera.matrix, K)
    assert found.camera.distortion == (*k, 0, 0, 0)


@pytest.mark.parametrize("entry", ["5", '"x"', "[[1, 2], [3]]", '{"data": 3}', "null"])
def test_a_refusal_does_not_speak_of_python(entry, tmp_path) -> None:
    path = tmp_path / "file.json"
    path.write_text(f'{{"camera_matrix": {entry}}}')
    with pytest.raises(InputError) as refused:
        FORMATS["opencv"].read(path)
    assert not re.search("indices|object|subscript|attribute|setting|convert|NoneType", str(refused.value))


def test_distortion_that_we_do_not_have_is_refused(calibration, tmp_path) -> None:
    path = tmp_path / "file.xml"
    FORMATS["agisoft"].write(fit_pair(calibration, FORMATS["agisoft"].free), path)
    path.write_text(path.read_text().replace("</calibration>", "<p3>0.02</p3></calibration>"))
    with pytest.raises(InputError, match="p3"):
        FORMATS["agisoft"].read(path)


def test_a_lens_that_the_format_cannot_hold_is_refused(calibration) -> None:
    bent = dataclasses.replace(INTERIORS[0], a=(-6e-3, 3e-4, -0.0143, 0.02, -0.12e-3, -0.75e-4))  # 1 degree of shear
    wrong = dataclasses.replace(calibration, devices={**calibration.devices, "camera": device(CAMERA, bent)})
    with pytest.raises(InputError, match=r"px r\.m\.s\."):
        fit_pair(wrong, FORMATS["kalibr"].free)


@pytest.mark.parametrize("name", sorted(FORMATS))
@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe", b"{}", b"[1, 2", b"<calibration><f>nan</f></calibration>"])
def test_foreign_files_are_refused_in_one_line(name, content, tmp_path) -> None:
    path = tmp_path / f"file{FORMATS[name].endings[0]}"
    path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        FORMATS[name].read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["[" * 100_000, "- " * 100_000, "? " * 100_000, "a: 1\n" * 300_000])
def test_yaml_that_would_take_the_stack_or_minutes_is_refused(text: str, tmp_path: Path) -> None:
    """libyaml ends the process at 100,000 lists within lists, and takes quadratic time for brackets."""
    path = tmp_path / "file.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"deep|characters"):
        FORMATS["kalibr"].read(path)


def test_a_damaged_mat_file_ends_nothing_but_its_reader(tmp_path: Path) -> None:
    """These bytes end the process that SciPy reads them in (bus error in 1.17)."""
    path = tmp_path / "damaged.mat"
    struct = {"RotationOfCamera2": np.eye(3), "TranslationOfCamera2": np.ones((1, 3)), "Version": "9.0"}
    scipy.io.savemat(path, {"stereoParams": struct}, oned_as="row")
    data, rng = bytearray(path.read_bytes()), np.random.default_rng(68)
    for _ in range(rng.integers(1, 4)):
        data[int(rng.integers(120, len(data)))] = int(rng.integers(0, 256))
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"damaged\.mat"):
        FORMATS["matlab"].read(path)
