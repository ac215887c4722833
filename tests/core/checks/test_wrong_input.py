"""Wrong input is named, on two rigs; sound input raises no concern.

What is changed are the documents and the measured targets of a simulated project; the cause that the first sentences
must name is given as a pattern. `STRIPE_MANY=200 pytest …` counts false alarms on that many varied rigs.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from core.calibrate import calibrate_photogrammetric
from core.calibrate.depth.camera import TargetPlane, orient_camera
from core.checks import (
    adjustment_concerns,
    depthless_concerns,
    flatness_concerns,
    foreign_concerns,
    length_concerns,
    misplaced_concerns,
    misplaced_on_plate,
    nominal_concerns,
    placed_concerns,
    pose_plates,
    repeated_targets,
    see_plates,
)
from core.checks.plates import Plates
from core.errors import StripeError
from core.geometry import Pose, pair_of
from core.geometry import nominal as nominal_of
from core.model import (
    Concern,
    DepthCalibration,
    Interior,
    PhotogrammetricCalibration,
    ScaleBar,
    TargetSet,
    Testfield,
    Verdict,
    verdict_of,
)
from tests.calibrated import calibration_of_pair
from tests.core.checks.rigs import RIGS, Project, simulate, turn

_DONE: list[tuple] = []  # the last sound calibration, which wrong plates do not touch


def calibrated(p: Project) -> tuple:
    for key, result in _DONE:
        if key[0] is p.rig and key[1] is p.board and key[2] is p.fields and key[3] is p.scale:
            return result
    result = calibrate_photogrammetric(p.rig, p.board, p.fields, scale=p.scale)
    if len(_DONE) < 2:
        _DONE.append(((p.rig, p.board, p.fields, p.scale), result))
    return result


def judge(p: Project) -> Verdict:
    """As the program does, without files."""
    calibration, adjustment = calibrated(p)
    network = adjustment.network
    count = dict(zip(network.station_names, np.bincount(network.observation_station), strict=True))
    rejected = {}
    for t in p.fields:
        for device in ("camera", "projector"):
            name = f"{t.capture}/{device}"
            rejected[name] = len(t.row) - int(count.get(name, 0)), len(t.row)

    def lengths() -> list[Concern]:
        plates = see_plates(calibration, p.plates, p.z_mm, p.plate)
        told = length_concerns(adjustment, p.board, p.scale, plates, False)
        told = [*told, *misplaced_on_plate(p.plate, plates)]
        return told or placed_concerns(depth(p, calibration), plates)

    concerns = [
        *repeated_targets(p.fields),
        *adjustment_concerns(adjustment, rejected),
        *misplaced_concerns(p.board, adjustment, p.fields),
        *(depthless_concerns(calibration, adjustment) or lengths()),
        *nominal_concerns({"camera": calibration.camera, "projector": calibration.projector}),
    ]
    return verdict_of(concerns)


def depth(p: Project, known: PhotogrammetricCalibration) -> DepthCalibration:
    """Where a depth calibration has the plate; its curves are no matter of targets."""
    index, spec, at = p.plate.index(), p.rig.cameras["camera"], pair_of(known).covariance[:9, :9]
    rows = [[index[key] for key in t.keys] for t in p.plates]
    planes = [
        TargetPlane(p.z_mm[t.capture], np.array(k), p.plate.xyz_mm[k], t.camera_uv)
        for k, t in zip(rows, p.plates, strict=True)
    ]
    found = orient_camera(spec, planes, interior=(known.camera.interior, at))
    none, z = np.zeros((1, 1, 1), np.float32), np.array([*p.z_mm.values()])
    pose, axis = found.camera_from_plate, found.axis_direction
    return DepthCalibration(
        "u", z, 3, none, none, 0.1, 1, spec, found.interior, pose, axis, covariance=found.covariance
    )


def shifted_column(field: Testfield, col: int, x_mm: float) -> Testfield:
    """As a slip of the hand in a table of coordinates makes it."""
    return replace(field, xyz_mm=field.xyz_mm + x_mm * (field.col == col)[:, None] * [1, 0, 0])


def sheared(field: Testfield) -> Testfield:
    return replace(field, xyz_mm=field.xyz_mm + 0.01 * field.xyz_mm[:, [1]] * [1, 0, 0])


def lifted(field: Testfield, z_mm: float) -> Testfield:
    return replace(field, xyz_mm=field.xyz_mm + np.array([0, 0, z_mm]))


def scaled(field: Testfield, x: float, y: float | None = None) -> Testfield:
    return replace(field, xyz_mm=field.xyz_mm * [x, x if y is None else y, 1.0])


def uneven(field: Testfield) -> Testfield:
    """Heights of some µm, given in µm."""
    return replace(field, xyz_mm=field.xyz_mm + [0, 0, 1] * (8 * np.sin(field.xyz_mm[:, :1] / 40)))


def bowl(field: Testfield) -> Testfield:
    """A board given as bent by a hundredth of its size."""
    xy = field.xyz_mm[:, :2] / np.abs(field.xyz_mm[:, :2]).max()
    return replace(field, xyz_mm=field.xyz_mm + np.outer(np.sum(xy**2, axis=1) * np.ptp(field.xyz_mm) / 100, [0, 0, 1]))


def device(p: Project, camera: bool, **changes) -> Project:
    cameras, projectors = dict(p.rig.cameras), dict(p.rig.projectors)
    group, name = (cameras, "camera") if camera else (projectors, "projector")
    group[name] = replace(group[name], **{k: f(getattr(group[name], k)) for k, f in changes.items()})
    return replace(p, rig=replace(p.rig, cameras=cameras, projectors=projectors))


def one(p: Project, k: int, change: Callable[[TargetSet], TargetSet]) -> Project:
    fields = list(p.fields)
    fields[k] = change(fields[k])
    return replace(p, fields=tuple(fields))


def shifted(t: TargetSet, px: float, lines: float = 0.0) -> TargetSet:
    return replace(t, camera_uv=t.camera_uv + np.array([px, 0.0]), projector_uv=t.projector_uv + np.array([lines, 0.0]))


def with_lines_of(other: TargetSet, t: TargetSet) -> TargetSet:
    """Camera's coordinates of one capture, the projector's of another, for the targets that both have."""
    at = {key: k for k, key in enumerate(zip(other.row.tolist(), other.col.tolist(), strict=True))}
    keys = list(zip(t.row.tolist(), t.col.tolist(), strict=True))
    lines = [other.projector_uv[at[key]] if key in at else [np.nan, np.nan] for key in keys]
    return replace(t, projector_uv=np.array(lines))


def exposed_again(t: TargetSet, sigmas: float) -> TargetSet:
    """The same targets with further noise."""
    rng = np.random.default_rng(0)
    uv = t.camera_uv + sigmas * rng.normal(0, np.sqrt(np.diagonal(t.camera_cov, axis1=1, axis2=2)))
    return replace(t, camera_uv=uv, projector_uv=t.projector_uv + sigmas * rng.normal(0, t.projector_sigma))


def one_coordinate(p: Project, k: int) -> Project:
    """Columns alone, or rows."""
    only = np.where(np.arange(2) == k, 1.0, np.nan)
    return replace(p, fields=tuple(replace(t, projector_uv=t.projector_uv * only) for t in p.fields))


def half_turned(t: TargetSet, rows: int, cols: int) -> TargetSet:
    return replace(t, row=rows - 1 - t.row, col=cols - 1 - t.col)


def known_before(p: Project, c: float, sigma: float) -> Project:
    """The camera's c as some other calibration had it."""
    spec = p.rig.cameras["camera"]
    interior = Interior(c * spec.nominal_c_mm, r0_mm=spec.zero_radius_mm)
    sigmas = (sigma, *[math.inf] * 8)
    camera = replace(spec, interior=interior, interior_sigma=sigmas)
    return replace(p, rig=replace(p.rig, cameras={"camera": camera}))


