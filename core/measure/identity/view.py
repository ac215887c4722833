"""How a capture sees the board: a pose with the nominal focal length and one radial parameter.

Good enough to predict the neighbourhood of known targets and the eccentricity of circles; it calibrates nothing.
"""

from __future__ import annotations

import cv2
import numpy as np

from core.compiling import njit
from core.errors import InputError
from core.geometry import Pose, image_to_pixel, matrix_from_rotation_vector, pixel_to_image
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior

RADIAL_SIGMA = 0.1  # a lens rarely moves the corner of its image by more than a tenth of its radius


@dataclass(frozen=True)
class View:
    """The camera (nominal c, no principal point, A1 alone, r0 = 0) and its pose relative to the board."""

    spec: DeviceSpec
    camera_from_board: Pose
    a1: float = 0.0

    @property
    def interior(self) -> Interior:
        """The approximate interior orientation."""
        return Interior(self.spec.nominal_c_mm, a=(self.a1, 0.0, 0.0, 0.0, 0.0, 0.0))

    @property
    def angles_deg(self) -> tuple[float, float]:
        """Roll of the board, 0 where its rows run to the right, growing anticlockwise; and tilt, from either side."""
        R = self.camera_from_board.rotation
        if R[2, 2] < 0:  # seen from its back
            R = R @ np.diag([1.0, -1.0, -1.0])
        roll = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
        return roll, float(np.degrees(np.arccos(np.clip(R[2, 2], -1.0, 1.0))))

    def project(self, xyz_mm: Array) -> Array:
        """Pixels (n, 2) of board points (n, 3); NaN behind the camera or where the radial term has turned round."""
        p = self.camera_from_board.apply(xyz_mm)
        xy = self.spec.nominal_c_mm * p[:, :2] / np.where(p[:, 2:] < 0, -p[:, 2:], np.nan)
        radial = self.a1 * np.sum(xy**2, axis=1)
        xy[1.0 + 3.0 * radial < 0.2] = np.nan
        return image_to_pixel(self.spec, xy * (1.0 + radial)[:, None])

    def jacobian(self, xyz_mm: Array) -> Array:
        """Pixels per mm on the board at points (n, 3): shape (n, 2, 2), columns along the board's X and Y."""
        by_point = _linearised(self, xyz_mm, np.zeros((len(xyz_mm), 2)))[0].reshape(-1, 2, 7)[:, :, 3:6]
        on_board = by_point * [[1.0], [-1.0]] @ self.camera_from_board.rotation[:, :2]
        return np.asarray(on_board / np.array(self.spec.pitch_mm)[:, None])


def first_view(spec: DeviceSpec, xyz_mm: Array, uv: Array) -> View | None:
    """View from at least 4 identified targets, None where no pose puts them in front of the camera."""
    xy = pixel_to_image(spec, uv) / spec.nominal_c_mm
    plane = np.ascontiguousarray(np.stack([xy[:, 0], -xy[:, 1]], axis=1))  # y down, looking along +Z
    try:
        found, turns, shifts, _ = cv2.solvePnPGeneric(
            np.ascontiguousarray(xyz_mm), plane, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP
        )
    except cv2.error:
        return None
    flip = np.diag([1.0, -1.0, -1.0])
    best: tuple[float, View] | None = None
    for k in range(found):
        R = flip @ matrix_from_rotation_vector(np.ravel(turns[k]))
        view = fit_both_tilts(View(spec, Pose(R, flip @ np.ravel(shifts[k]))), xyz_mm, uv, radial=False)
        error = float(np.sum((view.project(xyz_mm) - uv) ** 2))
        if np.isfinite(error) and (best is None or error < best[0]):
            best = error, view
    return None if best is None else best[1]


def no_view(where: str) -> InputError:
    """The error of picks for which `first_view` finds none."""
    return InputError(
        where,
        "no view of the board has the picks where they are",
        "correct rows and columns, or nominal_c_mm and pitch_mm of the camera",
    )


def fit_both_tilts(start: View, xyz_mm: Array, uv: Array, *, radial: bool) -> View:
    """Fit from a start and from its mirror image in tilt, which a distant board resembles; keep the better one."""
    fits = [fit_view(s, xyz_mm, uv, radial=radial) for s in (start, _other_tilt(start, xyz_mm.mean(axis=0)))]
    errors = [float(np.sum((fit.project(xyz_mm) - uv) ** 2)) for fit in fits]
    return fits[1] if errors[1] < 0.999 * errors[0] or not np.isfinite(errors[0]) else fits[0]


