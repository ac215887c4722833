"""From arrays, without files. The truth comes from OpenCV's own projection, which shares no code with ours."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import core
from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector
from core.model import AdjustedDevice, DeviceSpec, Interior
from core.patterns import White, gray_and_phase, pattern_image, pattern_to_dict
from tests.calibrated import calibration_of_pair

FLIP = np.diag([1.0, -1.0, -1.0])
CAMERA = DeviceSpec(1280, 1024, (0.005, 0.005), 8.0, r0_mm=0.0)
PROJECTOR = DeviceSpec(912, 1140, (0.0076, 0.0076), 14.0, r0_mm=0.0)
# OpenCV's numbers: k1, k2, p1, p2; ours with r0 = 0 say the same: A1 = k1/c², A2 = k2/c⁴, A5 = -p1/c (y up), A6 = p2/c
CAMERA_CV, PROJECTOR_CV = (-0.12, 0.05, 4e-4, -3e-4), (0.03, -0.02, -2e-4, 5e-4)
CAMERA_C, CAMERA_X0, PROJECTOR_C, PROJECTOR_X0 = 8.05, (0.03, -0.02), 13.93, (-0.04, 0.25)
PROJECTOR_FROM_CAMERA = Pose(matrix_from_rotation_vector([0.02, -0.35, 0.01]), np.array([-180.0, 6.0, -30.0]))


def seen_by_opencv(points, spec, c, x0, k, pose=None):
    """Pixels at which OpenCV says a device sees points of our frame."""
    matrix = np.array(
        [
            [c / spec.pitch_mm[0], 0, (spec.width - 1) / 2 + x0[0] / spec.pitch_mm[0]],
            [0, c / spec.pitch_mm[1], (spec.height - 1) / 2 - x0[1] / spec.pitch_mm[1]],
            [0, 0, 1],
        ]
    )
    pose = pose or Pose()
    R, t = FLIP @ pose.rotation, FLIP @ pose.translation_mm
    there = np.asarray(points, float).reshape(-1, 3) @ R.T + t
    return cv2.projectPoints(there, np.zeros(3), np.zeros(3), matrix, np.array(k))[0].reshape(-1, 2)


def interior(c, x0, k):
    return Interior(c, *x0, (k[0] / c**2, k[1] / c**4, 0.0, 0.0, -k[2] / c, k[3] / c), 0.0)


CAMERA_TRUTH = CAMERA, interior(CAMERA_C, CAMERA_X0, CAMERA_CV)
PROJECTOR_TRUTH = PROJECTOR, interior(PROJECTOR_C, PROJECTOR_X0, PROJECTOR_CV)


def camera_sees(points):
    return seen_by_opencv(points, CAMERA, CAMERA_C, CAMERA_X0, CAMERA_CV)


def projector_sees(points):
    return seen_by_opencv(points, PROJECTOR, PROJECTOR_C, PROJECTOR_X0, PROJECTOR_CV, PROJECTOR_FROM_CAMERA)


def calibration(covariance=None):
    def device(truth):
        return AdjustedDevice(*truth, np.zeros(9), (0.0, 0.0), 0)

    cov = np.zeros((24, 24)) if covariance is None else covariance
    return calibration_of_pair(device(CAMERA_TRUTH), device(PROJECTOR_TRUTH), PROJECTOR_FROM_CAMERA, cov)


@pytest.fixture
def points():
    rng = np.random.default_rng(1)
    return rng.uniform([-150, -120, -850], [150, 120, -550], (400, 3))


def test_points_appear_where_opencv_sees_them(points):
    camera, projector = core.project_points(CAMERA_TRUTH, points), calibration().projector
    assert np.abs(camera.uv - camera_sees(points)).max() < 1e-9
    seen = core.project_points(projector, points, PROJECTOR_FROM_CAMERA)
    assert np.abs(seen.uv - projector_sees(points)).max() < 1e-9


def test_the_derivatives_are_those_of_the_projection(points):
    spec, inner = PROJECTOR_TRUTH
    inner = Interior(inner.c_mm, inner.x0_mm, inner.y0_mm, (*inner.a[:2], 1e-3, -2e-3, *inner.a[4:]), 2.0)
    pose = PROJECTOR_FROM_CAMERA
    whole = core.project_points((spec, inner), points, pose)

    def difference(change, h):
        return (change(h) - change(-h)) / (2 * h)

    for k in range(3):
        by = difference(lambda h, k=k: core.project_points((spec, inner), points + h * np.eye(3)[k], pose).uv, 1e-3)
        assert np.allclose(whole.by_point[..., k], by, rtol=1e-6, atol=1e-8)
    vector = inner.vector
    for k in range(9):
        step = 1e-5 * max(abs(vector[k]), 1e-3)
        by = difference(
            lambda h, k=k: (
                core.project_points(
                    (spec, Interior.from_vector(vector + h * np.eye(9)[k], inner.r0_mm)), points, pose
                ).uv
            ),
            step,
        )
        assert np.allclose(whole.by_interior[..., k], by, rtol=1e-4, atol=1e-4 * np.abs(by).max() + 1e-9)
    for k in range(6):
        e = 1e-6 * np.eye(6)[k]

        def turned(sign, e=e):
            R = matrix_from_rotation_vector(sign * e[:3]) @ pose.rotation
            there = Pose(R, pose.translation_mm + sign * e[3:])
            return core.project_points((spec, inner), points, there).uv

        assert np.allclose(whole.by_pose[..., k], (turned(1) - turned(-1)) / 2e-6, rtol=1e-5, atol=1e-5)
    assert np.isnan(core.project_points((spec, inner), [0.0, 0.0, 10.0]).uv).all()


@pytest.mark.parametrize("missing", [None, 0, 1], ids=["both", "without u", "without v"])
def test_points_are_found_again_from_any_coordinates(points, missing):
    lines = projector_sees(points)
    if missing is not None:
        lines[:, missing] = np.nan
    found = core.triangulate(calibration(), camera_sees(points).reshape(20, 20, 2), lines.reshape(20, 20, 2))
    assert found.xyz_mm.shape == (20, 20, 3)
    assert found.covariance_mm2.shape == (20, 20, 3, 3)
    there = found.xyz_mm.reshape(-1, 3)
    if missing == 0:  # v hardly changes with depth on this rig: some have another solution, or none
        there = there[np.isfinite(there).all(axis=1)]
        assert len(there) > 350
        assert np.abs(projector_sees(there)[:, 1] - lines[np.isfinite(found.xyz_mm).all(-1).ravel(), 1]).max() < 1e-6
    else:
        assert np.abs(there - points).max() < 1e-6


def test_the_covariance_is_what_repetition_shows(points):
    rng = np.random.default_rng(3)
    point = points[:4]
    camera, lines = camera_sees(point), projector_sees(point)
    n, sigma_px, sigma_lines = 20000, 0.07, np.array([0.04, 0.09])
    found = core.triangulate(
        calibration(),
        camera + rng.normal(size=(n, 4, 2)) * sigma_px,
        lines + rng.normal(size=(n, 4, 2)) * sigma_lines,
        camera_sigma_px=sigma_px,
        projector_sigma_lines=sigma_lines,
    )
    for k in range(4):
        seen = np.cov(found.xyz_mm[:, k].T)
        # variances of 20,000 repetitions are good to 1 %: five sigmas
        assert np.allclose(found.covariance_mm2[0, k], seen, rtol=0.05, atol=0.05 * np.sqrt(np.trace(seen)) ** 2)


def test_what_the_calibration_is_unsure_of_goes_into_the_covariance(points):
    """To first order, by what each parameter's own deviation moves: as good as very many draws of all of them."""
    truth, point = calibration(), points[:3]
    sigma = np.array([2e-3, 1e-3, 1e-3, *[0.0] * 6, 4e-3, 2e-3, 2e-3, *[0.0] * 6, 2e-5, 2e-5, 2e-5, 0.02, 0.02, 0.03])
    told = core.triangulate(calibration(np.diag(sigma**2)), camera_sees(point), projector_sees(point))
    exact = core.triangulate(calibration(), camera_sees(point), projector_sees(point))
    moved = []
    for e in np.vstack([np.diag(sigma), -np.diag(sigma)])[np.tile(sigma > 0, 2)]:
        R = matrix_from_rotation_vector(e[18:21]) @ PROJECTOR_FROM_CAMERA.rotation
        other = calibration_of_pair(
            AdjustedDevice(CAMERA, Interior.from_vector(truth.camera.interior.vector + e[:9], 0.0), e[:9], (0, 0), 0),
            AdjustedDevice(
                PROJECTOR, Interior.from_vector(truth.projector.interior.vector + e[9:18], 0.0), e[:9], (0, 0), 0
            ),
            Pose(R, PROJECTOR_FROM_CAMERA.translation_mm + e[21:]), np.zeros((24, 24)),
        )  # fmt: skip
        moved.append(core.triangulate(other, camera_sees(point), projector_sees(point)).xyz_mm)
    there, back = np.split(np.array(moved), 2)
    for k in range(3):
        slope = (there - back)[:, k] / 2
        seen = slope.T @ slope
        by_calibration = told.covariance_mm2[k] - exact.covariance_mm2[k]
        assert np.allclose(by_calibration, seen, rtol=0.01, atol=0.001 * np.trace(seen))