def turned_plates(p: Project) -> Project:
    """The projector stood upside down while the plates were captured."""
    spec = p.rig.projectors["projector"]
    last = np.array([spec.width - 1, spec.height - 1])
    return replace(p, plates=tuple(replace(t, projector_uv=last - t.projector_uv) for t in p.plates))


def bar(p: Project, factor: float) -> Project:
    return replace(p, scale=replace(p.scale, length_mm=p.scale.length_mm * factor))


def z(p: Project, change: Callable[[str, float], float]) -> Project:
    return replace(p, z_mm={name: change(name, value) for name, value in p.z_mm.items()})


def exchanged(p: Project, a: str, b: str) -> Project:
    names = {a: b, b: a}
    return z(p, lambda name, value: p.z_mm[names.get(name, name)])


def both_boards(p: Project, factor: float) -> Project:
    return replace(p, board=scaled(p.board, factor), plate=scaled(p.plate, factor))


def misplaced(p: Project, row: int, col: int, x: float = 0.0, z: float = 0.0, *, seen: bool = True) -> Project:
    """One target's place in the file wrong; beyond a tenth of the spacing no image is seen to have it."""
    xyz = p.board.xyz_mm.copy()
    xyz[p.board.index()[row, col]] += (x, 0, z)
    fields = p.fields if seen else tuple(without(t, row, col) for t in p.fields)
    return replace(p, board=replace(p.board, xyz_mm=xyz), fields=fields)


