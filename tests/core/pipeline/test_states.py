"""The table of states: what makes which result outdated, and what does not."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from core.cli import main
from core.model import Project
from core.pipeline import (
    CalibrateOptions,
    calibrate_project,
    load_calibrations,
    orient_capture,
    project_states,
    report_project,
    update_project,
)
from core.pipeline.evaluate import load_evaluation
from core.pipeline.report import outdated_words
from core.pipeline.signing import save_sign_off
from core.pipeline.state.states import differences
from core.project import read_capture, read_project, write_picks
from core.project.contents import Contents
from core.report import SignOff
from tests.copies import copied, own

pytestmark = pytest.mark.usefixtures("plain_reports")

ALL = ("decode", "measure", "calibrate", "reconstruct", "evaluate", "report")


def states(folder: Path) -> dict[str, str]:
    return {stage: state.state for stage, state in project_states(read_project(folder)).stages.items()}


def outdated(folder: Path) -> set[str]:
    return {stage for stage, state in states(folder).items() if state != "current"}


def because(folder: Path, stage: str) -> str:
    return "; ".join(project_states(read_project(folder)).stages[stage].because)


# ------------------------------------------------------------------------------------- what changes nothing


def copied_at_another_time(folder: Path, to: Path) -> Path:
    subprocess.run(["cp", "-r", folder, to], check=True)
    return to


def copied_with_times(folder: Path, to: Path) -> Path:
    subprocess.run(["cp", "-a", folder, to], check=True)
    return to


def unpacked(folder: Path, to: Path) -> Path:
    """Packed, and unpacked by a program that gives every file the time of unpacking."""
    with zipfile.ZipFile(to.with_suffix(".zip"), "w") as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(folder))
    with zipfile.ZipFile(to.with_suffix(".zip")) as archive:
        archive.extractall(to)
    return to


def moved(folder: Path, to: Path) -> Path:
    copied(folder, to.with_name("there"))
    return to.with_name("there").rename(to)


def touched(folder: Path, to: Path) -> Path:
    """Every file written at a time of its own, some in the future."""
    shutil.copytree(folder, to)
    for i, path in enumerate(sorted(to.rglob("*"))):
        at = time.time() + (i % 7 - 3) * 86_400
        os.utime(path, (at, at))
    return to


def without_memory(folder: Path, to: Path) -> Path:
    copied(folder, to)
    (to / "results" / ".contents.json").unlink()
    return to


def with_memory_damaged(folder: Path, to: Path) -> Path:
    copied(folder, to)
    (to / "results" / ".contents.json").write_text('{"version": 1, "files": [')
    return to


def reformatted(folder: Path, to: Path) -> Path:
    """Documents laid out in another way, with keys of other programs and a comment."""
    copied(folder, to)
    for path in (*to.glob("captures/*/*.json"), to / "project.json"):
        path.write_text(json.dumps({"other": 1, **json.loads(path.read_text())}, indent=3))
    board = to / "testfield.csv"
    board.write_text("# seen\n" + board.read_text())
    return to


@pytest.mark.parametrize(
    "bring",
    [
        copied_at_another_time,
        copied_with_times,
        unpacked,
        moved,
        touched,
        without_memory,
        with_memory_damaged,
        reformatted,
    ],
)
def test_nothing_is_outdated_by(bring: Callable[[Path, Path], Path], whole_original: Path, tmp_path: Path) -> None:
    assert outdated(bring(whole_original, tmp_path / "new")) == set()


def test_a_copy_needs_nothing_done(whole_original: Path, tmp_path: Path, capsys) -> None:
    folder = copied_at_another_time(whole_original, tmp_path / "new")
    assert main(["update", str(folder)]) == 0
    assert capsys.readouterr().out == "nothing to do\n"


# ------------------------------------------------------------------------------------ what makes outdated


def edit(path: Path, change: Callable[[dict], None]) -> None:
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def scale_changed(folder: Path) -> None:
    edit(folder / "project.json", lambda d: d["scale"].update(length_mm=1.01 * d["scale"]["length_mm"]))


def pick_changed(folder: Path) -> None:
    edit(folder / "captures/testfield-02/picks.json", lambda d: d["seeds"][0].update(u=d["seeds"][0]["u"] + 0.5))


def frame_replaced(folder: Path) -> None:
    """One grey value of one frame, the file's times and size kept."""
    path = own(folder / "captures/testfield-03/004.png")
    stat, image = path.stat(), cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    image[0, 0] ^= 1
    cv2.imwrite(str(path), image)
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def plane_replaced(folder: Path) -> None:
    shutil.copy(folder / "captures/plane+00/003.png", own(folder / "captures/plane+15/003.png"))