@pytest.fixture(scope="module")
def chessboard():
    """Its corners, and where camera and projector see them, with noise of 0.03 px and 0.05 lines."""
    rng = np.random.default_rng(7)
    x, y = np.meshgrid(np.linspace(-130, 130, 9), np.linspace(-100, 100, 7))
    board = np.column_stack([x.ravel(), y.ravel()])
    seen, lit = [], []
    sigma_px, sigma_lines = 0.03, 0.05
    for k in range(10):
        roll = (k % 4) * np.pi / 2
        tilt = 0.5 * np.array([np.cos(1.7 * k), np.sin(1.7 * k), 0]) if k else np.zeros(3)
        R = matrix_from_rotation_vector(tilt) @ matrix_from_rotation_vector([0, 0, roll])
        there = np.column_stack([board, np.zeros(len(board))]) @ R.T + [
            rng.uniform(-30, 30),
            rng.uniform(-30, 30),
            -650,
        ]
        camera, projector = camera_sees(there), projector_sees(there)
        out = ((projector < 0) | (projector > (PROJECTOR.width - 1, PROJECTOR.height - 1))).any(axis=1)
        projector[out] = np.nan
        seen.append(camera + rng.normal(size=camera.shape) * sigma_px)
        lit.append(projector + rng.normal(size=camera.shape) * sigma_lines)
    seen[3][5] = np.nan  # a corner that was not found
    return board, seen, lit