def without(t: TargetSet, row: int, col: int) -> TargetSet:
    """A set without one target."""
    keep = (t.row != row) | (t.col != col)
    arrays = {f.name: v[keep] for f in fields(t) if isinstance(v := getattr(t, f.name), np.ndarray)}
    return replace(t, **arrays)  # type: ignore[arg-type]


BAR, BOARD, PLATE, Z = "scale bar", r"testfield\b.*testfield\.csv", "plate's board", "plate positions"
KINDS: dict[str, tuple[Callable[[Project], Project], str]] = {
    "bar +0.5 %": (lambda p: bar(p, 1.005), f"{BAR}.*1.00"),
    "bar +10 %": (lambda p: bar(p, 1.1), rf"{BAR}.*1\.(1|09)"),
    "bar in cm": (lambda p: bar(p, 0.1), f"{BAR}.*cm"),
    "bar in m": (lambda p: bar(p, 0.001), f"{BAR}.* m instead"),
    "bar in inches": (lambda p: bar(p, 1 / 25.4), f"{BAR}.*inches"),
    "bar's sigma in um": (lambda p: replace(p, scale=replace(p.scale, sigma_mm=5.0)), "scale: sigma_mm is 5, .*µm"),
    "board's z in um": (
        lambda p: replace(p, board=uneven(p.board)),
        r"testfield\.csv: .* flatter than that: correct z_mm; .*µm",
    ),
    "a flat board given as a bowl": (
        lambda p: replace(p, board=bowl(p.board)),
        r"testfield\.csv: .* flatter than that: correct z_mm$",
    ),
    "bar on other targets": (lambda p: replace(p, scale=replace(p.scale, stop=(6, 6))), f"{BAR}.*other targets"),
    "bar on a short pair": (lambda p: replace(p, scale=replace(p.scale, stop=(3, 8))), BAR),
    "c known before 5 % off": (lambda p: known_before(p, 1.05, 0.02), "camera: c_mm is .*known before as"),
    "projector turned round for the plates": (turned_plates, "^depth-.*off each other's rays"),
    "board x1.05": (lambda p: replace(p, board=scaled(p.board, 1.05)), f"{BOARD}.*1.05|{BOARD}.*1.04"),
    "board in cm": (lambda p: replace(p, board=scaled(p.board, 0.1)), f"{BOARD}.*cm"),
    "board in inches": (lambda p: replace(p, board=scaled(p.board, 1 / 25.4)), f"{BOARD}.*inches"),
    "board's x x1.03": (lambda p: replace(p, board=scaled(p.board, 1.03, 1.0)), r"testfield\.csv: x is stretched"),
    "board's y x1.01": (lambda p: replace(p, board=scaled(p.board, 1.0, 1.01)), r"testfield\.csv: x is stretched"),
    "board's target 10 mm off": (
        lambda p: misplaced(p, 3, 4, 10, seen=False),
        r"target 3/4 is seen nowhere.* 10 mm beside its row and column \(\+10.00, ",
    ),
    "board's target 2 mm off": (
        lambda p: misplaced(p, 2, 5, 2),
        r"target 2/5 is seen (2|1\.[89]|2\.[12]) mm.*\(-",
    ),
    "board's target 4 mm too high": (
        lambda p: misplaced(p, 1, 1, z=4),
        r"target 1/1 is seen (4|3\.[89]|4\.[012]) mm from",
    ),
    "board's column 1.5 mm off": (
        lambda p: replace(p, board=shifted_column(p.board, 3, 1.5)),
        r"^testfield: column 3 is seen 1\.[3-7] mm from",
    ),
    "plate's column 1.5 mm off": (
        lambda p: replace(p, plate=shifted_column(p.plate, 2, 1.5)),
        r"^the plate's testfield file: column 2 is seen 1\.[3-7] mm from",
    ),
    "plate's target 2 mm off": (
        lambda p: replace(
            p, plate=replace(p.plate, xyz_mm=p.plate.xyz_mm + 2.0 * (np.arange(len(p.plate.row)) == 20)[:, None])
        ),
        r"^the plate's testfield file: target \d/\d is seen 3\.[1-6] mm from",
    ),
    "plate's board x1.05": (lambda p: replace(p, plate=scaled(p.plate, 1.05)), f"{PLATE}.*1.0"),
    "plate's board sheared by 1 %": (
        lambda p: replace(p, plate=sheared(p.plate)),
        r"plate.*x and y are (90\.5|89\.4)\d° apart",
    ),
    "plate's z 3 mm": (lambda p: replace(p, plate=lifted(p.plate, 3.0)), r"^the plate lies (3|2\.9)"),
    "plate's board in cm": (lambda p: replace(p, plate=scaled(p.plate, 0.1)), f"{PLATE}.*cm"),
    "plate's board x x1.03": (lambda p: replace(p, plate=scaled(p.plate, 1.03, 1.0)), "plate's .*x is stretched"),
    "both boards x1.05": (lambda p: both_boards(p, 1.05), "known lengths disagree"),
    "both boards in cm": (lambda p: both_boards(p, 0.1), "known lengths disagree.*cm"),
    "z in cm": (lambda p: z(p, lambda _, v: v / 10), f"{Z}.*cm"),
    "z in m": (lambda p: z(p, lambda _, v: v / 1000), f"{Z}.* m instead"),
    "z in inches": (lambda p: z(p, lambda _, v: v / 25.4), f"{Z}.*inches"),
    "z x1.02": (lambda p: z(p, lambda _, v: v * 1.02), f"{Z}.*1.0"),
    "one plate 0.5 mm off": (lambda p: z(p, lambda n, v: v - 0.5 * (n == "depth-05")), "depth-05: .*z_mm"),
    "one plate 5 mm off": (lambda p: z(p, lambda n, v: v + 5 * (n == "depth-01")), "depth-01: .*z_mm"),
    "last plate 2 mm off": (lambda p: z(p, lambda n, v: v - 2 * (n == "depth-07")), "depth-07: .*z_mm"),
    "plates with play": (lambda p: z(p, lambda n, v: v + 0.5 * np.sin(7 * int(n[-2:]))), "depth-.*z_mm says"),
    "plates on a bent rail": (lambda p: z(p, lambda n, v: v + 4e-4 * v * v), "z_mm says"),
    "two plates exchanged": (lambda p: exchanged(p, "depth-02", "depth-03"), r"depth-0[23]: .*z_mm"),
    "one plate's sign reversed": (lambda p: z(p, lambda n, v: -v if n == "depth-06" else v), "depth-06: .*z_mm"),
    "camera's c x2": (lambda p: device(p, True, nominal_c_mm=lambda c: 2 * c), "camera: c is"),
    "camera's c x0.5": (lambda p: device(p, True, nominal_c_mm=lambda c: c / 2), "camera: c is"),
    "projector's c x2": (lambda p: device(p, False, nominal_c_mm=lambda c: 2 * c), "projector: c is"),
    "projector's c x0.5": (lambda p: device(p, False, nominal_c_mm=lambda c: c / 2), "projector: c is"),
    "camera's pitch y -5 %": (
        lambda p: device(p, True, pitch_mm=lambda q: (q[0], 0.95 * q[1])),
        "camera: pixels are .*pitch_mm",
    ),
    "camera's pitch x +10 %": (
        lambda p: device(p, True, pitch_mm=lambda q: (1.1 * q[0], q[1])),
        "camera: pixels are .*pitch_mm",
    ),
    "camera's pitch x2": (lambda p: device(p, True, pitch_mm=lambda q: (2 * q[0], 2 * q[1])), "camera: c is"),
    "projector's pitch y x0.5": (
        lambda p: device(p, False, pitch_mm=lambda q: (q[0], q[1] / 2)),
        "projector: pixels are .*pitch_mm",
    ),
    "projector's pitch x2": (
        lambda p: device(p, False, pitch_mm=lambda q: (2 * q[0], 2 * q[1])),
        "projector: c is",
    ),
    "a capture moved by 2 px": (lambda p: one(p, 4, lambda t: shifted(t, 2.0)), "testfield-05"),
    "a capture's lines off by 8": (lambda p: one(p, 7, lambda t: shifted(t, 0.0, 8.0)), "testfield-08"),
    "lines of another capture": (lambda p: one(p, 2, lambda t: with_lines_of(p.fields[8], t)), "testfield-03"),
    "a capture measured twice": (
        lambda p: one(p, 2, lambda t: replace(p.fields[8], capture=t.capture)),
        "testfield-0[39].*same targets",
    ),
    "a capture measured twice, noise added": (
        lambda p: one(p, 2, lambda t: exposed_again(replace(p.fields[8], capture=t.capture), 0.4)),
        "testfield-0[39].*same targets",
    ),
    "sigmas a tenth": (
        lambda p: replace(
            p,
            fields=tuple(
                replace(t, camera_cov=t.camera_cov / 100, projector_sigma=t.projector_sigma / 10) for t in p.fields
            ),
        ),
        "times what the sigmas",
    ),
    "a fold in all images": (
        lambda p: replace(
            p,
            fields=tuple(
                replace(t, camera_uv=t.camera_uv + 0.3 * np.sin(t.camera_uv / t.camera_uv.max() * 9)) for t in p.fields
            ),
        ),
        "camera: residuals",
    ),
    "rows alone": (lambda p: one_coordinate(p, 1), "projector: v alone was observed.*patterns along x"),
    "stripes bent": (
        lambda p: replace(
            p,
            fields=tuple(
                replace(t, projector_uv=t.projector_uv + 1.5 * np.sin(t.projector_uv / t.projector_uv.max() * 12))
                for t in p.fields
            ),
        ),
        "projector: residuals",
    ),
}


