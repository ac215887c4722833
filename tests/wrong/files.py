"""Files as people and other programs write them, wrong or merely unusual: accepted, or refused in one line.

A refusal is exit code 2, one line that matches the pattern given, and a folder in which nothing has changed. `None`
stands for what must be accepted: exit code 0. Tried is `measure`, and where that takes no offence `calibrate`.
"""

# ruff: noqa: E501 - tables, a line an entry
from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from tests.wrong.changes import Change, edit, named, on

FIRST = "captures/testfield-01"


def text(file: str, change: Callable[[str], str], encoding: str = "utf-8") -> Change:
    def write(folder: Path) -> None:
        path = folder / file
        path.write_bytes(change(path.read_text(encoding="utf-8")).encode(encoding))

    return write


def cell(column: int, value: str, line: int = 5) -> Change:
    """Put a value into a cell of testfield.csv."""

    def change(whole: str) -> str:
        lines = whole.splitlines()
        cells = lines[line].split(",")
        cells[column] = value
        lines[line] = ",".join(cells)
        return "\n".join([*lines, ""])

    return text("testfield.csv", change)


def row_of(change: Callable[[list[str]], list[str]]) -> Change:
    """Change the cells of every line of testfield.csv, the header's too."""

    def lines(whole: str) -> str:
        return "\n".join(t if t.startswith("#") else ",".join(change(t.split(","))) for t in whole.splitlines()) + "\n"

    return text("testfield.csv", lines)


def first(change: Callable[[dict[str, Any]], Any]) -> Change:
    """Change the first capture.json."""

    def whole(document: dict[str, Any]) -> None:
        change(document)

    return lambda folder: edit(folder / FIRST / "capture.json", whole)


def pattern(kind: str, **values: Any) -> Change:
    """Change the first pattern of a kind in the first capture."""

    def change(document: dict[str, Any]) -> None:
        found = next(f["pattern"] for f in document["frames"] if f["pattern"]["kind"] == kind)
        found |= values

    return first(change)


def raw(file: str, find: str, put: str) -> Change:
    def change(whole: str) -> str:
        assert find in whole, (file, find)
        return whole.replace(find, put, 1)

    return text(file, change)


def project_text(change: Callable[[str], str]) -> Change:
    return text("project.json", lambda whole: change(json.dumps(json.loads(whole))))


def images(change: Callable[[np.ndarray], np.ndarray], ending: str = "", begin: str = "testfield-01") -> Change:
    def write(folder: Path) -> None:
        for capture in named(folder, begin):
            document = json.loads((capture / "capture.json").read_text())
            for frame in document["frames"]:
                image = cv2.imread(str(capture / frame["file"]), cv2.IMREAD_UNCHANGED)
                frame["file"] = Path(frame["file"]).stem + (ending or Path(frame["file"]).suffix)
                cv2.imwrite(str(capture / frame["file"]), change(image))
            (capture / "capture.json").write_text(json.dumps(document))

    return write


def tiffs(**options: Any) -> Change:
    """Store the first frames as TIFF files of another kind."""

    def write(folder: Path) -> None:
        for capture in named(folder, "testfield-01"):
            document = json.loads((capture / "capture.json").read_text())
            for frame in document["frames"]:
                image = Image.open(capture / frame["file"])
                frame["file"] = Path(frame["file"]).stem + ".tif"
                image.save(capture / frame["file"], **options)
            (capture / "capture.json").write_text(json.dumps(document))

    return write


def exif(begin: str, orientation: int) -> Change:
    """Say in the first frame how the camera was held."""

    def write(folder: Path) -> None:
        path = folder / "captures" / begin / "000.png"
        image = Image.open(path)
        said = image.getexif()
        said[274] = orientation
        image.save(path, exif=said)

    return write


def link(to: str) -> Change:
    def write(folder: Path) -> None:
        path = next(p for p in sorted((folder / FIRST).iterdir()) if p.suffix != ".json")
        kept = folder / "elsewhere"
        path.rename(kept)
        path.symlink_to(kept if to == "it" else path.name)

    return write


def placed(file: str, put: Callable[[Path], None]) -> Change:
    def write(folder: Path) -> None:
        path = folder / file
        if path.is_file():
            path.unlink()
        put(path)

    return write


