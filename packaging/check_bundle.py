"""Try a built bundle as a laboratory without Python would use it: `packaging/check_bundle.py DIST [--quick]`.

Run it with an interpreter that has the program's packages, as `.bundle-venv/bin/python`: the window's pictures are
compared with those the sources make. The bundle itself gets no Python, an empty home and nothing else from here; called
by root it runs as nobody, who cannot write in the bundle. The first thing that is not right ends it with exit code 1.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

import cv2
import numpy as np
from PyInstaller.archive.readers import CArchiveReader

GERMAN = {"LANG": "de_DE.UTF-8"}
PARAMETERS = ("c_mm", "x0_mm", "y0_mm", "A1", "A2", "A3", "A4", "A5", "A6")
NOBODY = 65534
SCREEN = (1400, 900)
UNLIKE = 0.03  # of a window's pixels: a date or the noise of a virtual camera stays below, a language does not


class BundleError(Exception):
    """The bundle does not do what it should."""


def expect(right: bool, otherwise: str) -> None:
    """Go on if all is right."""
    if not right:
        raise BundleError(otherwise)


@dataclass(frozen=True)
class Bundle:
    """The bundle's folder, and one to work in that holds the home of whoever runs it."""

    folder: Path
    work: Path

    def environment(self, **more: str) -> dict[str, str]:
        """Give what a clean login would have, without Python and without a font of the system."""
        places = {"HOME": self.work / "home", "TMPDIR": self.work, "FONTCONFIG_FILE": self.work / "fonts.conf"}
        return {**{name: str(path) for name, path in places.items()}, "PATH": "/nonexistent", **more}

    def run(self, program: str, *arguments: object, code: int = 0, **more: str) -> subprocess.CompletedProcess[str]:
        """Run a program of the bundle to its end; it has to give this exit code."""
        command = [str(self.folder / program), *map(str, arguments)]
        done = subprocess.run(
            command, env=self.environment(**more), cwd=self.work, user=USER, capture_output=True, text=True, check=False
        )
        expect(done.returncode == code, f"{' '.join(command)} gave {done.returncode}, not {code}:\n{done.stderr}")
        return done

    def figures(self, *arguments: object) -> dict:
        """Run a command of `stripe-core` and read its figures."""
        out = self.work / "figures.json"
        self.run("stripe-core", *arguments, "--json", out)
        return json.loads(out.read_text())

    def state(self) -> dict[str, tuple[int, int]]:
        """Give size and time of everything in the bundle."""
        return {str(path): (s.st_size, s.st_mtime_ns) for path in self.folder.rglob("*") for s in (path.lstat(),)}

    def kernels(self) -> dict[str, int]:
        """Give the compiled kernels in the user's cache and when they were written."""
        cache = self.work / "home/.cache/stripe-workbench"
        return {str(path.relative_to(cache)): path.stat().st_mtime_ns for path in cache.rglob("*.kernel")}


USER = NOBODY if os.geteuid() == 0 else None


def check_commands(bundle: Bundle) -> str:
    """Both programs start."""
    started = time.monotonic()
    text = bundle.run("stripe-core", "--help").stdout
    seconds = time.monotonic() - started
    expect("calibrate" in text, f"stripe-core --help tells nothing of calibrate:\n{text}")
    expect("PROJECT" in bundle.run("stripe-gui", "--help").stdout, "stripe-gui --help tells nothing of a project")
    return f"stripe-core and stripe-gui tell their use ({seconds:.2f} s at the first start)"


def check_wrong_input(bundle: Bundle) -> str:
    """What is wrong is refused in one line, exit code 2."""
    (bundle.work / "empty").mkdir()
    wrong = (
        ("decode", bundle.work / "nothing", "--out", bundle.work / "x.npz"),
        ("calibrate", bundle.work / "empty"),
        ("simulate", bundle.work / "x", "--scenario", "unknown"),
        ("report",),
    )
    for arguments in wrong:
        lines = bundle.run("stripe-core", *arguments, code=2).stderr.splitlines()
        expect(len(lines) == 1, f"{arguments[0]} refuses in {len(lines)} lines, not one: {lines}")
    lines = bundle.run("stripe-gui", code=2).stderr.splitlines()
    expect(len(lines) == 1 and "display" in lines[0], f"without a display stripe-gui says {lines}")
    return f"{len(wrong)} wrong inputs and a missing display are refused in one line each"


