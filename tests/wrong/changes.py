"""What is changed in a sound project's folder, for the kinds of wrong input: documents, boards, picks, frames."""

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
        for path in [p for capture in named(folder, begin) if (p := capture / "picks.json").exists()]:
            edit(path, lambda d: {**d, "seeds": change(d["seeds"])})

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


def late_half(a: str, b: str) -> Change:
    """Put the second half of one capture's frames into another."""
    return lambda folder: copied(a, b, file=lambda name: int(name) >= len(_images(folder / "captures" / a)) // 2)(
        folder
    )


def _images(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix != ".json"]


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


def dead_lines(images: Images) -> Images:
    """A row and two columns of the sensor tell nothing."""
    images = [image.copy() for image in images]
    for image in images:
        image[101], image[:, (50, 77)] = 17, 0
    return images


def drawn_over(images: Images) -> Images:
    """The time of day stands in every frame."""
    letters = np.zeros(images[0].shape, np.uint8)
    cv2.putText(letters, "CAM 1 12:30", (images[0].shape[1] // 3, images[0].shape[0] // 2), 0, 0.5, 255, 1)
    return [np.where(letters > 128, np.array(0.8 * full(i), i.dtype), i) for i in images]


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


def region_moved(folder: Path) -> None:
    """The camera's region of interest, and what was picked in it, moved before the fifth board."""
    for capture in named(folder, "testfield-0")[4:]:
        frames(moved(8.0), capture.name)(folder)
        picks(capture.name, lambda s: [{**a, "u": a["u"] + 8, "v": a["v"] - 4} for a in s])(folder)


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
    """The highest of the bits in use lost."""
    half = 2 ** (int(max(i.max() for i in images)).bit_length() - 1)
    return [i % half for i in images]


def resized(height: float, width: float) -> Callable[[Images], Images]:
    """Frames scaled about the corner, as by another format of recording."""

    def change(images: Images) -> Images:
        M = np.array([[width, 0, (width - 1) / 2], [0, height, (height - 1) / 2]])
        return [cv2.warpAffine(i, M, i.shape[::-1], flags=cv2.INTER_AREA) for i in images]

    return change


def cropped(images: Images) -> Images:
    """The middle nine tenths, enlarged to the camera's size."""
    h, w = images[0].shape
    return [cv2.resize(i[h // 20 : h - h // 20, w // 20 : w - w // 20], (w, h)) for i in images]


def quarter(images: Images) -> Images:
    """Turned by 90 degrees and cut to the camera's size."""
    h, w = images[0].shape
    return [np.pad(np.rot90(i), ((0, max(0, h - w)), (0, max(0, w - h))))[:h, :w] for i in images]


def jpeg(quality: int) -> Callable[[Images], Images]:
    def change(images: Images) -> Images:
        top = 255 / full(images[0])
        coded = [cv2.imencode(".jpg", (i * top).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality]) for i in images]
        return [cv2.imdecode(code, cv2.IMREAD_UNCHANGED) / top for _, code in coded]

    return change


def stretched(images: Images) -> Images:
    """Every frame by itself to the full range."""
    return [(i.astype(float) - i.min()) * full(i) / max(int(np.ptp(i)), 1) for i in images]


def neighbours_averaged(images: Images) -> Images:
    """Every frame with the one after it, as by an exposure over two patterns."""
    return [(a.astype(float) + b) / 2 for a, b in zip(images, [*images[1:], images[-1]], strict=True)]


def rewritten(change: Callable[[np.ndarray], np.ndarray], begin: str = "") -> Change:
    """Write frames with another depth or number of channels."""

    def write(folder: Path) -> None:
        for capture in named(folder, begin):
            for frame in json.loads((capture / "capture.json").read_text())["frames"]:
                image = cv2.imread(str(capture / frame["file"]), cv2.IMREAD_UNCHANGED)
                cv2.imwrite(str(capture / frame["file"]), change(image))

    return write


def one_channel(image: np.ndarray) -> np.ndarray:
    """A colour image of which only the blue channel was lit."""
    return np.dstack([image, image * 0, image * 0])


def exposed_by_itself(images: Images) -> Images:
    """Every frame with another exposure."""
    gains = np.random.default_rng(7).uniform(0.5, 1.3, len(images))
    return [np.clip(i * gain, 0, full(i)) for i, gain in zip(images, gains, strict=True)]


def one_field(images: Images) -> Images:
    """The even rows of a video image, each twice."""
    return [i[np.arange(len(i)) // 2 * 2] for i in images]


def fields_exchanged(images: Images) -> Images:
    """Even rows of the video image in the place of odd ones."""
    return [i[np.minimum(np.arange(len(i)) ^ 1, len(i) - 1)] for i in images]


def fields_woven(images: Images) -> Images:
    """Odd rows of the video image still show the pattern before."""
    odd = (np.arange(len(images[0])) % 2 > 0)[:, None]
    return [np.where(odd, a, b) for a, b in zip([images[0], *images], images, strict=False)]


def flickering(images: Images) -> Images:
    """A lamp goes dark and bright while rows are read."""
    rows = np.arange(len(images[0]))[:, None]
    return [i * (0.7 + 0.3 * np.sin(rows / 25 + 2.3 * k)) for k, i in enumerate(images)]


def equalised(images: Images) -> Images:
    """The histogram of every frame made even, in 8 bits."""
    return [cv2.equalizeHist((i * (255 / full(i))).astype(np.uint8)) * (full(i) / 255) for i in images]


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


def further_length(document: dict[str, Any], factor: float = 1.02, to: list[int] | None = None) -> None:
    bar = document["scale"]
    document |= {"version": 2, "lengths": [{**bar, "length_mm": bar["length_mm"] * factor, "to": to or bar["to"]}]}


def without_picks(folder: Path) -> None:
    for path in folder.glob("captures/*/picks.json"):
        path.unlink()


def other_role(name: str, role: str, **more: Any) -> Change:
    return captures(name, lambda d: d.update({"role": role, **more}))


def angles_exchanged(folder: Path) -> None:
    """The angles of the first two planes stand in each other's place."""
    first, second = (named(folder, "plane")[k] / "capture.json" for k in (0, 1))
    a, b = (json.loads(path.read_text())["angle_deg"] for path in (first, second))
    edit(first, lambda d: d.update(angle_deg=b))
    edit(second, lambda d: d.update(angle_deg=a))