DIAGONAL = 0, 62, float(np.hypot(260, 200)), 0.001


def calibrated(board, seen, lit, length=DIAGONAL):
    return core.calibrate_points(
        CAMERA, PROJECTOR, board, seen, lit, camera_sigma_px=0.03, projector_sigma_lines=0.05, length=length
    )


def test_points_of_a_chessboard_calibrate_camera_and_projector(chessboard):
    found = calibrated(*chessboard)
    assert found.verdict.state == "passed"
    off = np.concatenate(
        [
            found.camera.interior.vector - CAMERA_TRUTH[1].vector,
            found.projector.interior.vector - PROJECTOR_TRUTH[1].vector,
        ]
    )
    sigma = np.sqrt(np.diagonal(found.covariance))
    assert np.abs(off / sigma[:18]).max() < 4.5  # 18 values: one beyond 4.5 sigma in 8,000 runs
    shift = found.projector_from_camera.translation_mm - PROJECTOR_FROM_CAMERA.translation_mm
    assert np.abs(shift / sigma[21:]).max() < 4.5
    assert found.sigma0 == pytest.approx(1, abs=0.1)


def test_calibrations_are_judged_and_mirrored_images_named(chessboard):
    board, seen, lit = chessboard
    twice = calibrated(board, seen, lit, length=(0, 62, 656.0, 0.01)).verdict
    assert (twice.state, "lengths disagree" in twice.because[0]) == ("failed", True)
    upwards = [[1, -1] * uv + [0, PROJECTOR.height - 1] for uv in lit]
    with pytest.raises(
        core.AdjustmentError, match="camera or projector: images fit the points only when they are mirrored"
    ):
        calibrated(board, seen, upwards)
    both = calibrated(board, [[1, -1] * uv + [0, CAMERA.height - 1] for uv in seen], upwards).verdict
    assert (both.state, "from behind" in both.because[0]) == ("doubtful", True)


def test_frames_decode_by_patterns_or_by_their_description():
    patterns = gray_and_phase("x", 64, cell=4, periods=[8])
    images = [np.uint8(40 + 150 * pattern_image(p, 64, 3)) for p in patterns]
    by_object = core.decode_frames(patterns, images, projector_size=(64, 3))
    by_words = core.decode_frames([pattern_to_dict(p) for p in patterns], [image[:, ::1] for image in images])
    assert np.nanmax(np.abs(by_object.u[:, 6:-6] - np.arange(64)[6:-6])) < 0.1
    assert np.array_equal(by_words.u[:, 6:-6], by_object.u[:, 6:-6])


