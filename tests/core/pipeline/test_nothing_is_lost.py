"""Power cuts, kills, two writers, full disks, people's own files: the old state or the new one, nothing deleted."""

from __future__ import annotations

import io
import itertools
import json
import os
import shutil
import signal
import struct
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.atomic import atomic_write, is_leftover, part_prefix, write_together
from core.cli import main
from core.errors import BusyError, InputError, StripeError
from core.model import DeviceSpec, Interior, ScaleBar, Subject
from core.patterns import White
from core.pipeline import CalibrateOptions, simulate_project
from core.pipeline.check import check_project
from core.pipeline.runs import Run, calibration_file, current_runs, keep_run, list_runs
from core.progress import Progress
from core.project import add_capture, load_archive, read_image, read_project, write_project
from core.project.contents import hash_file
from core.project.lock import RESULTS_LOCK, holder_of, writing_results
from core.project.made import guarding
from tests.captures import write_capture

SPEC = DeviceSpec(8, 6, (0.01, 0.01), 12.0)
NAMES = ("photogrammetric.npz", "adjustment.npz", "polynomial.npz")


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A project of one tiny capture, with one kept run of which each archive holds the number 1."""
    folder = tmp_path / "small"
    write_capture(folder / "captures" / "a", Subject("object"), [(White(), np.zeros((6, 8), np.uint8))])
    write_project(folder, "small", SPEC, SPEC, ScaleBar((0, 0), (0, 1), 10.0, 0.1), ["captures/a"])
    keep(folder, 1)
    return folder


def keep(folder: Path, value: float) -> None:
    """Keep a run whose archives hold a number."""
    run = Run(0, "", CalibrateOptions(), {"photogrammetric": (), "polynomial": ()}, {}, {}, {})
    keep_run(read_project(folder), run, {name: Interior(value) for name in NAMES})


def in_use(folder: Path) -> set[float]:
    """Give the numbers in the archives in use, by the way that readers go; one number is the sound state."""
    project = read_project(folder)
    paths = [calibration_file(project, name) for name in NAMES]
    return {load_archive(path, Interior).c_mm for path in paths if path is not None}


# --------------------------------------------------------------------------------------------------------- power cuts


@dataclass
class Node:
    """A file or folder as the model of the disk has it: what was flushed, and what is in memory only."""

    folder: bool = False
    flushed: Any = None  # bytes, or names with nodes
    now: Any = None
    number: int = field(default_factory=itertools.count().__next__)


class Disk:
    """What the calls of a program leave on a disk that keeps only what was flushed; names and contents apart."""

    def __init__(self, root: Path) -> None:
        self.root, self.top = root, self._read(root)

    def _read(self, path: Path) -> Node:
        if path.is_dir():
            names = {child.name: self._read(child) for child in path.iterdir()}
            return Node(True, dict(names), dict(names))
        return Node(False, path.read_bytes(), path.read_bytes())

    def find(self, path: str) -> Node:
        node = self.top
        for part in Path(path).relative_to(self.root).parts:
            node = node.now[part]
        return node

    def play(self, call: tuple[Any, ...]) -> None:
        kind, path, *rest = call
        parent, name = (
            (self.find(os.path.dirname(path)), os.path.basename(path)) if path != str(self.root) else (None, "")
        )
        if kind == "mkdir":
            parent.now[name] = Node(True, {}, {})
        elif kind == "create":
            parent.now[name] = Node(False, b"", b"")
        elif kind == "rename":
            self.find(os.path.dirname(rest[0])).now[os.path.basename(rest[0])] = parent.now.pop(name)
        elif kind == "unlink":
            parent.now.pop(name, None)
        elif kind == "fsync":
            node = self.find(path)
            node.flushed = dict(node.now) if node.folder else rest[0]

    def unsettled(self) -> list[Node]:
        """Folders whose names in memory are not those on the disk."""
        found: dict[int, Node] = {}

        def walk(node: Node) -> None:
            if node.folder:
                if node.flushed != node.now:
                    found[node.number] = node
                for child in {**node.flushed, **node.now}.values():
                    walk(child)

        walk(self.top)
        return list(found.values())

    def leave(self, path: Path, written: set[int]) -> None:
        """Put what is left into a folder; of the folders in `written` the names got to the disk without being asked."""

        def put(node: Node, at: Path) -> None:
            if node.folder:
                at.mkdir()
                for name, child in (node.now if node.number in written else node.flushed).items():
                    put(child, at / name)
            else:
                at.write_bytes(node.flushed)

        put(self.top, path)


@contextmanager
def recorded(calls: list[tuple[Any, ...]], root: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Note every call that changes the disk below a folder."""

    def inside(path: Any) -> bool:
        return not isinstance(path, int) and str(path).startswith(str(root)) and not str(path).endswith(".lock")

    real = {name: getattr(os, name) for name in ("open", "mkdir", "rename", "replace", "unlink", "fsync")}
    real_file = io.open

    def opened(path: Any, flags: int, *rest: Any, **named: Any) -> int:
        new = inside(path) and flags & os.O_CREAT and not os.path.exists(path)
        handle = real["open"](path, flags, *rest, **named)
        if new:
            calls.append(("create", str(path)))
        return int(handle)

    def filed(path: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:
        new = inside(path) and not {"w", "x"}.isdisjoint(mode) and not os.path.exists(path)
        file = real_file(path, mode, *rest, **named)
        if new:
            calls.append(("create", str(path)))
        return file

    def synced(handle: int) -> None:
        real["fsync"](handle)
        path = os.readlink(f"/proc/self/fd/{handle}")
        if inside(path):
            calls.append(("fsync", path, b"" if os.path.isdir(path) else Path(path).read_bytes()))

    def noted(kind: str, name: str) -> Callable[..., None]:
        def call(path: Any, *rest: Any, **named: Any) -> None:
            real[name](path, *rest, **named)
            if inside(path):
                calls.append((kind, str(path), *map(str, rest[:1] if kind == "rename" else ())))

        return call

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", opened)
        patch.setattr(io, "open", filed)
        patch.setattr(os, "fsync", synced)
        for kind, name in (("mkdir", "mkdir"), ("rename", "rename"), ("rename", "replace"), ("unlink", "unlink")):
            patch.setattr(os, name, noted(kind, name))
        yield


def test_a_power_cut_at_any_call_leaves_the_old_run_in_use_or_the_new(small: Path, tmp_path: Path, monkeypatch) -> None:
    """Every prefix of the calls, and every choice of folders whose unflushed names reached the disk all the same."""
    disk, calls = Disk(small), []
    with recorded(calls, small, monkeypatch):
        keep(small, 2)
    assert {"create", "fsync", "rename", "mkdir"} <= {call[0] for call in calls}
    seen, states = set(), 0
    for k in range(len(calls) + 1):
        if k:
            disk.play(calls[k - 1])
        unsettled = disk.unsettled()
        for some in itertools.product((False, True), repeat=len(unsettled)):
            left = tmp_path / "left"
            disk.leave(left, {node.number for node, chosen in zip(unsettled, some, strict=True) if chosen})
            (found,) = in_use(left)
            seen.add(found)
            states += 1
            shutil.rmtree(left)
    assert seen == {1.0, 2.0}
    assert found == 2.0  # after the last call nothing can be lost any more
    assert states > len(calls)


# -------------------------------------------------------------------------------------------------------------- kills


def in_child(work: Callable[[], None]) -> int:
    """Run something in a process of its own; give how it ended."""
    pid = os.fork()
    if pid == 0:
        try:
            work()
            os._exit(0)
        except BaseException:
            os._exit(9)
    return os.waitpid(pid, 0)[1]


@pytest.mark.parametrize("call", ["replace", "rename", "fsync"])
def test_a_kill_at_any_step_of_the_commit_leaves_one_run_in_use(small: Path, call: str) -> None:
    value, ended, killed = 1.0, 1, 0
    while ended:
        value += 1

        def work(number: int = killed, value: float = value) -> None:
            real, countdown = getattr(os, call), itertools.count()

            def deadly(*arguments: Any, **named: Any) -> Any:
                if next(countdown) == number:
                    os.kill(os.getpid(), signal.SIGKILL)
                return real(*arguments, **named)

            setattr(os, call, deadly)
            keep(small, value)

        ended, before = in_child(work), in_use(small)
        assert len(before) == 1
        killed += 1
    assert killed > 1
    assert in_use(small) == {value}
    keep(small, 99)
    assert not list(small.rglob("*.part"))  # what the killed ones left is swept
    assert not (small / "results" / RESULTS_LOCK).exists()


def test_what_a_killed_simulation_left_is_taken_up_again(few_captures: int, tmp_path: Path) -> None:
    out = tmp_path / "bench"

    def work() -> None:
        def report(fraction: float, message: str) -> None:
            if "testfield-02" in message:
                os.kill(os.getpid(), signal.SIGKILL)

        simulate_project(out, "quick", progress=Progress(report))

    assert in_child(work) == signal.SIGKILL
    assert (out / "captures").is_dir()
    assert not (out / "project.json").exists()
    (out / "notes.txt").write_text("mine")
    assert main(["simulate", str(out), "--scenario", "quick"]) == 2
    (out / "notes.txt").unlink()
    assert main(["simulate", str(out), "--scenario", "quick"]) == 0
    assert len(read_project(out).captures) == few_captures
    # a second time it replaces what it wrote, and refuses what somebody changed, by name
    picks = out / "captures/testfield-01/picks.json"
    picks.write_text(picks.read_text() + " ")
    with pytest.raises(InputError, match=r"testfield-01/picks\.json"):
        simulate_project(out, "quick")
    assert picks.exists()


# -------------------------------------------------------------------------------------------------------- two writers


def test_a_second_writer_is_told_by_whom_and_a_dead_one_is_no_obstacle(small: Path, capsys) -> None:
    ready, go = os.pipe()
    pid = os.fork()
    if pid == 0:
        with writing_results(small, "calibrate"):
            os.write(go, b"x")
            time.sleep(60)
        os._exit(0)
    os.read(ready, 1)
    try:
        with (
            pytest.raises(BusyError, match=rf"calibrate \(process {pid} of .* on .*, since 20"),
            writing_results(small, "x"),
        ):
            pass
        assert in_use(small) == {1.0}  # reading goes on
        assert main(["status", str(small)]) == 0
        assert main(["update", str(small)]) == 1
        assert f"process {pid}" in capsys.readouterr().err
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    lock = small / "results" / RESULTS_LOCK
    assert lock.exists()
    assert holder_of(lock) is None
    (stale,) = [item for item in check_project(small) if item.where.endswith(RESULTS_LOCK)]
    assert "nobody holds" in stale.seen
    assert stale.mended  # whether repair is asked for or not
    assert not lock.exists()
    keep(small, 2)
    assert in_use(small) == {2.0}


def test_two_writers_of_the_list_of_captures_lose_none(small: Path) -> None:
    for name in [f"{who}{i}" for who in "bc" for i in range(15)]:
        shutil.copytree(small / "captures" / "a", small / "captures" / name)
    children = []
    for who in "bc":
        pid = os.fork()
        if pid == 0:
            for i in range(15):
                add_capture(small, f"captures/{who}{i}")
            os._exit(0)
        children.append(pid)
    assert [os.waitpid(pid, 0)[1] for pid in children] == [0, 0]
    assert len(read_project(small).captures) == 31


# ------------------------------------------------------------------------------------------------- other people's files


def test_a_file_that_somebody_else_put_there_is_not_replaced(small: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "board.pdf"
    (small / "testfield.csv").write_text(
        "row,col,x_mm,y_mm,z_mm,diameter_mm\n" + "".join(f"0,{i},{20 * i},0,0,5\n" for i in range(3))
    )
    command = ["testfield", str(small), "--out", str(out)]
    out.write_bytes(b"mine")
    assert main(command) == 2
    assert "board.pdf: is there already" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"
    out.unlink()
    assert main(command) == 0
    assert main(command) == 0  # its own, unchanged
    out.write_bytes(out.read_bytes() + b"% changed")
    assert main(command) == 2


def test_a_place_told_in_a_roundabout_way_is_the_same_place(small: Path, tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for _ in range(2):
        assert main(["status", str(small), "--json", "../elsewhere/figures.json"]) == 0
        assert main(["patterns", str(small), "--out", "../elsewhere/../images"]) == 0
    board = ["testfield", str(small), "--out", "same.pdf", "--json", "../elsewhere/same.pdf"]
    assert main(board) == 2


def test_names_whose_bytes_are_no_text_are_names(small: Path, tmp_path: Path, capsys) -> None:
    odd, out = tmp_path / os.fsdecode(b"odd\xff"), tmp_path / os.fsdecode(b"odd\xff/out\xfe.ply")
    try:
        small.rename(odd)
    except OSError:
        pytest.skip("this disk takes text alone")
    for content in (b"one", b"two"):  # the second replaces what the first wrote
        with guarding(out), atomic_write(out) as file:
            file.write(content)
    assert out.read_bytes() == b"two"
    assert main(["status", str(odd)]) == 0, capsys.readouterr().err


def test_who_has_no_home_works_without_a_cache(small: Path, monkeypatch, capsys) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as it gives it back for a user without an entry
    monkeypatch.setattr(Path, "home", lambda: pytest.fail("asked for the home"))
    assert main(["status", str(small)]) == 0, capsys.readouterr().err


def test_what_a_project_keeps_is_no_place_for_results(calibrated: Path, tmp_path: Path, capsys) -> None:
    project = calibrated
    (tmp_path / "images.txt").write_text("mine")
    kept = [project / name for name in ("project.json", "testfield.csv", "captures/plane+00/000.png")]
    kept += [project / "results" / name for name in ("current.json", "targets.json", "targets.npz")]
    before = {path: path.read_bytes() for path in (*kept, tmp_path / "images.txt")}
    for path in kept:
        assert main(["export", str(project), "--to", "opencv", str(path)]) == 2
        assert f"{path.name}: is there already" in capsys.readouterr().err
        assert main(["status", str(project), "--json", str(path)]) == 2
    assert main(["export", str(project), "--to", "colmap", str(tmp_path / "cameras.txt")]) == 2
    assert {path: path.read_bytes() for path in before} == before
    for command in (["export", str(project), "--to", "opencv"], ["status", str(project), "--json"]):
        for _ in range(2):
            assert main([*command, str(project / f"{command[0]}.json")]) == 0


def test_figures_replace_figures_and_nothing_else(small: Path, tmp_path: Path, capsys) -> None:
    command = ["status", str(small), "--json"]
    for target, text in ((tmp_path / "notes.txt", "mine"), (small / "project.json", None)):
        if text:
            target.write_text(text)
        before = target.read_bytes()
        assert main([*command, str(target)]) == 2
        assert "holds no figures" in capsys.readouterr().err
        assert target.read_bytes() == before
    figures = tmp_path / "figures.json"
    for text in ('{"of": "another program"}', '{"format": "stripe-batch", "version": 1}'):
        figures.write_text(text)
        assert main([*command, str(figures)]) == 0
    assert main([*command, str(figures)]) == 0
    assert "stages" in json.loads(figures.read_text())


# ------------------------------------------------------------------------------------------------------------- damages


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)


def unlisted(folder: Path) -> None:
    shutil.copytree(folder / "captures" / "a", folder / "captures" / "b")


def gone(folder: Path) -> None:
    shutil.rmtree(folder / "captures" / "a")


def dangling(folder: Path) -> None:
    (folder / "results" / "current.json").write_text('{"photogrammetric": 7, "polynomial": 1}')


def cut_pointer(folder: Path) -> None:
    (folder / "results" / "current.json").write_text('{"photogr')


def damaged_run(folder: Path) -> None:
    flip(folder / "results" / "runs" / "0002" / "photogrammetric.npz")


def damaged_targets(folder: Path) -> None:
    (folder / "results" / "targets.npz").write_bytes(b"PK\x03\x04")


def leftover(folder: Path) -> None:
    (folder / "captures" / "a" / ".picks.json.abc.part").write_bytes(b"half")


def test_a_capture_that_is_gone_is_told_once(small: Path) -> None:
    gone(small)
    (told,) = [item for item in check_project(small) if "which is not there" in item.seen]
    assert "captures_missing" in told.remedy


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (unlisted, "a capture that project.json does not list"),
        (gone, "captures lists 'captures/a', which is not there"),
        (dangling, "points to run 7"),
        (cut_pointer, "cannot be read"),
        (damaged_targets, "damaged"),
        (leftover, "left by a program that was stopped"),
        (damaged_run, "not as it was written"),
    ],
)
def test_check_explains_and_mends_without_loss(small: Path, spoil: Callable[[Path], None], words: str, capsys) -> None:
    keep(small, 2)
    for path in small.glob("results/runs/*/run.json"):  # archives of numbers are no calibrations: these are told apart
        data = json.loads(path.read_text())
        path.write_text(json.dumps({**data, "captures": {}} if spoil is not dangling else data))
    before = {hash_file(p) for p in small.rglob("*") if p.is_file() and not p.name.endswith((".part", ".json"))}
    if spoil is damaged_run:
        for path in small.glob("results/runs/*/run.json"):
            data = json.loads(path.read_text())
            path.write_text(json.dumps({**data, "captures": {"photogrammetric": []}}))
    spoil(small)
    found = [item for item in check_project(small) if words in item.seen]
    assert found
    assert main(["check", str(small)]) == 1
    assert all(item.mended for item in check_project(small, repair=True) if words in item.seen)
    assert not [item for item in check_project(small) if words in item.seen]
    if spoil not in (gone, damaged_run):
        assert before <= {hash_file(p) for p in small.rglob("*") if p.is_file()}


