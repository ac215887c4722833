"""What goes wrong on real benches, by name, to be switched on in tests.

A fault may change the scene (specks, glints), the rig (exposure, sharpness), the light from frame to frame (drift), the
object's place during the sequence, or the order in which the images arrive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from core.bench.rig import Rig
from core.bench.scene import Detour, Scene
from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector
from core.lazy import dataclass


@dataclass(frozen=True)
class Fault:
    """One fault: `what` says it in words."""

    what: str
    #: scene, rig: change what stands there and what looks at it
    scene: Callable[[Scene, np.random.Generator], Scene] = lambda scene, rng: scene
    rig: Callable[[Rig], Rig] = lambda rig: rig
    #: lamp, room: factor of the projector's and the room's light at a part (0 to 1) of the sequence
    lamp: Callable[[float], float] = lambda part: 1.0
    room: Callable[[float], float] = lambda part: 1.0
    #: how far the object is displaced, in the camera's frame, from the middle of the sequence on
    moved_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: for n frames, which exposure arrives as image 0, 1, ...
    order: Callable[[int], list[int]] = lambda frames: list(range(frames))


def _spots(scene: Scene, rng: np.random.Generator, count: int, radius_mm: tuple[float, float], albedo: float) -> Scene:
    half = np.array(scene.board.half_size_mm)
    reach = np.minimum(half, 120.0)  # a wide plate is only lit in its middle
    xy = rng.uniform(-reach, reach, (count, 2))
    radius = rng.uniform(*radius_mm, count)
    spots = np.column_stack([xy, np.zeros(count), radius, np.full(count, albedo)])
    return replace(scene, board=replace(scene.board, spots=np.vstack([scene.board.spots, spots])))


def _specks(scene: Scene, rng: np.random.Generator) -> Scene:
    bright = _spots(scene, rng, 60, (0.3, 1.2), 0.7)
    return _spots(bright, rng, 60, (0.3, 1.2), 0.03)


def _detour(share: float, spread: float, mirrored: bool = False) -> Callable[[Scene, np.random.Generator], Scene]:
    return lambda scene, rng: replace(scene, detours=(*scene.detours, Detour(share, spread, mirrored)))


def _overexposed(rig: Rig) -> Rig:
    return replace(rig, sensor=replace(rig.sensor, white_level=3.5 * rig.sensor.white_level))


def _out_of_focus(rig: Rig) -> Rig:
    return replace(rig, lens=replace(rig.lens, blur_px=1.5), lcd=replace(rig.lcd, blur_lines=1.6 * rig.lcd.blur_lines))


def _flicker(part: float) -> float:
    return float(1 + 0.05 * np.sin(97 * part))


def _knocked(rig: Rig) -> Rig:
    turn, shift = matrix_from_rotation_vector([0.2e-3, 0.3e-3, 0.15e-3]), np.array([0.0, 0.07, 0.07])
    pose = rig.projector_from_camera
    R = pose.rotation @ turn.T
    return replace(rig, projector_from_camera=Pose(R, -R @ (pose.origin_mm + shift)))


def _one_lost(frames: int) -> list[int]:
    lost = frames // 3
    return [*range(lost), *range(lost + 1, frames), frames - 1]


def _two_swapped(frames: int) -> list[int]:
    order = list(range(frames))
    a, b = frames // 4, frames // 4 + 1
    order[a], order[b] = b, a
    return order


FAULTS = {
    "dropped-frame": Fault("an image is lost, all later ones arrive one too early, the last twice", order=_one_lost),
    "swapped-frames": Fault("two neighbouring images arrive in the wrong order", order=_two_swapped),
    "saturated": Fault("the exposure is 3.5 times too long", rig=_overexposed),
    "blurred": Fault("camera and projector are out of focus", rig=_out_of_focus),
    "moved": Fault("the object is displaced by half a millimetre in mid-sequence", moved_mm=(0.4, 0.2, 0.2)),
    "specks": Fault("bright and dark specks on the board", scene=_specks),
    "reflections": Fault("glints that saturate", scene=lambda scene, rng: _spots(scene, rng, 8, (1.0, 3.0), 40.0)),
    "ambient-drift": Fault("the light of the room grows to four times", room=lambda part: 1 + 3 * part),
    "knocked": Fault("the projector has turned by 0.4 mrad and shifted by 0.1 mm", rig=_knocked),
    "lamp-flicker": Fault("the lamp flickers by 5 % from frame to frame", lamp=_flicker),
    "room-flicker": Fault("the light of the room flickers by 5 % from frame to frame", room=_flicker),
    "response": Fault(
        "the projector's light is the level to the power of 2.2",
        rig=lambda rig: replace(rig, lcd=replace(rig.lcd, exponent=2.2)),
    ),
    "facing-wall": Fault("a facing wall throws back a quarter of its light", scene=_detour(0.25, 0.1, True)),
    "gloss-lobe": Fault(
        "a facing wall mirrors a tenth of its light into a narrow lobe", scene=_detour(0.1, 0.002, True)
    ),
    "subsurface": Fault("a third of the light goes on below the surface", scene=_detour(0.33, 0.015)),
    "lamp-drift": Fault("the lamp fades by 8 % during the sequence", lamp=lambda part: 1 - 0.08 * part),
}


def faults() -> tuple[str, ...]:
    """Names of the faults that can be switched on."""
    return tuple(FAULTS)


def fault(name: str) -> Fault:
    """Look up a fault."""
    if name not in FAULTS:
        raise InputError("fault", f"no fault {name!r}", f"choose among {', '.join(FAULTS)}")
    return FAULTS[name]


def displaced(scene: Scene, by_mm: ArrayLike) -> Scene:
    """Move the object, in the camera's frame, and turn it a little: nobody bumps a table without turning it."""
    shift = np.asarray(by_mm, np.float64)
    nudge = Pose(matrix_from_rotation_vector([0.0, 0.0, 1e-3 * float(np.linalg.norm(shift))]), shift)
    return replace(scene, camera_from_board=nudge @ scene.camera_from_board)
