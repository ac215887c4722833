"""A scene of the virtual bench as what virtual devices look at."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from core.bench import Experiment, Prepared, experiment, scenarios
from core.bench.experiment import Shot
from core.devices.address import Address
from core.devices.protocol import Pixels, refuse_grey
from core.devices.scene import Lines
from core.errors import InputError
from core.lazy import dataclass
from core.patterns import Pattern, grey_reason


@dataclass(frozen=True)
class BenchScene:
    """One capture's scene of a simulated experiment; its rays are cast when the first image is taken."""

    experiment: Experiment
    shot: Shot

    @property
    def camera_size(self) -> tuple[int, int]:
        return self.experiment.rig.camera.width, self.experiment.rig.camera.height

    @property
    def projector_size(self) -> tuple[int, int]:
        return self.experiment.rig.projector.width, self.experiment.rig.projector.height

    @property
    def bits(self) -> int:
        return self.experiment.rig.sensor.bits

    @property
    def sequence(self) -> tuple[Pattern, ...]:
        return self.shot.patterns

    def seen_by(self, camera: str, where: str) -> BenchScene:
        """The same before another camera of the experiment's rig."""
        views = self.experiment.views
        if camera not in views:
            raise InputError(where, f"no camera {camera!r}", f"use {', '.join(views)}")
        return replace(self, experiment=views[camera], shot=views[camera].shot(self.shot.name))

    def refusal(self, pattern: Pattern) -> str | None:
        grey = any(grey_reason(p) for shot in self.experiment.shots for p in shot.patterns)
        return None if grey else refuse_grey(pattern)

    def frame(self, pattern: Pattern, seed: int) -> Pixels:
        return self._prepared.frame(pattern, seed)

    def frame_lines(self, columns: Lines, rows: Lines, seed: int) -> Pixels:
        return self._prepared.frame_lines(columns.astype(np.float64), rows.astype(np.float64), seed)

    @cached_property
    def _prepared(self) -> Prepared:
        return self.experiment.prepared(self.shot.name)


def bench_scene(address: Address, seed: int) -> BenchScene:
    """Find the scene that a URL names: ``SCENARIO?shot=NAME``, or ``SCENARIO?pose=3`` for the third testfield.

    Of several projectors `projector` names the one that lights it; the first without.
    """
    if address.place not in scenarios():
        raise InputError(address.url, f"scene {address.place!r}", f"use flat, {', '.join(scenarios())}")
    lights = experiment(address.place, seed).lights
    lamp = address.text("projector", next(iter(lights)))
    if lamp not in lights:
        raise InputError(address.url, f"no projector {lamp!r}", f"use {', '.join(lights)}")
    made = lights[lamp]
    name = address.text("shot", f"testfield-{address.integer('pose', 1, 1):02d}")
    names = [shot.name for shot in made.shots]
    if name not in names:
        raise InputError(address.url, f"no capture {name!r} in {address.place}", f"use {', '.join(names)}")
    return BenchScene(made, made.shot(name))
