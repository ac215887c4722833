"""All readers of files that come from outside, each with a sound file to begin with."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from core.calibrate import calibrate_photogrammetric
from core.devices.line.profiles import read_profile
from core.exchange import FORMATS
from core.model import Adjustment, PhotogrammetricCalibration, TargetSet
from core.patterns.spec import read_sequence_file
from core.pipeline.runs import calibration_file, read_run
from core.pipeline.signed import load_sign_off
from core.pipeline.state.failures import read_failures
from core.pipeline.state.holdings import decoded_figures, stored_record
from core.project import load_archive, read_capture, read_image, read_network, read_project, save_archive
from core.project.captures import read_picks, read_testfield
from core.project.contents import FILE as CONTENTS
from core.project.contents import Contents
from core.project.lock import holder_of, words_of
from core.project.made import read_made
from core.project.unfinished import intact_shots
from core.report.seal import verify
from tests.core.checks.rigs import simulate

BOARD = "row,col,x_mm,y_mm,z_mm,diameter_mm\n" + "".join(
    f"{r},{c},{20 * c},{20 * r},0,5\n" for r in range(3) for c in range(3)
)
DEVICE = {"width": 8, "height": 6, "pitch_mm": [0.01, 0.01], "nominal_c_mm": 12}
PROJECT = {
    "format": "stripe-project",
    "version": 2,
    "name": "small",
    "cameras": {"left": {**DEVICE, "interior": {"model": "brown", "c_mm": 12.1, "sigma": {"c_mm": 0.1}}}},
    "projector": {**DEVICE, "response": [[0, 0], [1, 1]]},
    "scale": {"from": [0, 0], "to": [0, 1], "length_mm": 20, "sigma_mm": 0.1},
    "lengths": [{"from": [0, 0], "to": [1, 1], "length_mm": 28, "sigma_mm": 0.1}],
    "sequence": {"preset": "gray-sine"},
    "captures": ["captures/a"],
}
PATTERNS = [
    {"kind": "white"},
    {"kind": "gray", "axis": "x", "bit": 0, "bits": 3, "cell": 1, "inverse": False},
    {"kind": "phase", "axis": "y", "period": 4.5, "steps": 4, "step": 1, "shift_rad": 1.57, "profile": "sine"},
    {"kind": "line", "axis": "x", "index": 3, "width": 2},
    {"kind": "level", "value": 0.5},
    {"kind": "lines", "axis": "x", "values": "01100110"},
]
CAPTURE = {
    "format": "stripe-capture",
    "version": 2,
    "role": "depth",
    "z_mm": 5.0,
    "testfield": "testfield.csv",
    "frames": [{"file": f"{k}.png", "pattern": p, "camera": "left", "exposure_ms": 2} for k, p in enumerate(PATTERNS)],
}
PICKS = {
    "format": "stripe-picks",
    "version": 1,
    "seeds": [{"row": r, "col": c, "u": 2.0 + c, "v": 1.0 + r} for r in (0, 2) for c in (0, 2)],
}
NETWORK = {
    "format": "stripe-network",
    "version": 1,
    "devices": {"cam": {**DEVICE, "estimate": ["c", "x0"]}},
    "stations": {"1": {"device": "cam"}, "2": {"device": "cam"}},
    "scale": {"from": "A", "to": "B", "length_mm": 10, "sigma_mm": 0.1},
}


IMAGES: dict[str, tuple[type, list[int]]] = {
    "grey.png": (np.uint16, []),
    "colour.png": (np.uint8, []),
    "grey-lzw.tiff": (np.uint16, []),
    "grey-none.tiff": (np.uint16, [cv2.IMWRITE_TIFF_COMPRESSION, 1]),
    "colour-deflate.tiff": (np.uint8, [cv2.IMWRITE_TIFF_COMPRESSION, 8]),
    "colour-jpeg.tiff": (np.uint8, [cv2.IMWRITE_TIFF_COMPRESSION, 7]),
    "colour-packbits.tiff": (np.uint16, [cv2.IMWRITE_TIFF_COMPRESSION, 32773]),
}


@dataclass(frozen=True)
class Reader:
    """A file within a folder, a sound one's contents, and what reads it."""

    file: str
    seed: bytes
    read: Callable[[Path], object]  # given the folder


def text_of(document: object) -> bytes:
    return json.dumps(document).encode()


