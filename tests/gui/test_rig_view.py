"""The sketch's numbers against closed forms."""

from __future__ import annotations

from dataclasses import replace
from math import asin, degrees

import numpy as np
import pytest

from core.bench import converging_pair, plan
from core.geometry import project
from core.model import DeviceSpec, Interior
from stripe_gui.presenters.new_project import board_words, nominal_testfield
from stripe_gui.presenters.rig_view import RigPlan, presets, rig_problem, rig_view, rig_words

REFERENCE = presets()[0][1]


def test_fields_and_units_are_those_of_similar_triangles() -> None:
    view = rig_view(REFERENCE)
    assert view.camera.field_mm == pytest.approx((748 * 0.008 * 600 / 12.1, 576 * 0.008 * 600 / 12.1))
    assert view.projector.field_mm == pytest.approx((640 * 0.09 * 600 / 181.9,) * 2)
    assert view.camera.unit_mm == pytest.approx(0.008 * 600 / 12.1)
    assert view.convergence_deg == pytest.approx(2 * degrees(asin(125 / 600)))


def test_rays_reach_the_object_plane_where_the_core_projects_them_from() -> None:
    """The places at the ends of the sketch's rays are imaged onto the edges of the sensor by `core.geometry`."""
    view = rig_view(REFERENCE)
    camera_from_object, projector_from_camera = converging_pair(REFERENCE.base_mm, REFERENCE.distance_mm)
    poses = {"camera": camera_from_object, "projector": projector_from_camera @ camera_from_object}
    for name, pose in poses.items():
        spec, cover = getattr(REFERENCE, name), getattr(view, name)
        ends = [[x, 0.0, 0.0] for x in cover.reach_mm]
        u = project(spec, Interior(spec.nominal_c_mm), ends, pose)[:, 0]
        np.testing.assert_allclose(np.sort(u), [-0.5, spec.width - 0.5], atol=1e-9)
        at = pose.inverse().translation_mm
        np.testing.assert_allclose(at[[0, 2]], cover.at_mm)


def test_one_line_of_depth_is_what_moving_a_point_shows() -> None:
    view = rig_view(REFERENCE)
    _, projector_from_camera = converging_pair(REFERENCE.base_mm, REFERENCE.distance_mm)
    spec = REFERENCE.projector
    step = 1e-3
    points = np.array([[0.0, 0.0, -600.0], [0.0, 0.0, -600.0 - step]])  # along the camera's axis
    u = project(spec, Interior(spec.nominal_c_mm), points, projector_from_camera)[:, 0]
    assert abs(step / (u[1] - u[0])) == pytest.approx(view.depth_per_line_mm, rel=1e-4)


def test_presets_are_rigs_that_the_virtual_bench_can_play() -> None:
    """So that a new project can record on the bench: there a rig is found by its sizes."""
    for (_, rig), name in zip(presets(), ("paper", "modern"), strict=True):
        true = plan(name).rig
        for device, other in ((rig.camera, true.camera), (rig.projector, true.projector)):
            assert (device.width, device.height, device.pitch_mm) == (other.width, other.height, other.pitch_mm)
            assert device.nominal_c_mm == pytest.approx(other.nominal_c_mm, rel=0.01)


@pytest.mark.parametrize(
    ("base", "distance", "word"), [(60.0, 600.0, "weak"), (700.0, 600.0, "base"), (640.0, 600.0, "base")]
)
def test_unusual_rigs_are_told(base: float, distance: float, word: str) -> None:
    rig = replace(REFERENCE, base_mm=base, distance_mm=distance)
    told = rig_problem(rig) or " ".join(rig_words(rig_view(rig)))
    assert word in told


def test_a_usual_rig_is_not_remarked_on() -> None:
    assert all(not rig_problem(rig) and not rig_words(rig_view(rig)) for _, rig in presets())


def test_rays_that_miss_the_object_are_a_problem() -> None:
    fish_eye = DeviceSpec(4000, 3000, (0.01, 0.01), 1.0)
    assert "miss" in rig_problem(RigPlan(fish_eye, REFERENCE.projector, 600.0, 250.0))


def test_a_board_is_judged_by_its_size_in_the_camera() -> None:
    view = rig_view(REFERENCE)
    small = " ".join(board_words(nominal_testfield(5, 7, 6.0, 2.0), view.camera, view.projector))
    assert f"{2.0 / view.camera.unit_mm:.1f} px" in small
    assert "small" in small
    assert "% of the camera's field" in small
    large = " ".join(board_words(nominal_testfield(13, 19, 30.0, 10.0), view.camera, view.projector))
    assert "larger than the camera's field" in large
