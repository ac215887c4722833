"""All targets of an image from its 4 picks, beside OpenCV's search for a grid of circles, which needs no picks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from core.geometry import Pose, matrix_from_axis_angle, project, ray_directions
from core.measure import measure_targets
from core.model import PhaseMap, Seed, TargetSet, Testfield
from core.project import nominal_testfield
from tests.benchmarks.scenes import phase_of, pixels, rig, sizes
from tests.benchmarks.timing import OURS, Contestant, Row, race

ROWS, COLS, PITCH_MM, DIAMETER_MM = 13, 19, 12.0, 5.0
CAMERA_FROM_BOARD = Pose(matrix_from_axis_angle([0.3, 1.0, 0.1], 0.2), np.array([2.0, -3.0, -620.0]))


@dataclass(frozen=True)
class Board:
    """A decoded image of white dots, its testfield, and where the dots' centres are."""

    phase: PhaseMap
    testfield: Testfield
    uv: np.ndarray

    @property
    def seeds(self) -> list[Seed]:
        """Clicks on the four corners, a pixel beside their centres."""
        corners = (0, COLS - 1, ROWS * COLS - COLS, ROWS * COLS - 1)
        return [Seed(n // COLS, n % COLS, self.uv[n, 0] + 1.0, self.uv[n, 1] - 1.0) for n in corners]


def run() -> list[Row]:
    """At all image sizes."""
    rows = []
    for size, (width, height) in sizes().items():
        board = seen(width, height)
        camera = rig(width, height).camera.spec

        def ours(board=board, camera=camera) -> TargetSet:
            return measure_targets(board.phase, board.testfield, board.seeds, camera)

        def circles(board=board) -> np.ndarray:
            dark = 255 - np.clip(np.rint(board.phase.image), 0, 255).astype(np.uint8)
            found, uv = cv2.findCirclesGrid(dark, (COLS, ROWS), flags=cv2.CALIB_CB_SYMMETRIC_GRID)
            assert found, "the grid is not found"
            return uv.reshape(-1, 2)

        field = [
            Contestant(OURS, ours, lambda t, b=board: _right(b, t.row * COLS + t.col, t.camera_uv, 0.05)),
            Contestant("cv2.findCirclesGrid", circles, lambda uv, b=board: _nearest(b, uv), peer=True),
        ]
        rows += race("measurement", size, width * height, "pixels", field)
    return rows


def seen(width: int, height: int) -> Board:
    """Draw the board as the reference camera sees it: every pixel's ray meets the plane, dots have soft edges."""
    calibration = rig(width, height)
    camera = calibration.camera
    rays = ray_directions(camera.spec, camera.interior, pixels(camera.spec))
    R, t = CAMERA_FROM_BOARD.rotation, CAMERA_FROM_BOARD.translation_mm
    points = rays * ((R[:, 2] @ t) / (rays @ R[:, 2]))[..., None]
    xy = (points - t) @ R[:, :2]
    testfield = nominal_testfield(ROWS, COLS, PITCH_MM, DIAMETER_MM)
    first = testfield.xyz_mm[:, :2].min(axis=0)
    node = np.clip(np.rint((xy - first) / PITCH_MM), 0, [COLS - 1, ROWS - 1])
    distance = np.linalg.norm(xy - first - PITCH_MM * node, axis=-1)
    footprint_mm = camera.spec.pitch_mm[0] * -t[2] / camera.interior.c_mm
    cover = np.clip(0.5 + (DIAMETER_MM / 2 - distance) / (1.5 * footprint_mm), 0, 1)
    noise = np.random.default_rng(0).normal(0, 1, cover.shape)
    phase = phase_of(calibration, points)
    image = (40 + 120 * cover + noise).astype(np.float32)
    modulation = (5 + 40 * cover).astype(np.float32)
    uv = project(camera.spec, camera.interior, testfield.xyz_mm, CAMERA_FROM_BOARD)
    made = PhaseMap(phase.u, phase.v, phase.sigma_u, phase.sigma_v, modulation, image, phase.flags)
    return Board(made, testfield, uv)


def _right(board: Board, targets: np.ndarray, uv: np.ndarray, allowed_px: float) -> str:
    """Everyone measured, each where it is."""
    assert len(set(targets.tolist())) == ROWS * COLS, f"{len(set(targets.tolist()))} targets of {ROWS * COLS}"
    rms = float(np.sqrt(np.mean((uv - board.uv[targets]) ** 2)))
    assert rms < allowed_px, f"targets {rms:.3f} px r.m.s. off"
    return f"{len(targets)} targets, {rms:.4f} px r.m.s. off"


def _nearest(board: Board, uv: np.ndarray) -> str:
    """The same for centres in an order of their own; a binary image knows them to a tenth of a pixel or two."""
    targets = np.argmin(np.linalg.norm(uv[:, None] - board.uv, axis=-1), axis=1)
    return _right(board, targets, uv, 0.5)