def check_experiment(bundle: Bundle) -> str:
    """The seven stages one by one, judged by what the virtual bench knows."""
    project = bundle.work / "project"
    started = time.monotonic()
    bundle.run("stripe-core", "simulate", project, "--scenario", "quick")
    bundle.run("stripe-core", "decode", project / "captures/plane+00", "--out", bundle.work / "phase.npz")
    with np.load(bundle.work / "phase.npz") as phase:
        expect(np.isfinite(phase["u"]).mean() > 0.2, "less than a fifth of the plane's pixels are decoded")
    targets = sum(len(capture["targets"]) for capture in bundle.figures("measure", project)["captures"])
    found = bundle.figures("calibrate", project)["photogrammetric"]
    truth = json.loads((project / "truth.json").read_text())
    deviations = [
        (found[device][name]["value"] - truth[device][name]) / found[device][name]["sigma"]
        for device in ("camera", "projector")
        for name in PARAMETERS
    ]
    off = float(np.sqrt(np.mean(np.square(deviations))))
    expect(off < 2.0, f"the calibration is {off:.1f} sigma off the truth, r.m.s. of {len(deviations)} parameters")
    points = bundle.figures("reconstruct", project, "object-sphere", "--out", bundle.work / "sphere.ply")["points"]
    expect(points > 1000, f"{points} points of the sphere")
    planes = bundle.figures("evaluate", project)["planes"]
    for plane in (plane for plane in planes if plane["method"] == "photogrammetric"):
        ratio = plane["rms_mm"] / plane["predicted_rms_mm"]
        # the bench's planes are flat to a few µm: noise of the phase explains the deviations
        expect(0.75 < ratio < 1.25, f"{plane['capture']}: r.m.s. is {ratio:.2f} of what noise explains")
    paths = bundle.figures("report", project)
    expect("<table" in Path(paths["html"]).read_text(encoding="utf-8"), "the HTML report has no table")
    pdf = Path(paths["pdf"]).read_bytes()
    expect(pdf.startswith(b"%PDF") and b"DejaVuSans" in pdf, "the PDF report is none, or lacks the program's font")
    seconds = time.monotonic() - started
    return f"seven stages: {targets} targets, parameters {off:.2f} sigma off the truth, report ({seconds:.0f} s)"


def check_kernels(bundle: Bundle) -> str:
    """The stages load the bundle's kernels; a processor below their level compiles its own, once."""
    before = bundle.kernels()
    level = {"avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"} <= set(Path("/proc/cpuinfo").read_text().split())
    expect(level != bool(before), f"{len(before)} kernels were compiled though the bundle brings them: {list(before)}")
    started = time.monotonic()
    capture = bundle.work / "project/captures/plane+00"
    bundle.run("stripe-core", "decode", capture, "--out", bundle.work / "phase.npz")
    seconds = time.monotonic() - started
    expect(bundle.kernels() == before, "kernels were compiled again at the next start")
    brought = len(list((bundle.folder / "_internal/core/kernels").iterdir()))
    return f"{brought} kernels came with the bundle, {len(before)} were compiled (decode {seconds:.1f} s)"


def check_reference(bundle: Bundle) -> str:
    """The reference experiment: below every published r.m.s."""
    started = time.monotonic()
    planes = bundle.figures("demo", bundle.work / "demo")["planes"]
    resources = bundle.folder / "_internal/stripe_resources/reference/brenner1999.json"
    published = json.loads(resources.read_text(encoding="utf-8"))["plane_table"]
    expect(len(planes) == 8, f"{len(planes)} planes by two methods, not 8")
    for plane in planes:
        limit = published["rms_mm"][plane["method"]][published["angle_deg"].index(plane["angle_deg"])]
        text = f"{plane['angle_deg']}°, {plane['method']}: r.m.s. {plane['rms_mm']:.4f} mm, published {limit}"
        expect(plane["rms_mm"] < limit, text)
    worst = max(plane["rms_mm"] for plane in planes)
    seconds = time.monotonic() - started
    return f"reference experiment: at most {worst:.3f} mm r.m.s., all below the published ({seconds:.0f} s)"


