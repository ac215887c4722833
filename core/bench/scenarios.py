"""The experiments that can be simulated by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from core.bench.experiment import Experiment, Place, Plan, build
from core.bench.optics import Lcd, Lens
from core.bench.rig import CAMERA_1999, PROJECTOR_1999, Rig, converging_pair, interior, look_at
from core.bench.sensor import Sensor
from core.errors import InputError
from core.model import DeviceSpec, Role
from core.patterns import Black, Pattern, SequenceSpec, White, gray_and_phase, reference_sequence

# tilt, about, roll (degrees), place in the volume (mm)
_PAPER_PLACES = (
    Place(4, 0, 0, (-29, 20, -30)),
    Place(5, 90, 90, (24, -15, 25)),
    Place(5, 200, 180, (54, 29, -5)),
    Place(4, 300, 270, (-37, -24, 40)),
    Place(30, 0, 0, (-44, 24, 10)),
    Place(30, 45, 90, (29, 34, -20)),
    Place(28, 90, 180, (49, -24, 0)),
    Place(31, 135, 270, (-24, -39, 25)),
    Place(30, 180, 0, (49, -24, -15)),
    Place(30, 225, 90, (-34, 24, 5)),
    Place(32, 270, 180, (-39, 29, -10)),
    Place(28, 315, 270, (34, 29, 15)),
    Place(33, 20, 90, (-49, -34, -35)),
    Place(27, 70, 0, (59, 39, 20)),
    Place(34, 110, 270, (39, -44, -25)),
    Place(26, 160, 180, (-59, 34, 30)),
    Place(33, 200, 90, (44, 44, -40)),
    Place(27, 250, 0, (-54, -39, 35)),
    Place(34, 290, 270, (-44, 34, -10)),
    Place(25, 340, 180, (54, -29, 20)),
)


# made up, of the size that good lenses without a special design have
_MODERN_CAMERA = (16.0842, 0.0413, -0.0287, -0.41e-3, 0.19e-5, 0.8e-4, -0.5e-4, 0.12e-4, -0.21e-4)
_MODERN_PROJECTOR = (28.1375, 0.0521, 0.3046, -0.11e-3, 0.4e-6, 0.21e-3, -0.9e-4, 0.8e-5, -0.11e-4)


def _rig(
    camera: DeviceSpec,
    projector: DeviceSpec,
    lcd: Lcd,
    lens: Lens,
    sensor: Sensor,
    truth: tuple[tuple[float, ...], tuple[float, ...]] = (CAMERA_1999, PROJECTOR_1999),
    subsamples: int = 3,
) -> Rig:
    camera_from_volume, projector_from_camera = converging_pair(250.0, 600.0)
    return Rig(
        camera,
        interior(camera, truth[0]),
        projector,
        interior(projector, truth[1]),
        projector_from_camera,
        camera_from_volume,
        lcd,
        lens,
        sensor,
        subsamples=subsamples,
    )


def _paper() -> Plan:
    rig = _rig(
        DeviceSpec(748, 576, (0.008, 0.008), 12.0),
        DeviceSpec(640, 640, (0.09, 0.09), 182.0),
        Lcd(),
        Lens(),
        Sensor(white_level=120.0, offset=6.0, read_noise=1.6, shot_gain=0.02, jitter_px=0.02),
    )
    return Plan(
        "paper",
        "The reference experiment on the virtual bench",
        rig,
        field=(13, 19, 12.0, 5.0),
        plate=(7, 9, 24.0, 3.0),
        places=_PAPER_PLACES,
        depths_mm=range(-50, 51, 10),
        angles_deg=(0, -15, 10, 20),
        sequence=lambda _role: reference_sequence(),
        reference="brenner1999",
        ending=".tif",
    )


def _quick() -> Plan:
    rig = _rig(
        DeviceSpec(320, 240, (0.0185, 0.0185), 12.0),
        DeviceSpec(160, 160, (0.36, 0.36), 182.0),
        Lcd(blur_lines=0.55),
        Lens(blur_px=0.4),
        Sensor(white_level=110.0, offset=6.0, read_noise=1.5, shot_gain=0.02, jitter_px=0.01),
        subsamples=2,
    )
    return Plan(
        "quick",
        "A small rig for tests",
        rig,
        field=(7, 9, 19.0, 9.0),
        plate=(5, 7, 28.0, 7.0),
        places=[
            Place(4, 0, 0, (-5, 5, -20)),
            Place(5, 120, 90, (5, -5, 20)),
            Place(28, 20, 180, (8, 5, 0)),
            Place(29, 70, 270, (-6, 8, 15)),
            Place(28, 125, 0, (6, -6, -10)),
            Place(29, 170, 90, (-8, -4, 10)),
            Place(28, 245, 180, (4, 8, -15)),
            Place(29, 310, 270, (-4, -8, 5)),
        ],
        depths_mm=(-50, -25, 0, 25, 50),
        angles_deg=(0, 15),
        sequence=lambda _role: reference_sequence(160, 160),
    )


def _standing(rig: Rig, at_mm: tuple[float, float, float], c_mm: float, *truth: float) -> Rig:
    """Give the rig with another camera of the same sensor, at a place of the volume; `truth` is its x0, y0, A1..A6."""
    camera, camera_from_volume = replace(rig.camera, nominal_c_mm=c_mm), look_at(at_mm)
    return replace(
        rig,
        camera=camera,
        camera_interior=interior(camera, (c_mm + 0.1, *truth)),
        camera_from_volume=camera_from_volume,
        projector_from_camera=rig.projector_from_camera @ rig.camera_from_volume @ camera_from_volume.inverse(),
    )


def _stereo() -> Plan:
    """The small rig with a second camera on the projector's other side, with a longer lens."""
    plan = _quick()
    truth = 0.04, -0.06, -0.45e-3, 0.2e-5, -0.11e-1, -0.4e-4, 0.9e-4, 0.6e-4
    return replace(
        plan,
        name="stereo",
        title="A small rig with two cameras",
        depths_mm=(),
        objects=False,
        shadow=True,
        camera_name="left",
        others={"right": _standing(plan.rig, (375.0, 20.0, 560.0), 13.0, *truth)},
    )


