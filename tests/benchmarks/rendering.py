"""The virtual bench: rays cast and frames exposed, on one and on all threads, beside a copy of what they write.

A ray is undistorted, meets the board and is projected into the projector in double precision; it writes 17 bytes. Where
one thread takes as many times longer as there are threads, and the copy next to nothing, arithmetic is the bound.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core import parallel
from core.bench import Prepared, experiment, prepare
from core.bench.raycast import cast
from core.geometry import project
from core.patterns import Phase, brightness
from tests.benchmarks.timing import EFFORT, OURS, Contestant, Row, floor, race

BYTES = 17  # u, v, gain, reflect as float32, and the number of the defocus


def run() -> list[Row]:
    """The reference rig before its plane-table, at one, four and nine rays a pixel; then its frames."""
    taken = experiment("paper")
    scene, rig = taken.shot("plane+00").scene, taken.rig
    rows = []
    for side in (1,) if EFFORT.quick else (1, 2, 3):
        finer = replace(rig, subsamples=side)
        rays = rig.camera.width * rig.camera.height * side**2

        def work(rig=finer) -> Prepared:
            return prepare(rig, scene)

        field = [
            Contestant(OURS, work, _traced),
            Contestant("stripe workbench, one thread", lambda w=work: _single(w), _traced),
            *floor([], BYTES * rays),
        ]
        rows += _rated(race("rays", f"{side * side} rays a pixel", rays, "rays", field))
    prepared = prepare(rig, scene)
    wave = Phase("x", 8.0, 4, 0, 0.0, "sine")
    samples = prepared.samples.u.size

    def shows(image: np.ndarray) -> str:
        return _shows(prepared, wave, image)

    field = [
        Contestant(OURS, lambda: prepared.frame(wave), shows),
        Contestant("stripe workbench, one thread", lambda: _single(lambda: prepared.frame(wave)), shows),
        *floor([prepared.samples.u, prepared.samples.v, prepared.samples.gain], prepared.samples.width.size),
    ]
    size = f"{rig.camera.width}x{rig.camera.height} x {rig.subsamples**2} samples"
    return rows + _rated(race("frames exposed", size, samples, "", field), "samples")


def _single(work):
    threads = parallel.THREADS
    parallel.limit_threads(1)
    try:
        return work()
    finally:
        parallel.limit_threads(threads)


def _traced(prepared: Prepared) -> str:
    """Compare with core.geometry, which shares no formula: rays end where they were aimed, and are seen where told."""
    rig, scene = prepared.rig, prepared.scene
    side = rig.subsamples
    _, points = cast(rig, scene, side, with_points=True)
    v, u = np.mgrid[0 : points.shape[0], 0 : points.shape[1]]
    aimed = np.stack([(u + 0.5) / side - 0.5, (v + 0.5) / side - 0.5], axis=-1)
    on = np.isfinite(points[..., 0])
    seen = project(rig.camera, rig.camera_interior, points[on], scene.camera_from_board)
    off = np.abs(seen - aimed[on]).max()
    assert off < 1e-6, f"rays end {off:.1e} px beside their aim"
    projector_from_board = rig.projector_from_camera @ scene.camera_from_board
    lines = project(rig.projector, rig.projector_interior, points[on], projector_from_board)
    told = np.stack([prepared.samples.u, prepared.samples.v], axis=-1)[on]
    off = np.abs(told - lines).max()
    assert off < 1e-3, f"projector coordinates {off:.1e} lines off"  # kept as float32
    return f"{on.mean():.0%} meet the board, {off:.1e} lines off"


def _shows(prepared: Prepared, wave: Phase, image: np.ndarray) -> str:
    """The light over the board goes with what the pattern shows there."""
    side = prepared.rig.subsamples
    u = prepared.samples.u[side // 2 :: side, side // 2 :: side]
    lit = prepared.samples.gain[side // 2 :: side, side // 2 :: side] > 0.5
    meant = brightness(wave, np.clip(np.rint(u[lit]), 0, prepared.rig.projector.width - 1))
    correlation = np.corrcoef(meant, image[lit])[0, 1]
    assert correlation > 0.8, f"the image does not show the pattern: correlation {correlation:.2f}"
    return f"correlation with the pattern {correlation:.2f}"


def _rated(rows: list[Row], what: str = "rays") -> list[Row]:
    """Add samples a second, which is what a renderer is compared by."""
    return [
        replace(r, right=f"{r.amount / r.seconds / 1e6:.1f} M {what}/s; {r.right}")
        if r.contestant.startswith(OURS) and not r.failed
        else r
        for r in rows
    ]