def check_german_window(bundle: Bundle) -> str:
    """The pages in German, without a screen, beside those the sources make: fonts, icons, texts, help and styles."""
    project, ours, theirs = bundle.work / "project", bundle.work / "tour", bundle.work / "tour-of-sources"
    copy = bundle.work / "sources" / project.name  # neither sees what the other computed; the name is shown
    shutil.copytree(project, copy)
    one_scale = {**GERMAN, "STRIPE_TOUR_SCALE": "1"}
    bundle.run("stripe-gui", "--tour", ours, project, **one_scale)
    environment = bundle.environment(**one_scale)
    command = [sys.executable, "-m", "stripe_gui", "--tour", str(theirs), str(copy)]
    done = subprocess.run(command, env=environment, cwd=bundle.work, capture_output=True, text=True, check=False)
    expect(done.returncode == 0, f"the sources make no pictures:\n{done.stderr}")
    names, shown = ({path.name for path in folder.glob("*-1x.png")} for folder in (theirs, ours))
    lacking = f"the bundle lacks {sorted(names - shown)}, the sources lack {sorted(shown - names)}"
    expect(names == shown, f"bundle and sources show different pages: {lacking}")
    differ = {name: unlike(ours / name, theirs / name) for name in sorted(names)}
    strange = {name: share for name, share in differ.items() if share > UNLIKE and "capture-wizard-picture" not in name}
    expect(not strange, f"pages look unlike those of the sources: {strange}")
    same = sum(share == 0 for share in differ.values())
    return f"window without a screen, in German: {same} of {len(names)} pictures are those of the sources to the pixel"


def check_window_on_a_screen(bundle: Bundle) -> str:
    """On a virtual screen: a tour that makes its own experiment, with the commands' kernels; then a plain start."""
    with screen(bundle) as (display, picture):
        before = bundle.kernels()
        bundle.run("stripe-gui", "--tour", bundle.work / "tour-xcb", DISPLAY=display, QT_QPA_PLATFORM="xcb")
        after = bundle.kernels()
        compiled = [name for name in before if after.get(name) != before[name]]
        expect(not compiled, f"the window does not use the commands' kernels: {compiled[:3]}")
        english, german = (bundle.work / f"{folder}/start-light-1x.png" for folder in ("tour-xcb", "tour"))
        expect(unlike(english, german) > 0.005, "the window speaks the same language in German and in English")
        started = time.monotonic()
        command = [str(bundle.folder / "stripe-gui"), str(bundle.work / "project")]
        window = subprocess.Popen(command, env=bundle.environment(DISPLAY=display), cwd=bundle.work, user=USER)
        try:
            while colours(picture) < 50 and window.poll() is None and time.monotonic() < started + 30:
                time.sleep(0.05)
            seconds = time.monotonic() - started
            expect(colours(picture) >= 50, "no window appears on the screen in 30 s")
            time.sleep(2)
            expect(window.poll() is None, f"the window ended by itself, exit code {window.returncode}")
        finally:
            window.terminate()
            window.wait()
    count = len(list((bundle.work / "tour-xcb").glob("*.png")))
    return f"window on a screen: {count} pictures of its own experiment, started in {seconds:.1f} s"


def check_batch(bundle: Bundle) -> str:
    """Many captures on copies of the bundle's own process."""
    summary = bundle.figures("batch", bundle.work / "project", "--out", bundle.work / "batch", "--workers", 2)
    captures = len(summary["captures"])
    expect(0 < captures == summary["done"], f"{summary['done']} of {captures} captures are done")
    return f"batch: {captures} captures on two processes"


def check_licences(bundle: Bundle) -> str:
    """All that lies in the bundle is in the index of licences, with a text: told by its files, not as it was built."""
    folder = bundle.folder / "licences"
    rows = (folder / "INDEX.txt").read_text().partition("\n\n")[2].partition("\n\n")[2].splitlines()
    listed = {row.split()[0] for row in rows}
    empty = sorted(name for name in listed if not any(path.is_file() for path in (folder / name).rglob("*")))
    expect(not empty, f"without a text of their licence: {empty}")
    internal = bundle.folder / "_internal"
    owners = {str(f).split("/")[0].split(".py")[0]: p.name for p in distributions() for f in p.files or []}
    modules = CArchiveReader(str(bundle.folder / "stripe-core")).open_embedded_archive("PYZ.pyz").toc
    parts = {name.split(".")[0] for name in modules} | {path.name.split(".py")[0] for path in internal.iterdir()}
    missing = sorted(part for part in parts if part in owners and owners[part] not in listed)
    # the libraries beside them are Debian's, but for Python's and for modules, which are parts
    libraries = {path.name for path in internal.glob("*.so*") if not path.is_symlink()}
    for library in sorted(name for name in libraries - owners.keys() if not name.startswith("libpython")):
        told = subprocess.run(["dpkg-query", "-S", f"*/{library}"], capture_output=True, text=True, check=False).stdout
        packages = {line.split(":")[0] for line in told.splitlines()}
        missing += [] if packages & listed else [library]
    expect(not missing, f"not in the index of licences: {missing}")
    return f"licences: {len(listed)} parts with their texts, for {len(parts)} modules and {len(libraries)} libraries"


