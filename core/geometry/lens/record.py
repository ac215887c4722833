"""What a lens model is: one record, from which all others take names, sizes and derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior

Kind = Literal["radial", "affine", "decentring"]

MAIN = ("c", "x0", "y0")  # what every model has; mm


@dataclass(frozen=True)
class Parameter:
    """An additional parameter: its name, its unit (empty for none), what it does to an image, and whether it is usual.

    One that is not usual stays at zero unless it is asked for.
    """

    name: str
    unit: str
    kind: Kind
    usual: bool = True


@dataclass(frozen=True)
class Lens:
    """A lens model."""

    name: str  #: as files name it
    additional: tuple[Parameter, ...]  #: the parameters after c, x0 and y0, in the order of `Interior.a`
    #: ``(interior, xy) -> xy``: from the collinearity image, ``x = c X/-Z``, to the measured one, mm, (..., 2) both
    distort: Callable[[Interior, Array], Array]
    #: ``(interior, xy) -> by_xy, by_parameter``, shapes (..., 2, 2) and (..., 2, k): of what `distort` gives, by the
    #: collinearity image, and by all parameters for a point that stands still (xy moves with c)
    derivatives: Callable[[Interior, Array], tuple[Array, Array]]
    #: ``(spec) -> (k,)``: what one knows of any device's parameters, c included
    usual_sigma: Callable[[DeviceSpec], Array]
    #: ``(interior, r0_mm) -> interior``: the same imaging with the radial terms' zero elsewhere; None without r0
    referred: Callable[[Interior, float], Interior] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters: c, x0, y0 and the additional ones."""
        return (*MAIN, *(p.name for p in self.additional))

    @property
    def keys(self) -> tuple[str, ...]:
        """The same as files have them, with a unit where there may be doubt."""
        return (*(f"{name}_mm" for name in MAIN), *(p.name for p in self.additional))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of all parameters, empty for none."""
        return (*("mm" for _ in MAIN), *(p.unit for p in self.additional))

    @property
    def usual(self) -> tuple[str, ...]:
        """Names of those estimated unless something else is asked for."""
        return (*MAIN, *(p.name for p in self.additional if p.usual))

    def of_kind(self, kind: Kind) -> tuple[str, ...]:
        """Names of the parameters of one kind."""
        return tuple(p.name for p in self.additional if p.kind == kind)

    def kind_of(self, name: str) -> str:
        """Kind of a parameter; c, x0 and y0 are of their own."""
        return next((p.kind for p in self.additional if p.name == name), name)

    def interior(self, c_mm: float, r0_mm: float = 0.0) -> Interior:
        """Give a device without distortion."""
        return Interior(c_mm, a=(0.0,) * len(self.additional), r0_mm=r0_mm, model=self.name)

    def plain(self, interior: Interior) -> Interior:
        """Leave out all that bends straight lines."""
        kept = [v if p.kind == "affine" else 0.0 for p, v in zip(self.additional, interior.a, strict=True)]
        return Interior(interior.c_mm, interior.x0_mm, interior.y0_mm, tuple(kept), interior.r0_mm, interior.model)