def board_edited(folder: Path) -> None:
    path = folder / "testfield.csv"
    lines = path.read_text().splitlines()
    cells = lines[-1].split(",")
    lines[-1] = ",".join([*cells[:2], str(float(cells[2]) + 0.1), *cells[3:]])
    path.write_text("\n".join(lines))


def plate_moved(folder: Path) -> None:
    edit(folder / "captures/depth-02/capture.json", lambda d: d.update(z_mm=d["z_mm"] + 1))


def angle_corrected(folder: Path) -> None:
    edit(folder / "captures/plane+15/capture.json", lambda d: d.update(angle_deg=16))


def target_excluded(folder: Path) -> None:
    picks = folder / "captures/testfield-05"
    write_picks(picks / "picks.json", read_capture(picks).seeds, [(3, 4)])


def pattern_corrected(folder: Path) -> None:
    edit(
        folder / "captures/object-step/capture.json",
        lambda d: next(f for f in d["frames"] if f["pattern"]["kind"] == "phase")["pattern"].update(shift_rad=0.1),
    )


def pitch_corrected(folder: Path) -> None:
    edit(folder / "project.json", lambda d: d["camera"].update(pitch_mm=[0.0081, 0.008]))


def calibrated_otherwise(folder: Path) -> None:
    calibrate_project(read_project(folder), "polynomial", CalibrateOptions(degree=2))


def capture_left_out(folder: Path) -> None:
    edit(folder / "project.json", lambda d: d["captures"].remove("captures/testfield-04"))


def archive_damaged(folder: Path) -> None:
    path = own(folder / "results/runs/0001/photogrammetric.npz")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)


def watched(folder: Path) -> None:
    for name in ("plane+00", "plane+15"):
        orient_capture(read_project(folder), name)


def report_edited(folder: Path) -> None:
    path = folder / "results/report/report.html"
    path.write_text(path.read_text().replace("0.0", "0.1", 1))


ROWS = [
    (scale_changed, "calibrate reconstruct evaluate report", "calibrate", "scale.length_mm was"),
    (pick_changed, "measure calibrate reconstruct evaluate report", "measure", "testfield-02/picks.json changed"),
    (
        frame_replaced,
        "decode measure calibrate reconstruct evaluate report",
        "calibrate",
        "testfield-03/004.png changed",
    ),
    (plane_replaced, "decode evaluate report", "evaluate", "plane+15/003.png changed"),
    (board_edited, "measure calibrate reconstruct evaluate report", "measure", "the board of testfield-01"),
    (plate_moved, "calibrate evaluate report", "calibrate", "depth-02: z_mm was"),
    (angle_corrected, "evaluate report", "evaluate", "plane+15: angle_deg was 15, is 16"),
    (target_excluded, "measure calibrate reconstruct evaluate report", "calibrate", "testfield-05/picks.json"),
    (pattern_corrected, "decode reconstruct", "reconstruct", "object-step: the patterns in capture.json changed"),
    (pitch_corrected, "measure calibrate reconstruct evaluate report", "measure", "camera.pitch_mm was ["),
    (calibrated_otherwise, "evaluate report", "evaluate", "the polynomial calibration is another one now"),
    (capture_left_out, "calibrate reconstruct evaluate report", "calibrate", "testfield-04 has no part any more"),
    (archive_damaged, "calibrate reconstruct evaluate report", "calibrate", "photogrammetric.npz is not as it was"),
    (watched, "report", "report", "the drift chart is new"),
    (report_edited, "report", "report", "report.html is not as it was written"),
]


@pytest.mark.parametrize(("change", "stages", "told_by", "words"), ROWS, ids=[row[0].__name__ for row in ROWS])
def test_what_follows_from_it_is_outdated_by(
    change: Callable[[Path], None], stages: str, told_by: str, words: str, whole: Path
) -> None:
    change(whole)  # of a project as in test_nothing_is_outdated_by
    found = project_states(read_project(whole)).stages
    assert {stage for stage, state in found.items() if state.state != "current"} == set(stages.split())
    assert words in "; ".join(found[told_by].because)
    assert all(found[stage].because for stage in stages.split())


