"""The targets of a board: where they should be, and where they were measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from core.lazy import dataclass
from core.model.arrays import Array, Ints


@dataclass(frozen=True)
class Seed:
    """A target the operator picked: its identity and where it was clicked (px)."""

    row: int
    col: int
    u: float
    v: float
    camera: str = ""  # in whose image; empty where the rig has one


@dataclass(frozen=True)
class Testfield:
    """The nominal targets of a board, one row of every array per target."""

    __test__ = False  # the field's word, not a test class

    row: Ints
    col: Ints
    xyz_mm: Array  # (n, 3) in the board's frame
    diameter_mm: Array  # (n,)
    polarity: Literal["white-on-black", "black-on-white"] = "white-on-black"
    kind: str = "dots"  # one of core.measure.TARGET_KINDS
    estimator: str = "centroid"  # of a dot's centre, one of core.measure.ESTIMATORS
    file: str = "testfield.csv"  # as messages call it

    @property
    def keys(self) -> list[tuple[int, int]]:
        """(row, col) of every target."""
        return [*zip(self.row.tolist(), self.col.tolist(), strict=True)]

    def index(self) -> Mapping[tuple[int, int], int]:
        """Position in the arrays of every (row, col)."""
        return self._index

    @cached_property
    def _index(self) -> dict[tuple[int, int], int]:
        return {key: i for i, key in enumerate(self.keys)}

    def side_seen(self, seeds: Sequence[Seed]) -> Literal["front", "back"]:
        """From which side of the nominal coordinates' XY plane picks show the board."""
        xy = np.array([self.xyz_mm[self._index[s.row, s.col]][:2] for s in seeds])
        uv = np.array([[s.u, s.v] for s in seeds])
        linear = np.linalg.lstsq(xy - xy.mean(axis=0), uv - uv.mean(axis=0), rcond=None)[0].T
        return "front" if np.linalg.det(linear) < 0 else "back"  # v points down: a front view turns the order round


@dataclass(frozen=True)
class MissingTarget:
    """A target that was not measured, and why, in words."""

    row: int
    col: int
    reason: str


@dataclass(frozen=True)
class TargetSet:
    """The measured targets of one capture, one row of every array per target.

    `camera_uv` (n, 2) px is the image of the circle's centre: the weighted centroid less `eccentricity_px` (n, 2).
    `camera_cov` (n, 2, 2) px². `projector_uv` (n, 2) lines and `projector_sigma` (n, 2) are NaN where that axis was not
    decoded at the target. It is read at the measured centroid and shares that one's error: `gradient` (n, 2, 2) says by
    how many lines it changes per px of the camera's u and v, and `cov` is the covariance of all four. Every row of
    the image is shifted along u as a whole, and so is what is read in it of the projector's u and v: `row_shifts`, px²
    (3, 3), is the covariance of the three (part of `camera_cov` and `projector_sigma`). Targets share these errors in
    the rows that they share, `height_px` (n,) of them. `made_from` signs what they were measured from, empty where
    nobody asked; `notes` are those of the decoded capture, and of picks and turns; `response` (k, 2) and `gaps` are
    those of its `PhaseMap`. `told`: nobody picked, and the image alone tells how the board is turned.
    """

    capture: str
    row: Ints
    col: Ints
    camera_uv: Array
    camera_cov: Array
    projector_uv: Array
    projector_sigma: Array
    eccentricity_px: Array
    diameter_px: Array
    missing: tuple[MissingTarget, ...] = ()
    made_from: str = ""
    gradient: Array | None = None
    notes: tuple[str, ...] = ()
    camera: str = "camera"
    projector: str = "projector"
    row_shifts: Array | None = None
    height_px: Array | None = None
    response: Array | None = None
    gaps: float | None = None
    told: bool = False

    @property
    def keys(self) -> list[tuple[int, int]]:
        """(row, col) of every target."""
        return [*zip(self.row.tolist(), self.col.tolist(), strict=True)]

    @property
    def row_shift_px(self) -> float:
        """Standard deviation of the shift along u that every row of the image has as a whole."""
        return 0.0 if self.row_shifts is None else float(np.sqrt(self.row_shifts[0, 0]))

    @property
    def row_share(self) -> Array:
        """Variance and covariance (n, n) of the targets' places along u if each row were shifted by a variance of 1."""
        if (chords := self._chords) is None:
            return np.zeros((len(self.row), len(self.row)))
        rows, share = chords
        in_rows = np.zeros((len(rows), int(rows.max()) + 1))
        np.put_along_axis(in_rows, rows, share, axis=1)
        return np.asarray(in_rows @ in_rows.T)

    @property
    def row_variance(self) -> Array:
        """The diagonal (n,) of `row_share`."""
        return np.zeros(len(self.row)) if (chords := self._chords) is None else np.sum(chords[1] ** 2, axis=1)

    @property
    def _chords(self) -> tuple[Ints, Array] | None:
        """Rows (n, k) that targets reach over, and which share of each lies in them; None where no row is shifted."""
        if self.row_shifts is None or not self.row_shifts.any() or self.height_px is None or not len(self.row):
            return None
        v, half = (self.camera_uv + self.eccentricity_px)[:, 1:], np.maximum(self.height_px[:, None] / 2, 1.0)
        rows = np.floor(v - half) + np.arange(int(2 * half.max()) + 3)
        share = np.sqrt(np.maximum(1 - ((rows - v) / half) ** 2, 0.0))  # a disc's chords
        return (rows - rows.min()).astype(np.int64), share / share.sum(axis=1, keepdims=True)

    @property
    def by_row(self) -> Array:
        """How much (n, 4, 3) the camera's u, v and the projector's (lines) change with each of `row_shifts`, per px."""
        J = np.zeros((len(self.row), 2)) if self.gradient is None else np.nan_to_num(self.gradient[:, :, 0])
        change = np.zeros((len(self.row), 4, 3))
        change[:, 0, 0] = 1.0
        change[:, 2:, 0] = change[:, [2, 3], [1, 2]] = J
        return change

    @property
    def cov(self) -> Array:
        """Covariance (n, 4, 4) of the camera's u, v (px) and the projector's u, v (lines); NaN where not decoded."""
        whole = np.zeros((len(self.row), 4, 4))
        J = np.zeros((len(self.row), 2, 2)) if self.gradient is None else np.nan_to_num(self.gradient)
        whole[:, :2, :2] = self.camera_cov
        whole[:, 2:, :2] = J @ self.camera_cov
        whole[:, :2, 2:] = np.swapaxes(whole[:, 2:, :2], 1, 2)
        whole[:, 2:, 2:] = J @ whole[:, :2, 2:]
        if self.row_shifts is not None:
            as_read = self.row_shifts * (np.add.outer(range(3), range(3)) > 0)  # the image's is in `camera_cov`
            own = self.row_variance[:, None, None]
            whole += own * (self.by_row @ as_read @ np.swapaxes(self.by_row, 1, 2))
        whole[:, [2, 3], [2, 3]] = self.projector_sigma**2
        return whole
