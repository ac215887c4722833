"""What may be chosen about the calibration of a project."""

from __future__ import annotations

from core.errors import InputError, choose_among
from core.geometry import lens_of
from core.lazy import dataclass
from core.model import Project
from core.pipeline.folders import check_names

DEVICES = ("camera", "projector")


@dataclass(frozen=True)
class CalibrateOptions:
    """What the operator may choose; each method reads its own part."""

    #: one relative orientation of camera and projector for all poses; otherwise every station is free
    rigid: bool = True
    degree: int | None = 3  #: degree of the depth polynomial; None for the piecewise-linear table
    low_pass_px: float = 2.0  #: standard deviation of the Gaussian that smooths the depth calibration; 0 for none
    without: tuple[str, ...] = ()  #: names of captures that take no part
    #: parameters that are not estimated, such as "projector.A3": c stays at its nominal value, all others at zero
    hold: tuple[str, ...] = ()
    #: observations with a normalised residual beyond this are left out as gross errors; None keeps them all
    reject_beyond: float | None = 5.0
    #: camera, projector: those that the depth calibration is of; empty for those meant where none is named
    camera: str = ""
    projector: str = ""


def check_options(project: Project, options: CalibrateOptions) -> None:
    """See that the names chosen are names of something."""
    names = [folder.name for folder in project.captures]
    for name in options.without:
        if name not in names:
            raise InputError(project.path, f"no capture {name!r} to leave out", choose_among(name, names))
    for name in options.hold:
        device, _, parameter = name.partition(".")
        spec = project.rig.devices.get(device, project.camera)
        if device not in project.rig.devices or parameter not in lens_of(spec).names:
            devices = " or ".join(project.rig.devices)
            known = f"{devices}, a dot, and one of {', '.join(lens_of(spec).names)}"
            raise InputError("the parameters to hold", f"{name!r} is none", f"give {known}")
    check_names(project, "camera", filter(None, [options.camera]))
    check_names(project, "projector", filter(None, [options.projector]))
    if options.reject_beyond is not None and not options.reject_beyond >= 3:
        seen = f"is {options.reject_beyond:g}, which good observations exceed too"
        raise InputError("the limit of gross errors", seen, "give 3 or more, or none")
