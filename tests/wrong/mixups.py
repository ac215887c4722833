"""Mix-ups of a laboratory: one device's values in another's place, yesterday's picks, half a copy, frames retouched."""

# ruff: noqa: E501 - tables, a line an entry
from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.wrong.changes import (
    Change,
    Images,
    all_times,
    both,
    captures,
    copied,
    documents,
    frames,
    full,
    listed,
    named,
    on,
    other_role,
    picks,
    rewritten,
    shift,
    table,
    times,
    without_picks,
)


def devices_exchanged(document: dict[str, Any]) -> None:
    document["camera"], document["projector"] = document["projector"], document["camera"]


def to_the_edges(folder: Path) -> None:
    """The scale bar is longer by a dot's diameter."""
    rows = [line for line in (folder / "testfield.csv").read_text().splitlines() if not line.startswith("#")]
    diameter = float(next(csv.DictReader(rows))["diameter_mm"])
    on("scale", "length_mm", to=lambda v: v + diameter)(folder)


def with_commas(folder: Path) -> None:
    """As a spreadsheet writes it where decimals have commas."""
    path = folder / "testfield.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(t if t.startswith("#") else t.replace(",", ";").replace(".", ",") for t in lines) + "\n")


def one_for_all(folder: Path) -> None:
    """The first capture's picks in every board's capture."""
    own = folder / "captures" / "testfield-01" / "picks.json"
    for capture in named(folder, "testfield")[1:]:
        shutil.copy(own, capture / "picks.json")


def half_listed(document: dict[str, Any]) -> None:
    document["frames"] = document["frames"][: len(document["frames"]) // 2]


def half_copied(folder: Path) -> None:
    files = [
        frame["file"] for frame in json.loads((folder / "captures/testfield-03/capture.json").read_text())["frames"]
    ]
    for file in files[len(files) // 2 :]:
        (folder / "captures/testfield-03" / file).unlink()


def as_text(files: list[Any]) -> list[Any]:
    """1, 10, 11, ..., 2, 20."""
    return [files[k] for k in sorted(range(len(files)), key=str)]


def less_black(images: Images) -> Images:
    return [np.clip(i.astype(float) - images[-1], 0, full(i)) for i in images]


def over_white(images: Images) -> Images:
    """As if white were a picture of the shading alone."""
    white = np.maximum(cv2.GaussianBlur(images[-2], (0, 0), 1.0).astype(float), 1)
    return [np.clip(0.7 * full(i) * i / white, 0, full(i)) for i in images]


def sharpened(images: Images) -> Images:
    return [
        np.clip(2.2 * i.astype(float) - 1.2 * cv2.GaussianBlur(i.astype(np.float32), (0, 0), 1.2), 0, full(i))
        for i in images
    ]


def local_contrast(images: Images) -> Images:
    even = cv2.createCLAHE(4.0, (8, 8))
    return [even.apply(i) if full(i) == 255 else even.apply((i * 16).astype(np.uint16)) // 16 for i in images]


def brighter_white(images: Images) -> Images:
    return [*images[:-2], np.clip(1.5 * images[-2].astype(float), 0, full(images[-2])), images[-1]]


def each(change: Callable[[np.ndarray, int], np.ndarray]) -> Callable[[Images], Images]:
    return lambda images: [change(i, k) for k, i in enumerate(images)]


def false_colours(image: np.ndarray) -> np.ndarray:
    return cv2.applyColorMap((image * (255 / full(image))).astype(np.uint8), cv2.COLORMAP_JET)


def eight_bits(image: np.ndarray) -> np.ndarray:
    return (image // ((full(image) + 1) // 256)).astype(np.uint8)


MIXUPS: dict[str, tuple[Change, str]] = {
    "camera and projector exchanged in project.json": (documents(devices_exchanged), "frame|camera"),
    "camera's c in px": (documents(lambda d: d["camera"].update(nominal_c_mm=d["camera"]["nominal_c_mm"] / d["camera"]["pitch_mm"][0])), "nominal_c_mm"),
    "camera's pitch in pixels per mm": (on("camera", "pitch_mm", to=lambda v: [1 / x for x in v]), "camera.*pitch_mm"),
    "rows and columns of the scale bar exchanged": (documents(lambda d: d["scale"].update({k: d["scale"][k][::-1] for k in ("from", "to")})), "scale"),
    "scale bar measured to the dots' outer edges": (to_the_edges, "scale bar"),
    "testfield's x and y exchanged": (table("testfield.csv", lambda rows: [{**r, "x_mm": r["y_mm"], "y_mm": r["x_mm"]} for r in rows]), "testfield|mirror|pick"),
    "testfield's y downwards, without picks": (both(times("testfield.csv", y_mm=-1), without_picks), "mirror|testfield"),
    "testfield with decimal commas": (with_commas, r"testfield\.csv"),
    "testfield's diameters in cm": (times("testfield.csv", diameter_mm=0.1), "diameter_mm"),
    "testfield printed at 96 %": (all_times("testfield.csv", 1 / 0.96), r"testfield\b.*testfield\.csv"),
    "the first capture's picks in all": (one_for_all, "testfield-0[2-9].*pick|testfield-0[2-9]"),
    "picks of another day": (picks("testfield", lambda s: [{**a, "u": a["u"] + 25, "v": a["v"] - 18} for a in s]), "pick"),
    "picks of a mirrored image in one capture": (picks("testfield-02", lambda s: [{**a, "u": 320 - a["u"]} for a in s]), "testfield-02.*(pick|mirror)"),
    "black subtracted from every frame": (frames(less_black), "black|subtract"),
    "black subtracted from every frame of one capture": (frames(less_black, "testfield-03"), "testfield-03.*(black|subtract)"),
    "divided by white": (frames(over_white), "white|light|dot|testfield"),
    "sharpened in all": (frames(sharpened), "sharpened"),
    "sharpened in one capture": (frames(sharpened, "testfield-03"), "testfield-03.*sharpened"),
    "local contrast made even in one capture": (frames(local_contrast, "testfield-03"), "testfield-03"),
    "local contrast made even in all": (frames(local_contrast), "equalised|contrast|stretched"),
    "every second frame of another capture": (copied("testfield-05", "testfield-03", file=lambda n: int(n) % 2 > 0), "another capture"),
    "half of the frames listed in one capture": (captures("testfield-03", half_listed), "testfield-03"),
    "half of the frames copied in one capture": (half_copied, "testfield-03.*not there"),
    "a plane's capture called a plate": (other_role("plane+15", "depth", z_mm=13.0, testfield="plate.csv"), r"plane\+15"),
    "a plate's capture called a plane": (other_role("depth-02", "plane", angle_deg=7.0), "depth-02"),
    "false colours in one capture": (rewritten(false_colours, "testfield-03"), "testfield-03"),
    "rolled by the grabber in one capture": (frames(each(lambda i, k: np.roll(i, 7, axis=1)), "testfield-03"), "testfield-03"),
    "drifting by 0.1 px a frame in one capture": (frames(each(lambda i, k: shift(i, 0.1 * k)), "testfield-03"), "testfield-03"),
    "white exposed longer in one capture": (frames(brighter_white, "testfield-03"), "testfield-03"),
    "copies in 8 bits in one capture": (rewritten(eight_bits, "testfield-03"), "testfield-03"),
    "files sorted as text": (listed(as_text), "sorted by number"),
}  # fmt: skip
