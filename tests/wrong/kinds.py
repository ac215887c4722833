"""Kinds of wrong input: what is changed in a sound project's folder, and what must be told, as a pattern.

A kind is named where a refusal (exit code 2 or 1), or one of the first three sentences of a verdict that is not passed,
matches its pattern. Captures of every project are testfield-01 to 08, depth-01 to 05, plane+00 and plane+15.
"""

# ruff: noqa: E501 - tables, a line an entry
from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

Change = Callable[[Path], None]
Images = list[np.ndarray]


def edit(path: Path, change: Callable[[Any], Any]) -> None:
    document = json.loads(path.read_text())
    path.write_text(json.dumps(change(document) or document))


def documents(change: Callable[[dict[str, Any]], Any]) -> Change:
    """Change project.json."""
    return lambda folder: edit(folder / "project.json", change)


def on(*keys: str | int, to: Callable[[Any], Any]) -> Change:
    """Change one value of project.json."""

    def change(document: Any) -> None:
        node = document
        for key in keys[:-1]:
            node = node[key]
        node[keys[-1]] = to(node[keys[-1]])

    return documents(change)


def named(folder: Path, begin: str) -> list[Path]:
    return sorted(p for p in (folder / "captures").iterdir() if p.name.startswith(begin))


def captures(begin: str, change: Callable[[dict[str, Any]], Any]) -> Change:
    """Change capture.json of captures whose names begin so."""

    def all_of(folder: Path) -> None:
        for capture in named(folder, begin):
            edit(capture / "capture.json", change)

    return all_of


def patterns(change: Callable[[dict[str, Any]], Any], begin: str = "") -> Change:
    """Change the patterns that frames are said to show, in all captures or some."""

    def in_all(document: dict[str, Any]) -> None:
        for frame in document["frames"]:
            change(frame["pattern"])

    return captures(begin, in_all)


def of(*kinds: str, **changes: Callable[[dict[str, Any]], Any]) -> Callable[[dict[str, Any]], None]:
    def change(pattern: dict[str, Any]) -> None:
        if pattern["kind"] in kinds:
            pattern |= {key: value(pattern) for key, value in changes.items()}

    return change


def frames(change: Callable[[Images], Images], begin: str = "") -> Change:
    """Change the frames of all captures or of some, in the order of capture.json."""

    def write(folder: Path) -> None:
        for capture in named(folder, begin):
            names = [f["file"] for f in json.loads((capture / "capture.json").read_text())["frames"]]
            images = [cv2.imread(str(capture / name), cv2.IMREAD_UNCHANGED) for name in names]
            for name, old, image in zip(names, images, change(list(images)), strict=True):
                cv2.imwrite(str(capture / name), image.astype(old.dtype))

    return write


def z(change: Callable[[int, float], float]) -> Change:
    """Change z_mm of the plates, numbered from 1."""

    def write(folder: Path) -> None:
        for capture in named(folder, "depth-"):
            edit(capture / "capture.json", lambda d, c=capture: {**d, "z_mm": change(int(c.name[-2:]), d["z_mm"])})

    return write


def table(file: str, change: Callable[[list[dict[str, str]]], Any]) -> Change:
    """Change the rows of a board's file."""

    def write(folder: Path) -> None:
        lines = (folder / file).read_text().splitlines()
        comments, rest = [t for t in lines if t.startswith("#")], [t for t in lines if not t.startswith("#")]
        rows = list(csv.DictReader(rest))
        rows = change(rows) or rows
        out = io.StringIO()
        writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        (folder / file).write_text("\n".join([*comments, out.getvalue()]))

    return write


def times(file: str, **factors: float) -> Change:
    def change(rows: list[dict[str, str]]) -> None:
        for row in rows:
            row |= {key: f"{float(row[key]) * factor:.6f}" for key, factor in factors.items()}

    return table(file, change)


def all_times(file: str, factor: float) -> Change:
    return times(file, x_mm=factor, y_mm=factor, z_mm=factor, diameter_mm=factor)


def exchanged(file: str, a: str, b: str) -> Change:
    return table(file, lambda rows: [{**row, a: row[b], b: row[a]} for row in rows])


