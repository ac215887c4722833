"""An experiment as pure data: which captures are taken of what, with everything about them that is true.

A `Plan` says in round numbers what is to be done; `build` lets chance play its part (boards as made, places as set) and
gives the `Experiment`, from which any single capture can be rendered without a file being written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.bench.faults import displaced, fault
from core.bench.render import Exposure, Prepared, expose, prepare
from core.bench.rig import Rig
from core.bench.scene import BLACK, Block, Board, Form, Scene, Sphere, board_as_made, random_form
from core.bench.truth import operator_picks, true_targets
from core.errors import InputError, choose_among
from core.geometry import Pose, matrix_from_axis_angle
from core.lazy import dataclass
from core.model import Role, ScaleBar, Seed, Testfield
from core.patterns import Pattern
from core.progress import SILENT, Progress
from core.project import nominal_testfield

Image = NDArray[Any]
TESTFIELD, PLATE = "testfield.csv", "plate.csv"


@dataclass(frozen=True)
class Place:
    """Where a board is held: turned in its plane by `roll_deg`, tilted by `tilt_deg` about the axis at `about_deg`."""

    tilt_deg: float
    about_deg: float
    roll_deg: float
    at_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def volume_from_board(self) -> Pose:
        """Give the pose in the measuring volume."""
        about, roll = np.deg2rad(self.about_deg), np.deg2rad(self.roll_deg)
        tilt = matrix_from_axis_angle([np.cos(about), np.sin(about), 0.0], np.deg2rad(self.tilt_deg))
        return Pose(tilt @ matrix_from_axis_angle([0.0, 0.0, 1.0], roll), np.array(self.at_mm))


@dataclass(frozen=True)
class Plan:
    """What an experiment sets out to do."""

    name: str
    title: str
    rig: Rig
    #: field, plate: rows, columns, pitch in mm and diameter in mm of the testfield (white dots) and of the depth plate
    #: (black dots)
    field: tuple[int, int, float, float]
    plate: tuple[int, int, float, float]
    places: Sequence[Place]  #: one testfield capture each
    #: depths_mm, angles_deg: one capture of the depth plate or the plane-table each
    depths_mm: Sequence[float]
    angles_deg: Sequence[float]
    sequence: Callable[[Role], list[Pattern]]  #: the patterns shown for a role
    #: objects, shadow: captures of a sphere and a step; of a painted, bent board in whose middle something shadows the
    #: projector
    objects: bool = True
    shadow: bool = False
    reference: str | None = None
    #: bend_mm, offset_sigma_mm: of the testfield as made: bend from lowest to highest place; sigma of its targets'
    #: places in x, y, z
    bend_mm: float = 0.3
    offset_sigma_mm: tuple[float, float, float] = (0.1, 0.1, 0.05)
    #: plate_flat_mm, table_flat_mm: form error from lowest to highest place
    plate_flat_mm: float = 0.004
    table_flat_mm: float = 0.007
    #: depth_sigma_mm, axis_tilt_deg: error of the depth plate's positions; angle between its movement and its normal
    depth_sigma_mm: float = 0.003
    axis_tilt_deg: float = 0.2
    scale_sigma_mm: float = 0.005
    plate_half_mm: tuple[float, float] = (200.0, 200.0)
    camera_name: str = "camera"  #: of the rig's camera
    ending: str = ".png"  #: of the frames' names: PNG, or plain TIFF of twice the room and a tenth of the time
    others: Mapping[str, Rig] | None = None  #: further cameras, each as a rig with the same projector
    lamps: Mapping[str, Rig] | None = None  #: beside "projector", each as a rig with the same camera


@dataclass(frozen=True)
class Shot:
    """One capture to be taken."""

    name: str
    role: Role
    scene: Scene
    patterns: tuple[Pattern, ...]
    stream: int  # numbers the noise
    testfield: str | None = None
    z_mm: float | None = None
    angle_deg: float | None = None
    seeds: tuple[Seed, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """A plan after chance has played its part."""

    plan: Plan
    seed: int
    testfields: dict[str, Testfield]  # nominal, by file name
    scale: ScaleBar
    shots: tuple[Shot, ...]
    depth_true_mm: dict[str, float] = field(default_factory=dict)  # by capture

    @property
    def rig(self) -> Rig:
        """The rig as it really is."""
        return self.plan.rig

    @property
    def lights(self) -> dict[str, Experiment]:
        """The same experiment by every projector, by its name; the noise of each is its own."""
        found, plan = {"projector": self}, self.plan
        for k, (name, lamp) in enumerate((plan.lamps or {}).items(), 1):
            lit = replace(
                plan,
                rig=_lit_by(plan.rig, lamp),
                others={camera: _lit_by(rig, lamp) for camera, rig in (plan.others or {}).items()},
                lamps=None,
            )
            shots = tuple(replace(shot, stream=shot.stream + 100_000 * k) for shot in self.shots)
            found[name] = replace(self, plan=lit, shots=shots)
        return found

    @property
    def views(self) -> dict[str, Experiment]:
        """The same experiment before every camera, by its name; the noise of each is its own."""
        found = {self.plan.camera_name: self}
        for k, (name, rig) in enumerate((self.plan.others or {}).items(), 1):
            moved = rig.camera_from_volume @ self.rig.camera_from_volume.inverse()
            rng = np.random.default_rng([self.seed, 1000 * k])
            shots = []
            for shot in self.shots:
                scene = replace(shot.scene, camera_from_board=moved @ shot.scene.camera_from_board)
                seen = replace(shot, scene=scene, stream=shot.stream + 1000 * k)
                shots.append(replace(seen, seeds=_picks(rig, seen, rng)))
            plan = replace(self.plan, rig=rig, camera_name=name, others=None, lamps=None)
            found[name] = replace(self, plan=plan, shots=tuple(shots))
        return found

    def shot(self, name: str) -> Shot:
        """Look up a capture by name."""
        for shot in self.shots:
            if shot.name == name:
                return shot
        raise InputError("scenario", f"no capture {name!r}", choose_among(name, [s.name for s in self.shots]))

    def take(
        self, shot: Shot, fault_names: Sequence[str] = (), *, progress: Progress = SILENT
    ) -> list[tuple[Pattern, Image]]:
        """Take the frames of one capture, with any faults switched on: patterns as listed, images as they arrive."""
        wrong = [fault(name) for name in fault_names]
        rig, scene = self.rig, shot.scene
        for each in wrong:
            rig = each.rig(rig)
            scene = each.scene(scene, np.random.default_rng([self.seed, shot.stream, 7]))
        before = after = prepare(rig, scene)
        moved = np.array([f.moved_mm for f in wrong]).reshape(-1, 3).sum(axis=0)
        if np.any(moved):
            after = prepare(rig, displaced(scene, moved))
        exposures = []
        for k, pattern in enumerate(shot.patterns):
            part = k / max(1, len(shot.patterns) - 1)
            lamp = float(np.prod([f.lamp(part) for f in wrong]))
            room = float(np.prod([f.room(part) for f in wrong]))
            exposures.append(Exposure(before if part < 0.5 else after, pattern, lamp, room))
        images = expose(exposures, [self.seed, shot.stream], progress=progress)
        order = list(range(len(images)))
        for each in wrong:
            order = [order[k] for k in each.order(len(images))]
        return [(pattern, images[k]) for pattern, k in zip(shot.patterns, order, strict=True)]

    def prepared(self, name: str) -> Prepared:
        """Prepare the rig before the scene of a capture."""
        return prepare(self.rig, self.shot(name).scene)


def _lit_by(rig: Rig, lamp: Rig) -> Rig:
    """Put a projector of another rig in the place of a rig's own."""
    from_camera = lamp.projector_from_camera @ lamp.camera_from_volume @ rig.camera_from_volume.inverse()
    return replace(
        rig,
        projector=lamp.projector,
        projector_interior=lamp.projector_interior,
        projector_from_camera=from_camera,
        lcd=lamp.lcd,
    )


