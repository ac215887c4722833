"""The whole road with two cameras and one projector: nothing but the project's files says that there are two."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from core import orient
from core.bench import experiment
from core.bench.truth import truth_maps
from core.checks import form_of
from core.cli import main
from core.demo import Demo
from core.errors import AdjustmentError, InputError
from core.geometry import Pose, pair_of
from core.geometry import project as project_points
from core.model import PhotogrammetricCalibration, Project, RigMotion
from core.pipeline import calibrate_project, evaluate_project, load_calibrations, reconstruct_capture, simulate_project
from core.pipeline.decode import decode_capture, phase_maps
from core.pipeline.evaluate import _told
from core.pipeline.exchange import _foreign, export_calibration
from core.pipeline.judge import said_of
from core.pipeline.measure import kept_targets
from core.pipeline.orient import drift_of
from core.pipeline.planning import rig_light
from core.pipeline.report import report_data
from core.pipeline.state.graph import project_states
from core.pipeline.state.states import State
from core.pipeline.tables import kept_evaluation
from core.pipeline.update import decode_project, keep_points
from core.pipeline.views import reconstruct_views, seen_by_several
from core.pipeline.volumes import volume_figures
from core.project import read_capture, read_image, read_project
from core.reconstruct import Sight
from core.report import Tolerance, conformity, tables
from core.report.document import compose
from core.report.figures.planes import histograms, maps
from core.report.numbers import volume_table
from tests.copies import copied


def calibrated(folder: Path) -> None:
    simulate_project(folder, "stereo", 0)
    assert main(["calibrate", str(folder), "--json", str(folder / "calibration.json")]) == 0
    assert main(["evaluate", str(folder), "--json", str(folder / "evaluation.json")]) == 0


@pytest.fixture(scope="module")
def project(once: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Project:
    return read_project(copied(once("stereo", calibrated), tmp_path_factory.mktemp("two") / "project"))


def test_the_demo_tells_the_verdicts_of_whatever_methods_there_are(project: Project, capsys, monkeypatch) -> None:
    """Two cameras have no depth method: its verdict was asked for, and the demo ended in a KeyError."""
    figures = json.loads((project.path / "calibration.json").read_text())
    figures |= json.loads((project.path / "evaluation.json").read_text())
    assert "polynomial" not in figures
    report = SimpleNamespace(html="report.html", pdf="report.pdf")
    monkeypatch.setattr("core.demo.run_demo", lambda *args, **how: Demo("tables", figures, report))
    assert main(["demo", str(project.path), "--scenario", "stereo"]) == 0
    told = capsys.readouterr().out
    assert "photogrammetric: passed" in told
    assert "left with projector, photogrammetric: " in told


def test_a_projector_that_only_labels_needs_no_nominal_values(
    project: Project, tmp_path: Path, edit_json, capsys
) -> None:
    """Pitch and c of a projector that nobody calibrates were demanded; the cameras alone come out where they stand."""
    folder = Path(shutil.copytree(project.path, tmp_path / "labels", ignore=shutil.ignore_patterns("results")))
    raster = {key: json.loads((folder / "project.json").read_text())["projector"][key] for key in ("width", "height")}
    edit_json(folder / "project.json", projector=raster)
    assert main(["calibrate", str(folder)]) == 0
    found = load_calibrations(read_project(folder))["photogrammetric"]
    assert (list(found.devices), found.verdict.state) == (["left", "right"], "passed")
    left, right = (view.rig.camera_from_volume for view in experiment("stereo", 0).views.values())
    pair, true = pair_of(found, "left", "right"), right @ left.inverse()
    error = pair.projector_from_camera.translation_mm - true.translation_mm
    assert np.abs(error / np.sqrt(np.diagonal(pair.covariance)[-3:])).max() < 1.4 * 4.5  # as in the test below
    assert main(["uncertainty", str(folder)]) == 2
    assert "takes its pitch_mm and nominal_c_mm" in capsys.readouterr().err
    assert main(["reconstruct", str(folder), "plane+15", "--rays", "pair", "--out", str(tmp_path / "a.npz")]) == 2
    assert "--rays: pair, where projectors only label places" in capsys.readouterr().err
    camera = json.loads((folder / "project.json").read_text())["cameras"]["left"]
    edit_json(folder / "project.json", cameras={"left": {**camera, "pitch_mm": None}, "right": camera})
    assert main(["calibrate", str(folder)]) == 2
    assert "pitch_mm" in capsys.readouterr().err


def test_files_name_the_cameras(project: Project) -> None:
    assert json.loads((project.path / "project.json").read_text())["version"] == 2
    assert list(project.rig.cameras) == ["left", "right"]
    capture = read_capture(project.captures[0], project)
    assert capture.pairs == (("left", "projector"), ("right", "projector"))
    assert len(capture.seeds_in("left")) == len(capture.seeds_in("right")) == 4


def test_targets_of_every_camera_are_measured(project: Project) -> None:
    found = {(t.capture, t.camera, t.projector) for t in kept_targets(project)}
    assert len(found) == 16
    assert ("testfield-01", "right", "projector") in found


def test_what_is_said_of_a_pair_names_it(project: Project) -> None:
    """Points left out, and the working volume's table: each line was there for both cameras, of neither."""
    pairs = {f"{camera} with projector" for camera in project.rig.cameras}
    entries = [entry.because for entry in load_calibrations(project)["photogrammetric"].left_out]
    told = [text for text in entries if not text.startswith(("in the left's image", "in the right's image"))]  # named
    assert pairs == {text.partition(": ")[0] for text in told}
    figures, _ = volume_figures(project, camera="right")
    assert (figures["camera"], figures["projector"]) == ("right", "projector")
    assert "Of right with projector; " in volume_table(figures).notes[-1]