def picks(begin: str, change: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> Change:
    def write(folder: Path) -> None:
        for capture in named(folder, begin):
            edit(capture / "picks.json", lambda d: {**d, "seeds": change(d["seeds"])})

    return write


def both(*changes: Change) -> Change:
    def write(folder: Path) -> None:
        for change in changes:
            change(folder)

    return write


def copied(a: str, b: str, *, file: Callable[[str], bool] = lambda name: True, again: bool = False) -> Change:
    """Put the frames of one capture into another; written again, the bytes are others."""

    def write(folder: Path) -> None:
        for path in sorted((folder / "captures" / a).iterdir()):
            if path.suffix != ".json" and file(path.stem):
                to = folder / "captures" / b / path.name
                shutil.copy(path, to)
                if again:
                    cv2.imwrite(str(to), cv2.imread(str(path), cv2.IMREAD_UNCHANGED), [cv2.IMWRITE_PNG_COMPRESSION, 9])

    return write


def twice(folder: Path) -> None:
    """A capture under two names."""
    shutil.copytree(folder / "captures/testfield-02", folder / "captures/testfield-09x")
    edit(folder / "project.json", lambda d: d["captures"].append("captures/testfield-09x"))


def two_patterns(folder: Path) -> None:
    def change(document: dict[str, Any]) -> None:
        document["frames"][2]["file"] = document["frames"][5]["file"]

    edit(folder / "captures/testfield-03/capture.json", change)


def listed(change: Callable[[list[Any]], list[Any]], begin: str = "") -> Change:
    """Change the order of files in capture.json, not of patterns."""

    def one(document: dict[str, Any]) -> None:
        names = change([f["file"] for f in document["frames"]])
        for frame, name in zip(document["frames"], names, strict=True):
            frame["file"] = name

    return captures(begin, one)


def swapped(i: int, k: int) -> Callable[[list[Any]], list[Any]]:
    def change(items: list[Any]) -> list[Any]:
        items[i], items[k] = items[k], items[i]
        return items

    return change


def polarity(folder: Path) -> None:
    """White dots called black, or the other way round."""
    path = folder / "testfield.csv"
    white, black = "white-on-black", "black-on-white"
    text = path.read_text()
    path.write_text(text.replace(white, black) if white in text else text.replace(black, white))


def exchange_picks(folder: Path) -> None:
    a, b = (folder / "captures" / name / "picks.json" for name in ("testfield-01", "testfield-02"))
    first, second = a.read_bytes(), b.read_bytes()
    a.write_bytes(second)
    b.write_bytes(first)


def full(image: np.ndarray) -> int:
    return 255 if image.dtype == np.uint8 else 4095


def brighter(images: Images) -> Images:
    return [np.clip(i.astype(float) * 3, 0, full(i)) for i in images]


def darker(images: Images) -> Images:
    return [i // (50 * (full(i) + 1) // 256) for i in images]


def moved(px: float) -> Callable[[Images], Images]:
    return lambda images: [shift(i, px) for i in images]


def shift(image: np.ndarray, px: float) -> np.ndarray:
    M = np.array([[1, 0, px], [0, 1, -px / 2]])
    return cv2.warpAffine(image, M, image.shape[::-1], borderMode=cv2.BORDER_REPLICATE)


def half_moved(images: Images) -> Images:
    return [shift(i, 3.0) if k >= len(images) // 2 else i for k, i in enumerate(images)]


def lens_changed(images: Images) -> Images:
    """As with another focus: 1 % larger."""
    h, w = images[0].shape
    return [cv2.warpAffine(i, cv2.getRotationMatrix2D((w / 2, h / 2), 0, 1.01), (w, h)) for i in images]


def turned_a_little(images: Images) -> Images:
    h, w = images[0].shape
    return [cv2.warpAffine(i, cv2.getRotationMatrix2D((w / 2, h / 2), 0.6, 1.0), (w, h)) for i in images]


def lamp(images: Images) -> Images:
    return [i * (1.0 if k < len(images) // 2 else 0.6) for k, i in enumerate(images)]


def one_frame(k: int, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Images], Images]:
    return lambda images: [change(i) if n == k else i for n, i in enumerate(images)]


def binned(images: Images) -> Images:
    """Binned by two and enlarged again."""
    h, w = images[0].shape
    return [cv2.resize(i[: h // 2 * 2 : 2, : w // 2 * 2 : 2], (w, h), interpolation=cv2.INTER_NEAREST) for i in images]


def wrapped(images: Images) -> Images:
    """One bit shifted out at the top."""
    return [(i.astype(int) * 2) % (full(i) + 1) for i in images]


def fields_exchanged(images: Images) -> Images:
    """Even rows of the video image in the place of odd ones."""
    return [i[np.minimum(np.arange(len(i)) ^ 1, len(i) - 1)] for i in images]


def other_size(folder: Path) -> None:
    path = (
        named(folder, "testfield-04")[0]
        / json.loads((named(folder, "testfield-04")[0] / "capture.json").read_text())["frames"][2]["file"]
    )
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(path), image[:-2, :-4])


def cut(folder: Path) -> None:
    path = next(p for p in sorted(named(folder, "testfield-04")[0].iterdir()) if p.suffix != ".json")
    path.write_bytes(path.read_bytes()[:3000])


def gone(folder: Path) -> None:
    next(p for p in sorted(named(folder, "testfield-04")[0].iterdir()) if p.suffix != ".json").unlink()


def interior(name: str, factor: float) -> Change:
    def change(document: dict[str, Any]) -> None:
        c = document[name]["nominal_c_mm"] * factor
        document["version"] = 2
        document[name]["interior"] = {"model": "A1..A6", "c_mm": c, "x0_mm": 0, "y0_mm": 0, "hold": True}

    return documents(change)


def further_length(document: dict[str, Any]) -> None:
    bar = document["scale"]
    document |= {"version": 2, "lengths": [{**bar, "length_mm": bar["length_mm"] * 1.02}]}


def without_picks(folder: Path) -> None:
    for path in folder.glob("captures/*/picks.json"):
        path.unlink()


def other_role(name: str, role: str, **more: Any) -> Change:
    return captures(name, lambda d: d.update({"role": role, **more}))


CODE = ("gray", "binary")
OTHER = {"x": "y", "y": "x"}
BAR, BOARD, PLATE, Z = "scale bar", r"testfield\b.*testfield\.csv", "plate's board", "plate positions"

KINDS: dict[str, tuple[Change, str]] = {
    # known lengths
    "plate depths in cm": (z(lambda k, v: v / 10), f"{Z}.*cm"),
    "plate depths in inches": (z(lambda k, v: v / 25.4), f"{Z}.*inches"),
    "plate depths in m": (z(lambda k, v: v / 1000), f"{Z}.* m instead"),
    "plate depths x1.03": (z(lambda k, v: v * 1.03), Z),
    "one plate 1 mm off": (z(lambda k, v: v + (k == 3)), "depth-03: .*z_mm"),
    "one plate 5 mm off": (z(lambda k, v: v - 5 * (k == 2)), "depth-02: .*z_mm"),
    "two plates exchanged": (z(lambda k, v: -v if k in (2, 4) else v), "depth-0[24]: .*z_mm|order of their z_mm"),
    "one plate's sign reversed": (z(lambda k, v: -v if k == 1 else v), "depth-01: .*z_mm|two captures at z"),
    "two plates at one position": (z(lambda k, v: 0.0 if k == 2 else v), r"two captures at z = 0|depth-02: .*z_mm"),
    "scale bar +0.5 %": (on("scale", "length_mm", to=lambda v: v * 1.005), f"{BAR}.*1.00"),
    "scale bar -1 %": (on("scale", "length_mm", to=lambda v: v * 0.99), f"{BAR}.*0.9"),
    "scale bar +10 %": (on("scale", "length_mm", to=lambda v: v * 1.1), BAR),
    "scale bar in cm": (on("scale", "length_mm", to=lambda v: v / 10), f"{BAR}.*cm"),
    "scale bar in inches": (on("scale", "length_mm", to=lambda v: v / 25.4), f"{BAR}.*inches"),
    "scale bar in m": (on("scale", "length_mm", to=lambda v: v / 1000), f"{BAR}.* m instead"),
    "scale bar on other targets": (on("scale", "to", to=lambda v: [v[0] + 1, v[1]]), f"{BAR}.*other targets"),
    "a further length 2 % off": (documents(further_length), "lengths, entry 0.*disagree"),
    "testfield x1.05": (all_times("testfield.csv", 1.05), BOARD),
    "testfield in cm": (all_times("testfield.csv", 0.1), f"{BOARD}.*cm"),
    "testfield in inches": (all_times("testfield.csv", 1 / 25.4), f"{BOARD}.*inches"),
    "testfield's x x1.03": (times("testfield.csv", x_mm=1.03), r"testfield\.csv: x is stretched"),
    "testfield's y x1.01": (times("testfield.csv", y_mm=1.01), r"testfield\.csv: x is stretched"),
    "plate's board x1.05": (all_times("plate.csv", 1.05), f"{PLATE}.*1.0"),
    "plate's board in cm": (all_times("plate.csv", 0.1), f"{PLATE}.*cm"),
    "plate's board x x1.03": (times("plate.csv", x_mm=1.03), "plate's .*x is stretched"),
    "both boards x1.05": (both(all_times("testfield.csv", 1.05), all_times("plate.csv", 1.05)), "known lengths"),
    "both boards in cm": (both(all_times("testfield.csv", 0.1), all_times("plate.csv", 0.1)), "known lengths.*cm"),
    "rows and columns of the board exchanged": (exchanged("testfield.csv", "row", "col"), "testfield|mirror|pick"),
    "testfield's diameters are radii": (times("testfield.csv", diameter_mm=0.5), "diameter_mm.*radius"),
    "testfield's diameters x1.5": (times("testfield.csv", diameter_mm=1.5), "diameter_mm"),
    "testfield's polarity reversed": (polarity, "polarity"),
    "a wrong board's file": (captures("testfield", lambda d: d.update(testfield="plate.csv")), "plate.csv|pick"),
    "one capture names the other board": (
        captures("testfield-03", lambda d: d.update(testfield="plate.csv")),
        "testfield-03",
    ),
    # devices
    "camera's c x2": (on("camera", "nominal_c_mm", to=lambda v: v * 2), "camera: c is"),
    "camera's c x0.5": (on("camera", "nominal_c_mm", to=lambda v: v / 2), "camera: c is"),
    "projector's c x2": (on("projector", "nominal_c_mm", to=lambda v: v * 2), "projector: c is"),
    "projector's c x0.5": (on("projector", "nominal_c_mm", to=lambda v: v / 2), "projector: c is"),
    "camera's c in m": (on("camera", "nominal_c_mm", to=lambda v: v / 1000), "camera.*c"),
    "camera's pitch y -5 %": (on("camera", "pitch_mm", 1, to=lambda v: v * 0.95), "camera: pixels are .*pitch_mm"),
    "camera's pitch x2": (on("camera", "pitch_mm", to=lambda v: [2 * v[0]] * 2), "camera: c is.*pitch_mm"),
    "projector's pitch y x0.5": (on("projector", "pitch_mm", 1, to=lambda v: v / 2), "projector: pixels.*pitch_mm"),
    "projector's pitch x2": (on("projector", "pitch_mm", to=lambda v: [2 * v[0]] * 2), "projector: c is.*pitch_mm"),
    "projector's width x0.75": (on("projector", "width", to=lambda v: v * 3 // 4), "projector.*width"),
    "projector 40 lines too wide": (on("projector", "width", to=lambda v: v + 40), "projector.*width|by project.json the projector has"),
    "projector 16 lines too wide": (on("projector", "width", to=lambda v: v + 16), "projector.*width|by project.json the projector has"),
    "projector's height x0.75": (on("projector", "height", to=lambda v: v * 3 // 4), "projector.*height"),
    "projector's height x2": (on("projector", "height", to=lambda v: v * 2), "projector.*height|by project.json the projector has"),
    "camera's width and height exchanged": (
        documents(lambda d: d["camera"].update(width=d["camera"]["height"], height=d["camera"]["width"])),
        r"\d+x\d+|\d+ x \d+",
    ),
    "camera's interior held 5 % off": (interior("camera", 1.05), "camera.*(interior|held|known)"),
    "projector's interior held 5 % off": (interior("projector", 1.07), "projector.*(interior|held|known)"),
    # what patterns are said to be
    "shift in degrees": (patterns(of("phase", shift_rad=lambda p: np.rad2deg(p["shift_rad"]))), "shift_rad"),
    "phase begins one step late": (
        patterns(of("phase", shift_rad=lambda p: p["shift_rad"] + 2 * np.pi / p["steps"])),
        "shift_rad",
    ),
    "sign of the phase steps": (patterns(of("phase", shift_rad=lambda p: -p["shift_rad"])), "shift_rad"),
    "period +2.5 %": (patterns(of("phase", period=lambda p: p["period"] * 1.025)), "period"),
    "period doubled": (patterns(of("phase", period=lambda p: p["period"] * 2)), "period"),
    "cell doubled": (patterns(of(*CODE, cell=lambda p: p["cell"] * 2)), "cell"),
    "cell halved": (patterns(of(*CODE, cell=lambda p: p["cell"] // 2)), "cell"),
    "code inverted": (patterns(of(*CODE, inverse=lambda p: not p.get("inverse", False))), "invert"),
    "binary, not gray": (patterns(of("gray", kind=lambda p: "binary")), "gray"),
    "bits in reverse order": (patterns(of(*CODE, bit=lambda p: p["bits"] - 1 - p["bit"])), "bits"),
    "axes exchanged": (patterns(of(*CODE, "phase", axis=lambda p: OTHER[p["axis"]])), "exchanged"),
    "white and black exchanged": (
        both(patterns(of("white", kind=lambda p: "grey"))),
        "'grey'",
    ),
    "files of white and black exchanged": (listed(swapped(-1, -2)), "exchanged|inverted"),
    "files of two code frames exchanged": (listed(swapped(1, 3)), "exchanged|frames"),
    "files of two phase frames exchanged in one": (listed(swapped(-4, -5), "testfield-02"), "testfield-02.*exchanged"),
    "files one later": (listed(lambda f: f[1:] + f[:1]), "earlier|later"),
    "files in reverse order": (listed(lambda f: f[::-1]), "reverse order"),
    "phase one step late in one capture": (
        patterns(of("phase", shift_rad=lambda p: p["shift_rad"] + 2 * np.pi / p["steps"]), "testfield-03"),
        "testfield-03.*shift_rad",
    ),
    "code inverted in one capture": (
        patterns(of(*CODE, inverse=lambda p: not p.get("inverse", False)), "testfield-03"),
        "testfield-03.*invert",
    ),
    "axes exchanged in one capture": (
        patterns(of(*CODE, "phase", axis=lambda p: OTHER[p["axis"]]), "testfield-03"),
        "testfield-03.*exchanged",
    ),
    # frames
    "a capture under two names": (twice, "same frames|under two names"),
    "one file under two patterns": (two_patterns, "testfield-03.*two patterns"),
    "a file of another capture": (copied("testfield-06", "testfield-02", file=lambda n: n[-2:] == "03"), "testfield-0[26].*another capture"),
    "a capture written again under another name": (copied("testfield-06", "testfield-02", again=True), "testfield-0[26].*(same targets|same frames)|pick"),
    "x3 saturation in one capture": (frames(brighter, "testfield-03"), "testfield-03.*saturated"),
    "x3 saturation in all": (frames(brighter), "saturated"),
    "one capture dark": (frames(darker, "testfield-03"), "testfield-03.*(light|dark|contrast|modulat|noise)"),
    "one capture moved by 2 px": (frames(moved(2.0), "testfield-05"), "testfield-05"),
    "moved in mid-capture": (frames(half_moved, "testfield-05"), "testfield-05.*moved"),
    "camera moved before the plates": (frames(moved(3.0), "depth"), "depth-.*moved"),
    "camera moved before the planes": (frames(moved(3.0), "plane"), "plane.*moved"),
    "camera refocused before the planes": (frames(lens_changed, "plane"), "plane.*(moved|does not hold)"),
    "camera turned before the planes": (frames(turned_a_little, "plane"), "plane.*moved"),
    "one frame inverted": (frames(one_frame(3, lambda i: full(i) - i), "testfield-02"), "testfield-02.*inverse"),
    "one frame black": (frames(one_frame(3, lambda i: i * 0), "testfield-02"), "testfield-02.*black"),
    "one plane's frame black": (frames(one_frame(3, lambda i: i * 0), "plane+15"), r"plane\+15.*black"),
    "frames mirrored": (frames(lambda f: [i[:, ::-1] for i in f]), "mirror|pick"),
    "frames mirrored, no picks": (both(frames(lambda f: [i[:, ::-1] for i in f]), without_picks), "mirror"),
    "frames turned by 180° in one capture": (frames(lambda f: [i[::-1, ::-1] for i in f], "testfield-04"), "testfield-04"),
    "frames of a plane mirrored": (frames(lambda f: [i[:, ::-1] for i in f], "plane+15"), r"plane\+15.*mirror"),
    "all frames inverted": (frames(lambda f: [full(i) - i for i in f]), "invert|exchanged"),
    "the lamp fades in mid-capture": (frames(lamp, "testfield-02"), "testfield-02.*light"),
    "binned and enlarged in one capture": (frames(binned, "testfield-03"), "testfield-03"),
    "the highest bit lost in one capture": (frames(wrapped, "testfield-03"), "testfield-03"),
    "grey values by a gamma in one capture": (frames(lambda f: [full(i) * (i / full(i)) ** (1 / 2.2) for i in f], "testfield-03"), "testfield-03"),
    "fields of the video exchanged": (frames(fields_exchanged, "testfield-03"), "testfield-03"),
    "padded at the left and top": (frames(lambda f: [np.pad(i, ((10, 0), (14, 0)))[: i.shape[0], : i.shape[1]] for i in f], "testfield-03"), "testfield-03"),
    "square said to be sine, or the reverse": (patterns(of("phase", profile=lambda p: "sine" if p["profile"] == "square" else "square")), "profile|sine|square"),
    "one frame of another size": (other_size, r"testfield-04.*x"),
    "one frame cut short": (cut, "testfield-04"),
    "one frame is missing": (gone, "testfield-04"),
    # picks, roles, angles
    "picks in mm": (
        picks("testfield-02", lambda s: [{**a, "u": a["u"] * 0.01, "v": a["v"] * 0.01} for a in s]),
        "testfield-02.*pick",
    ),
    "picks half turned": (
        picks("testfield-02", lambda s: [{**a, "row": b["row"], "col": b["col"]} for a, b in zip(s, s[2:] + s[:2], strict=True)]),
        "testfield-02.*turned",
    ),
    "picks one column beside": (picks("testfield-02", lambda s: [{**a, "col": a["col"] - 1} for a in s]), "testfield-02"),
    "u and v of picks exchanged": (picks("testfield-02", lambda s: [{**a, "u": a["v"], "v": a["u"]} for a in s]), "testfield-02.*pick|testfield-02"),
    "picks of two captures exchanged": (exchange_picks, "testfield-0[12]"),
    "angle's sign reversed": (captures("plane+15", lambda d: d.update(angle_deg=-d["angle_deg"] + 0.0)), "angle_deg"),
    "angle 6° off": (captures("plane+15", lambda d: d.update(angle_deg=d["angle_deg"] + 6)), "angle_deg"),
    "angles in rad": (captures("plane", lambda d: d.update(angle_deg=round(np.deg2rad(d["angle_deg"]), 3))), "angle_deg"),
    "a board's capture called a plate": (other_role("testfield-02", "depth", z_mm=13.0), "testfield-02"),
    "a plate's capture called a board": (other_role("depth-02", "testfield"), "plate.csv|board|depth-02"),
    "a board's capture called a plane": (other_role("testfield-02", "plane", angle_deg=7), "testfield-02.*(angle|flat|clean)"),
}  # fmt: skip
