"""The devices of a rig, their interior orientation, and the project that holds them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.lazy import dataclass
from core.model.arrays import Array
from core.model.finding import Note

if TYPE_CHECKING:
    from core.patterns import SequenceSpec


@dataclass(frozen=True)
class Interior:
    """Interior orientation of a device: c, x0, y0 and the additional parameters of its lens model.

    `a` holds those in the order of `core.geometry.lens`: for the model "A1..A6" the six, referred to `r0_mm`.
    """

    c_mm: float
    x0_mm: float = 0.0
    y0_mm: float = 0.0
    a: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    r0_mm: float = 0.0
    model: str = "A1..A6"

    @property
    def vector(self) -> Array:
        """(c, x0, y0) and the additional parameters, shape (k,)."""
        return np.array([self.c_mm, self.x0_mm, self.y0_mm, *self.a])

    def changed(self, change: Array) -> Interior:
        """Add to c, x0, y0 and the additional parameters, shape (k,)."""
        return Interior.from_vector(self.vector + change, self.r0_mm, self.model)

    @staticmethod
    def from_vector(values: Array, r0_mm: float, model: str = "A1..A6") -> Interior:
        """Make the orientation from c, x0, y0 and the additional parameters, shape (k,)."""
        c, x0, y0, *a = (float(v) for v in values)
        return Interior(c, x0, y0, tuple(a), r0_mm, model)


@dataclass(frozen=True)
class DeviceSpec:
    """A camera or projector before calibration: its pixel (or line) raster and the maker's focal length."""

    width: int
    height: int
    pitch_mm: tuple[float, float]  # 0 of a projector that only labels places
    nominal_c_mm: float  # likewise
    r0_mm: float | None = None  #: where the radial parameters shall be zero
    #: known before: its model is the one that is estimated, its values are where the estimation begins
    interior: Interior | None = None
    #: how well each parameter of `interior` is known: 0 holds it, infinity leaves it free; empty for all free
    interior_sigma: tuple[float, ...] = ()
    #: (level, light) of a projector, measured before; empty where not known
    response: tuple[tuple[float, float], ...] = ()

    @property
    def labels_only(self) -> bool:
        """Whether nothing but the raster of a projector is told: it labels places, and is not calibrated."""
        return not self.nominal_c_mm

    @property
    def half_diagonal_mm(self) -> float:
        """Half the image diagonal."""
        return float(np.hypot(self.width * self.pitch_mm[0], self.height * self.pitch_mm[1]) / 2)

    @property
    def zero_radius_mm(self) -> float:
        """Where the radial parameters are zero: the given r0, else 2/3 of half the image diagonal."""
        if self.r0_mm is not None:
            return self.r0_mm
        return self.half_diagonal_mm * 2 / 3

    @property
    def model(self) -> str:
        """Name of the lens model."""
        return "A1..A6" if self.interior is None else self.interior.model


@dataclass(frozen=True)
class Rig:
    """Cameras and projectors by name, each name given once."""

    cameras: Mapping[str, DeviceSpec]
    projectors: Mapping[str, DeviceSpec]

    @property
    def devices(self) -> dict[str, DeviceSpec]:
        """All of them, cameras first."""
        return {**self.cameras, **self.projectors}

    @property
    def camera_name(self) -> str:
        """The camera meant where none is named: the only one, the one called "camera", else the first."""
        return "camera" if "camera" in self.cameras else next(iter(self.cameras))

    @property
    def projector_name(self) -> str:
        """The projector meant where none is named: the only one, the one called "projector", else the first."""
        return "projector" if "projector" in self.projectors else next(iter(self.projectors))

    @property
    def usual(self) -> tuple[str, str]:
        """The camera and the projector meant where none is named."""
        return self.pair()

    def pair(self, camera: str = "", projector: str = "") -> tuple[str, str]:
        """Name a camera and a projector, for an empty name the one meant where none is named."""
        return camera or self.camera_name, projector or self.projector_name

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Every camera with every projector."""
        return tuple((c, p) for c in self.cameras for p in self.projectors)

    @property
    def is_pair(self) -> bool:
        """Whether it is one camera and one projector."""
        return len(self.cameras) == len(self.projectors) == 1


@dataclass(frozen=True)
class ScaleBar:
    """A measured distance between two targets of the testfield, (row, col) each."""

    start: tuple[int, int]
    stop: tuple[int, int]
    length_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Project:
    """A project folder: the rig and the list of its captures (folders; read each with `core.project`)."""

    path: Path
    name: str
    rig: Rig
    scale: ScaleBar | None
    captures: tuple[Path, ...]
    reference: str | None = None  # a published experiment this rig repeats: a file name in resources/reference
    lengths: tuple[ScaleBar, ...] = ()  # further measured distances
    sequence: SequenceSpec | None = None  # what is captured unless something else is asked for
    estimate: bool = False  # coordinates are refined by all frames wherever captures are decoded
    notes: tuple[Note, ...] = ()  # on project.json

    @property
    def camera(self) -> DeviceSpec:
        """The only camera, or the one that is meant where none is named."""
        return self.rig.cameras[self.rig.camera_name]

    @property
    def projector(self) -> DeviceSpec:
        """The only projector, or the one that is meant where none is named."""
        return self.rig.projectors[self.rig.projector_name]