@contextmanager
def screen(bundle: Bundle) -> Iterator[tuple[str, Path]]:
    """Give a virtual screen's name, and the file that holds what it shows."""
    reading, writing = os.pipe()
    size = f"{SCREEN[0]}x{SCREEN[1]}x24"
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", size, "-fbdir", str(bundle.work), "-ac"]
    server = subprocess.Popen([*command, "-nolisten", "tcp"], pass_fds=[writing], stderr=subprocess.DEVNULL)
    try:
        os.close(writing)
        with os.fdopen(reading) as pipe:
            yield f":{pipe.readline().strip()}", bundle.work / "Xvfb_screen0"
    finally:
        server.terminate()
        server.wait()


def colours(picture: Path) -> int:
    """Count the colours on a screen: its pixels end the file, four bytes each."""
    pixels = np.frombuffer(picture.read_bytes()[-4 * SCREEN[0] * SCREEN[1] :], np.uint32)
    return len(np.unique(pixels))


def unlike(first: Path, second: Path) -> float:
    """Give the share of pixels in which two pictures differ."""
    a, b = cv2.imread(str(first)), cv2.imread(str(second))
    expect(a is not None and b is not None and a.shape == b.shape, f"{first} and {second} are no pictures of one size")
    return float((a != b).any(axis=-1).mean())


def check_installing(bundle: Bundle) -> str:
    """The script puts everything in its place, and takes it away."""
    prefix, script = bundle.work / "a prefix", bundle.folder / "install.sh"
    environment = {"HOME": str(bundle.work / "home"), "PATH": "/usr/bin:/bin"}

    def call(*command: str) -> None:
        done = subprocess.run(command, env=environment, user=USER, capture_output=True, text=True, check=False)
        expect(done.returncode == 0, f"{' '.join(command)}:\n{done.stderr}")

    for _ in range(2):  # a second time over the first
        call(str(script), str(prefix))
    call(str(prefix / "bin/stripe-core"), "--help")
    call(str(prefix / "bin/stripe-gui"), "--help")
    (entry,) = (prefix / "share/applications").glob("*.desktop")
    program = next(line for line in entry.read_text().splitlines() if line.startswith("Exec=")).split('"')[1]
    expect(os.access(program, os.X_OK), f"the desktop entry starts {program}, which is not there")
    expect(len(list((prefix / "share/icons/hicolor").rglob(f"{entry.stem}.*"))) == 4, "icons are missing")
    call(str(script), "--remove", str(prefix))
    left = [str(path) for path in prefix.rglob("*") if not path.is_dir() and path.name != "mimeinfo.cache"]
    expect(not left, f"left after removing: {left}")
    return "installs below a prefix, a second time over the first, and goes without a trace"


def main() -> int:
    """Make all checks in turn; give the exit code."""
    parser = argparse.ArgumentParser(prog="check_bundle.py", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIST")
    parser.add_argument("--quick", action="store_true", help="leave the reference experiment out, some minutes")
    options = parser.parse_args()
    checks = [check_commands, check_wrong_input, check_experiment, check_kernels]
    checks += [check_batch, check_licences, check_german_window, check_window_on_a_screen, check_installing]
    checks += [] if options.quick else [check_reference]
    with tempfile.TemporaryDirectory(prefix="bundle-") as temporary:
        bundle = Bundle(options.folder.resolve(), Path(temporary))
        (bundle.work / "home").mkdir()
        (bundle.work / "fonts.conf").write_text("<fontconfig/>")
        for folder in (bundle.work, bundle.work / "home") if USER else ():
            shutil.chown(folder, USER, USER)
        untouched = bundle.state()
        try:
            for check in checks:
                print(f"check: {check(bundle)}", flush=True)
            expect(bundle.state() == untouched, "something was written into the bundle")
        except BundleError as error:
            print(f"check: NOT RIGHT: {error}", file=sys.stderr)
            return 1
    print("check: the bundle is right, and as it was")
    return 0


if __name__ == "__main__":
    sys.exit(main())
