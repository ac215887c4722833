"""A rig in space: every device with what it sees, the base, where the board stood, what all see."""

from __future__ import annotations

from math import asin, cos, sin

import cv2
import numpy as np

from core.geometry import Pose, ray_directions
from core.lazy import dataclass
from core.model import Adjustment, Array, DeviceSpec, Interior, PhotogrammetricCalibration
from core.report import Number, Table
from core.report.table import Cell
from stripe_gui.presenters.rig_view import RigPlan
from stripe_gui.presenters.space import Line, Name, Scene, seen
from stripe_gui.presenters.told import translate

SLICES = 5  # of the working volume
UP = np.array([0.0, 1.0, 0.0])
TARGET = (150, 160, 170)


@dataclass(frozen=True)
class Stand:
    """A device and where it stands."""

    spec: DeviceSpec
    interior: Interior
    from_base: Pose
    camera: bool


def stands_of(calibration: PhotogrammetricCalibration) -> dict[str, Stand]:
    """Give the calibrated devices in the frame that orientations refer to; InputError if not all are tied."""
    from core.reconstruct.placed import placed  # only now: its room loads the kernels

    found = placed(calibration).items()
    return {name: Stand(d.spec, d.interior, d.from_base, name in calibration.cameras) for name, d in found}


def planned(plan: RigPlan) -> dict[str, Stand]:
    """Give the devices of a plan, both at the working distance from what they look at."""
    half = asin(plan.base_mm / 2 / plan.distance_mm)
    poses = []
    for azimuth in (-half, half):
        x, z = np.array([cos(azimuth), 0, -sin(azimuth)]), np.array([sin(azimuth), 0, cos(azimuth)])
        poses.append(Pose(np.stack([x, UP, z]), np.array([0.0, 0.0, -plan.distance_mm])))
    camera, projector = plan.camera, plan.projector
    return {
        translate("Rig", "camera"): Stand(camera, Interior(camera.nominal_c_mm), Pose(), True),
        translate("Rig", "projector"): Stand(
            projector, Interior(projector.nominal_c_mm), poses[1] @ poses[0].inverse(), False
        ),
    }


def rig_scene(devices: dict[str, Stand], reach: tuple[float, float], targets: Array) -> Scene:
    """Draw devices with what they see, what all see between two distances, and targets, shape (n, 3)."""
    middle = float(np.mean(reach))
    lines, names = [], []
    places = {name: device.from_base.inverse().translation_mm for name, device in devices.items()}
    for name, device in devices.items():
        colour = "mark" if device.camera else "mark_other"
        eye, corners = places[name], field(device, middle)
        lines.append(Line(seen(corners[[0, 1, 2, 3, 0]]), colour))
        lines += [Line(seen(np.stack([eye, corner])), colour) for corner in corners]
        near = eye + 0.12 * (corners - eye)
        lines.append(Line(seen(near), colour, 2.0, filled=True))
        names.append(Name(seen(eye), name, colour))
    first, *others = places
    for name in others:
        lines.append(Line(seen(np.stack([places[first], places[name]])), "text", 2.0))
        length = float(np.linalg.norm(places[name] - places[first]))
        text = translate("Rig", "{mm:.1f} mm").format(mm=length)
        share = 0.7 if devices[name].camera else 0.5  # a projector often stands midway between cameras
        names.append(Name(seen(places[first] + share * (places[name] - places[first])), text, "text"))
    lines += [Line(seen(slice_), "ok", filled=True) for slice_ in common_slices(devices, reach)]
    colours = np.broadcast_to(np.array(TARGET, np.uint8), targets.shape)
    return Scene(seen(targets), colours, tuple(lines), tuple(names), spacing_mm=0.004 * middle)


def board_places(calibration: PhotogrammetricCalibration, adjustment: Adjustment | None) -> Array:
    """Give the targets of all poses, shape (n, 3), as the device that orientations refer to saw them."""
    base = next((o.base for o in calibration.orientations.values()), calibration.camera_name)
    if adjustment is None:
        return np.zeros((0, 3))
    network = adjustment.network
    found = []
    for i, device in enumerate(network.station_device):
        points = np.unique(network.observation_point[network.observation_station == i])
        if device == base and len(points):
            found.append(adjustment.station_from_object[i].apply(adjustment.points_mm[points]))
    return np.concatenate(found) if found else np.zeros((0, 3))


def depths_of(devices: dict[str, Stand], targets: Array) -> tuple[float, float]:
    """Say between which distances the rig was calibrated; without targets, about where two axes meet."""
    if len(targets):
        near, far = np.percentile(-targets[:, 2], (1, 99))
        return float(near), float(far)
    apart = max(float(np.linalg.norm(device.from_base.translation_mm)) for device in devices.values())
    return 2.0 * apart or 500.0, 3.0 * apart or 1000.0


def field(device: Stand, depth_mm: float) -> Array:
    """Give the corners, shape (4, 3), of what a device sees at a depth of the common frame; clockwise in its image."""
    w, h = device.spec.width - 0.5, device.spec.height - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    back = device.from_base.inverse()
    eye, ways = back.translation_mm, ray_directions(device.spec, device.interior, corners) @ back.rotation.T
    return eye + ways * ((-depth_mm - eye[2]) / ways[:, 2])[:, None]


def common_slices(devices: dict[str, Stand], reach: tuple[float, float]) -> list[Array]:
    """Give what all devices see at several depths, as convex polygons, shape (n, 3)."""
    found = []
    for depth in np.linspace(*reach, SLICES):
        first, *others = (field(device, depth) for device in devices.values())
        common = first[:, :2].astype(np.float32)
        for other in others:
            area, overlap = cv2.intersectConvexConvex(common, other[:, :2].astype(np.float32))
            if area <= 0:
                break
            common = np.asarray(overlap, np.float32).reshape(-1, 2)
        else:
            found.append(np.column_stack([common, np.full(len(common), first[0, 2])]))
    return found


def rig_table(devices: dict[str, Stand], reach: tuple[float, float]) -> Table:
    """List the devices: where they stand, how they are turned, what they see of the working distance."""
    rows: list[tuple[Cell, ...]] = []
    for name, device in devices.items():
        place, corners = device.from_base.inverse().translation_mm, field(device, float(np.mean(reach)))
        turn = np.degrees(np.arccos(np.clip(device.from_base.rotation[2, 2], -1, 1)))
        wide, high = (float(np.linalg.norm(corners[i] - corners[0])) for i in (1, 3))
        sizes = (wide, high, wide / device.spec.width)
        rows.append(
            (
                name,
                *(Number(float(x), ".2f") for x in place),
                Number(float(turn), ".3f"),
                Number(device.interior.c_mm, ".4f"),
                *(Number(size, spec) for size, spec in zip(sizes, (".0f", ".0f", ".3f"), strict=True)),
            )
        )
    columns = (
        translate("Rig", "device"),
        "X [mm]",
        "Y [mm]",
        "Z [mm]",
        translate("Rig", "axis turned by [°]"),
        "c [mm]",
        translate("Rig", "sees across [mm]"),
        translate("Rig", "and down [mm]"),
        translate("Rig", "one pixel or line [mm]"),
    )
    text = translate("Rig", "At {mid:.0f} mm, the middle of the calibrated distances from {near:.0f} to {far:.0f} mm.")
    note = text.format(mid=np.mean(reach), near=reach[0], far=reach[1])
    return Table("", columns, tuple(rows), (note,))