def build(plan: Plan, seed: int) -> Experiment:
    """Let chance play its part: equal seeds give equal experiments."""
    rng = np.random.default_rng([seed, 1])
    field_nominal = nominal_testfield(*plan.field)
    plate_nominal = nominal_testfield(*plan.plate, polarity="black-on-white")
    made = board_as_made(
        field_nominal, rng, bend_mm=plan.bend_mm, offset_sigma_mm=plan.offset_sigma_mm, margin_mm=plan.field[2]
    )
    dots = board_as_made(
        plate_nominal, rng, bend_mm=plan.plate_flat_mm, offset_sigma_mm=(0.02, 0.02, 0.0), margin_mm=20.0
    )
    plate = replace(dots, half_size_mm=plan.plate_half_mm)
    table = Board((200.0, 200.0), random_form(rng, (120.0, 120.0), plan.table_flat_mm))
    fields = _field_shots(plan, made, rng)
    depths, depth_true_mm = _depth_shots(plan, plate, rng)
    shots = [*fields, *depths, *_plane_shots(plan, table, rng), *(_object_shots(plan) if plan.objects else [])]
    shots += [_shadow_shot(plan, seed)] if plan.shadow else []
    return Experiment(
        plan,
        seed,
        {TESTFIELD: field_nominal, PLATE: plate_nominal},
        _measured_scale(plan, fields, rng),
        tuple(replace(shot, stream=k, seeds=_picks(plan.rig, shot, rng)) for k, shot in enumerate(shots)),
        depth_true_mm,
    )