@pytest.fixture(scope="module")
def projects() -> dict[str, Project]:
    found = {name: simulate(name, 7) for name in RIGS}
    for p in found.values():
        calibrated(p)
    return found


MANY = int(os.environ.get("STRIPE_MANY", "2"))
# every kind on one of two rigs; with many, on both
CASES = [(kind, name) for i, kind in enumerate(KINDS) for k, name in enumerate(RIGS) if MANY > 2 or i % 2 == k]


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_wrong_input_is_named(kind: str, name: str, projects: dict[str, Project]) -> None:
    change, told = KINDS[kind]
    try:
        verdict = judge(change(projects[name]))
    except StripeError as error:  # named as well
        verdict = Verdict("failed", (str(error),))
    assert verdict.state != "passed"
    assert any(re.search(told, text) for text in verdict.because[:3]), verdict.because


def test_columns_alone_give_points(projects: dict[str, Project]) -> None:
    assert depthless_concerns(*calibrated(one_coordinate(projects["paper"], 0))) == []


def test_a_board_that_stood_still_is_not_one_capture(projects: dict[str, Project]) -> None:
    for t in projects["paper"].fields[:3]:
        assert not repeated_targets([t, replace(exposed_again(t, 1.0), capture="again")])


@pytest.mark.parametrize("name", list(RIGS))
def test_sound_input_raises_no_concern(name: str, projects: dict[str, Project]) -> None:
    assert judge(projects[name]) == Verdict("passed")