def _other_tilt(view: View, middle_mm: Array) -> View:
    """The board tilted the other way about its middle, as seen along the line of sight to it."""
    at = view.camera_from_board.apply(middle_mm)
    sight = at / np.linalg.norm(at)
    half_turn = 2 * np.outer(sight, sight) - np.eye(3)
    R = half_turn @ view.camera_from_board.rotation @ np.diag([-1.0, -1.0, 1.0])
    return View(view.spec, Pose(R, at - R @ middle_mm), view.a1)


def fit_view(start: View, xyz_mm: Array, uv: Array, *, radial: bool, iterations: int = 8) -> View:
    """Fit the pose (and A1, held near 0 by `RADIAL_SIGMA`) to identified targets by damped Gauss-Newton steps."""
    spec = start.spec
    measured = pixel_to_image(spec, uv)
    pitch = float(np.mean(spec.pitch_mm))
    corner2 = (spec.width * spec.pitch_mm[0] / 2) ** 2 + (spec.height * spec.pitch_mm[1] / 2) ** 2
    prior = pitch * corner2 / RADIAL_SIGMA if radial else 1e12
    view, cost, damping = View(spec, start.camera_from_board, start.a1 if radial else 0.0), np.inf, 1e-6
    J, r = np.zeros((0, 7)), np.zeros(0)
    step: Array = np.zeros(7)
    for _ in range(iterations):
        R, t, a1 = view.camera_from_board.rotation, view.camera_from_board.translation_mm, view.a1
        trial = view
        if len(r):
            turn = np.asarray(cv2.Rodrigues(step[:3])[0], np.float64)  # of one vector much quicker than ours
            trial = View(spec, Pose(turn @ R, t + step[3:6]), a1 + step[6])
        J_new, r_new = _linearised(trial, xyz_mm, measured)
        new_cost = float(r_new @ r_new) + (prior * trial.a1) ** 2
        if not np.isfinite(new_cost) or new_cost > cost * (1 + 1e-12):
            damping *= 100
        else:
            done = cost - new_cost < 1e-7 * new_cost
            view, cost, J, r, damping = trial, new_cost, J_new, r_new, damping / 10
            if done:
                break
        if not len(r):
            break
        N = J.T @ J
        N[6, 6] += prior**2
        b = J.T @ r
        b[6] -= prior**2 * view.a1
        N.flat[::8] *= 1 + damping
        step = np.asarray(np.linalg.solve(N, b), np.float64)
    return view


def _linearised(view: View, xyz_mm: Array, measured: Array) -> tuple[Array, Array]:
    """Jacobian (2n, 7) by turn, shift and A1, and residuals (2n,), mm in the image; y up."""
    J, rest, pose = np.empty((len(xyz_mm), 2, 7)), np.empty((len(xyz_mm), 2)), view.camera_from_board
    given = (np.ascontiguousarray(a, np.float64) for a in (xyz_mm, pose.rotation, pose.translation_mm, measured))
    _linearise(*given, float(view.spec.nominal_c_mm), float(view.a1), J, rest)
    return J.reshape(-1, 7), rest.reshape(-1)


@njit(cache=True, nogil=True, error_model="numpy")
def _linearise(
    xyz: Array, R: Array, shift: Array, measured: Array, c: float, a: float, J: Array, rest: Array
) -> None:  # pragma: no cover  compiled
    q = np.empty(3)
    for n in range(len(xyz)):
        for k in range(3):
            q[k] = R[k, 0] * xyz[n, 0] + R[k, 1] * xyz[n, 1] + R[k, 2] * xyz[n, 2]
        z = q[2] + shift[2]
        per_z = -1 / z if z < 0 else np.nan
        x, y = c * (q[0] + shift[0]) * per_z, c * (q[1] + shift[1]) * per_z
        r2 = x * x + y * y
        xx, xy, yy = 1 + a * (r2 + 2 * x * x), 2 * a * x * y, 1 + a * (r2 + 2 * y * y)
        J[n, 0, 3], J[n, 0, 4], J[n, 0, 5] = c * per_z * xx, c * per_z * xy, (xx * x + xy * y) * per_z
        J[n, 1, 3], J[n, 1, 4], J[n, 1, 5] = c * per_z * xy, c * per_z * yy, (xy * x + yy * y) * per_z
        J[n, 0, 6], J[n, 1, 6] = x * r2, y * r2
        for i in range(2):
            for k in range(3):  # d(turn x p) = turned x derivative, because the turn is applied from the left
                J[n, i, k] = q[k - 2] * J[n, i, 3 + (k + 2) % 3] - q[k - 1] * J[n, i, 3 + (k + 1) % 3]
        rest[n, 0], rest[n, 1] = measured[n, 0] - x * (1 + a * r2), measured[n, 1] - y * (1 + a * r2)
