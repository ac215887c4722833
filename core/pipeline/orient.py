"""Beside the road: has the rig moved since its calibration? From any one capture with columns and rows, or from all."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

from core.errors import AdjustmentError, InputError, TooLittleSeenError
from core.geometry import knows, pair_for, pair_of
from core.lazy import dataclass
from core.model import Capture, DriftPoint, KnownLength, Pair, PhaseMap, PhotogrammetricCalibration, Project, RigMotion
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import decode_series, one_series
from core.pipeline.folders import all_captures, find_capture, result_path
from core.pipeline.orient_known import between_targets, known_points
from core.pipeline.state.inputs import decoded_from
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive
from core.project.archive import read_head
from core.project.contents import hash_value

VERSION = 8  # raise it where the same capture and calibration give other figures: what is kept is then found again


class Look:
    """A capture looked at by one pair of devices after the other; each camera's frames are decoded once."""

    def __init__(self, project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> None:
        self.project, self.capture, self.calibration = project, capture, calibration
        self._phases: dict[tuple[str, str], PhaseMap] = {}

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Every camera with every projector, and every two calibrated cameras that took the same stripes."""
        found = list(self.capture.pairs)
        for projector in dict.fromkeys(p for _, p in found):
            cameras = [c for c, p in found if p == projector and c in self.calibration.cameras]
            found += [pair for pair in combinations(cameras, 2) if pair not in found]
        return found

    def chosen(self, camera: str, other: str, only_watched: bool) -> list[tuple[str, str]]:
        """Those that names mean, "" for all. Two cameras, which are only watched, may be named in any order."""
        found = []
        for one, two in self.pairs:
            if two in self.calibration.cameras:
                meant = bool(other or only_watched) and {camera, other} <= {"", one, two} and camera != (other or None)
            else:
                meant = camera in ("", one) and other in ("", two)
            found += [(one, two)] if meant else []
        return found

    def series(self, camera: str, other: str) -> tuple[Capture, ...]:
        """The frames of a camera and a projector, or those of two cameras."""
        if other not in self.calibration.cameras:
            return (one_series(self.capture, camera, other),)
        if other == (camera or self.capture.camera):
            raise InputError(self.capture.name, f"{other} is to be held against itself", "name two devices")
        both = [p for c, p in self.capture.pairs if c == (camera or self.capture.camera)]
        projector = next((p for p in both if (other, p) in self.capture.pairs), "")
        return one_series(self.capture, camera, projector), one_series(self.capture, other, projector)

    def phase(self, series: Sequence[Capture], progress: Progress) -> PhaseMap:
        """What these frames show of where a camera sees the lines of a projector, or the pixels of another camera."""
        from core.reconstruct import seen_by_other

        for each, part in zip(series, progress.parts(len(series)), strict=True):
            if (each.camera, each.projector) not in self._phases:
                self._phases[each.camera, each.projector] = decode_series(each, self.project, part)
        own, *others = (self._phases[each.camera, each.projector] for each in series)
        return seen_by_other(own, others[0]) if others else own

    def pair(self, series: Sequence[Capture]) -> Pair:
        """The calibration of the two."""
        if len(series) == 1:
            return pair_for(series[0], self.calibration)
        return pair_of(self.calibration, *(each.camera for each in series))

    def kept(self, series: Sequence[Capture]) -> RigMotion | None:
        """What was found before, if neither the frames nor the calibration have changed since."""
        path = _drift(self.project, series)
        try:
            if read_head(path).get("made_from") == self.made_from(series):
                return load_archive(path, RigMotion)
        except InputError:
            pass
        return None

    def made_from(self, series: Sequence[Capture]) -> dict[str, Any]:
        """The contents of all that is found from."""
        own, *others = (decoded_from(self.project, each) for each in series)
        known = {"calibration": signature_of(self.pair(series)), "orient": VERSION}
        return {**own, **known, **({"other": others[0]} if others else {})}


def orient_capture(
    project: Project,
    name: str,
    *,
    camera: str = "",
    projector: str = "",
    correct: bool = False,
    keep: bool = True,
    significance: float = 1e-3,
    lengths: Sequence[KnownLength] = (),
    points: Path | Literal["testfield"] | None = None,
    progress: Progress = SILENT,
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, by one capture.

    Parameters
    ----------
    name : str
        The capture: its name, or its folder.
    camera, projector : str
        Which pair, where the capture holds frames of several. In the projector's place may be another camera that took
        the same stripes: the projector then only labels places, and need not be calibrated.
    correct : bool
        Keep the corrected orientation, for `reconstruct_capture(..., orient=True)`. The calibration stays as it is.
    keep : bool
        Keep what was found for the control chart, which the report shows.
    significance : float
        Share of captures of an unmoved rig that may be called moved.
    lengths : sequence of KnownLength
        In the scene; kind "targets" is between targets (row, col) of the testfield. With one, the base's length and c,
        x0, y0 of both devices are estimated, too.
    points : Path or "testfield", optional
        Points measured before, as a table or as the calibration found those of the testfield: for all of that again.

    Raises
    ------
    InputError
        If there is no photogrammetric calibration, or too few pixels have both projector coordinates; if of two cameras
        more is wanted than whether they moved.
    """
    calibration = photogrammetric_calibration(project)
    look = Look(project, find_capture(project, name), calibration)
    how = Wanted(correct, keep, significance, tuple(lengths), points)
    return _orient(look, look.series(camera, projector), how, progress)


@dataclass(frozen=True)
class Wanted:
    """The options of `orient_capture`, which tells of them."""

    correct: bool = False
    keep: bool = True
    significance: float = 1e-3
    lengths: Sequence[KnownLength] = ()
    points: Path | Literal["testfield"] | None = None

    @property
    def more(self) -> bool:
        """Whether more is wanted than to know if anything has moved."""
        return bool(self.correct or self.lengths or self.points)


def _orient(look: Look, series: Sequence[Capture], wanted: Wanted, progress: Progress) -> RigMotion:
    from core.orient import OrientOptions, find_motion

    significance, points, (capture, *others) = wanted.significance, wanted.points, series
    if not 0 < significance < 1:
        raise InputError("the significance", f"is {significance:g}", "give a share between 0 and 1, such as 0.001")
    if others and wanted.more:
        seen = f"{capture.camera} and {others[0].camera} are two cameras, which are only watched"
        raise InputError(capture.name, seen, "correct a camera and a projector, or calibrate again")
    project = look.project
    kept = _corrected(project, capture)
    with still_used(kept, lambda: hash_value(look.made_from(series))) if wanted.correct else nullcontext():
        phase = look.phase(series, progress.part(0.0, 0.3))
        motion = find_motion(
            phase,
            look.pair(series),
            lengths=[between_targets(project, capture, length) for length in wanted.lengths],
            points=None if points is None else known_points(project, capture, phase, points),
            capture=capture.name,
            options=OrientOptions(significance=significance),
            progress=progress.part(0.3, 1.0),
        )
    with suppress(InputError):  # a project that may only be read is judged all the same, and again the next time
        if wanted.keep:
            save_archive(_drift(project, series), motion, look.made_from(series))
    if wanted.correct:
        save_archive(kept, (motion, hash_value(look.made_from(series))))
    return motion


def orient_pairs(
    project: Project,
    name: str,
    wanted: Wanted | None = None,
    *,
    camera: str = "",
    projector: str = "",
    progress: Progress = SILENT,
) -> tuple[list[RigMotion], dict[tuple[str, str], str]]:
    """Say it of every two devices of a capture, or of those named.

    Returns
    -------
    found : list of RigMotion
    untold : dict
        By (camera, projector or other camera) why nothing can be told of others; where nothing can be told of any, that
        is raised.
    """
    calibration = photogrammetric_calibration(project)
    look = Look(project, find_capture(project, name), calibration)
    wanted = wanted or Wanted()
    pairs = look.chosen(camera, projector, only_watched=not wanted.more)
    if not pairs or (wanted.lengths and len({pair[0] for pair in pairs}) > 1):
        one_series(look.capture, camera, projector)  # places are in one camera's image
    found: list[RigMotion] = []
    there = [pair for pair in pairs if set(pair) <= set(calibration.devices)]
    there = there or [pair for pair in pairs if knows(calibration, *pair)]  # an only one may have another name
    known_pairs = there or pairs[:1]  # of which what lacks is said
    because = f"the calibration in use is of {', '.join(calibration.devices)} alone"
    untold = {pair: because for pair in pairs if pair not in known_pairs} if calibration.projectors else {}
    wanted = replace(wanted, significance=wanted.significance / len(known_pairs))
    for pair, part in zip(known_pairs, progress.parts(len(known_pairs)), strict=True):
        try:
            found.append(_orient(look, look.series(*pair), wanted, part))
        except TooLittleSeenError as error:
            untold[pair] = error.seen
            if not found and pair == known_pairs[-1]:
                raise
    return found, untold


def drift_of(
    project: Project, *, significance: float = 1e-3, kept: bool = False, progress: Progress = SILENT
) -> dict[tuple[str, str], tuple[DriftPoint, ...]]:
    """Make the control chart of every two devices, from all captures of the project in their order.

    What a capture shows is kept, and found again only where its frames or the calibration have changed; `kept` looks at
    nothing else. Captures with one axis, or of too little, are left out, and with a warning those of another rig.
    """
    from core.orient import OrientOptions, drift_chart

    calibration = photogrammetric_calibration(project)
    motions: dict[tuple[str, str], list[RigMotion]] = {}
    captures = all_captures(project)
    for i, capture in enumerate(captures):
        progress(i / len(captures), f"looking at {capture.name}")
        look = Look(project, capture, calibration)
        for pair in look.pairs:
            if set(pair) <= set(calibration.devices):
                series = look.series(*pair)
                motion = look.kept(series) or (None if kept else _motion_if_seen(look, series))
                motions.setdefault(pair, []).extend([motion] if motion else [])
    options = OrientOptions(significance=significance)
    return {pair: drift_chart(found, pair_of(calibration, *pair), options) for pair, found in motions.items() if found}


def oriented(project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> Pair:
    """Give camera and projector of a calibration with the projector where a kept result of this capture has it.

    InputError if no corrected orientation is kept for the capture, or it is of another calibration or other frames.
    """
    sign = hash_value(Look(project, capture, calibration).made_from((capture,)))
    corrected: Pair = kept_correction(project, capture, _corrected(project, capture), sign, "orientation").pair
    return corrected


def kept_correction(project: Project, capture: Capture, path: Path, signature: str, what: str) -> Any:
    """Read what `orient --correct` has kept; InputError if it has not, or by another calibration or other frames."""
    again = f"run `stripe-core orient {project.path} {capture.name} --correct` first"
    if not path.exists():
        raise InputError(path, f"no corrected {what} is kept for this capture", again)
    found, of = load_archive(path, tuple)
    if of != signature:
        raise InputError(path, "was found with another calibration, or from other frames", again)
    return found


@contextmanager
def still_used(kept: Path, signature: Callable[[], str]) -> Iterator[None]:
    """Where a correction fails, say that an earlier one of the same frames and calibration is there for `--orient`."""
    try:
        yield
    except (InputError, AdjustmentError) as error:
        with suppress(InputError):
            if load_archive(kept, tuple)[1] == signature():
                seen = f"{error.seen} (the earlier correction stays in use for --orient: delete {kept} to be rid of it)"
                error = type(error)(error.where, seen, error.remedy)
        raise error from None


def _motion_if_seen(look: Look, series: Sequence[Capture]) -> RigMotion | None:
    try:
        return _orient(look, series, Wanted(), SILENT)
    except InputError:  # one axis, too few pixels, or frames that do not decode
        return None
    except AdjustmentError as error:  # it takes no other capture out of the chart
        logging.getLogger(__name__).warning("%s: %s; left out of the chart", error.where, error.seen)
        return None


def signature_of(calibration: Pair | PhotogrammetricCalibration) -> str:
    """What tells one calibration from another: the digits of its orientations and interiors."""
    if isinstance(calibration, Pair):
        poses, devices = [calibration.projector_from_camera], [calibration.camera, calibration.projector]
    else:
        poses = [known.device_from_base for known in calibration.orientations.values()]
        devices = [*calibration.devices.values()]
    digits = [a for pose in poses for a in (pose.rotation, pose.translation_mm)]
    digits += [device.interior.vector for device in devices]
    return hashlib.sha256(b"".join(a.tobytes() for a in digits)).hexdigest()


def _corrected(project: Project, capture: Capture) -> Path:
    return result_path(project, "orientations") / _file_name(project, (capture,))


def _drift(project: Project, series: Sequence[Capture]) -> Path:
    return result_path(project, "drift") / _file_name(project, series)


def _file_name(project: Project, series: Sequence[Capture]) -> str:
    own, *others = series
    of = "" if project.rig.is_pair else f".{own.camera}-{others[0].camera if others else own.projector}"
    return f"{own.name}{of}.npz"
