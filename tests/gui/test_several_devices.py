"""A rig of two cameras in the window: both are named, and the frames, picks and maps of either are looked at."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from core.capture.plan import make_plan
from core.errors import InputError
from core.geometry.pairs import names_of, orientation_names
from core.model import Adjustment, Concern, Orientation, PhotogrammetricCalibration, Subject, verdict_of
from core.pipeline.evaluate import TOGETHER, load_evaluation
from core.pipeline.options import check_options
from core.pipeline.runs import keep_run, list_runs, run_folder
from core.pipeline.sequences import import_into
from core.project import load_archive, read_capture, read_image, read_project, save_archive, write_image
from stripe_gui.pages.page import PairChoice
from stripe_gui.presenters.capture import rig_lines
from stripe_gui.presenters.evaluate import load_evaluation as evaluation_of
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.sequences import Shown, look_at
from tests.gui.hands import front, idle

SHARE = 1e-4  # sigma of all bases over their lengths, in a rig where nothing else is uncertain
KEPT = ("testfield-01", "plane+00")


@pytest.fixture
def pair_project(recorded: Path, tmp_path: Path) -> Path:
    """Two captures by two cameras: what the one camera of the bench took, and the same turned upside down."""
    folder = tmp_path / "pair"
    document = json.loads((recorded / "project.json").read_text())
    camera = document.pop("camera")
    document |= {
        "version": 2,
        "cameras": {"left": camera, "right": camera},
        "captures": [f"captures/{n}" for n in KEPT],
    }

    for name in KEPT:
        shutil.copytree(recorded / "captures" / name, folder / "captures" / name)
        path = folder / "captures" / name / "capture.json"
        capture = json.loads(path.read_text())
        own = [entry | {"camera": "left"} for entry in capture["frames"]]
        for entry in capture["frames"]:
            turned = np.ascontiguousarray(read_image(path.parent / entry["file"])[::-1, ::-1])
            write_image(path.parent / f"right-{entry['file']}", turned)
            own.append(entry | {"file": f"right-{entry['file']}", "camera": "right"})
        path.write_text(json.dumps(capture | {"version": 2, "frames": own}))
    for board in recorded.glob("*.csv"):
        shutil.copy(board, folder)
    (folder / "project.json").write_text(json.dumps(document))
    return folder


def choose(window, camera: str, qtbot) -> None:
    """Choose a camera at the top of the page, as an operator does."""
    choice = window.page.findChild(PairChoice)
    assert choice.isVisible()
    choice.setCurrentIndex(choice.findText(camera))
    choice.activated.emit(choice.currentIndex())
    idle(window, qtbot)


def test_both_cameras_are_named_and_looked_at(window, pair_project: Path, notices, qtbot) -> None:
    assert window.open_path(pair_project)
    page = window.page
    assert page.rig.text().splitlines() == rig_lines(read_project(pair_project).rig)
    assert page.rig.text().startswith("left: camera, ")
    shown = [page.frames.item(i).text() for i in range(page.frames.count())]
    assert not any(text.startswith("right-") for text in shown)
    choose(window, "right", qtbot)
    turned = [page.frames.item(i).text() for i in range(page.frames.count())]
    assert turned == [f"right-{text}" for text in shown]
    window.bench.session.choose_capture("plane+00")
    window.show_page("decode")
    idle(window, qtbot)
    right = window.page._phase.u
    choose(window, "left", qtbot)
    left, sigma = window.page._phase.u, window.page._phase.sigma_u
    both = np.isfinite(left) & np.isfinite(right[::-1, ::-1])
    assert both.sum() > 0.9 * np.isfinite(left).sum()
    # the same frames, but turned: only the blur is told from a sample of other pixels
    assert (np.abs(left - right[::-1, ::-1]) < sigma)[both].all()
    for name in ("calibrate", "reconstruct", "evaluate", "report"):
        window.show_page(name)
        idle(window, qtbot)
    assert not [n for n in notices if n.kind == "error"]


def test_picks_of_one_camera_leave_those_of_the_other(window, pair_project: Path, qtbot) -> None:
    folder = pair_project / "captures" / "testfield-01"
    before = read_capture(folder).seeds
    camera = read_project(pair_project).rig.cameras["left"]
    assert window.open_path(pair_project)
    window.show_page("measure")
    idle(window, qtbot)
    assert window.page.model.picks.seeds == before
    choose(window, "right", qtbot)
    model = window.page.model
    assert not model.picks.seeds
    for i, seed in enumerate(before):
        model.choose((seed.row, seed.col))
        model.pick(camera.width - 1 - seed.u, camera.height - 1 - seed.v)
        kept = "picks.json" if i >= 3 else "picks-draft.json"
        assert (folder / kept).exists()
    both = read_capture(folder)
    assert [(s.row, s.col, s.u, s.v) for s in both.seeds_in("left")] == [(s.row, s.col, s.u, s.v) for s in before]
    assert len(both.seeds_in("right")) == len(before)
    for _ in before:
        assert model.undo()
    assert read_capture(folder).seeds_in("right") == ()
    assert len(read_capture(folder).seeds_in("left")) == len(before)


def test_frames_are_imported_for_a_camera_by_name(pair_project: Path, recorded: Path) -> None:
    source = recorded / "captures" / "plane+00"
    import_into(pair_project, source, Subject("object", "again", camera="right"))
    project = read_project(pair_project)
    assert read_capture(project.captures[-1], project).pairs == (("right", "projector"),)
    with pytest.raises(InputError, match="left, right"):
        import_into(pair_project, source, Subject("object", "more", camera="top"))
    named = make_plan(project, Subject("object", "x")).devices
    assert named == {"camera": "left"}  # a capture says whose frames it has
    assert look_at(None, Shown((64, 64))).patterns == ()


def test_parameters_of_every_device_can_be_held(pair_project: Path, window, qtbot) -> None:
    """The page offered those of "camera", which is no device of such a rig: calibrating refused what was unticked."""
    document = json.loads((pair_project / "project.json").read_text())
    document["projector"] = {key: document["projector"][key] for key in ("width", "height")}
    (pair_project / "project.json").write_text(json.dumps(document))
    assert window.open_path(pair_project)
    window.show_page("calibrate")
    idle(window, qtbot)
    form = window.page.form
    assert {name.partition(".")[0] for name in form.parameters} == {"left", "right"}  # the projector only labels
    form.parameters["right.A3"].setChecked(False)
    options = window.page.choice().options
    assert options.hold == ("right.A3",)
    check_options(read_project(pair_project), options)


def test_the_uncertain_scale_of_a_rig_is_that_share_of_every_distance(
    window,
    finished: Path,
    pair_project: Path,
    qtbot,
) -> None:
    """Two cameras either side of a projector; the sigmas are those of the pair that is chosen."""
    project, folder = read_project(pair_project), run_folder(read_project(finished), 1)
    one = load_archive(folder / "photogrammetric.npz", PhotogrammetricCalibration)
    stands = {"projector": (pose := one.orientations["projector"].device_from_base), "right": pose @ pose}
    devices = {"left": one.camera, "right": one.camera, "projector": one.devices["projector"]}
    names = [name for device in devices for name in names_of(device, devices[device])]
    names += [name for device in stands for name in orientation_names(device)]
    errors = np.zeros(len(names))
    for device, stand in stands.items():
        errors[[names.index(f"{device}.t{axis}") for axis in "xyz"]] = SHARE * stand.translation_mm
    rig = replace(
        one,
        devices=devices,
        cameras=("left", "right"),
        orientations={device: Orientation("left", stand) for device, stand in stands.items()},
        covariance=np.outer(errors, errors),
        parameter_names=tuple(names),
    )
    (run,) = list_runs(read_project(finished))
    archives = {
        "photogrammetric.npz": rig,
        "adjustment.npz": load_archive(folder / "adjustment.npz", Adjustment),
    }
    keep_run(project, replace(run, captures={"photogrammetric": ()}), archives)
    assert window.open_path(pair_project)
    window.show_page("calibrate")
    page = window.page
    assert page.go_to("results")
    front(page.results.tabs, "volume")
    seen = []
    for camera in ("left", "right"):
        choose(window, camera, qtbot)
        rows = [[cell.value for cell in row] for row in page.results.volume.table.model.table.rows]
        # r.m.s. of the distances from the camera, up to a few per cent longer than those along its axis
        assert all(SHARE <= row[1] / row[0] < 1.05 * SHARE for row in rows)
        assert all(row[3] < 1e-6 and row[4] < 1e-6 for row in rows)  # the lenses are known
        seen.append(rows)
    assert seen[0] != seen[1]


def test_the_pair_of_the_depth_calibration_is_chosen_and_kept(window, pair_project: Path, qtbot) -> None:
    assert window.open_path(pair_project)
    window.show_page("calibrate")
    idle(window, qtbot)
    form = window.page.form
    assert form.pair.isVisible()
    assert [form.pair.itemText(i) for i in range(form.pair.count())] == ["left – projector", "right – projector"]
    assert (form.choice().options.camera, form.choice().options.projector) == ("", "")  # as where nothing is named
    form.pair.setCurrentIndex(1)
    options = window.page.choice().options
    assert (options.camera, options.projector) == ("right", "projector")
    form.method.setCurrentIndex(form.method.findData("photogrammetric"))
    assert not form.pair.isEnabled()  # nothing of it is read


def test_what_all_devices_made_stands_beside_the_pair(finished: Path, pair_project: Path) -> None:
    plane, *_ = load_evaluation(read_project(finished))
    rows = [
        replace(plane, devices=(camera, by), deviation_mm=np.full_like(plane.deviation_mm, k))
        for k, (camera, by) in enumerate(product(("left", "right"), ("projector", TOGETHER)))
    ]
    save_archive(pair_project / "results" / "evaluation.npz", tuple(rows))
    folder = ProjectFolder(pair_project)
    for camera, first in (("left", 0), ("right", 2)):
        view = evaluation_of(folder, (camera, "projector"))
        shown = {way: made[plane.capture].deviation_mm[0, 0] for way, made in view.ways.items()}
        assert shown == {plane.method: first, f"{plane.method}, all devices": first + 1}
        assert view.camera is folder.project.rig.cameras[camera]
        assert {e.method for e in view.evaluations} == {plane.method}


def test_whatever_is_doubtful_of_a_plane_is_told_and_every_curve_differs(
    window, finished: Path, pair_project: Path, qtbot
) -> None:
    """Of a pair and of all devices only the last verdict was told; the third curve of a profile looked as the first."""
    plane, *_ = load_evaluation(read_project(finished))
    doubt = verdict_of([Concern("doubtful", "seen")], [])
    made = [("photogrammetric", "projector"), ("polynomial", "projector"), ("photogrammetric", TOGETHER)]
    rows = tuple(replace(plane, devices=("left", by), method=m, verdict=doubt) for m, by in made)
    save_archive(pair_project / "results" / "evaluation.npz", rows)
    assert window.open_path(pair_project)
    window.show_page("evaluate")
    idle(window, qtbot)
    assert len(window.page.verdicts.boxes) == len(rows)
    for curves in (window.page.profile.plot.curves, window.page.histogram.histogram.curves):
        assert len({(curve.tone, curve.style) for curve in curves}) == len(curves) >= len(rows)


def test_the_maps_of_a_camera_are_those_by_the_projector_that_is_chosen(
    window, finished: Path, pair_project: Path, qtbot
) -> None:
    """Where both had one camera, those by the projector chosen before stayed."""
    document = json.loads((pair_project / "project.json").read_text())
    document["projectors"] = dict.fromkeys(("above", "below"), document["projector"])
    document["cameras"] = {"left": document["cameras"]["left"]}
    del document["projector"]
    (pair_project / "project.json").write_text(json.dumps(document | {"captures": []}))
    plane, *_ = load_evaluation(read_project(finished))
    rows = [
        replace(plane, devices=("left", by), deviation_mm=np.full_like(plane.deviation_mm, k))
        for k, by in enumerate(("above", "below"))
    ]
    save_archive(pair_project / "results" / "evaluation.npz", tuple(rows))
    assert window.open_path(pair_project)
    window.show_page("evaluate")
    idle(window, qtbot)
    for k, by in enumerate(("above", "below")):
        choose(window, f"left with {by}", qtbot)
        assert [made.image[0, 0] for made in window.page.deviations.maps] == [k]