@pytest.mark.parametrize("seed", range(MANY))
def test_varied_rigs_raise_no_false_alarm(seed: int) -> None:
    """Centroids are up to 1.4 times as bad as their sigmas say, as on the virtual bench."""
    name = ("paper", "modern")[seed % 2]
    honest = float(np.random.default_rng(seed).uniform(0.7, 1.4))
    p = simulate(name, 1000 + seed, vary=True, poses=8 + seed % 5, honest=honest)
    assert judge(p) == Verdict("passed")


@pytest.mark.parametrize("name", list(RIGS))
def test_an_imported_calibration_of_another_rig_is_named(name: str, projects: dict[str, Project]) -> None:
    p = projects[name]
    own = pair_of(calibrated(p)[0])

    def told(pose: Pose) -> str:
        none = np.zeros_like(own.covariance)  # as other programs' calibrations tell none
        known = calibration_of_pair(own.camera, own.projector, pose, none)
        seen = see_plates(known, p.fields, {t.capture: 0.0 for t in p.fields}, p.board)
        return "; ".join(c.text for c in foreign_concerns(seen))

    R, t = own.projector_from_camera.rotation, own.projector_from_camera.translation_mm
    assert told(own.projector_from_camera) == ""
    assert "the board measures 1.100 times" in told(Pose(R, 1.1 * t))
    assert "does it belong to another rig" in told(Pose(turn("x", 2) @ R, t))
    assert "does it belong to another rig" in told(Pose(turn("y", 3) @ R, t))


