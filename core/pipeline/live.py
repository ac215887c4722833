"""Stages 1, 2 and 5 again and again: what stands before the rig, as points, while it stands there."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from itertools import count as numbers
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.errors import AdjustmentError, InputError
from core.geometry import pair_of
from core.lazy import dataclass
from core.model import DriftPoint, Method, PhaseMap, PhotogrammetricCalibration, Project
from core.pipeline.calibrate import chosen_calibration
from core.pipeline.capture import devices_of
from core.pipeline.method import CalibrationMethod
from core.pipeline.methods import METHODS
from core.pipeline.reconstruct import check_cloud, write_cloud
from core.progress import SILENT, Progress
from core.project import read_project

if TYPE_CHECKING:
    from core.capture.live import Taken
    from core.patterns import SequenceSpec


@dataclass(frozen=True)
class Cycle:
    """One sequence, from the first pattern to its points."""

    number: int
    #: points, share: points, and their share of the pixels
    points: int
    share: float
    sigma_depth_mm: float | None  #: median standard deviation of the depths, from the phase's noise
    #: of the test whether projector and camera still stand as in the cycles before, in the first as they were
    #: calibrated; None where it cannot be told: without both axes, with a calibration by depths, or with too few pixels
    p: float | None
    moved: bool
    retakes: int
    #: capture_s, latency_s: from the first pattern to the last verified frame, and to the points. The next sequence is
    #: taken meanwhile.
    capture_s: float
    latency_s: float
    file: str
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Give it as `--json` writes it."""
        return {**asdict(self), "notes": list(self.notes)}

    @property
    def words(self) -> str:
        """The figures in one line."""
        sigma = "" if self.sigma_depth_mm is None else f"  sigma of depth {self.sigma_depth_mm:.4f} mm"
        rig = "" if self.p is None else f"  rig p = {self.p:.2g}{' MOVED' if self.moved else ''}"
        again = f"  {self.retakes} frames again" if self.retakes else ""
        took = f"  captured in {self.capture_s:.2f} s, points after {self.latency_s:.2f} s"
        return f"{self.number:4d}  {self.points} points ({self.share:.1%}){sigma}{rig}{again}{took}"


def live_cycles(
    folder: Path,
    *,
    projector: str | None = None,
    camera: str | None = None,
    method: Method | None = None,
    sequence: SequenceSpec | None = None,
    count: int = 0,
    out: Path | None = None,
    ending: str = "ply",
    progress: Progress = SILENT,
) -> Generator[Cycle, None, None]:
    """Capture, decode and intersect again and again; give every cycle's figures when its points are there.

    While one sequence is decoded the next one is taken. Closing the iterator lets the devices go. Nothing in the
    project, which must be calibrated, is changed.

    Parameters
    ----------
    projector, camera : str, optional
        URLs; without them the virtual bench's rig of the project's sizes.
    count : int
        Cycles; 0: until it is ended.
    out, ending
        A folder for the points, a file for each cycle of this ending, as `stripe-core reconstruct` takes it.

    Raises
    ------
    InputError
        Before anything is shown.
    DeviceError
    """
    from core.capture.live import continuous

    project = read_project(folder)
    chosen, calibration = chosen_calibration(project, method)
    if count < 0:
        raise InputError("--count", str(count), "give a whole number from 0 on; 0 goes on until it is ended")
    if out is not None:
        check_cloud(out / f"0001.{ending}")
    lines = project.projector.width, project.projector.height
    patterns = None if sequence is None else sequence.patterns(lines)
    ended = threading.Event()
    watching = Progress(cancelled=lambda: ended.is_set() or progress.cancelled())
    watch = _Watch(calibration)
    urls = devices_of(project, projector, camera)
    with continuous(project, *urls, patterns, watching) as rig, ThreadPoolExecutor(1, "sequences") as pool:
        try:
            ahead = pool.submit(rig.take, watching)
            for number in numbers(1):
                taken = _wait(ahead, progress)
                if number != count:
                    ahead = pool.submit(rig.take, watching)
                file = None if out is None else out / f"{number:04d}.{ending}"
                yield _cycle(project, METHODS[chosen], calibration, number, taken, file, watch)
                if number == count:
                    return
        finally:
            ended.set()  # a sequence that is under way ends at its next check


def _wait(ahead: Any, progress: Progress) -> Taken:
    """Wait for a sequence in grains, so that who waits can be interrupted."""
    while True:
        try:
            taken: Taken = ahead.result(timeout=0.1)
            return taken
        except TimeoutError:
            progress.check()


def _cycle(
    project: Project,
    method: CalibrationMethod,
    calibration: Any,
    number: int,
    taken: Taken,
    file: Path | None,
    watch: _Watch,
) -> Cycle:
    from core.decode import decode

    lines = project.projector.width, project.projector.height
    phase = decode(list(taken.patterns), list(taken.images), lines=lines, where=f"cycle {number}")
    phase = replace(phase, camera=project.rig.camera_name, projector=project.rig.projector_name)
    cloud = method.reconstruct(phase, calibration, False, SILENT)
    if file is not None:
        write_cloud(file, phase.image, cloud)
    valid = np.isfinite(cloud.xyz_mm[..., 2])
    depths = None if cloud.sigma_depth_mm is None else cloud.sigma_depth_mm[valid]
    seen = watch.look(phase, number)
    told = [finding.text for finding in taken.findings if finding.level != "good"]
    return Cycle(
        number,
        int(np.count_nonzero(valid)),
        float(valid.mean()),
        None if depths is None or not len(depths) else float(np.nanmedian(depths)),
        None if seen is None else seen.p,
        seen is not None and seen.state == "action",
        taken.retakes,
        taken.seconds,
        time.monotonic() - taken.begun_s,
        "" if file is None else str(file),
        (*phase.notes, *told),
    )


class _Watch:
    """Holds the rig of every cycle against those before it, the first against its calibration."""

    def __init__(self, calibration: Any) -> None:
        from core.orient import expectation_of

        self._pair = pair_of(calibration) if isinstance(calibration, PhotogrammetricCalibration) else None
        self._expected = None if self._pair is None else expectation_of(self._pair)

    def look(self, phase: PhaseMap, number: int) -> DriftPoint | None:
        """Test whether the rig stands as it did; None where that cannot be told."""
        from core.orient import find_motion, judged

        if self._pair is None or self._expected is None:
            return None
        try:
            motion = find_motion(phase, self._pair, capture=f"cycle {number}")
        except (InputError, AdjustmentError):  # one axis, few pixels, another rig: the points are there all the same
            return None
        point, self._expected = judged(motion, self._expected)
        return point