@pytest.mark.parametrize("change", [frame_replaced, archive_damaged])
def test_update_brings_everything_up_to_date(
    change: Callable[[Path], None], whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change(whole)
    update_project(read_project(whole))
    assert outdated(whole) == set()
    monkeypatch.setattr("core.pipeline.update.writing_results", None)  # what is current may be read only
    assert update_project(read_project(whole)).done == ()


def test_a_depth_calibration_follows_the_interior_orientation_that_it_took(calibrated: Path) -> None:
    project = read_project(calibrated)
    assert not load_calibrations(project)["polynomial"].warnings  # that the plate alone had to orient the camera
    calibrate_project(project, "photogrammetric", CalibrateOptions(hold=("projector.A2",)))
    assert because(calibrated, "calibrate") == "the photogrammetric calibration is another one now"
    calibrate_project(project, "polynomial")
    assert states(calibrated)["calibrate"] == "current"


def test_an_exported_report_does_not_make_the_signed_one_outdated(whole: Path, tmp_path: Path) -> None:
    project = read_project(whole)
    evaluations = load_evaluation(project)
    save_sign_off(project, SignOff("E. Abbe", date="2026-11-22"), evaluations)
    assert outdated(whole) == {"report"}
    report_project(project, evaluations=evaluations)
    assert outdated(whole) == set()
    save_sign_off(project, SignOff("E. Abbe", date="2026-11-22"), evaluations)
    report_project(project, tmp_path / "out", evaluations=evaluations)
    assert outdated(whole) == set()


def test_results_of_something_else_are_told_and_stand_in_the_report(whole: Path, capsys) -> None:
    scale_changed(whole)
    for command in ("evaluate", "report"):
        assert main([command, str(whole)]) == 0
        (line,) = [text for text in capsys.readouterr().err.splitlines() if text.startswith("stripe-core: ")]
        assert "scale.length_mm was" in line
    assert "scale.length_mm was" in (whole / "results/report/report.html").read_text()


def test_an_update_reconstructs_nothing_by_a_calibration_that_it_cannot_renew(
    whole: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (whole / "captures/testfield-03/003.png").unlink()
    points = {p: p.stat().st_mtime_ns for p in (whole / "results/points").rglob("*") if p.is_file()}
    assert main(["update", str(whole)]) == 2
    told = capsys.readouterr()
    assert "003.png: the frame is not there" in told.err
    for stage in ("reconstruct: no new points of object-", "evaluate: not done: "):
        (line,) = [text for text in told.out.splitlines() if text.startswith(stage)]
        assert "calibrate is outdated: testfield-03 has no part any more" in line
    assert {p: p.stat().st_mtime_ns for p in points} == points
    assert states(whole)["reconstruct"] == states(whole)["evaluate"] == "outdated"


def test_planes_that_evaluating_reconstructed_are_as_current_as_the_evaluation(whole: Path) -> None:
    edit(whole / "project.json", lambda d: d.update(captures=[c for c in d["captures"] if "object" not in c]))
    shutil.rmtree(whole / "results" / "points")
    assert states(whole)["reconstruct"] == states(whole)["evaluate"] == "current"
    scale_changed(whole)
    assert states(whole)["reconstruct"] == states(whole)["evaluate"] == "outdated"


def test_no_capture_is_current_in_a_calibration_that_is_outdated(whole: Path) -> None:
    scale_changed(whole)
    told = project_states(read_project(whole)).captures
    assert {of["calibrate"].state for of in told.values() if "calibrate" in of} == {"outdated"}
    for stage in ("calibrate", "evaluate"):  # the depth calibration takes the other into account
        assert because(whole, stage).count("scale.length_mm was") == 1


def test_status_tells_every_cause_once(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scale_changed(whole)
    assert main(["status", str(whole)]) == 0
    told = capsys.readouterr().out
    assert told.count("scale.length_mm was") == 1, told
    stages, captures = told.split("\n\n")
    lines = {line.split()[0]: line.split()[1:] for line in stages.splitlines()}
    assert lines["evaluate"] == ["outdated", "see", "calibrate"]
    assert any(line.split() == ["plane+00", "evaluate", "outdated"] for line in captures.splitlines())


def test_status_is_written_as_the_contract_says(whole: Path, tmp_path: Path) -> None:
    scale_changed(whole)
    assert main(["status", str(whole), "--json", str(tmp_path / "s.json")]) == 0
    found = json.loads((tmp_path / "s.json").read_text())
    assert set(found["stages"]) == set(ALL)
    assert found["stages"]["calibrate"]["state"] == "outdated"
    assert found["captures"]["testfield-01"]["measure"] == {"state": "current", "because": []}
    assert found["captures"]["plane+00"]["evaluate"]["state"] == "outdated"
    words = {s["state"] for of in (found["stages"], *found["captures"].values()) for s in of.values()}
    assert words <= {"absent", "current", "outdated", "failed"}


def test_a_capture_that_cannot_be_read_has_failed_and_says_why(whole: Path) -> None:
    (whole / "captures/plane+00/capture.json").write_text("{")
    found = project_states(read_project(whole))
    assert found.captures["plane+00"]["decode"].state == "failed"
    assert "not JSON" in found.captures["plane+00"]["decode"].because[0]
    assert found.captures["plane+15"]["evaluate"].state == "current"


def test_what_stopped_an_update_is_its_state_until_something_changes(whole: Path) -> None:
    fewer = [f"captures/testfield-0{name}" for name in range(2, 9)]
    edit(whole / "project.json", lambda d: d.update(captures=[c for c in d["captures"] if c not in fewer]))
    assert main(["update", str(whole)]) in (1, 2)
    assert states(whole)["calibrate"] == "failed"
    assert because(whole, "calibrate")
    angle_corrected(whole)
    assert states(whole)["calibrate"] == "outdated"


def test_calibrating_by_all_methods_is_reported_to_its_end(quick: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from core.pipeline import update
    from core.progress import Progress

    told: list[tuple[float, str]] = []
    progress = Progress(lambda fraction, message: told.append((fraction, message)))
    monkeypatch.setattr(update, "calibrate_project", lambda _, method, options, progress: progress(1.0, method))
    project = read_project(quick)
    update._calibrate(project, project_states(project), progress)
    assert told == [(1.0, "all")]


def test_an_update_that_was_stopped_goes_on_where_it_was(whole: Path) -> None:
    from core.errors import Cancelled
    from core.progress import Progress

    seen: list[str] = []
    progress = Progress(lambda _, message: seen.append(message), lambda: "iteration 2" in seen)
    target_excluded(whole)
    assert states(whole)["measure"] == "outdated"
    with pytest.raises(Cancelled):
        update_project(read_project(whole), progress)
    assert states(whole)["measure"] == "current"
    done = update_project(read_project(whole)).done
    assert [text.partition(":")[0] for text in done] == ["calibrate", "reconstruct", "evaluate", "report"]


def test_the_work_of_opening_grows_with_the_captures_and_not_with_their_square(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("core.project.contents._TICK_NS", 0)  # what was linked just now would be hashed again

    def calls(project: Project) -> int:
        count = 0

        def one(_frame: object, event: str, _arg: object) -> None:
            nonlocal count
            count += event in ("call", "c_call")

        sys.setprofile(one)
        try:
            project_states(project)
        finally:
            sys.setprofile(None)
        return count

    def more(to: int) -> None:
        names = [f"captures/more-{i:03d}" for i in range(to)]
        for name in (n for n in names if not (whole / n).exists()):
            shutil.copytree(whole / "captures/plane+00", whole / name, copy_function=os.link)
            for kind in ("npz", "json"):
                kept = whole / f"results/points/object-step.photogrammetric.{kind}"
                os.link(kept, kept.with_name(f"{Path(name).name}.photogrammetric.{kind}"))
        edit(whole / "project.json", lambda d: d.update(captures=list(dict.fromkeys([*d["captures"], *names]))))

    found = []
    for count in (0, 40, 80):
        more(count)
        project = read_project(whole)
        project_states(project)  # hashes what is new
        found.append(min(calls(project) for _ in range(3)))  # of other tests' garbage the least
    assert found[2] - found[1] < 1.1 * (found[1] - found[0]), found


# ------------------------------------------------------------------------------------------ remembered hashes


def test_a_file_written_again_within_a_tick_is_seen(tmp_path: Path) -> None:
    """Size, times and inode as they were: git's racy case. The tick is longer than what a test takes."""
    path = tmp_path / "a"
    path.write_bytes(b"one")
    contents, stat = Contents(tmp_path), path.stat()
    first = contents.of(path)
    with path.open("r+b") as file:
        file.write(b"two")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert contents.of(path) != first


def test_what_is_settled_is_not_read_again(tmp_path: Path, monkeypatch) -> None:
    from core.project import contents as module

    path = tmp_path / "a"
    path.write_bytes(b"one")
    monkeypatch.setattr(module, "_TICK_NS", 0)
    contents = Contents(tmp_path)
    (tmp_path / "results").mkdir()
    time.sleep(0.02)
    value = contents.of(path)
    contents.keep()
    monkeypatch.setattr(module, "hash_file", lambda name: pytest.fail("read again"))
    assert contents.of(path) == value
    assert Contents(tmp_path).of(path) == value


def test_what_a_reconstruction_asks_of_a_copy_is_hashed_once(whole: Path, monkeypatch) -> None:
    from core.project import contents as module

    module._opened.cache_clear()
    monkeypatch.setattr(module, "_TICK_NS", 0)
    (whole / "results/.contents.json").unlink(missing_ok=True)
    assert not outdated_words(read_project(whole), "photogrammetric")
    assert any("testfield-01" in name for name in json.loads((whole / "results/.contents.json").read_text())["files"])


def test_differences_name_what_they_are_of() -> None:
    then = {"captures": {"a": {"frames": {"0.png": "1", "1.png": "2"}, "picks": None}}, "methods": {"measure": 1}}
    now = {"captures": {"a": {"frames": {"0.png": "3"}, "picks": "5"}, "b": {}}, "methods": {"measure": 2}}
    assert differences(then, then) == ()
    assert set(differences(then, now)) == {
        "the program's method to measure changed (version 1 then, 2 now)",
        "a/0.png changed",
        "a/1.png is gone",
        "a/picks.json is new",
        "b was added",
    }