def of_lengths(p: Project, bar: float, size: float, steps: float) -> list[Concern]:
    """Concerns about a bar, a plate's board and positions that are so many times as long as they are seen."""
    field, z = p.plate, np.array([*p.z_mm.values()])
    board = scaled(field, size)
    xyz = board.xyz_mm + size * (np.array([0, 0, -600]) + z[:, None, None] * [0, 0, 1])
    seen = Plates(tuple(p.z_mm), z * steps, board.xyz_mm, xyz, xyz[None][:0], {})
    ends = [(int(field.row[k]), int(field.col[k])) for k in (0, -1)]
    scale = ScaleBar(*ends, bar * float(np.linalg.norm(field.xyz_mm[-1] - field.xyz_mm[0])), 0.01)
    return length_concerns(None, board, scale, seen, False)


@pytest.mark.parametrize(
    ("bar", "size", "steps", "named"),
    [
        (1e-3, 1, 1, "scale bar.* m instead"),
        (1e3, 1, 1, "scale bar.*µm instead"),
        (1, 0.1, 1, "plate's board.*cm"),
        (1, 1, 1e3, "plate positions.*µm instead"),
    ],
)
def test_the_wrong_one_of_bar_board_and_positions_is_named_without_a_calibration(
    bar: float, size: float, steps: float, named: str, projects: dict[str, Project]
) -> None:
    """The camera alone sees the plates as large as their file says."""
    (concern,) = of_lengths(projects["paper"], bar, size, steps)
    assert concern.state == "failed"
    assert re.search(named, concern.text), concern.text