def test_an_undistorted_image_is_what_opencv_makes():
    rng = np.random.default_rng(2)
    image = cv2.GaussianBlur(rng.uniform(0, 60000, (CAMERA.height, CAMERA.width)).astype(np.float32), (0, 0), 4)
    straight = core.undistort_image(CAMERA_TRUTH, image)
    f = CAMERA_C / CAMERA.pitch_mm[0]
    ideal = np.array([[f, 0, (CAMERA.width - 1) / 2], [0, f, (CAMERA.height - 1) / 2], [0, 0, 1]])
    matrix = ideal.copy()
    matrix[:2, 2] += CAMERA_X0[0] / CAMERA.pitch_mm[0], -CAMERA_X0[1] / CAMERA.pitch_mm[1]
    theirs = cv2.undistort(image, matrix, np.array(CAMERA_CV), None, ideal)
    assert np.abs(straight - theirs)[8:-8, 8:-8].max() < 60  # both interpolate to 1/32 px, of 2,000 grey values a pixel


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: core.calibrate_points(CAMERA, PROJECTOR, np.zeros((5, 4)), [], []), "board_mm"),
        (lambda: core.calibrate_points(CAMERA, PROJECTOR, np.zeros((5, 2)), [], []), "camera_uv"),
        (lambda: core.calibrate_points(CAMERA, PROJECTOR, np.zeros((5, 2)), [np.zeros((4, 2))], []), r"camera_uv\[0\]"),
        (lambda: calibrated(np.zeros((5, 2)), [np.full((5, 2), 3e3)], [np.zeros((5, 2))], None), "1280x1024"),
        (lambda: calibrated(np.zeros((5, 2)), [], [], (0, 5, 100.0, 0.1)), "length: .* 5 points"),
        (lambda: core.calibrate_points(CAMERA, PROJECTOR, [[0, 0]], [[[0, 0]]], [[[0, 0]]], camera_sigma_px=0), "zero"),
        (
            lambda: core.calibrate_points(DeviceSpec(-3, 4, (0.1, 0.1), 3), PROJECTOR, [[0, 0]], [], []),
            "size",
        ),
        (lambda: core.calibrate_points(CAMERA, DeviceSpec(3, 4, 0.1, 3), [[0, 0]], [], []), "projector.pitch_mm"),
        (lambda: core.triangulate(calibration(), np.zeros((5, 2)), np.zeros((4, 2))), "projector_uv"),
        (lambda: core.triangulate(calibration(), [0, 0], [0, 0], camera_sigma_px=-1), "camera_sigma_px"),
        (lambda: core.triangulate(calibration(), [[0, 0], [0]], [0, 0]), "camera_uv"),
        (lambda: core.triangulate(calibration(), [0, 0], [0, 0], projector_sigma_lines=[np.nan, 1]), "projector_sigma"),
        (lambda: core.project_points(CAMERA_TRUTH, np.zeros((3, 400))), "points_mm"),
        (lambda: core.project_points(CAMERA_TRUTH[:1], np.zeros(3)), "device"),
        (lambda: core.undistort_image(CAMERA_TRUTH, np.zeros((4, 4), np.uint8)), "image"),
        (lambda: core.undistort_image(CAMERA_TRUTH, np.zeros((1024, 1280))), "float64"),
        (lambda: core.decode_frames([White()], [[[1, 2], [3]]]), r"images\[0\]"),
        (lambda: core.decode_frames([White()], [np.ma.masked_less(np.zeros((2, 2), np.uint8), 1)]), "masked"),
        (lambda: core.decode_frames(["x"], [np.zeros((2, 2), np.uint8)]), r"patterns\[0\]"),
        (lambda: core.decode_frames([White()], [np.zeros((2, 2), np.uint8)], projector_size=(0, 8)), "projector_size"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(call, word):
    with pytest.raises(InputError, match=word):
        call()


def test_masked_and_undefined_coordinates_give_no_points(points):
    """As a phase map has them: sigmas are NaN where coordinates are."""
    camera, lines = camera_sees(points), projector_sees(points)
    hidden = np.arange(len(points))[:, None] < [100, 100]
    whole = core.triangulate(calibration(), camera, lines, projector_sigma_lines=0.1)
    sigma = np.where(hidden, np.nan, 0.1)
    for given in (np.ma.masked_array(lines, hidden), np.where(hidden, np.nan, lines), np.where(hidden, np.inf, lines)):
        found = core.triangulate(calibration(), camera, given, projector_sigma_lines=sigma)
        assert np.isnan(found.xyz_mm[:100]).all()
        assert np.array_equal(found.covariance_mm2[100:], whole.covariance_mm2[100:])
    seen = core.project_points(CAMERA_TRUTH, np.ma.masked_array(points, np.repeat(hidden[:, :1], 3, axis=1)))
    assert np.isnan(seen.uv[:100]).all()
    assert np.array_equal(seen.uv[100:], core.project_points(CAMERA_TRUTH, points[100:]).uv)


def test_an_image_of_any_layout_is_straightened_alike():
    image = np.random.default_rng(4).integers(0, 65535, (CAMERA.height, CAMERA.width), np.uint16)
    straight = core.undistort_image(CAMERA_TRUTH, image)
    for other in (np.asfortranarray(image), image.astype(">u2"), np.dstack([image] * 5)[..., 3]):
        assert np.array_equal(core.undistort_image(CAMERA_TRUTH, other), straight)
    assert np.array_equal(core.undistort_image(CAMERA_TRUTH, image[..., None]), straight[..., None])
    assert np.array_equal(core.undistort_image(CAMERA_TRUTH, np.dstack([image] * 5))[..., 4], straight)