def own_records(folder: Path) -> dict[str, Reader]:
    """Readers of what the program keeps for itself: what is damaged counts as absent."""
    project = read_project(folder)
    record = {"files": {"a.npz": "0" * 64}, "made_from": {"rig": "0", "captures": {"a": {"000.png": "1"}}}}
    shot = {"event": "shot", "planned": 0, "file": "0.png", "crc": 1, "bits": 8}
    sign_off = {"format": "stripe-sign-off", "version": 1, "operator": "A", "signed": []}
    seal = {"operator": "A", "date": "B", "instrument": "C", "sha256": "0" * 64}
    holder = {"pid": 1, "host": "a", "user": "b", "program": "c", "since": "d"}
    failure = {"calibrate": {"happened": "a", "remedy": "b", "details": "c", "read": "d"}}

    def of(file: str, document: object, read: Callable[[Path], object]) -> Reader:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(text_of(document))
        return Reader(file, text_of(document), read)

    in_use = "photogrammetric.npz"
    (folder / "results/runs/0001").mkdir(parents=True)
    (folder / "results/runs/0001" / in_use).touch()
    sealed = b"x\n<!-- stripe-report " + text_of(seal) + b" -->\n"
    decoded = {"captures": {"a": {"valid": 1, "made_from": {}}}}
    known = {"version": 1, "files": {"/a": [[1, 2, 3, 4], 5, "0" * 64]}}
    return {
        "failures": of("results/failures.json", failure, read_failures),
        "decoded": of("results/decode.json", decoded, lambda f: decoded_figures(project)),
        "pointer": of("results/current.json", {"photogrammetric": 1}, lambda f: calibration_file(project, in_use)),
        "record": of("results/a.json", record, lambda f: stored_record(f / "results/a.json", {"a.npz": "0" * 64})),
        "holder": of("results/.lock", holder, lambda f: words_of(holder_of(f / "results/.lock") or {})),
        "contents": of(f"results/{CONTENTS}", known, lambda f: Contents(f).of(f / "testfield.csv")),
        "transcript": of("transcript.jsonl", shot, intact_shots),
        "sign-off": of("results/runs/0001/sign-off.json", sign_off, lambda f: load_sign_off(project, ())),
        "seal": Reader("report.html", sealed, lambda f: verify(f / "report.html")),
    }


def readers(folder: Path) -> dict[str, Reader]:
    """Fill a folder with sound files, and give the readers of each."""
    (folder / "captures/a").mkdir(parents=True)
    (folder / "testfield.csv").write_text(BOARD)
    (folder / "project.json").write_bytes(text_of(PROJECT))
    (folder / "captures/a/capture.json").write_bytes(text_of(CAPTURE))
    image = np.arange(48, dtype=np.uint8).reshape(6, 8)
    for k in range(len(PATTERNS)):
        cv2.imwrite(str(folder / f"captures/a/{k}.png"), image)
    for name, (kind, options) in IMAGES.items():
        colours = image if "grey" in name else np.stack([image, image, image], 2)
        cv2.imwrite(str(folder / name), colours.astype(kind), options)
    (folder / "network.json").write_bytes(text_of(NETWORK))
    (folder / "points.csv").write_text(
        "point,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\nA,0,0,0,1,1,0\nB,10,0,0,,,\n"
    )
    rows = "".join(f"{s},{p},{u},3.5,0.1\n" for s in (1, 2) for p, u in (("A", 1.5), ("B", 6)))
    (folder / "observations.csv").write_text(f"station,point,u,v,sigma_px\n{rows}")
    p = simulate("modern", 1, poses=5)
    calibration, adjustment = calibrate_photogrammetric(p.rig, p.board, p.fields[:5], scale=p.scale)
    for name, value in (("calibration", calibration), ("adjustment", adjustment), ("targets", p.fields[:2])):
        save_archive(folder / f"{name}.npz", value)
    run = {"number": 1, "made_at": "2026-01-01T00:00:00", "options": {}, "captures": {}, "excluded": {}, "figures": {}}
    (folder / "run.json").write_bytes(text_of(run))
    (folder / ".stripe-made.json").write_bytes(text_of({"format": "stripe-made", "files": {"a": "b"}, "replaced": {}}))
    (folder / "sequence.json").write_bytes(text_of({"preset": "paper"}))
    (folder / "profile.toml").write_text(
        (Path(__file__).parents[2] / "resources/profiles/stripe-lines.toml").read_text(encoding="utf-8")
    )

    def of(file: str, read: Callable[[Path], object]) -> Reader:
        return Reader(file, (folder / file).read_bytes(), read)

    found = {
        **own_records(folder),
        "project": of("project.json", read_project),
        "board": of("testfield.csv", lambda f: read_testfield(f / "testfield.csv")),
        "capture": of("captures/a/capture.json", lambda f: read_capture(f / "captures/a", read_project(f))),
        "picks": Reader("picks.json", text_of(PICKS), lambda f: read_picks(f / "picks.json")),
        "png": of("captures/a/0.png", lambda f: read_image(f / "captures/a/0.png", (6, 8))),
        "network": of("network.json", read_network),
        "points": of("points.csv", read_network),
        "observations": of("observations.csv", read_network),
        "calibration": of("calibration.npz", lambda f: load_archive(f / "calibration.npz", PhotogrammetricCalibration)),
        "adjustment": of("adjustment.npz", lambda f: load_archive(f / "adjustment.npz", Adjustment)),
        "targets": of("targets.npz", lambda f: load_archive(f / "targets.npz", tuple, TargetSet)),
        "run": of("run.json", read_run),
        "made": of(".stripe-made.json", read_made),
        "sequence": of("sequence.json", lambda f: read_sequence_file(f / "sequence.json")),
        "profile": of("profile.toml", lambda f: read_profile(str(f / "profile.toml"), 640, 640)),
    }
    for name in IMAGES:
        found[name] = of(name, lambda f, name=name: read_image(f / name, (6, 8)))  # type: ignore[misc]
    from core.exchange import fit_pair

    for name, form in FORMATS.items():
        if name == "matlab":  # read in a process of its own: too slow for this
            continue
        path = folder / "exchange" / name / f"calibration{form.endings[0]}"
        path.parent.mkdir(parents=True)
        written = form.write(fit_pair(calibration, form.free), path)
        for k, file in enumerate(written):
            own = str(file.relative_to(folder))
            found[f"{name}{k or ''}"] = of(own, lambda f, form=form, path=path: form.read(path))  # type: ignore[misc]
    return found