def seeds(change: Callable[[list[dict[str, Any]]], Any]) -> Change:
    def write(folder: Path) -> None:
        edit(folder / FIRST / "picks.json", lambda d: {**d, "seeds": change(d["seeds"]) or d["seeds"]})

    return write


def renamed(folder: Path) -> None:
    """A capture whose name has spaces and umlauts."""
    (folder / FIRST).rename(folder / "captures/Prüf feld №1")
    edit(folder / "project.json", lambda d: d["captures"].__setitem__(0, "captures/Prüf feld №1"))


def palette(folder: Path) -> None:
    for path in (folder / FIRST).glob("*.png"):
        Image.open(path).convert("RGB").convert("P", palette=Image.Palette.ADAPTIVE, colors=256).save(path)


def no_folder(folder: Path) -> None:
    """A file where results would go."""
    shutil.rmtree(folder / "results")
    (folder / "results").touch()


COLOUR = (lambda i: cv2.cvtColor(i, cv2.COLOR_GRAY2BGR), lambda i: cv2.cvtColor(i, cv2.COLOR_GRAY2BGRA))
WRONG_CSV = r"testfield\.csv"

FILES: dict[str, tuple[Change, str | None]] = {
    "board with BOM and CRLF": (text("testfield.csv", lambda t: "\ufeff" + t.replace("\n", "\r\n")), None),
    "board with old line ends": (text("testfield.csv", lambda t: t.replace("\n", "\r")), None),
    "board in UTF-16": (text("testfield.csv", lambda t: t, "utf-16"), WRONG_CSV),
    "board with umlauts in Latin 1": (text("testfield.csv", lambda t: "# Prüffeld\n" + t, "latin-1"), f"{WRONG_CSV}.*UTF-8"),
    "board with semicolons and decimal commas": (
        text("testfield.csv", lambda t: t.replace(",", ";").replace(".", ",")),
        rf"{WRONG_CSV}.*(;|comma|column)",
    ),
    "board with tabs": (text("testfield.csv", lambda t: t.replace(",", "\t")), WRONG_CSV),
    "board with a decimal comma in quotes": (cell(2, '"12,5"'), rf"{WRONG_CSV}.*12,5"),
    "board with NaN": (cell(2, "nan"), rf"{WRONG_CSV}.*nan"),
    "board with an infinite place": (cell(3, "1e999"), WRONG_CSV),
    "board with an empty cell": (cell(3, ""), WRONG_CSV),
    "board with units in cells": (cell(2, "19 mm"), rf"{WRONG_CSV}.*19 mm"),
    "board with a diameter of 0": (cell(5, "0"), rf"{WRONG_CSV}.*diameter"),
    "board with a negative diameter": (cell(5, "-9"), rf"{WRONG_CSV}.*diameter"),
    "board with a row of 1.5": (cell(0, "1.5"), rf"{WRONG_CSV}.*1\.5"),
    "board with whole numbers as 1.0": (row_of(lambda c: [f"{c[0]}.0", *c[1:]] if c[0].isdigit() else c), None),
    "board with a negative row": (cell(0, "-1"), None),
    "board with a huge row": (cell(0, "99999999999"), None),
    "board with columns in another order": (row_of(lambda c: [c[3], c[2], c[0], c[1], *c[4:]]), None),
    "board with a further column": (row_of(lambda c: [*c, "note"]), None),
    "board with a column missing": (row_of(lambda c: c[:5]), rf"{WRONG_CSV}.*diameter_mm"),
    "board without a header": (text("testfield.csv", lambda t: t.split("diameter_mm\n")[1]), WRONG_CSV),
    "board with spaces about its cells": (row_of(lambda c: [f" {x} " for x in c]), None),
    "board with empty lines": (text("testfield.csv", lambda t: t.replace("\n", "\n\n")), None),
    "board of its header alone": (text("testfield.csv", lambda t: t.split("diameter_mm\n")[0] + "diameter_mm\n"), WRONG_CSV),
    "board with a stray quote": (cell(2, '"12'), WRONG_CSV),
    "board with a zero byte": (cell(2, "1\x002"), WRONG_CSV),
    "board of another polarity": (text("testfield.csv", lambda t: t.replace("white-on-black", "white on black")), WRONG_CSV),
    "board twice the same target": (row_of(lambda c: ["0", "0", *c[2:]] if c[:2] == ["1", "1"] else c), WRONG_CSV),
    "board is a folder": (placed("testfield.csv", Path.mkdir), WRONG_CSV),
    "board elsewhere, by ..": (first(lambda d: d.update(testfield="../testfield.csv")), "testfield"),
    "board without a name": (first(lambda d: d.update(testfield="")), "testfield is ''"),
    "project with a BOM": (text("project.json", lambda t: "\ufeff" + t), None),
    "project in UTF-16": (text("project.json", lambda t: t, "utf-16"), r"project\.json"),
    "project with a comma too many": (project_text(lambda t: t[:-1] + ",}"), r"project\.json.*JSON"),
    "project with comments": (project_text(lambda t: t.replace("{", "{ // the rig\n", 1)), r"project\.json.*JSON"),
    "project with single quotes": (project_text(lambda t: t.replace('"', "'")), r"project\.json.*JSON"),
    "project is empty": (text("project.json", lambda t: ""), r"project\.json"),
    "project is a list": (text("project.json", lambda t: f"[{t}]"), r"project\.json"),
    "project nested a hundred thousand deep": (text("project.json", lambda t: "[" * 100_000), r"project\.json"),
    "project with a key twice": (project_text(lambda t: t.replace('"width": 320', '"width": 640, "width": 320', 1)), r"project\.json.*width"),
    "project with a number of 5000 digits": (raw("project.json", '"sigma_mm": ', '"sigma_mm": ' + "9" * 5000), r"project\.json"),
    "project with Infinity": (on("scale", "length_mm", to=lambda v: float("inf")), "length_mm"),
    "width as text": (on("camera", "width", to=str), "width"),
    "width with a fraction": (on("camera", "width", to=lambda v: v + 0.5), "width"),
    "width as 320.0": (on("camera", "width", to=float), None),
    "width negative": (on("camera", "width", to=lambda v: -v), "width"),
    "width true": (on("camera", "width", to=lambda v: True), "width"),
    "width of another camera": (on("camera", "width", to=lambda v: 2 * v), r"\d+ ?[x×] ?\d+"),
    "pitch as one number": (on("camera", "pitch_mm", to=lambda v: v[0]), "pitch_mm"),
    "pitch of three numbers": (on("camera", "pitch_mm", to=lambda v: [*v, 1]), "pitch_mm"),
    "pitch negative": (on("camera", "pitch_mm", to=lambda v: [v[0], -v[1]]), "pitch_mm"),
    "pitch in µm": (on("camera", "pitch_mm", to=lambda v: [1000 * x for x in v]), "pitch_mm"),
    "c is 0": (on("camera", "nominal_c_mm", to=lambda v: 0), "nominal_c_mm"),
    "bar from a target to itself": (on("scale", "to", to=lambda v: [6, 0]), "scale"),
    "bar to a target that is not there": (on("scale", "to", to=lambda v: [77, 0]), "77"),
    "bar's end as text": (on("scale", "to", to=lambda v: "0,8"), "scale"),
    "bar's end between two rows": (on("scale", "to", to=lambda v: [0.5, v[1]]), "scale: to: row is 0.5"),
    "bar's length negative": (on("scale", "length_mm", to=lambda v: -v), "length_mm"),
    "bar's sigma 0": (on("scale", "sigma_mm", to=lambda v: 0), "sigma_mm"),
    "a capture with another case": (on("captures", 0, to=str.upper), "TESTFIELD-01"),
    "a capture with a slash behind": (on("captures", 0, to=lambda v: v + "/"), None),
    "a capture with backslashes": (on("captures", 0, to=lambda v: v.replace("/", "\\")), r"captures.*testfield-01"),
    "captures as one text": (on("captures", to=lambda v: v[0]), "captures"),
    "a name with spaces and umlauts": (renamed, None),
    "role with a capital": (first(lambda d: d.update(role="Testfield")), "Testfield"),
    "version as text": (first(lambda d: d.update(version="1")), "version"),
    "version 1.0": (first(lambda d: d.update(version=1.0)), None),
    "another program's format": (first(lambda d: d.update(format="capture")), "format"),
    "unknown keys": (first(lambda d: d.update(operator="Ann", camera={"gain": 3})), None),
    "no frames": (first(lambda d: d.update(frames=[])), "frames"),
    "a frame without a pattern": (first(lambda d: d["frames"][3].pop("pattern")), "pattern"),
    "a frame's file as a number": (first(lambda d: d["frames"][3].update(file=3)), "file"),
    "a frame's file is not there": (first(lambda d: d["frames"][3].update(file="3.png")), r"3\.png"),
    "a frame's file is its folder": (first(lambda d: d["frames"][3].update(file=".")), "testfield-01"),
    "a key of capture.json twice": (raw(f"{FIRST}/capture.json", '"role"', '"role": "plane", "role"'), "role"),
    "bit as 1.0": (pattern("gray", bit=0.0), None),
    "bit beyond the bits": (pattern("gray", bit=7), "bit"),
    "bits of 60": (pattern("gray", bits=60), "60 bits"),
    "cell of 0": (pattern("gray", cell=0), "cell"),
    "inverse as text": (pattern("gray", inverse="false"), "inverse"),
    "axis with a capital": (pattern("gray", axis="X"), "axis"),
    "a section of a line beyond the projector": (first(lambda d: d["frames"][0].update(pattern={"kind": "line", "axis": "x", "index": 160})), "index is 160"),
    "cell of more lines than there are": (pattern("gray", cell=1601), "cell is 1601"),
    "period below two lines": (pattern("phase", period=1.5), "period is 1.5"),
    "period of 0": (pattern("phase", period=0), "period"),
    "period negative": (pattern("phase", period=-4), "period"),
    "steps of 1": (pattern("phase", steps=1), "steps|step"),
    "step as many as steps": (pattern("phase", step=4), "step"),
    "shift as NaN": (pattern("phase", shift_rad=float("nan")), "shift_rad"),
    "profile of a triangle": (pattern("phase", profile="triangle"), "triangle"),
    "colour images": (images(COLOUR[0]), None),
    "colour images with opacity": (images(COLOUR[1]), None),
    "images with a palette": (palette, None),
    "images as TIFF": (images(lambda i: i, ".tiff"), None),
    "16 bits with data of 10": (images(lambda i: i.astype(np.uint16) * 4, ".tiff"), None),
    "images as JPEG": (images(lambda i: i, ".jpg"), None),
    "images of 32-bit floats": (images(lambda i: i.astype(np.float32), ".tiff"), r"000\.tiff"),
    "TIFF that asks to be turned": (tiffs(tiffinfo={274: 3}), r"000\.tif.*orientation 3"),
    "PNG that asks to be turned": (exif("testfield-01", 6), r"000\.png.*orientation 6"),
    "TIFF of two images": (tiffs(save_all=True, append_images=[Image.new("L", (320, 240))]), r"000\.tif.*several"),
    "images turned by 90°": (images(lambda i: np.ascontiguousarray(np.rot90(i))), r"000\.png.*\d+ ?[x×] ?\d+"),
    "images of half the size": (images(lambda i: i[::2, ::2].copy()), r"000\.png.*\d+ ?[x×] ?\d+"),
    "a frame that is a link": (link("it"), None),
    "a frame that links to itself": (link("itself"), r"000\.png"),
    "a frame that is empty": (placed(f"{FIRST}/000.png", Path.touch), r"000\.png"),
    "a frame that is text": (placed(f"{FIRST}/000.png", lambda p: p.write_text("no image") and None), r"000\.png"),
    "picks with u as text": (seeds(lambda s: s[0].update(u="66,9")), "seed 0"),
    "picks with row 0.5": (seeds(lambda s: s[0].update(row=0.5)), "seed 0"),
    "picks outside of the image": (seeds(lambda s: s[0].update(u=-50.0)), r"testfield-01/picks\.json"),
    "picks of five": (seeds(lambda s: [*s, {**s[0], "row": 3, "col": 4}]), r"testfield-01/picks\.json"),
    "a plate without z_mm": (lambda f: edit(f / "captures/depth-01/capture.json", lambda d: d.pop("z_mm") and None), r"depth-01.*z_mm"),
    "a plate's z_mm as text": (lambda f: edit(f / "captures/depth-01/capture.json", lambda d: d.update(z_mm="-50 mm")), r"depth-01.*z_mm"),
    "results is a file": (no_folder, "results"),
}  # fmt: skip