def _measured_scale(plan: Plan, shots: Sequence[Shot], rng: np.random.Generator) -> ScaleBar:
    """Measure a diagonal of the field, its ends as far out as the captures see them at least three times."""
    board = shots[0].scene.board.targets
    assert board is not None
    seen = np.sum([true_targets(plan.rig, shot.scene).visible for shot in shots], axis=0)
    index, (rows, cols) = board.index(), plan.field[:2]
    for k in range(min(rows, cols) // 2):
        rising = (rows - 1 - k, k), (k, cols - 1 - k)
        falling = (k, k), (rows - 1 - k, cols - 1 - k)
        ends = max((rising, falling), key=lambda pair: min(seen[index[end]] for end in pair))
        if min(seen[index[end]] for end in ends) >= 3:
            break
    a, b = (board.xyz_mm[index[end]] for end in ends)
    length = float(np.linalg.norm(b - a)) + rng.normal() * plan.scale_sigma_mm
    return ScaleBar(ends[0], ends[1], round(length, 4), plan.scale_sigma_mm)


def _field_shots(plan: Plan, board: Board, rng: np.random.Generator) -> list[Shot]:
    shots = []
    for k, place in enumerate(plan.places, 1):
        tilt, about, roll = np.array([place.tilt_deg, place.about_deg, place.roll_deg]) + rng.normal(size=3) * [
            1.0,
            4.0,
            1.5,
        ]
        at = np.array(place.at_mm) + rng.normal(size=3) * 2.0
        pose = Place(tilt, about, roll, tuple(at)).volume_from_board()
        scene = Scene(board, plan.rig.camera_from_volume @ pose)
        shots.append(_shot(plan, f"testfield-{k:02d}", "testfield", scene, testfield=TESTFIELD))
    return shots


def _depth_shots(plan: Plan, plate: Board, rng: np.random.Generator) -> tuple[list[Shot], dict[str, float]]:
    square = Place(rng.normal() * 0.3, rng.uniform(0, 360), rng.normal() * 0.3).volume_from_board().rotation
    tilt, about = np.deg2rad(plan.axis_tilt_deg), rng.uniform(0, 2 * np.pi)
    axis = square @ [np.sin(tilt) * np.cos(about), np.sin(tilt) * np.sin(about), np.cos(tilt)]
    shots, depths = [], {}
    for k, z in enumerate(plan.depths_mm, 1):
        true = z + rng.normal() * plan.depth_sigma_mm
        scene = Scene(plate, plan.rig.camera_from_volume @ Pose(square, axis * true))
        shot = _shot(plan, f"depth-{k:02d}", "depth", scene, testfield=PLATE, z_mm=float(z))
        depths[shot.name] = true
        shots.append(shot)
    return shots, depths


def _plane_shots(plan: Plan, table: Board, rng: np.random.Generator) -> list[Shot]:
    shots = []
    for angle in plan.angles_deg:
        turned = matrix_from_axis_angle([0.0, 1.0, 0.0], np.deg2rad(angle + rng.normal() * 0.05))
        scene = Scene(table, plan.rig.camera_from_volume @ Pose(turned, rng.normal(size=3) * [5.0, 5.0, 1.0]))
        shots.append(_shot(plan, f"plane{angle:+03.0f}", "plane", scene, angle_deg=float(angle)))
    return shots


def _object_shots(plan: Plan) -> list[Shot]:
    base = Board((200.0, 200.0), albedo=BLACK)
    pose = plan.rig.camera_from_volume @ Pose(np.eye(3), np.array([0.0, 0.0, -25.0]))
    sphere = Scene(base, pose, spheres=(Sphere((0.0, 0.0, 30.0), 30.0),))
    step = Scene(replace(base, albedo=1.0), pose, blocks=(Block((0.0, -50.0, 0.0), (60.0, 50.0, 20.0)),))
    return [_shot(plan, "object-sphere", "object", sphere), _shot(plan, "object-step", "object", step)]


def _shadow_shot(plan: Plan, seed: int) -> Shot:
    """A board with random spots; a ball near the projector, which no camera sees, shadows its middle."""
    rng = np.random.default_rng([seed, 2])
    half, count = np.array([140.0, 110.0]), 1600
    x, y = rng.uniform(-half, half, (count, 2)).T
    spots = np.column_stack([x, y, np.zeros(count), rng.uniform(1.2, 3.5, count), rng.uniform(0.15, 0.8, count)])
    board = Board(
        (half[0], half[1]),
        Form(np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 0.0], [-4.0, 0.0, 0.0]]), 100.0),
        0.6,
        spots=spots,
    )
    volume_from_board = Pose(matrix_from_axis_angle([0.3, 1.0, 0.0], np.deg2rad(12.0)), np.array([0.0, 0.0, -10.0]))
    volume_from_projector = (plan.rig.projector_from_camera @ plan.rig.camera_from_volume).inverse()
    ball = volume_from_board.inverse().apply(0.75 * volume_from_projector.translation_mm)
    scene = Scene(board, plan.rig.camera_from_volume @ volume_from_board, (Sphere(tuple(ball), 10.0),), ambient=24.0)
    return _shot(plan, "object-shadow", "object", scene)


def _shot(plan: Plan, name: str, role: Role, scene: Scene, **more: Any) -> Shot:
    return Shot(name, role, scene, tuple(plan.sequence(role)), 0, **more)


def _picks(rig: Rig, shot: Shot, rng: np.random.Generator) -> tuple[Seed, ...]:
    return () if shot.testfield is None else operator_picks(true_targets(rig, shot.scene), rng)