def test_leftovers_are_told_by_their_process(tmp_path: Path) -> None:
    assert is_leftover(tmp_path / ".a.npz.xyz.part")
    assert not is_leftover(tmp_path / f"{part_prefix('a.npz')}xyz.part")  # this process writes it
    assert not is_leftover(tmp_path / ".a.npz.1@000000.xyz.part")  # of another machine nothing is known
    mine = part_prefix("a").split(".")[2]
    assert is_leftover(tmp_path / f".a.{mine.replace(str(os.getpid()), '99999999')}.xyz.part")
    assert not is_leftover(tmp_path / "a.part")


def test_archives_of_another_shape_or_type_are_damaged(tmp_path: Path) -> None:
    from core.model import TargetSet
    from core.project import save_archive

    n, pair = np.arange(3), np.zeros((3, 2))
    sound: dict[str, Any] = {
        "capture": "a",
        "row": n,
        "col": n,
        "camera_uv": pair,
        "camera_cov": np.zeros((3, 2, 2)),
        "projector_uv": pair,
        "projector_sigma": pair,
        "eccentricity_px": pair,
        "diameter_px": np.zeros(3),
    }
    path = tmp_path / "t.npz"
    save_archive(path, (TargetSet(**sound),))
    assert len(load_archive(path, tuple, TargetSet)) == 1
    for name, wrong in (
        ("capture", 7),
        ("row", np.arange(4)),
        ("row", np.zeros(3)),
        ("camera_uv", np.zeros((3, 3))),
        ("camera_cov", np.zeros(3)),
        ("diameter_px", np.array(["a", "b", "c"])),
        ("missing", ("x",)),
        ("made_from", 1.5),
    ):
        save_archive(path, (TargetSet(**{**sound, name: wrong}),))
        with pytest.raises(InputError, match="damaged"):
            load_archive(path, tuple, TargetSet)
    save_archive(path, (Interior(1.0),))
    with pytest.raises(InputError, match="holds Interior"):
        load_archive(path, tuple, TargetSet)