def test_a_bar_a_thousandth_off_what_board_and_positions_agree_on_is_named(projects: dict[str, Project]) -> None:
    """Boards are printed to a thousandth: only where the positions confirm one closely it speaks against a bar."""
    (concern,) = of_lengths(projects["paper"], 1.001, 1, 1)
    assert concern.state == "doubtful"
    assert "scale bar" in concern.text
    assert "1.0010 times what the plate's board and the plate positions give" in concern.text
    for bar, steps in ((1.0003, 1), (1.001, 1.001), (1, 1.001), (1.001, 1.0005)):
        assert not of_lengths(projects["paper"], bar, 1, steps)


@pytest.mark.parametrize(("aside_mm", "told"), [(2.0, ["plate stood 2.0 mm beside its axis"]), (0.3, [])])
def test_a_plate_that_moved_sideways_is_named_among_others(aside_mm: float, told: list[str], projects) -> None:
    """Beside the line of the others: one of eleven turns a line through all only by a little, one of six does more."""
    p = projects["paper"]
    z, rng = np.linspace(-40, 40, 6), np.random.default_rng(1)
    places = np.array([0.02, -0.01, 1.0]) * z[:, None] + [0, 0, -600] + rng.normal(0, 0.01, (6, 3))
    places[1] += [0.8 * aside_mm, -0.6 * aside_mm, 0]
    xyz = p.plate.xyz_mm + places[:, None]
    seen = Plates(tuple("abcdef"), z, p.plate.xyz_mm, xyz, xyz[None][:0], {})
    found = length_concerns(None, p.plate, None, seen, False)
    assert [c.text for c in found if told[0] not in c.text or not c.text.startswith("b: ")] == [] if told else not found
    assert len(found) == len(told)


@pytest.mark.parametrize(("bow_mm", "state"), [(0.0, []), (0.02, []), (0.2, ["doubtful"]), (1.5, ["failed"])])
def test_a_plate_that_is_bowed_at_all_positions_is_told(bow_mm: float, state: list[str], projects) -> None:
    """No residual of the depths shows it: the curves go through the bow."""
    p, rng = projects["paper"], np.random.default_rng(2)
    nominal = p.plate.xyz_mm
    bowed = nominal + bow_mm * (np.sum(nominal**2, axis=1) / np.sum(nominal**2, axis=1).max())[:, None] * [0, 0, 1]
    z = np.linspace(-40, 40, 6)
    xyz = bowed + np.array([0, 0, 1.0]) * (z[:, None, None] - 600) + rng.normal(0, 0.01, (6, *nominal.shape))
    seen = Plates(tuple("abcdef"), z, nominal, xyz, xyz[None][:0], {})
    one = np.zeros((1, 1, 1), np.float32)
    spec = p.rig.cameras["camera"]
    depth = DepthCalibration(
        "u", z, 3, one, one, 0.05, 1, spec, nominal_of(spec), Pose(), np.array([0, 0, 1.0]), noise_rms_mm=0.05
    )
    found = flatness_concerns(depth, seen)
    assert [c.state for c in found] == state
    # a bow of r² over a square of dots is this far off its plane, r.m.s.
    off = bowed[:, 2] - bowed[:, 2].mean()
    assert all(f"{np.std(off):.2g} mm r.m.s. off a plane" in c.text for c in found)


def test_the_simulator_turns_as_it_says() -> None:
    assert np.allclose(turn("z", 90) @ [1, 0, 0], [0, 1, 0])


@pytest.mark.parametrize("name", list(RIGS))
def test_a_column_is_found_elsewhere_by_the_camera_alone(name: str, projects: dict[str, Project]) -> None:
    """Of a depth calibration alone no projector is known; a lens of unknown distortion moves no column alone."""
    p = projects[name]
    spec = p.rig.cameras["camera"]

    def told(plate: Testfield) -> list[str]:
        seen = pose_plates(spec, nominal_of(spec), p.plates, p.z_mm, plate, seen=True)
        return [concern.text for concern in misplaced_on_plate(plate, seen)]

    assert not told(p.plate)
    (text,) = told(shifted_column(p.plate, 2, 1.5))
    assert re.match(r"the plate's testfield file: column 2 is seen 1\.[3-7] mm from", text)
