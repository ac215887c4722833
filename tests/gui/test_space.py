"""Views in space: projection by closed form, what is nearer covers, the rig's fields, points of all cameras."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor

from core.geometry import Pose
from core.model import DeviceSpec, Interior, PointCloud, Verdict
from core.pipeline.update import keep_points
from stripe_gui.presenters.reconstruct import PATCHES, joint_scene, load_points, merged_scene
from stripe_gui.presenters.rig_space import Stand, common_slices, field
from stripe_gui.presenters.space import Line, Scene, seen
from stripe_gui.widgets.space_view import DISTANCE, FROM_CAMERA, SpaceView

SPEC, INTERIOR = DeviceSpec(640, 480, (0.01, 0.01), 8.0), Interior(8.0)  # sees 0.8 by 0.6 of the distance
BASE_MM = 200.0


@pytest.fixture
def view(qtbot) -> SpaceView:
    made = SpaceView("points")
    qtbot.addWidget(made)
    made.resize(500, 420)
    made.show()
    return made


def box_scene(**more) -> Scene:
    """A cube of 2 mm about (0, 0, -100) of the camera's frame, which fixes middle and size."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-101, -99)], float)
    return Scene(lines=(Line(seen(corners), "text"),), **more)


def test_places_are_projected_centrally(view: SpaceView) -> None:
    view.show_scene(box_scene())
    space = view.space
    space.look(*FROM_CAMERA)
    space._fitted = False
    size = np.sqrt(12)  # of the cube
    at, near = space.on_screen(seen([[0, 0, -100], [1, 0, -100], [0, 1, -100], [1, 0, -99]]))
    scale = min(space.width(), space.height()) / size * space._zoom
    # the camera's right is right, its up is up; what is 1 mm nearer to the eye is larger by 1 / (1 - 1/distance)
    assert at[1] - at[0] == pytest.approx([scale, 0], abs=1e-6)
    assert at[2] - at[0] == pytest.approx([0, -scale], abs=1e-6)
    assert at[3, 0] - at[0, 0] == pytest.approx(scale / (1 - 1 / (DISTANCE * size)))
    assert near.tolist() == pytest.approx([0, 0, 0, 1])


def test_the_nearer_point_covers_the_farther_one(view: SpaceView) -> None:
    colours = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    places = seen([[0.0, 0.5, -99.2], [0.0, 0.5, -100.8]])  # one behind the other but for the perspective
    for order in ([0, 1], [1, 0]):
        view.show_scene(box_scene(places_mm=places[order], colours=colours[order], spacing_mm=0.2))
        view.space.look(*FROM_CAMERA)
        picture = view.space.grab().toImage()
        u, v = view.space.on_screen(seen([[0.0, 0.5, -99.2]]))[0][0]
        assert QColor(picture.pixel(round(u), round(v))).name() == "#ff0000"


def test_a_device_sees_its_format_times_the_distance() -> None:
    corners = field(Stand(SPEC, INTERIOR, Pose(), True), 500.0)
    assert np.ptp(corners, axis=0) == pytest.approx([400.0, 300.0, 0.0], abs=1e-9)
    assert corners[0] == pytest.approx([-200.0, 150.0, -500.0])  # the image's upper left


def test_what_two_parallel_devices_see_in_common_is_narrower_by_their_base() -> None:
    beside = Pose(translation_mm=np.array([-BASE_MM, 0.0, 0.0]))
    devices = {"left": Stand(SPEC, INTERIOR, Pose(), True), "right": Stand(SPEC, INTERIOR, beside, False)}
    slices = common_slices(devices, (400.0, 600.0))
    assert len(slices) == 5
    for depth, common in zip(np.linspace(400, 600, 5), slices, strict=True):
        assert np.ptp(common, axis=0) == pytest.approx([0.8 * depth - BASE_MM, 0.6 * depth, 0.0], abs=1e-9)
    assert common_slices(devices, (100.0, 200.0)) == []  # nearer than that their fields do not meet


def test_points_of_all_cameras_are_coloured_and_counted_by_camera_and_sight() -> None:
    xyz = np.random.default_rng(1).normal(size=(1, 50, 3)).astype(np.float32)
    source = np.repeat([0, 1], [30, 20]).astype(np.uint8)[None]
    sight = np.repeat([2, 1, 4], [25, 20, 5]).astype(np.uint8)[None]
    cloud = PointCloud(xyz, np.full((1, 50, 3), 0.02, np.float32), None, sight, source)
    scene, words = joint_scene(cloud, "joint-source", ["left", "right"])
    assert "left 30" in words
    assert "right 20" in words
    assert {QColor(*c).name() for c in scene.colours.tolist()} == set(PATCHES[:2])
    words = joint_scene(cloud, "joint-sight", ["left", "right"])[1]
    assert all(text in words for text in ("by several 25", "by one camera 20", "rays disagree 5"))
    assert "0.02 mm" in joint_scene(cloud, "joint-sigma", ["left", "right"])[1]