def test_the_size_that_a_header_claims_is_looked_at_before_the_pixels(tmp_path: Path) -> None:
    """A PNG of 30,000 x 30,000 px in a few hundred bytes; decoding would take 0.9 GB."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path = tmp_path / "000.png"
    head = struct.pack(">IIBBBBB", 30000, 30000, 8, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", b"x") + chunk(b"IEND", b""))
    with pytest.raises(InputError, match=r"30000x30000 px, the camera in project\.json has 748x576"):
        read_image(path, (576, 748))
    with pytest.raises(InputError, match="its header claims 30000x30000 px"):
        read_image(path)


def test_a_full_disk_leaves_the_run_in_use(small: Path, monkeypatch) -> None:
    from core import atomic

    real, left = os.fsync, [0]

    def full(handle: int) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")
        real(handle)

    for room in range(12):
        left[0] = room
        with monkeypatch.context() as patch:
            patch.setattr(atomic.os, "fsync", full)
            with suppress(Exception):
                keep(small, 2)
        assert in_use(small) in ({1.0}, {2.0})
    keep(small, 3)
    assert in_use(small) == {3.0}
    assert len(current_runs(read_project(small))) == 2
    assert list_runs(read_project(small))


def test_what_a_killed_program_left_beside_a_users_files_is_swept(tmp_path: Path) -> None:
    def work() -> None:
        with atomic_write(tmp_path / "points.ply") as file:
            file.write(b"half")
            file.flush()
            os.kill(os.getpid(), signal.SIGKILL)

    (tmp_path / ".theirs.part").write_bytes(b"of another program")
    assert in_child(work) == signal.SIGKILL
    assert len(list(tmp_path.glob(".points.ply.*.part"))) == 1
    write_together({tmp_path / "points.ply": b"whole"})
    assert {path.name for path in tmp_path.iterdir()} == {".theirs.part", "points.ply"}


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let no file grow beyond some bytes: the system refuses the rest, as on a full disk."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_what_a_killed_program_had_replaced_is_listed_no_longer_than_needed(tmp_path: Path) -> None:
    for text in (b"first", b"second"):
        with guarding(tmp_path), atomic_write(tmp_path / "a.txt") as file:
            file.write(text)
    made = tmp_path / ".stripe-made.json"
    listed = json.loads(made.read_text())
    own = listed["files"]["a.txt"]
    for placed, before, left in ((own, "other", []), ("other", own, ["a.txt"])):  # killed after the rename, and before
        made.write_text(json.dumps({**listed, "files": {"a.txt": placed}, "replaced": {"a.txt": before}}))
        with guarding(tmp_path), atomic_write(tmp_path / f"{placed}.txt") as file:
            file.write(b"beside")
        assert [*json.loads(made.read_text())["replaced"]] == left


def test_of_files_that_belong_together_none_is_replaced_alone(tmp_path: Path) -> None:
    first, second = tmp_path / "a.html", tmp_path / "b.pdf"
    write_together({first: b"old", second: b"old"})
    for texts in ({first: b"new", second: b"n" * 5000}, {second: b"n" * 5000, first: b"new"}):
        with room_for(1000), pytest.raises(StripeError, match=r"b\.pdf: cannot be written .*make room") as told:
            write_together(texts)
        assert told.value.exit_code == 1
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.html": b"old", "b.pdf": b"old"}
    write_together({first: b"new", second: b"n" * 5000})
    assert first.read_bytes() + second.read_bytes() == b"new" + b"n" * 5000


def test_what_cannot_be_listed_as_its_own_is_not_written(tmp_path: Path) -> None:
    """Else the repeat would take its own file for somebody's, and refuse."""
    figures = tmp_path / "out" / "figures.csv"
    with room_for(20), pytest.raises(StripeError, match="make room"), guarding(figures.parent):
        write_together({figures: b"1,2,3"})
    assert not list(figures.parent.glob("*.part"))
    assert not figures.exists()
    for text in (b"1,2,3", b"4,5,6"):
        with guarding(figures.parent):
            write_together({figures: text})
        assert figures.read_bytes() == text
