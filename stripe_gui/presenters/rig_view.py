"""How camera and projector stand and what they cover: the numbers behind the sketch of a rig.

Both stand at the same distance from the middle of the object plane and look at it; lens errors are left out.
"""

from __future__ import annotations

from math import asin, atan, degrees, radians, sin, tan

from core.lazy import dataclass
from core.model import DeviceSpec
from stripe_gui.presenters.told import translate

LEAST_ANGLE_DEG, MOST_ANGLE_DEG = 10.0, 60.0  # between the axes: below, depth is weak; above, much lies in shadow


@dataclass(frozen=True)
class RigPlan:
    """A rig as its sketch shows it."""

    camera: DeviceSpec
    projector: DeviceSpec
    distance_mm: float = 600.0  #: from either device to the middle of the object plane
    base_mm: float = 250.0  #: from device to device


@dataclass(frozen=True)
class Cover:
    """What one device covers."""

    #: its place in the plan: x along the base, y from the object plane (0) away; the object's middle is the origin
    at_mm: tuple[float, float]
    #: width and height of its field square to its axis at the working distance
    field_mm: tuple[float, float]
    reach_mm: tuple[float, float]  #: where its outermost rays meet the object plane
    unit_mm: float  #: one pixel, or one line, at the working distance


@dataclass(frozen=True)
class RigView:
    """The sketch's numbers."""

    camera: Cover
    projector: Cover
    convergence_deg: float  #: angle between the axes
    common_mm: float  #: width in the object plane that both cover
    #: how far a point moves along the camera's axis while the projector's coordinate changes by one line
    depth_per_line_mm: float


def presets() -> list[tuple[str, RigPlan]]:
    """Rigs to start from, with their names."""
    return [
        (
            translate("NewProject", "Reference rig: SONY XC75, cross-pattern LCD"),
            RigPlan(DeviceSpec(748, 576, (0.008, 0.008), 12.1), DeviceSpec(640, 640, (0.09, 0.09), 181.9)),
        ),
        (
            translate("NewProject", "5 Mpx camera, HDMI projector"),
            RigPlan(DeviceSpec(2448, 2048, (0.00345, 0.00345), 16.0), DeviceSpec(1280, 800, (0.0076, 0.0076), 28.0)),
        ),
    ]


def rig_text(plan: RigPlan) -> str:
    """Name both devices in one line each."""
    lines = []
    texts = (
        (plan.camera, translate("NewProject", "camera {w} × {h} px of {px:g} × {py:g} µm, focal length {c:g} mm")),
        (
            plan.projector,
            translate("NewProject", "projector {w} × {h} lines of {px:g} × {py:g} µm, focal length {c:g} mm"),
        ),
    )
    for device, text in texts:
        x, y = (1000 * pitch for pitch in device.pitch_mm)
        lines.append(text.format(w=device.width, h=device.height, px=x, py=y, c=device.nominal_c_mm))
    return "\n".join(lines)


def rig_problem(plan: RigPlan) -> str:
    """Say why a rig cannot stand like that; empty if it can."""
    if plan.base_mm >= plan.distance_mm:
        return translate("NewProject", "The base has to be shorter than the working distance.")
    half_deg = degrees(asin(plan.base_mm / 2 / plan.distance_mm))
    if max(_half_angle_deg(device, 0) for device in (plan.camera, plan.projector)) + half_deg >= 89.0:
        return translate("NewProject", "Rays of a device miss the object: its image is too wide for this focal length.")
    return ""


def rig_view(plan: RigPlan) -> RigView:
    """Work out what a rig without a `rig_problem` covers."""
    half = asin(plan.base_mm / 2 / plan.distance_mm)
    camera, projector = _cover(plan, plan.camera, -half), _cover(plan, plan.projector, half)
    common = min(camera.reach_mm[1], projector.reach_mm[1]) - max(camera.reach_mm[0], projector.reach_mm[0])
    return RigView(camera, projector, degrees(2 * half), max(common, 0.0), projector.unit_mm / sin(2 * half))


def rig_words(view: RigView) -> list[str]:
    """What the numbers mean for the work, where they are out of the ordinary."""
    words = []
    if view.convergence_deg < LEAST_ANGLE_DEG:
        text = translate(
            "NewProject", "The axes meet at {angle:.0f}°: depth is weak below {least:.0f}°, widen the base."
        )
        words.append(text.format(angle=view.convergence_deg, least=LEAST_ANGLE_DEG))
    if view.convergence_deg > MOST_ANGLE_DEG:
        text = translate(
            "NewProject", "The axes meet at {angle:.0f}°: above {most:.0f}° much of an object is in shadow."
        )
        words.append(text.format(angle=view.convergence_deg, most=MOST_ANGLE_DEG))
    narrow = min(view.camera.field_mm[0], view.projector.field_mm[0])
    if view.common_mm < narrow / 2:
        text = translate("NewProject", "Camera and projector have only {common:.0f} mm of the object plane in common.")
        words.append(text.format(common=view.common_mm))
    return words


def _cover(plan: RigPlan, device: DeviceSpec, azimuth: float) -> Cover:
    at = plan.distance_mm * sin(azimuth), plan.distance_mm * (1 - sin(azimuth) ** 2) ** 0.5
    angles = tuple(2 * _half_angle_deg(device, axis) for axis in (0, 1))
    fields = tuple(2 * plan.distance_mm * tan(radians(angle / 2)) for angle in angles)
    edges = [at[0] - at[1] * tan(azimuth + sign * radians(angles[0] / 2)) for sign in (1, -1)]
    unit = max(device.pitch_mm) * plan.distance_mm / device.nominal_c_mm
    return Cover(at, (fields[0], fields[1]), (min(edges), max(edges)), unit)


def _half_angle_deg(device: DeviceSpec, axis: int) -> float:
    size = (device.width, device.height)[axis] * device.pitch_mm[axis]
    return degrees(atan(size / 2 / device.nominal_c_mm))