def _many() -> Plan:
    """The stereo rig with a third camera above, and a second projector below, with a shorter lens."""
    plan = _stereo()
    rig, projector = plan.rig, DeviceSpec(160, 160, (0.36, 0.36), 170.0)
    truth = -0.05, 0.03, -0.5e-3, 0.1e-5, -0.13e-1, 0.2e-4, -0.7e-4, 0.4e-4
    lamp = replace(
        rig,
        projector=projector,
        projector_interior=interior(projector, (170.3, -0.8, 0.6, 0.4e-6, -0.2e-9, 0.1e-3, -0.1e-3, 0.3e-5, -0.8e-5)),
        projector_from_camera=look_at((40.0, -230.0, 550.0)) @ rig.camera_from_volume.inverse(),
    )
    return replace(
        plan,
        name="many",
        title="A small rig with three cameras and two projectors",
        others={**(plan.others or {}), "top": _standing(rig, (60.0, 240.0, 570.0), 12.5, *truth)},
        lamps={"lamp": lamp},
    )


def _modern() -> Plan:
    rig = _rig(
        DeviceSpec(2448, 2048, (0.00345, 0.00345), 16.0),
        DeviceSpec(1280, 800, (0.0076, 0.0076), 28.0),
        Lcd(fill=1.0, contrast=400.0, blur_lines=0.9, defocus_lines=2.0),
        Lens(blur_px=0.6),
        Sensor(white_level=2600.0, offset=64.0, read_noise=4.0, shot_gain=0.35, bits=12),
        truth=(_MODERN_CAMERA, _MODERN_PROJECTOR),
        subsamples=2,
    )
    return Plan(
        "modern",
        "A 5 Mpx camera and a sine projector of 1280 x 800",
        rig,
        field=(13, 19, 12.0, 5.0),
        plate=(7, 9, 24.0, 3.0),
        places=[_PAPER_PLACES[k] for k in (0, 1, 12, 14, 15, 16, 17, 18)],
        depths_mm=(-50, -25, 0, 25, 50),
        angles_deg=(0, -15),
        sequence=_modern_sequence,
        objects=False,
        bend_mm=0.2,
    )


def _modern_sequence(role: Role) -> list[Pattern]:
    """Gray code and one period for boards, columns only for the depth plate, two periods with inverses for surfaces."""
    patterns: list[Pattern] = []
    surface = role in ("plane", "object")
    for axis, lines in (("x", 1280), ("y", 800)):
        if role == "depth" and axis == "y":
            continue
        periods = (128.0, 16.0) if surface else (16.0,)
        patterns += gray_and_phase(axis, lines, cell=8, periods=periods, steps=4, inverse=surface)  # type: ignore[arg-type]
    return [*patterns, White(), Black()]


_PLANS: dict[str, Callable[[], Plan]] = {
    "paper": _paper,
    "modern": _modern,
    "quick": _quick,
    "stereo": _stereo,
    "many": _many,
}


def scenarios() -> tuple[str, ...]:
    """Names of the experiments that can be simulated."""
    return tuple(_PLANS)


def plan(name: str) -> Plan:
    """Look up an experiment's plan."""
    if name not in _PLANS:
        raise InputError("scenario", f"no scenario {name!r}", f"choose among {', '.join(_PLANS)}")
    return _PLANS[name]()


def experiment(name: str = "paper", seed: int = 0, sequence: SequenceSpec | None = None) -> Experiment:
    """Build an experiment of the given name, by its own sequence or another; equal seeds give equal experiments.

    Examples
    --------
    >>> e = experiment("paper")
    >>> len(e.shots), e.shots[0].name, len(e.shots[0].patterns)
    (37, 'testfield-01', 28)
    """
    found = plan(name)
    if seed < 0:
        raise InputError("seed", f"is {seed}", "give a whole number from 0 on")
    if sequence is not None:
        patterns = list(sequence.patterns((found.rig.projector.width, found.rig.projector.height)))
        found = replace(found, sequence=lambda _role: patterns)
    return build(found, seed)