def test_figures_of_one_pair_say_of_which(project: Project, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["profile", "plane+15"], ["uncertainty"], ["compare", "1"]):
        words = [command[0], str(project.path), *command[1:]]
        assert main(words) == 0
        assert "of left with projector; --camera and --projector choose others\n" in capsys.readouterr().out
        assert main([*words, "--camera", "right", "--projector", "projector"]) == 0
        assert "choose others" not in capsys.readouterr().out


def test_reports_say_whose_planes_they_tell_of(project: Project, plain_reports: None) -> None:
    """Six planes of one name passed, at twelve positions of two, and a map belonged to nobody."""
    data = report_data(project, kept_evaluation(project))
    whole = compose(data)
    assert [fact.partition(":")[0] for fact in whole.facts[:3]] == ["Camera left", "Camera right", "Projector"]
    planes = [name for name, _ in whole.summary.verdicts if name.startswith("plane")]
    assert len(planes) == len(set(planes)) == 8
    assert "plane+15, right and all devices, photogrammetric" in planes
    rows = (f"plane+{angle}, all 4 rows of Table 3, photogrammetric" for angle in ("00", "15"))
    assert whole.summary.passed == ("photogrammetric calibration", *rows)
    assert any("from the fitted plane over 2 positions" in text for text in whole.summary.findings)
    drawings = [*maps(data), *histograms(data)]
    keys = {drawing.key.partition("-")[0] + drawing.caption.rpartition(" Of")[2] for drawing in drawings}
    assert keys == {"deviations left.", "deviations right.", "histograms left.", "histograms right."}
    rows = [axes.get_ylabel() for drawing in drawings for axes in drawing.figure.axes]
    assert sum("all devices" in label for label in rows) == sum("\nprojector" in label for label in rows) == 4
    assert "plane+15, left and projector photogrammetric" in conformity(data.evaluations, Tolerance(1e-3)).text


def test_figures_have_all_devices_and_orientations(project: Project) -> None:
    figures = json.loads((project.path / "calibration.json").read_text())["photogrammetric"]
    assert set(figures["devices"]) == {"left", "right", "projector"}
    assert figures["camera"] == figures["devices"]["left"]
    assert {name: o["from"] for name, o in figures["orientations"].items()} == {"right": "left", "projector": "left"}
    assert figures["projector_from_camera"]["rotation"] == figures["orientations"]["projector"]["rotation"]


def test_both_cameras_stand_where_the_bench_put_them(project: Project) -> None:
    """One free parameter in a thousand beyond 4.5 sigma; the small rig's centroids are worse than they say, by 1.4."""
    found = load_calibrations(project)["photogrammetric"]
    assert isinstance(found, PhotogrammetricCalibration)
    for name, view in experiment("stereo", 0).views.items():
        pair, true = pair_of(found, name, "projector"), view.rig.projector_from_camera
        sigma = np.sqrt(np.diagonal(pair.covariance)[-3:])
        error = pair.projector_from_camera.translation_mm - true.translation_mm
        assert np.abs(error / sigma).max() < 1.4 * 4.5, name


