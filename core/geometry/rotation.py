"""Rotations as matrices, and the rigid movement between two frames."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.lazy import dataclass

Array = NDArray[np.float64]  # as core.model has it, which stands on the poses here


def cross_matrix(vector: ArrayLike) -> Array:
    """Matrix K (3, 3) of a vector v (3,) with ``K x = v × x``."""
    x, y, z = np.asarray(vector, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def matrix_from_rotation_vector(vector: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), axis times angle in rad, by Rodrigues' formula.

    Examples
    --------
    >>> np.round(matrix_from_rotation_vector([0, 0, np.pi / 2]) @ [1, 0, 0], 12)
    array([0., 1., 0.])
    """
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(v, -1, 0)
    K = np.zeros((*v.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = x, y, z
    K[..., 1, 2], K[..., 2, 0], K[..., 0, 1] = -x, -y, -z
    # sin(a)/a and (1 - cos a)/a² through sinc, which knows its limit at 0
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (K @ K)


def similarity(source: Array, target: Array, *, scaled: bool = True) -> tuple[float, Array, Array]:
    """Scale, rotation and shift that lay points (n, 3) onto others best: ``target = scale * R @ source + shift``.

    Without `scaled` the scale is 1. Source: Umeyama, *Least-squares estimation of transformation parameters*, IEEE
    PAMI 13 (1991).

    Examples
    --------
    >>> source = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> scale, R, shift = similarity(source, 2 * source @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [5, 6, 7])
    >>> round(scale, 6), np.round(shift, 6)
    (2.0, array([5., 6., 7.]))
    """
    middle, target_middle = source.mean(axis=0), target.mean(axis=0)
    a, b = source - middle, target - target_middle
    U, s, Vt = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * signs) @ Vt
    scale = float(np.sum(s * signs) / np.sum(a * a)) if scaled else 1.0
    return scale, R, target_middle - scale * R @ middle


def similarity_residual(source: Array, target: Array) -> float:
    """Deviations of points (n, 3) from others after the best `similarity`, r.m.s."""
    scale, R, shift = similarity(source, target)
    return float(np.sqrt(np.mean(np.sum((scale * source @ R.T + shift - target) ** 2, axis=1))))


def matrix_from_axis_angle(axis: ArrayLike, angle_rad: float) -> Array:
    """Rotation matrix about an axis (shape (3,), any length) by an angle in rad, right-handed."""
    a = np.asarray(axis, dtype=np.float64)
    return matrix_from_rotation_vector(a / np.linalg.norm(a) * angle_rad)


def rotation_vector_from_matrix(matrix: ArrayLike) -> Array:
    """Rotation vector (shape (3,), rad, length at most pi) of a rotation matrix (shape (3, 3))."""
    R = np.asarray(matrix, dtype=np.float64)
    # by way of the unit quaternion, which stays well conditioned at every angle
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]],
        ]
    )
    q = np.linalg.eigh(K / 3.0)[1][:, -1]  # eigh reads the lower triangle
    q = -q if q[3] < 0 else q
    sine = float(np.linalg.norm(q[:3]))
    if sine < 1e-9:
        return 2.0 * q[:3]
    return 2.0 * np.arctan2(sine, q[3]) / sine * q[:3]


@dataclass(frozen=True)
class Pose:
    """A rigid movement ``X_a = R X_b + t``; name the variable ``a_from_b``.

    Examples
    --------
    >>> camera_from_board = Pose(np.eye(3), np.array([0.0, 0.0, -600.0]))
    >>> camera_from_board.apply([[1.0, 2.0, 0.0]])
    array([[   1.,    2., -600.]])
    >>> np.allclose((camera_from_board @ camera_from_board.inverse()).translation_mm, 0)
    True
    """

    rotation: Array = field(default_factory=lambda: np.eye(3))  #: (3, 3): proper rotation
    translation_mm: Array = field(default_factory=lambda: np.zeros(3))  #: (3,)

    def apply(self, points: ArrayLike) -> Array:
        """Take points, shape (..., 3), from frame b to frame a."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation_mm

    def inverse(self) -> Pose:
        """Give the movement from frame a to frame b."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation_mm)

    def changed(self, change: Array) -> Pose:
        """Turn from the left by a rotation vector (rad) and shift (mm), shape (6,) together."""
        turn = matrix_from_rotation_vector(change[:3])
        return Pose(turn @ self.rotation, self.translation_mm + change[3:])

    def __matmul__(self, other: Pose) -> Pose:
        """Chain: ``a_from_b @ b_from_c`` is ``a_from_c``."""
        return Pose(self.rotation @ other.rotation, self.apply(other.translation_mm))

    @property
    def origin_mm(self) -> Array:
        """Where the origin of frame a lies in frame b (for a device: its projection centre in the object frame)."""
        return -self.rotation.T @ self.translation_mm
