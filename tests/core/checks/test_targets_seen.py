"""What targets show by themselves: where a pair of devices sees them, and how large."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.checks.captures import size_concerns
from core.checks.plates import intersect_targets
from core.decode.compressed import COMPRESSED
from core.decode.waves.camera import TONE
from core.errors import AdjustmentError
from core.geometry import Pose, matrix_from_axis_angle, pair_of, project
from core.model import AdjustedDevice, Capture, DeviceSpec, Interior, MissingTarget, TargetSet, Testfield
from core.pipeline.evidence import Evidence, because_of, notes_of
from core.pipeline.options import CalibrateOptions
from tests.calibrated import calibration_of_pair


def test_targets_far_away_in_focal_lengths_are_found_on_the_board_that_they_were_projected_from() -> None:
    """A camera of 2.65 mm with pixels of 4 µm; the projector's polynomial turns round far outside."""
    specs = DeviceSpec(300, 300, (0.004076, 0.004076), 2.6346), DeviceSpec(240, 200, (0.19113, 0.19113), 62.12)
    interiors = (
        Interior(2.647, -0.008, -0.0208, (0.048, 0, 0, 0, 0, 0)),
        Interior(63.604, 0.513, 0.085, (1.8e-6, -1.15e-8, 0, 0, 0, 0), 19.9),
    )
    devices = [AdjustedDevice(s, i, np.zeros(9), (0.1, 0.1), 9) for s, i in zip(specs, interiors, strict=True)]
    pose = Pose(matrix_from_axis_angle([0.174, 0.2057, 0.0], np.deg2rad(15.64)), np.array([130.27, -110.22, -23.42]))
    pair = pair_of(calibration_of_pair(*devices, pose, np.zeros((24, 24))))
    x, y = np.meshgrid(np.linspace(-119, 119, 7), np.linspace(-80, 80, 5))
    for depth in (-684.0, -658.5, -633.3, -607.9):
        points = np.stack([x.ravel(), y.ravel(), np.full(x.size, depth)], axis=1)
        uv, lines = project(specs[0], interiors[0], points), project(specs[1], interiors[1], points, pose)
        found, off, _ = intersect_targets(pair, uv, lines, np.full(lines.shape, 0.007))
        np.testing.assert_allclose(found, points, atol=1e-4)
        assert np.abs(off).max() < 1e-6


@pytest.mark.parametrize(
    ("given", "told"), [(10.0, None), (8.5, None), (5.0, "2.00 times.*radius"), (15.0, "0.67 times")]
)
def test_diameters_that_the_dots_do_not_have_are_told(given: float, told: str | None) -> None:
    """A board tilted by 40 degrees and rolled: dots of 10 mm, whose images have the area that the view gives them."""
    r, c = (a.ravel() for a in np.mgrid[:6, :8])
    board = Testfield(r, c, np.stack([20.0 * c, -20.0 * r, 0.0 * r], axis=1), np.full(len(r), given))
    J = np.array([[1.2, 0.3], [-0.3, 1.2]]) @ np.diag([np.cos(np.deg2rad(40)), 1.0])
    uv, n = board.xyz_mm[:, :2] @ J.T + 200, len(r)
    diameter = np.full(n, 10.0 * np.sqrt(np.linalg.det(J)))
    nothing = np.zeros((n, 2, 2)), np.full((n, 2), np.nan), np.full((n, 2), np.nan), np.zeros((n, 2))
    t = TargetSet("testfield-01", r, c, uv, *nothing, diameter)
    both = [t, replace(t, capture="testfield-02")]
    concerns = size_concerns(both, {"testfield-01": board, "testfield-02": board})
    assert len(concerns) == (told is not None)
    if told is not None:
        assert re.match(f"testfield-01 and 1 more: .*{told}", concerns[0].text)


def test_work_that_fails_names_the_captures_of_which_nothing_was_measured_and_why() -> None:
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), *(np.zeros((0, 2)) for _ in range(6))
    why = [f"pick {k} at ({k}.5, 8.0) px has no dot" for k in (1, 2)]
    sets = [TargetSet(f"board-{k}", *none, missing=(MissingTarget(0, 0, text),)) for k, text in enumerate(why)]
    told = r"singular.*First see to this: board-0, board-1: none of its targets was measured: pick 1 at"
    with pytest.raises(AdjustmentError, match=told), because_of(notes_of(sets)):
        raise AdjustmentError("the network", "singular", "add poses")


def test_boards_that_show_no_dot_as_it_should_be_say_what_may_have_become_of_the_frames() -> None:
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), *(np.zeros((0, 2)) for _ in range(6))
    for why, hint in (
        ("it is uneven inside: glare", "sharpened by the camera"),
        ("its contour is open", "diameter_mm"),
    ):
        (told,) = notes_of([TargetSet("board", *none, missing=(MissingTarget(0, 0, why),))])["board"]
        assert hint in told


@pytest.mark.parametrize(("note", "told"), [(TONE, []), (COMPRESSED, ["board: The frames were compressed"])])
def test_what_was_taken_out_of_the_frames_leaves_no_result_in_doubt(note: str, told: list[str]) -> None:
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), *(np.zeros((0, 2)) for _ in range(6))
    targets, capture = TargetSet("board", *none, notes=(note,)), Capture(Path("board"), "testfield", ())
    used = {"photogrammetric": [capture]}
    rig = SimpleNamespace(notes=())
    evidence = Evidence(rig, {}, {}, used, CalibrateOptions(), [targets], {}, [capture])  # type: ignore[arg-type]
    assert [c.text[: len("board: The frames were compressed")] for c in evidence.said("photogrammetric")] == told