def test_every_camera_is_held_against_the_centre_of_its_image(
    project: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("core.checks.network.OFF_CENTRE", -1.0)  # all are beyond that
    copy = read_project(shutil.copytree(project.path, tmp_path / "copy"))
    because = calibrate_project(copy)["photogrammetric"].verdict.because
    assert [words.partition(":")[0] for words in because if "principal point" in words] == ["left", "right"]


def test_planes_are_judged_by_each_camera(project: Project) -> None:
    rows = json.loads((project.path / "evaluation.json").read_text())["planes"]
    assert {(row["capture"], row["camera"]) for row in rows} == {
        (capture, camera) for capture in ("plane+00", "plane+15") for camera in ("left", "right")
    }
    for row in rows:
        # flat to 7 um beside some 0.1 mm of noise: the prediction holds, alike from either side
        assert row["rms_mm"] == pytest.approx(row["predicted_rms_mm"], rel=0.1)
    # by both cameras together, in either raster: sigma of Z at most 0.65 of a pair's; less of it across the plane
    by = {(row["capture"], row["camera"], row["projector"]): row["rms_mm"] for row in rows}
    for (capture, camera, projector), rms in by.items():
        if projector == "all devices":
            assert rms < 0.75 * by[capture, camera, "projector"]


def test_a_plane_is_doubted_for_the_devices_that_took_it_and_no_others(project: Project) -> None:
    """The row of a sound pair was doubtful because the other camera had moved, which its own points are not."""
    rows = kept_evaluation(project)
    of_right = {("right", "projector"): ("right and projector do not see it as they were calibrated",)}
    told = _told([(e, form_of(e.deviation_mm), 1.0, of_right.get(e.devices, ())) for e in rows], {}, {})
    doubted = {e.devices for e in told if any("right and projector do not" in text for text in e.verdict.because)}
    assert doubted == {("right", "projector"), ("left", "all devices"), ("right", "all devices")}


def test_profiles_are_those_of_each_camera(project: Project, tmp_path: Path) -> None:
    assert main(["tables", str(project.path), "--out", str(tmp_path)]) == 0
    evaluations = [e for e in kept_evaluation(project) if e.capture == "plane+15"]
    assert {e.devices[0] for e in evaluations} == {"left", "right"}
    for e in evaluations:
        name = f"profile-plane+15-{'-'.join(e.devices).replace(' ', '-')}.csv"
        u, v, _, deviation_um, _ = np.genfromtxt(tmp_path / name, delimiter=",", skip_header=1).T
        there = e.deviation_mm[v.astype(int), u.astype(int)] * 1e3  # the line leads through the pixels' centres
        assert np.isfinite(there).sum() > 100
        np.testing.assert_allclose(deviation_um, there, atol=0.006)


def test_points_of_both_cameras_lie_on_one_plane(project: Project) -> None:
    found = load_calibrations(project)["photogrammetric"]
    assert isinstance(found, PhotogrammetricCalibration)
    left_from_right = found.orientations["right"].device_from_base.inverse()
    _, left = reconstruct_capture(project, "plane+15", camera="left")
    _, right = reconstruct_capture(project, "plane+15", camera="right")
    planes = []
    for cloud, pose in ((left, None), (right, left_from_right)):
        points = cloud.xyz_mm[np.isfinite(cloud.xyz_mm[..., 2])].astype(float)
        points = points if pose is None else pose.apply(points)
        middle = points.mean(axis=0)
        planes.append((middle, np.linalg.svd(points - middle, full_matrices=False)[2][-1]))
    (one, normal), (other, second) = planes
    assert abs(float((other - one) @ normal)) < 0.05  # the calibration's own sigma of depth is some 0.05 mm
    assert np.degrees(np.arccos(min(1.0, abs(float(normal @ second))))) < 0.06  # 0.1 mm over 100 mm


def test_points_of_a_further_camera_are_told_as_those_of_the_first(project: Project, tmp_path: Path, edit_json) -> None:
    """Nobody but the window told of them, and took them for current whatever became of their calibration."""
    there = read_project(copied(project.path, tmp_path / "project"))
    kept = keep_points(there, "plane+15", "photogrammetric", camera="right", projector="projector")

    def told() -> State:
        return project_states(read_project(there.path)).captures["plane+15"]["reconstruct"]

    assert told().state == "current"
    scale = json.loads((there.path / "project.json").read_text())["scale"]
    edit_json(there.path / "project.json", scale={**scale, "length_mm": scale["length_mm"] * 1.01})
    assert any("scale.length_mm was" in text for text in told().because)
    shutil.copy(project.path / "project.json", there.path)
    with kept.open("ab") as file:
        file.write(b"more")
    assert told().state == "outdated"


def test_whose_frames_must_be_said(project: Project) -> None:
    folder = project.path / "captures" / "plane+00"
    with pytest.raises(InputError, match="left with projector, right with projector"):
        decode_capture(folder)
    assert decode_capture(folder, camera="right").camera == "right"
    with pytest.raises(InputError, match="no frames of top"):
        reconstruct_capture(project, "plane+00", camera="top")
    whole = read_capture(folder, project)
    of_right = [k for k, frame in enumerate(whole.frames) if frame.camera == "right"][3:]
    lacking = replace(whole, frames=tuple(f for k, f in enumerate(whole.frames) if k not in of_right))
    with pytest.raises(InputError, match=r"plane\+00, right with projector, axis x: .* is missing"):
        list(phase_maps(project, [lacking]))


def test_other_programs_get_the_camera_that_is_named(project: Project, tmp_path: Path) -> None:
    found = load_calibrations(project)["photogrammetric"]
    assert isinstance(found, PhotogrammetricCalibration)
    for name in ("left", "right"):
        export_calibration(project, "opencv", tmp_path / f"{name}.yml", camera=name)
        told = cv2.FileStorage(str(tmp_path / f"{name}.yml"), cv2.FILE_STORAGE_READ)
        pair, point = pair_of(found, name, "projector"), np.array([[20.0, 10.0, -600.0]])
        lens = (told.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients"))
        seen = cv2.projectPoints(point * (1, -1, -1), np.zeros(3), np.zeros(3), *lens)[0][0]
        device = pair.camera
        assert np.allclose(seen, project_points(device.spec, device.interior, point), atol=0.02)  # two lens models
        shift = pair.projector_from_camera.translation_mm * (1, -1, -1)
        assert np.allclose(told.getNode("T").mat().ravel(), shift, atol=1e-6)


def test_the_camera_that_is_named_is_read_back_and_no_other(project: Project, tmp_path: Path, capsys) -> None:
    """A foreign calibration of the right camera judges, makes and watches what that one saw, and nothing else."""
    own = load_calibrations(project)["photogrammetric"]
    folder = copied(project.path, tmp_path / "project")
    export_calibration(project, "opencv", tmp_path / "right.yml", camera="right")
    words = ["import", str(tmp_path / "right.yml"), "--from", "opencv", str(folder)]
    assert main([*words, "--camera", "top"]) == 2
    assert "no camera 'top'; choose among left, right" in capsys.readouterr().err
    assert main([*words, "--camera", "right"]) == 0
    read = load_calibrations(read_project(folder))["photogrammetric"]
    assert list(read.devices) == ["right", "projector"]
    pairs = pair_of(own, "right", "projector"), pair_of(read)
    point = np.array([[20.0, 10.0, -600.0]])
    seen = [project_points(p.camera.spec, p.camera.interior, point) for p in pairs]
    assert np.allclose(*seen, atol=0.02)  # two lens models
    out, said = str(tmp_path / "a.npz"), tmp_path / "a.json"
    assert main(["reconstruct", str(folder), "plane+15", "--out", out]) == 0
    assert flatness(Path(out))[1] == pytest.approx(1.0, abs=0.15)
    for camera in (["--camera", "left"], ["--camera", "left", "--rays", "pair"]):
        assert main(["reconstruct", str(folder), "plane+15", *camera, "--out", out]) == 2
        assert "it knows right, projector" in capsys.readouterr().err
    assert main(["evaluate", str(folder), "--json", str(said)]) == 0
    assert {plane["camera"] for plane in json.loads(said.read_text())["planes"]} == {"right"}
    assert main(["orient", str(folder), "plane+15", "--json", str(said)]) == 0
    assert list(json.loads(said.read_text())["untold"]) == ["left-projector"]
    assert main(["compare", str(folder), "1", "--json", str(said)]) == 0  # with the same camera of the other
    worst = max(layer["difference_mm_max"] for layer in json.loads(said.read_text())["depths"])
    assert worst < 0.1  # of the left camera 250 mm, the base's length


def test_a_batch_takes_every_camera_by_itself(project: Project, tmp_path: Path) -> None:
    out = tmp_path / "batch"
    words = ["batch", str(project.path), "plane+15", "--out", str(out)]
    assert main([*words, "--do", "decode"]) == 0
    assert main(words) == 0  # with what was decoded before
    for camera in ("left", "right"):
        folder = out / "plane+15" / f"{camera}-projector"
        assert flatness(folder / "points.npz")[1] == pytest.approx(1.0, abs=0.15)
        (row,) = json.loads((folder / "figures.json").read_text())["evaluate"]
        own = next(
            e for e in kept_evaluation(project) if e.capture == "plane+15" and e.devices == (camera, "projector")
        )
        assert (row["camera"], row["projector"]) == own.devices
        assert row["rms_mm"] == pytest.approx(own.rms_mm)
    assert main(words) == 0
    assert json.loads((out / "summary.json").read_text())["left"] == 2


def test_a_command_says_it_too(project: Project, tmp_path: Path) -> None:
    folder = str(project.path / "captures" / "plane+00")
    assert main(["decode", folder, "--out", str(tmp_path / "a.npz")]) == 2
    assert main(["decode", folder, "--camera", "left", "--out", str(tmp_path / "a.npz")]) == 0


def flatness(cloud: Path) -> tuple[float, float, int]:
    """R.m.s. of the deviations from a plane, the same over their sigmas, and the number of points."""
    with np.load(cloud) as stored:
        valid = np.isfinite(stored["xyz"]).all(axis=-1)
        points, sigma = stored["xyz"][valid].astype(float), stored["sigma_depth"][valid]
    points -= points.mean(axis=0)
    off = points @ np.linalg.svd(points, full_matrices=False)[2][-1]
    return float(off.std()), float((off / sigma).std()), len(points)


def test_points_are_made_from_all_that_saw_them(project: Project, tmp_path: Path) -> None:
    figures = {}
    for name, words in {
        "pair": ["--camera", "left", "--rays", "pair"],
        "joint": ["--camera", "left"],
        "cameras": ["--camera", "left", "--rays", "cameras"],
        "one cloud": [],
    }.items():
        out = tmp_path / f"{name}.npz"
        assert main(["reconstruct", str(project.path), "plane+15", *words, "--out", str(out)]) == 0
        figures[name] = flatness(out)
    # 0.55 of the noise at best (two thirds of a pixel's are left between pixels); the plane's part of Z is its cosine
    assert figures["joint"][0] < 0.72 * figures["pair"][0]
    assert figures["cameras"][0] < figures["pair"][0]
    for name in ("joint", "cameras"):
        assert figures[name][1] == pytest.approx(1.0, abs=0.15), name
    assert figures["one cloud"][2] > figures["joint"][2] > figures["cameras"][2]


def test_texture_fills_the_shadow(project: Project, tmp_path: Path) -> None:
    """A ball that no camera sees shadows a painted board: the hole is filled, and errors are what the sigmas say."""
    words = ["reconstruct", str(project.path), "object-shadow", "--fill", "texture"]
    assert main([*words, "--rays", "pair", "--camera", "left", "--out", str(tmp_path / "a.npz")]) == 2
    figures = tmp_path / "a.json"
    assert main([*words, "--camera", "left", "--out", str(tmp_path / "a.npz"), "--json", str(figures)]) == 0
    covered = json.loads(figures.read_text())["covered"]
    assert covered["by_code"] < 0.88
    assert covered["filled"] > 0.95
    view = experiment("stereo", 0).views["left"]
    true = truth_maps(view.rig, view.shot("object-shadow").scene).xyz_mm
    with np.load(tmp_path / "a.npz") as stored:
        new = stored["sight"] == Sight.TEXTURE
        error = (stored["xyz"] - true)[..., 2][new] / stored["sigma"][..., 2][new]
        depth = (stored["xyz"] - true)[..., 2][new] / stored["sigma_depth"][new]
    # some 30 windows lie side by side in the hole; what of the calibration's error is common to all of it is taken off
    assert 0.7 < np.nanstd(depth) < 1.4
    assert abs(np.nanmean(error)) < 3
    assert main([*words, "--out", str(tmp_path / "all.npz"), "--json", str(figures)]) == 0
    assert json.loads(figures.read_text())["covered"] == covered


@pytest.mark.parametrize("moved", ["projector", "right"])
def test_points_of_cameras_alone_are_not_doubted_for_the_projector(project: Project, moved: str) -> None:
    found = load_calibrations(project)["photogrammetric"]
    assert isinstance(found, PhotogrammetricCalibration)
    stood = found.orientations[moved]
    turned = replace(stood, device_from_base=stood.device_from_base.changed(np.array([2e-3, 0, 2e-3, 0, 0, 0])))
    calibration = replace(found, orientations={**found.orientations, moved: turned})
    capture = read_capture(project.path / "captures" / "plane+15", project)
    phases = [phase for _, phase in phase_maps(project, [capture])]
    told = {rays: said_of(capture, phases, calibration, rays) for rays in ("all", "cameras")}
    pairs = ["left and projector", "right and projector"] if moved == "projector" else ["right and projector"]
    assert [note.split(" do not see")[0] for note in told["all"]] == pairs
    assert [note.split(" do not see")[0] for note in told["cameras"]] == (
        ["left and right"] if moved == "right" else []
    )


@pytest.mark.parametrize("most", [500_000, 10_000], ids=["all pixels", "patches"])
def test_what_moved_between_the_cameras_images_is_told_though_each_of_them_fits_the_projector(
    project: Project, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Left took the plane before it was turned, right after it: the points, of both, were in no doubt."""
    monkeypatch.setattr("core.pipeline.judge.MOST_PIXELS", most)
    monkeypatch.setattr("core.pipeline.judge.PATCH_PX", 32)
    found = load_calibrations(project)["photogrammetric"]
    captures = [read_capture(project.path / "captures" / f"plane+{angle}", project) for angle in ("00", "15")]
    (left, _), (_, right) = ([phase for _, phase in phase_maps(project, [each])] for each in captures)
    for rays in ("all", "cameras"):
        (told,) = said_of(captures[0], [left, right], found, rays)
        assert told.startswith("left and right do not see it as they were calibrated")


def test_the_light_is_that_of_the_first_camera_whatever_the_other_counts(
    project: Project, tmp_path: Path, edit_json
) -> None:
    """White of one camera less black of another of more bits: no capture had either."""
    folder = Path(shutil.copytree(project.path, tmp_path / "light", ignore=shutil.ignore_patterns("results")))
    edit_json(folder / "project.json", captures=["captures/plane+15"])
    before = rig_light(read_project(folder))
    for frame in read_capture(folder / "captures" / "plane+15", project).frames:
        if frame.camera == "right":
            cv2.imwrite(str(frame.path), read_image(frame.path).astype(np.uint16) * 16)
    light = rig_light(read_project(folder))
    assert light == before
    assert light.known_from[0] == "contrast, noise and blur from the capture plane+15"


def test_a_capture_of_several_pairs_is_decoded_for_its_own_sake(project: Project, tmp_path: Path, edit_json) -> None:
    """Where no later stage had asked for it, `update` ended in a ValueError, and every other stage with it."""
    folder = Path(shutil.copytree(project.path, tmp_path / "alone", ignore=shutil.ignore_patterns("results")))
    edit_json(folder / "project.json", captures=["captures/plane+15"])
    assert decode_project(read_project(folder)) == 1
    assert project_states(read_project(folder)).captures["plane+15"]["decode"].state == "current"
    figures = json.loads((folder / "results" / "decode.json").read_text())["captures"]["plane+15"]
    assert {"left-projector", "right-projector"} < set(figures)


def test_a_capture_that_no_movement_explains_takes_no_other_out_of_the_chart(
    project: Project, tmp_path: Path, edit_json, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = copied(project.path, tmp_path / "chart")
    edit_json(folder / "project.json", captures=["captures/plane+00", "captures/plane+15"])
    found = orient.find_motion

    def unless_turned(*args: object, capture: str, **more: object) -> RigMotion:
        if capture == "plane+15":
            raise AdjustmentError(capture, "left and projector see it 120 lines off each other's rays", "see to that")
        return found(*args, capture=capture, **more)

    monkeypatch.setattr("core.orient.find_motion", unless_turned)
    charts = drift_of(read_project(folder))
    assert {point.capture for point in charts["left", "projector"]} >= {"plane+00"}
    assert "plane+15" not in {point.capture for chart in charts.values() for point in chart}
    assert "plane+15: left and projector see it 120 lines off each other's rays; left out of the chart" in caplog.text


def test_rays_that_contradict_one_another_are_refused(project: Project, tmp_path: Path) -> None:
    words = ["reconstruct", str(project.path), "plane+15", "--out", str(tmp_path / "a.npz"), "--rays", "all"]
    assert main([*words, "--orient"]) == 2
    assert main([*words, "--camera", "top"]) == 2


def test_every_pair_is_watched(project: Project, tmp_path: Path) -> None:
    """Nothing has moved: at the stated rate one capture in a thousand would say so."""
    out = tmp_path / "orient.json"
    assert main(["orient", str(project.path), "plane+15", "--correct", "--json", str(out)]) == 0
    figures = json.loads(out.read_text())
    assert set(figures["pairs"]) == {"left-projector", "right-projector"}
    assert figures["moved"] is any(pair["moved"] for pair in figures["pairs"].values()) is False
    assert figures["untold"] == {}
    for device in ("right", "projector"):  # together they are where they were, too: sixteen normal deviates
        moved = figures["together"][device]
        off = np.abs([*moved["rotation_urad"], *moved["shift_mm"]]) / [*moved["sigma_urad"], *moved["sigma_mm"]]
        assert off.max() < 4
    assert main(["orient", str(project.path), "plane+15", "--json", str(out)]) == 0
    figures = json.loads(out.read_text())
    assert set(figures["pairs"]) == {"left-projector", "right-projector", "left-right"}
    assert figures["moved"] is False
    two = ["orient", str(project.path), "plane+15", "--camera", "left", "--projector"]
    assert main([*two, "right", "--correct"]) == 2  # cameras are only watched
    assert main([*two, "left"]) == 2
    assert main(["orient", str(project.path), "plane+15", "--camera", "right", "--projector", "left"]) == 0
    words = ["reconstruct", str(project.path), "plane+15", "--orient", "--camera", "right"]
    for rays in ("all", "cameras", "pair"):  # the plane stays flat by the corrected devices
        assert main([*words, "--rays", rays, "--out", str(tmp_path / "right.npz")]) == 0
        assert flatness(tmp_path / "right.npz")[1] == pytest.approx(1.0, abs=0.15), rays
    assert main([*words[:-2], "--rays", "pair", "--out", str(tmp_path / "left.npz")]) == 0  # of the first
    assert np.load(tmp_path / "left.npz")["xyz"].shape[:2] == (project.camera.height, project.camera.width)


def test_a_pair_that_alone_is_calibrated_is_corrected_alone(project: Project, tmp_path: Path) -> None:
    """What `orient --correct` had kept of the pair was asked for again, as of all devices."""
    folder, other, out = copied(project.path, tmp_path / "project"), tmp_path / "left.yml", tmp_path / "a.npz"
    named = ["--camera", "left", "--projector", "projector"]
    assert main(["export", str(project.path), "--to", "opencv", str(other), *named]) == 0
    assert main(["import", str(other), "--from", "opencv", str(folder), *named]) == 0
    words = ["reconstruct", str(folder), "plane+15", "--orient", "--out", str(out)]
    assert main(words) == 2  # nothing is kept yet
    assert main(["orient", str(folder), "plane+15", "--correct"]) == 0
    assert main(words) == 0
    assert flatness(out)[1] == pytest.approx(1.0, abs=0.15)


def test_a_translation_in_metres_is_no_base(project: Project) -> None:
    found = load_calibrations(project)["photogrammetric"]
    stood = found.orientations["right"]
    metres = Pose(stood.device_from_base.rotation, stood.device_from_base.translation_mm / 1000)
    theirs = replace(found, orientations={**found.orientations, "right": replace(stood, device_from_base=metres)})
    told = [[c.text for c in _foreign(project, each) if "in m instead of mm" in c.text] for each in (found, theirs)]
    assert told[0] == []
    assert [text.partition(" is ")[0] for text in told[1]] == ["right"]


def test_no_device_is_held_against_the_calibration_of_another(project: Project, tmp_path: Path, edit_json) -> None:
    """A camera beside the calibrated one, whose name was "camera", was taken for it: it had moved by 0.2 m."""
    folder, other, out = copied(project.path, tmp_path / "project"), tmp_path / "left.yml", tmp_path / "a.json"
    named = ["--projector", "projector", "--camera"]
    assert main(["export", str(project.path), "--to", "opencv", str(other), *named, "left"]) == 0
    edit_json(folder / "project.json", captures=["captures/plane+15"])
    for file in (folder / "project.json", folder / "captures" / "plane+15" / "capture.json"):
        file.write_text(file.read_text().replace('"left"', '"camera"'))
    assert main(["import", str(other), "--from", "opencv", str(folder), *named, "camera"]) == 0
    assert main(["orient", str(folder), "plane+15", "--json", str(out)]) == 0
    figures = json.loads(out.read_text())
    assert set(figures["untold"]) == {"right-projector"}
    assert figures["moved"] is False
    assert main(["evaluate", str(folder), "--json", str(out)]) == 0
    planes = json.loads(out.read_text())["planes"]
    assert {plane.get("camera", "camera") for plane in planes} == {"camera"}


def test_rays_of_all_are_the_default_of_what_knows_all_devices(project: Project, monkeypatch) -> None:
    """A calibration of one camera with one projector stays what it is for where it alone is in use."""
    assert seen_by_several(project, "plane+15")
    monkeypatch.setattr("core.pipeline.views.current_runs", lambda _: {"polynomial": 1})
    assert not seen_by_several(project, "plane+15")


def test_a_camera_of_one_axis_keeps_no_other_pair_from_being_watched(
    project: Project, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "one-axis", tmp_path / "orient.json"
    shutil.copytree(project.path / "captures" / "plane+15", folder)
    data = json.loads((folder / "capture.json").read_text())
    data["frames"] = [f for f in data["frames"] if (f["camera"], f["pattern"].get("axis")) != ("right", "y")]
    (folder / "capture.json").write_text(json.dumps(data))
    words = ["orient", str(project.path), str(folder)]
    assert main([*words, "--json", str(out)]) == 0
    figures = json.loads(out.read_text())
    assert set(figures["pairs"]) == {"left-projector"}
    none = "no pixels have both projector coordinates"
    assert figures["untold"] == {"right-projector": none, "left-right": none}
    assert "projector against right cannot be judged" in capsys.readouterr().out
    assert main([*words, "--camera", "right"]) == 2


def test_a_camera_of_rows_alone_keeps_no_other_from_points_and_planes(
    project: Project, tmp_path: Path, edit_json, caplog: pytest.LogCaptureFixture
) -> None:
    """All devices stand side by side: rows do not change with depth, neither by the projector nor by the other."""
    folder, out = copied(project.path, tmp_path / "project"), tmp_path / "figures.json"
    edit_json(folder / "project.json", captures=["captures/plane+15"])
    frames = json.loads((folder / "captures" / "plane+15" / "capture.json").read_text())["frames"]
    left = [f for f in frames if (f["camera"], f["pattern"].get("axis")) != ("right", "x")]
    edit_json(folder / "captures" / "plane+15" / "capture.json", frames=left)
    assert main(["evaluate", str(folder), "--json", str(out)]) == 0
    planes = json.loads(out.read_text())["planes"]
    pairs = {(plane["camera"], plane["projector"]) for plane in planes}
    assert pairs == {("left", "projector"), ("left", "all devices")}
    assert all(plane["rms_mm"] == pytest.approx(plane["predicted_rms_mm"], rel=0.1) for plane in planes)
    assert "hardly changes with depth on this rig; not judged by right and projector" in caplog.text
    words = ["reconstruct", str(folder), "plane+15", "--out", str(tmp_path / "a.npz")]
    assert main(words) == 0
    assert main([*words, "--camera", "right"]) == 2


def test_cameras_calibrated_elsewhere_need_no_projector(project: Project, tmp_path: Path, edit_json, capsys) -> None:
    """The projector of a stereo scanner labels places: planes are as flat as the noise of its labels lets them be."""
    stereo, folder = tmp_path / "stereo.yml", copied(project.path, tmp_path / "project")
    edit_json(folder / "project.json", captures=["captures/plane+00"])
    assert main(["export", str(project.path), "--to", "opencv", str(stereo), "--cameras", "left", "right"]) == 0
    words = ["import", str(stereo), "--from", "opencv", str(folder)]
    assert main(words) == 2
    assert "--projector and --cameras name them" in capsys.readouterr().err
    assert main([*words, "--cameras", "left", "top"]) == 2
    capsys.readouterr()
    assert main([*words, "--cameras", "left", "right"]) == 0
    assert "the projector is not calibrated, and only labels corresponding places" in capsys.readouterr().out
    read = load_calibrations(read_project(folder))["photogrammetric"]
    assert isinstance(read, PhotogrammetricCalibration)
    assert (read.cameras, read.projectors, [*read.devices]) == (("left", "right"), (), ["left", "right"])
    own = load_calibrations(project)["photogrammetric"]
    assert isinstance(own, PhotogrammetricCalibration)
    assert read.orientations["right"].device_from_base.translation_mm == pytest.approx(
        pair_of(own, "left", "right").projector_from_camera.translation_mm, abs=1e-6
    )
    assert main(["evaluate", str(folder), "--json", str(tmp_path / "e.json")]) == 0
    rows = json.loads((tmp_path / "e.json").read_text())["planes"]
    assert {(row["camera"], row["projector"]) for row in rows} == {("left", "all cameras"), ("right", "all cameras")}
    for row in rows:  # what is wrong with a line's phase is so for both cameras, and drops out
        assert row["n"] > 30_000
        assert row["rms_mm"] / row["predicted_rms_mm"] < 1.05
    for made in kept_evaluation(read_project(folder)):
        sigma, deviation = made.sigma_mm, made.deviation_mm
        usual = sigma < 3 * np.nanmedian(sigma)  # without a few at the light's rim, whose places are hardly known
        assert np.count_nonzero(usual) > 0.995 * made.n
        assert 0.9 < np.sqrt(np.mean(deviation[usual] ** 2) / np.mean(sigma[usual] ** 2)) < 1.05
    capsys.readouterr()
    assert main(["uncertainty", str(folder)]) == 2
    assert "is of left and right; no projector is calibrated" in capsys.readouterr().err
    assert main(["orient", str(folder), "plane+00", "--json", str(tmp_path / "o.json")]) == 0
    assert capsys.readouterr().out.startswith("plane+00: ")
    watched = json.loads((tmp_path / "o.json").read_text())
    assert (watched["camera"], watched["projector"]) == ("left", "right")
    assert watched["corrected_rms"] < 1.1
    for camera in ("left", "right"):
        _, cloud = reconstruct_capture(read_project(folder), "plane+00", camera=camera)
        _, known = reconstruct_views(project, "plane+00", camera=camera, rays="cameras")
        both = np.isfinite(cloud.xyz_mm[..., 2]) & np.isfinite(known.xyz_mm[..., 2])
        assert cloud.sigma_depth_mm is not None
        assert both.sum() > 0.99 * np.isfinite(known.xyz_mm[..., 2]).sum()
        off = np.abs(cloud.xyz_mm - known.xyz_mm)[both][:, 2] / cloud.sigma_depth_mm[both]
        assert np.quantile(off, 0.999) < 0.3  # two lens models
    out = tmp_path / "points.npz"
    assert main(["reconstruct", str(folder), "plane+00", "--out", str(out), "--camera", "right"]) == 0
    with np.load(out) as points:
        assert np.array_equal(points["xyz"], cloud.xyz_mm, equal_nan=True)
    there = read_project(folder)
    assert "base left to right" in str(tables(report_data(there, kept_evaluation(there))))
    assert main(["status", str(folder), "--json", str(tmp_path / "s.json")]) == 0
    states = json.loads((tmp_path / "s.json").read_text())["stages"]
    assert (states["calibrate"]["state"], states["evaluate"]["state"]) == ("current", "current")
    turn_second_camera(stereo, 2e-3)
    assert main([*words, "--cameras", "left", "right"]) == 0
    assert main(["evaluate", str(folder), "--json", str(tmp_path / "e.json")]) == 0
    for row in json.loads((tmp_path / "e.json").read_text())["planes"]:
        assert row["verdict"]["state"] != "passed"
        assert "left and right do not see it as they were calibrated" in str(row["verdict"])


def turn_second_camera(stereo: Path, angle: float) -> None:
    """Rewrite the file of a stereo calibration as if the second camera were rolled by an angle."""
    read = cv2.FileStorage(str(stereo), cv2.FILE_STORAGE_READ)
    nodes = {key: read.getNode(key) for key in read.root().keys()}  # noqa: SIM118  no dict
    values = {key: node.mat() if node.isMap() else int(node.real()) for key, node in nodes.items()}
    read.release()
    roll = cv2.Rodrigues(np.array([0.0, 0.0, angle]))[0]
    write = cv2.FileStorage(str(stereo), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        write.write(key, roll @ value if key in ("R", "T") else value)
    write.release()


def test_live_takes_every_camera(project: Project, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only the first pair's was taken. Points of a plane, each once: flat within their sigmas, in the first's frame."""
    scene = "virtual:stereo?shot=plane%2B15"
    urls = ["--projector", scene, *(f"--camera={name}={scene}&camera={name}" for name in project.rig.cameras)]
    words = ["live", str(project.path), *urls, "--count", "1", "--out", str(tmp_path), "--format", "npz"]
    assert main([*words, "--json", str(tmp_path / "live.json")]) == 0
    (cycle,) = json.loads((tmp_path / "live.json").read_text())["cycles"]
    assert list(cycle["pairs"]) == ["left-projector", "right-projector"]
    assert cycle["p"] == min(cycle["pairs"].values()) > 1e-3
    with np.load(tmp_path / "0001.npz") as stored:
        points, sigma = stored["xyz"].reshape(-1, 3), stored["sigma_depth"].ravel()
    bench = experiment("stereo", 0)
    true = truth_maps(bench.rig, bench.shot("plane+15").scene).xyz_mm.reshape(-1, 3)
    normal = np.linalg.svd((true - np.nanmean(true, 0))[np.isfinite(true).all(1)], full_matrices=False)[2][2]
    off = (points - np.nanmean(true, 0)) @ normal
    assert abs(off.mean()) < 0.3  # as well as the calibration's sigmas tell where the plane is
    flat = np.linalg.svd(points - points.mean(0), full_matrices=False)[1][2] / np.sqrt(len(points))
    assert flat < 1.2 * np.sqrt(np.mean(sigma**2))
    assert len(points) == cycle["points"] > 35_000
    rows = json.loads((project.path / "evaluation.json").read_text())["planes"]
    (alone,) = (row["rms_mm"] for row in rows if row["capture"] == "plane+15" and row["projector"] == "projector"
                and row["camera"] == "left")  # fmt: skip
    assert flat < 0.75 * alone  # sixty per cent are expected: the cameras stand on either side


@pytest.mark.parametrize(
    ("option", "seen"), [("--camera=up=", "no camera 'up'"), ("--projector=p=", "no projector 'p'")]
)
def test_live_names_devices_that_are_not_there(project: Project, option: str, seen: str, capsys) -> None:
    assert main(["live", str(project.path), f"{option}virtual:stereo"]) == 2
    told = capsys.readouterr().err
    assert seen in told
    assert told.count("\n") == 1


def test_profiles_of_unknown_devices_say_who_saw_the_plane(project: Project, capsys) -> None:
    assert main(["profile", str(project.path), "plane+15", "--camera", "up"]) == 2
    assert "plane+15 by right and projector" in capsys.readouterr().err


def test_the_depth_method_is_of_the_pair_that_is_asked_for(quick: Path, edit_json, capsys) -> None:
    """It was of the pair that the rig names first, and no other could be had; the same frames give the same depths."""
    assert main(["calibrate", str(quick), "--method", "polynomial"]) == 0
    first = load_calibrations(read_project(quick))["polynomial"]
    device = json.loads((quick / "project.json").read_text())["camera"]
    edit_json(quick / "project.json", version=2, camera=None, cameras={"a": device, "b": device})
    for path in quick.glob("captures/*/capture.json"):
        frames = [{**frame, "camera": "b"} for frame in json.loads(path.read_text())["frames"]]
        edit_json(path, version=2, frames=frames)
    calibrate = ["calibrate", str(quick), "--method", "polynomial"]
    assert main(calibrate) == 2
    assert "has no frames of a with projector" in capsys.readouterr().err
    assert main([*calibrate, "--camera", "c"]) == 2
    assert "no camera 'c'" in capsys.readouterr().err
    assert main([*calibrate, "--camera", "b"]) == 0
    project = read_project(quick)
    second = load_calibrations(project)["polynomial"]
    assert second.devices == ("b", "projector")
    assert np.array_equal(first.coefficients, second.coefficients, equal_nan=True)
    (plane, *_) = evaluate_project(project)
    assert plane.devices == ("b", "projector")
    assert not project_states(project).outdated("calibrate")
    assert main(["live", str(quick), "--count", "1", "--camera", "a=virtual:quick"]) == 2
    assert "is of b with projector, not of a with projector" in capsys.readouterr().err
