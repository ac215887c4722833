"""Stages 1, 2 and 5 again and again: what stands before the rig, as points, while it stands there."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from itertools import combinations
from itertools import count as numbers
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.digits import fixed
from core.errors import AdjustmentError, InputError
from core.geometry import pair_named, pair_of
from core.lazy import dataclass
from core.model import DriftPoint, Floats, Method, Pair, PhaseMap, PhotogrammetricCalibration, PointCloud, Project
from core.pipeline.calibrate import chosen_calibration
from core.pipeline.capture import virtual_cameras, virtual_rig
from core.pipeline.folders import check_names
from core.pipeline.judge import based_on
from core.pipeline.methods import METHODS
from core.pipeline.reconstruct import check_cloud, check_pair, write_cloud
from core.pipeline.views import joint_clouds
from core.progress import SILENT, Progress
from core.project import read_project

if TYPE_CHECKING:
    from core.capture.live import Taken
    from core.patterns import SequenceSpec


@dataclass(frozen=True)
class Cycle:
    """One sequence, from the first pattern to its points."""

    number: int
    #: points, share: points, and their share of the pixels; those that several cameras saw count once
    points: int
    share: float
    sigma_depth_mm: float | None  #: median standard deviation of the depths, from the phase's noise
    #: of the test whether projector and camera still stand as in the cycles before, in the first as they were
    #: calibrated; None where it cannot be told: without both axes, with a calibration by depths, with too few pixels;
    #: of several pairs of devices the least, and whether any has moved
    p: float | None
    moved: bool
    retakes: int
    #: capture_s, latency_s: from the first pattern to the last verified frame, and to the points. The next sequence is
    #: taken meanwhile.
    capture_s: float
    latency_s: float
    file: str
    notes: tuple[str, ...]
    pairs: Mapping[str, float]  #: p of every pair of devices, such as "left-projector", where there are several

    def as_dict(self) -> dict[str, Any]:
        """Give it as `--json` writes it."""
        return {**asdict(self), "notes": list(self.notes)}

    @property
    def words(self) -> str:
        """The figures in one line."""
        sigma = "" if self.sigma_depth_mm is None else f"  sigma of depth {fixed(self.sigma_depth_mm, 4)} mm"
        rig = "" if self.p is None else f"  rig p = {self.p:.2g}{' MOVED' if self.moved else ''}"
        again = f"  {self.retakes} frames again" if self.retakes else ""
        took = f"  captured in {self.capture_s:.2f} s, points after {self.latency_s:.2f} s"
        return f"{self.number:4d}  {self.points} points ({self.share:.1%}){sigma}{rig}{again}{took}"


def live_cycles(
    folder: Path,
    *,
    projector: str | None = None,
    camera: str | Mapping[str, str] | None = None,
    shown_by: str = "",
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
    projector, camera : optional
        URLs; of several cameras by their names in the rig. Without them the virtual bench's rig of the project's sizes,
        with all cameras that the method takes. Points of several are each there once, in the frame of the first.
    shown_by : str
        The projector's name in the rig, if that has several.
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
    from core.reconstruct import exporter_for

    project = read_project(folder)
    chosen, calibration = chosen_calibration(project, method)
    if count < 0:
        raise InputError("--count", str(count), "give a whole number from 0 on; 0 goes on until it is ended")
    ending = ending.removeprefix(".")
    record = METHODS[chosen]
    usual, own = record.pair(project, calibration) if record.one_pair else project.rig.usual
    shown_by = shown_by or own
    cameras = _cameras(project, camera, "" if record.joint else usual)
    if out is None:
        exporter_for(Path(f"0001.{ending}"))  # nothing is written: the ending alone has to be one
    else:
        check_cloud(out / f"0001.{ending}", joined=record.joint and len(cameras) > 1)
    check_names(project, "camera", cameras)
    check_names(project, "projector", [shown_by])
    maker = _Maker(project, chosen, calibration, tuple(cameras), shown_by)
    patterns = None if sequence is None else sequence.patterns(maker.lines)
    ended = threading.Event()
    watching = Progress(cancelled=lambda: ended.is_set() or progress.cancelled())
    with (
        continuous(project, projector or virtual_rig(project), cameras, patterns, watching, shown_by) as rig,
        ThreadPoolExecutor(1, "sequences") as pool,
    ):
        try:
            ahead = pool.submit(rig.take, watching)
            for number in numbers(1):
                taken = _wait(ahead, progress)
                if number != count:
                    ahead = pool.submit(rig.take, watching)
                yield maker.cycle(number, taken, None if out is None else out / f"{number:04d}.{ending}")
                if number == count:
                    return
        finally:
            ended.set()  # a sequence that is under way ends at its next check


def _cameras(project: Project, camera: str | Mapping[str, str] | None, only: str) -> Mapping[str, str]:
    """Give the URLs of cameras by their names in the rig; unless they are named, all that the bench has, or one."""
    if isinstance(camera, str):
        return {only or project.rig.camera_name: camera}
    if camera is not None:
        return camera
    virtual = virtual_cameras(project)
    return {only: virtual[only]} if only else virtual


def _wait(ahead: Any, progress: Progress) -> Taken:
    """Wait for a sequence in grains, so that who waits can be interrupted."""
    while True:
        try:
            taken: Taken = ahead.result(timeout=0.1)
            return taken
        except TimeoutError:
            progress.check()


class _Maker:
    """Makes points of a sequence, and holds the rig of every cycle against those before it."""

    def __init__(
        self, project: Project, name: Method, calibration: Any, cameras: tuple[str, ...], projector: str
    ) -> None:
        self._method, self._calibration, self._cameras, self._projector = METHODS[name], calibration, cameras, projector
        self._basis = [concern.text for concern in based_on(name, calibration.verdict)]
        shown_by = project.rig.projectors[projector]
        self.lines = shown_by.width, shown_by.height
        self._watches: dict[tuple[str, str], _Watch] = {}
        if len(cameras) > 1 and not self._method.joint:
            seen = f"the {self._method.title} is of one camera, not of {len(cameras)}"
            raise InputError("--camera", seen, "name one")
        check_pair(project, self._method, calibration, cameras[0], projector)
        if not isinstance(calibration, PhotogrammetricCalibration):
            return
        if len(cameras) == 1:
            self._watches[cameras[0], projector] = _Watch(pair_named(calibration, cameras[0], projector))
        else:
            lit = projector in calibration.devices
            pairs = [(c, projector) for c in cameras] if lit else combinations(cameras, 2)
            self._watches = {pair: _Watch(pair_of(calibration, *pair)) for pair in pairs}

    def cycle(self, number: int, taken: Taken, file: Path | None) -> Cycle:
        """Make the points of a sequence, and write them if a file is named."""
        from core.decode import decode

        phases, notes = {}, [*self._basis]
        for camera, images in taken.images.items():
            phase = decode(list(taken.patterns), list(images), lines=self.lines, where=f"cycle {number}, {camera}")
            phases[camera] = replace(phase, camera=camera, projector=self._projector)
            notes += [f"{camera}: {note}" if len(self._cameras) > 1 else note for note in phase.notes]
        image, cloud = self._points(phases)
        if file is not None:
            write_cloud(file, image, cloud)
        valid = np.isfinite(cloud.xyz_mm[..., 2])
        depths = None if cloud.sigma_depth_mm is None else cloud.sigma_depth_mm[valid]
        seen = {pair: watch.look(self._between(phases, *pair), number) for pair, watch in self._watches.items()}
        known = {"-".join(pair): point for pair, point in seen.items() if point is not None}
        return Cycle(
            number,
            int(np.count_nonzero(valid)),
            float(np.count_nonzero(valid) / sum(phase.u.size for phase in phases.values())),
            None if depths is None or not len(depths) else float(np.nanmedian(depths)),
            min((point.p for point in known.values()), default=None),
            any(point.state == "action" for point in known.values()),
            taken.retakes,
            taken.seconds,
            time.monotonic() - taken.begun_s,
            "" if file is None else str(file),
            (*notes, *(finding.text for finding in taken.findings if finding.level != "good")),
            {name: point.p for name, point in known.items()} if len(self._watches) > 1 else {},
        )

    def _points(self, phases: Mapping[str, PhaseMap]) -> tuple[Floats, PointCloud]:
        from core.reconstruct import merged

        if len(phases) == 1:
            (phase,) = phases.values()
            return phase.image, self._method.reconstruct(phase, self._calibration, False, SILENT)
        clouds = joint_clouds([*phases.values()], self._calibration)
        cloud, image = merged(clouds, {name: phase.image for name, phase in phases.items()}, self._calibration)
        return image, cloud

    def _between(self, phases: Mapping[str, PhaseMap], one: str, other: str) -> PhaseMap:
        """Give what a camera saw of the projector, or of another camera."""
        from core.reconstruct import seen_by_other

        return seen_by_other(phases[one], phases[other]) if other in phases else phases[one]


class _Watch:
    """Holds a pair of devices in every cycle against those before it, in the first against its calibration."""

    def __init__(self, pair: Pair) -> None:
        from core.orient import expectation_of

        self._pair, self._expected = pair, expectation_of(pair)

    def look(self, phase: PhaseMap, number: int) -> DriftPoint | None:
        """Test whether they stand as they did; None where that cannot be told."""
        from core.orient import find_motion, judged

        try:
            motion = find_motion(phase, self._pair, capture=f"cycle {number}")
        except (InputError, AdjustmentError):  # one axis, few pixels, another rig: the points are there all the same
            return None
        point, self._expected = judged(motion, self._expected)
        return point