def test_a_capture_by_several_cameras_offers_the_points_of_all(
    window, finished_project, monkeypatch, answers, tmp_path, qtbot
) -> None:
    from stripe_gui.pages import reconstruct_page
    from tests.gui.hands import idle

    xyz = np.random.default_rng(1).normal(size=(1, 500, 3)).astype(np.float32)
    ones = np.ones((1, 500), np.uint8)
    doubted = Verdict("doubtful", ("left: a frame is black",))
    cloud = PointCloud(xyz, np.full((1, 500, 3), 0.02, np.float32), None, ones, 0 * ones, verdict=doubted)
    monkeypatch.setattr(reconstruct_page, "seen_by_several", lambda project, name: True)
    filled = replace(cloud, sight=np.where(np.arange(500) < 100, 5, ones).astype(np.uint8), object_px=1000)

    def views(project, name, progress, fill=False):
        return ones, filled if fill else cloud

    monkeypatch.setattr(reconstruct_page, "reconstruct_views", views)
    monkeypatch.setattr(reconstruct_page, "cameras_of", lambda entry: ["left", "right"])
    window.open_path(finished_project)
    keep_points(window.bench.session.opened.project, window.bench.session.capture_name, "photogrammetric")
    window.show_page("reconstruct")
    page = window.page
    idle(window, qtbot)
    page.kind.setCurrentIndex(page.kind.findData("joint-sight"))
    idle(window, qtbot)
    assert [box.verdict for box in page.verdicts.boxes] == [doubted]
    assert page.stack.currentWidget() is page.space
    assert page.state.text().startswith("500 points.&emsp;<")
    assert page.state.textFormat() == Qt.TextFormat.RichText
    page.fill.setChecked(True)
    idle(window, qtbot)
    assert "Of the object 40.0% by code, 50.0% with texture." in page.state.text()
    assert "by texture 100" in page.state.text()
    page.kind.setCurrentIndex(page.kind.findData("shaded"))
    idle(window, qtbot)
    assert page.stack.currentWidget() is page.view
    assert page.fill.isHidden()  # it is of all cameras' points
    own = page.state.text()
    for kind in ("joint-sight", "shaded"):  # neither is worked out again
        page.kind.setCurrentIndex(page.kind.findData(kind))
        idle(window, qtbot)
    assert (page.state.text(), page.verdicts.boxes) == (own, [])
    window.show_page("rig")
    assert page.bench.session.opened.project.rig.is_pair
    assert [page.text for page in window.page.space.space.scene.names][:2] == ["camera", "projector"]
    assert window.page.table.model.rowCount() == 2


def test_the_capture_that_is_looked_at_says_whether_the_rig_has_moved(window, finished_project, qtbot) -> None:
    window.open_path(finished_project)
    window.bench.session.choose_capture("plane+00")
    strip = window.page.health
    assert "Looking" in strip.text.text()
    said = "plane+00: no sign that the projector has moved"
    qtbot.waitUntil(lambda: strip.text.text().startswith(said), timeout=60_000)
    assert not list(finished_project.glob("results/drift/*"))  # looking outdates no report
    strip.chart_button.click()
    assert (window.page.id, window.page.step.name) == ("rig", "drift")


def test_the_drift_chart_tells_what_is_out_of_control(window, finished_project, monkeypatch, qtbot) -> None:
    from core.model import DriftPoint
    from stripe_gui.pages import rig_page

    one = np.array([1e-5, 1e-5, 1e-5, 0.01, 0.01])
    steady = DriftPoint("plane+00", "camera", "projector", one, 0 * one, one, 0.4, "steady")
    moved = DriftPoint("plane+15", "camera", "projector", 5 * one, 0 * one, one, 1e-6, "action")
    charts = {("camera", "projector"): (steady, moved)}
    monkeypatch.setattr(rig_page, "drift_of", lambda project, progress: charts)
    window.open_path(finished_project)
    window.show_page("rig#drift")
    page = window.page
    page.look_button.click()
    qtbot.waitUntil(lambda: page.said.text().startswith("Out of control: plane+15"))
    elements = [curve for curve in page.chart.curves if curve.marked]
    assert [float(curve.y[1]) for curve in elements] == [5.0] * 5  # in sigmas
    cells = [page.captures.model.index(1, j).data() for j in range(1, 5)]
    assert cells == ["plane+15", "OUT OF CONTROL", "1e-06", "+50.0 ± 10.0"]


def test_merged_points_are_coloured_by_the_capture_that_made_them_alone() -> None:
    xyz = np.random.default_rng(2).normal(size=(1, 6, 3)).astype(np.float32)
    sight, source = np.ones((1, 6), np.uint8), np.array([[0, 1, 2, 3, 3, 3]], np.uint8)
    cloud = PointCloud(xyz, np.full((1, 6, 3), 0.02, np.float32), None, sight, source)
    made_by = [("camera", "front"), ("camera", "left"), ("camera", "front + left"), ("camera", "front + left + back")]
    scene, words = merged_scene(cloud, made_by)
    assert [words.count(name) for name in ("front 1", "left 1", "by several 4")] == [1, 1, 1]
    assert len({tuple(colour) for colour in scene.colours}) == 3


@pytest.mark.parametrize(
    "kept",
    [5, "doubtful", {}, {"state": "doubtful"}, {"state": "evil", "because": ["x"]},
     {"state": ["failed"], "because": ["x"]}, {"state": "failed", "because": "x"}, {"state": "failed", "because": [1]}],
)  # fmt: skip
def test_points_are_shown_whatever_stands_for_their_verdict(tmp_path: Path, kept: object) -> None:
    xyz, path = np.zeros((2, 2, 3), np.float32), tmp_path / "a.npz"
    np.savez(path, xyz=xyz)
    path.with_suffix(".json").write_text(json.dumps({"verdict": kept}))
    assert load_points(path).verdict is None
    path.with_suffix(".json").write_text(json.dumps({"verdict": {"state": "failed", "because": ["it slipped"]}}))
    assert load_points(path).verdict == Verdict("failed", ("it slipped",))
