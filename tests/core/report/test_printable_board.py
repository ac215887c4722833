"""The sheet to print: true places and sizes in SVG and PDF, bars of the stated length, labels that are no targets."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import cv2
import numpy as np
import pytest
from pypdf import PdfReader

from core.cli import main
from core.measure import measure_targets
from core.model import DeviceSpec, PhaseMap, Seed, Testfield
from core.project import nominal_testfield, write_project, write_testfield
from core.report.board import Sheet, board_sheet, sheet_pdf, sheet_svg

SVG = "{http://www.w3.org/2000/svg}"
POINT_MM = 25.4 / 72


def field(rows: int = 5, cols: int = 7, spacing: float = 20.0, diameter: float = 8.0, **more: str) -> Testfield:
    return nominal_testfield(rows, cols, spacing, diameter, **more)  # type: ignore[arg-type]


def measured_field() -> Testfield:
    """A board as someone else measured it: crooked places, two sizes, a target missing, rows from 1 on."""
    regular = field()
    rng = np.random.default_rng(1)
    xyz = regular.xyz_mm + rng.normal(size=regular.xyz_mm.shape) * [0.3, 0.3, 0.05] + [70.0, -40.0, 5.0]
    keep = np.arange(len(regular.row)) != 11
    diameter = np.where(regular.row == 2, 9.5, 8.0)
    return Testfield(regular.row[keep] + 1, regular.col[keep], xyz[keep], diameter[keep], "black-on-white")


def svg_circles(text: str) -> np.ndarray:
    """Centre and diameter in mm of every circle, by the file's own size and view box."""
    root = ET.fromstring(text)
    view = [float(v) for v in root.attrib["viewBox"].split()]
    width = re.fullmatch(r"([\d.]+)mm", root.attrib["width"])
    assert width is not None
    unit = float(width[1]) / view[2]
    assert unit == pytest.approx(float(root.attrib["height"].removesuffix("mm")) / view[3])
    circles = root.findall(f".//{SVG}circle")
    return np.array([[float(c.attrib["cx"]), float(c.attrib["cy"]), 2 * float(c.attrib["r"])] for c in circles]) * unit


def pdf_circles(data: Path) -> np.ndarray:
    """Centre and diameter in mm of every closed path of four curves in a PDF's only page, y up."""
    pages = PdfReader(data).pages
    assert len(pages) == 1
    matrix, stack, path, circles = np.eye(3), [], [], []
    for operands, operator in pages[0].get_contents().operations:
        numbers = [float(o) for o in operands if isinstance(o, int | float)]
        match operator:
            case b"q":
                stack.append(matrix)
            case b"Q":
                matrix = stack.pop()
            case b"cm":
                matrix = np.array([[*numbers[:2], 0], [*numbers[2:4], 0], [*numbers[4:], 1]]) @ matrix
            case b"m":
                path = [numbers]
            case b"c":
                path.append(numbers[4:])
            case b"f" | b"f*":
                if len(path) == 5:
                    ends = np.column_stack([np.array(path[:4]), np.ones(4)]) @ matrix
                    circles.append([*ends[:, :2].mean(axis=0), np.linalg.norm(ends[0] - ends[2])[()]])
                path = []
            case _:
                pass
    return np.array(circles) * POINT_MM


def assert_true_to(testfield: Testfield, places: np.ndarray, y_down: bool) -> None:
    """Places equal the testfield's but for a shift: differences of all targets to the first, in mm."""
    sign = np.array([1.0, -1.0 if y_down else 1.0])
    found = (places[:, :2] - places[0, :2]) * sign
    np.testing.assert_allclose(found, testfield.xyz_mm[:, :2] - testfield.xyz_mm[0, :2], atol=2e-3)
    np.testing.assert_allclose(places[:, 2], testfield.diameter_mm, atol=2e-3)


@pytest.mark.parametrize(
    "testfield", [field(), field(13, 19, 12.0, 5.0), measured_field()], ids=["5x7", "13x19", "own"]
)
def test_svg_and_pdf_show_every_target_at_its_place_in_mm(testfield: Testfield, tmp_path: Path) -> None:
    sheet = board_sheet(testfield)
    assert_true_to(testfield, svg_circles(sheet_svg(sheet)), y_down=True)
    pdf = tmp_path / "board.pdf"
    pdf.write_bytes(sheet_pdf(sheet))
    assert_true_to(testfield, pdf_circles(pdf), y_down=False)


def test_the_pages_of_svg_and_pdf_have_one_size_that_holds_everything(tmp_path: Path) -> None:
    sheet = board_sheet(field(13, 19, 12.0, 5.0))
    pdf = tmp_path / "board.pdf"
    pdf.write_bytes(sheet_pdf(sheet))
    reader = PdfReader(pdf)
    box = reader.pages[0].mediabox
    assert (float(box.width) * POINT_MM, float(box.height) * POINT_MM) == pytest.approx(
        (sheet.width_mm, sheet.height_mm), abs=1e-3
    )
    assert reader.viewer_preferences is not None
    assert reader.viewer_preferences["/PrintScaling"] == "/None"
    left, top, wide, high = sheet.ground_mm
    assert left + wide < sheet.width_mm
    assert top + high < max(text.y_mm for text in sheet.texts) < sheet.height_mm
    x, y, d = sheet.targets_mm.T
    assert np.all((x - d / 2 > left) & (x + d / 2 < left + wide) & (y - d / 2 > top) & (y + d / 2 < top + high))


@pytest.mark.parametrize("size", [(2, 3, 5.0, 2.0), (5, 7, 20.0, 8.0), (13, 19, 12.0, 5.0), (40, 60, 25.0, 10.0)])
def test_the_bars_have_the_length_that_stands_beside_them(size: tuple[int, int, float, float]) -> None:
    sheet = board_sheet(field(*size))
    root = ET.fromstring(sheet_svg(sheet))
    lines = [[float(e.attrib[k]) for k in ("x1", "y1", "x2", "y2")] for e in root.findall(f".//{SVG}line")]
    words = [e.text or "" for e in root.findall(f".//{SVG}text")]
    across = max(abs(x2 - x1) for x1, _, x2, _ in lines)
    down = max(abs(y2 - y1) for _, y1, _, y2 in lines)
    assert (across, down) == pytest.approx(sheet.bars_mm)
    assert [w for w in words if re.fullmatch(r"[\d.]+ mm", w)] == [f"{across:g} mm", f"{down:g} mm"]
    advice = " ".join(words)
    assert f"must measure {across:g} mm across and {down:g} mm down" in advice
    ticks = sorted(x1 for x1, y1, x2, y2 in lines if x1 == x2 and abs(y2 - y1) < 10)
    np.testing.assert_allclose(np.diff(ticks), across / 10, atol=1e-3)


def test_title_and_facts_are_printed(tmp_path: Path) -> None:
    pdf = tmp_path / "board.pdf"
    pdf.write_bytes(sheet_pdf(board_sheet(field(13, 19, 12.0, 5.0), "Prüfstand 7")))
    text = PdfReader(pdf).pages[0].extract_text()
    for words in ("13 rows × 19 columns", "spacing 12 mm", "target diameter 5 mm", "white on black", "Prüfstand 7"):
        assert words in text
    assert "larger than A4" in text
    assert "larger than A4" not in " ".join(text.words for text in board_sheet(field(3, 4)).texts)


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
def test_polarity_and_labels(polarity: str) -> None:
    sheet = board_sheet(field(polarity=polarity))
    root = ET.fromstring(sheet_svg(sheet))
    ground, targets = root.find("*[@id='ground']"), root.find("*[@id='targets']")
    assert ground is not None
    assert targets is not None
    dark, bright = "#000000", "#ffffff"
    white = polarity == "white-on-black"
    assert (ground.attrib["fill"], targets.attrib["fill"]) == ((dark, bright) if white else (bright, dark))
    left, top, wide, high = sheet.ground_mm
    labels = [text for text in sheet.texts if text.faint]
    assert {text.words for text in labels} == {f"r{i}" for i in range(5)} | {f"c{i}" for i in range(7)}
    assert all(
        not (left < text.x_mm < left + wide and top < text.y_mm - text.size_mm / 2 < top + high) for text in labels
    )


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
def test_labels_and_bars_are_not_taken_for_targets(polarity: str) -> None:
    """A photograph of the whole sheet, labels and bars as they are, measured from four picks on its corners."""
    testfield = field(7, 9, 19.0, 9.0, polarity=polarity)
    sheet = board_sheet(testfield)
    per_mm, grey = 3.0, _photograph(sheet, 3.0)
    image = cv2.GaussianBlur(20 + 0.7 * grey.astype(np.float32), (0, 0), 0.8)
    nothing = np.full(image.shape, np.nan, np.float32)
    phase = PhaseMap(nothing, nothing, nothing, nothing, 0 * image, image, np.zeros(image.shape, np.uint8))
    uv = sheet.targets_mm[:, :2] * per_mm - 0.5
    index = testfield.index()
    seeds = [Seed(r, c, *(uv[index[r, c]] + 1.0)) for r, c in ((0, 0), (0, 8), (6, 8), (6, 0))]
    camera = DeviceSpec(image.shape[1], image.shape[0], (0.01, 0.01), 12.0)
    targets = measure_targets(phase, testfield, seeds, camera)
    assert not targets.missing
    order = [index[int(r), int(c)] for r, c in zip(targets.row, targets.col, strict=True)]
    # 0.1 px: an ideal dot sampled at 3 px/mm and blurred, without noise
    assert np.abs(targets.camera_uv - uv[order]).max() < 0.1


def _photograph(sheet: Sheet, per_mm: float) -> np.ndarray:
    """Draw ground, targets, bars and labels by OpenCV alone, 4 times finer and averaged."""
    fine = 4 * per_mm
    image = np.full((round(sheet.height_mm * fine), round(sheet.width_mm * fine)), 255, np.uint8)

    def at(x: float, y: float) -> tuple[int, int]:
        return round(x * fine), round(y * fine)

    left, top, wide, high = sheet.ground_mm
    ink, paper = (255, 0) if sheet.inverse else (0, 255)
    cv2.rectangle(image, at(left, top), at(left + wide, top + high), paper, -1)
    for x, y, d in sheet.targets_mm:
        centre = [round((v * fine - 0.5) * 256) for v in (x, y)]
        cv2.circle(image, centre, round(d / 2 * fine * 256), ink, -1, cv2.LINE_AA, 8)
    for a in sheet.lines:
        cv2.line(image, at(a.x1_mm, a.y1_mm), at(a.x2_mm, a.y2_mm), 0, max(round(0.2 * fine), 1))
    for text in sheet.texts:
        size = text.size_mm * fine / 30  # OpenCV's letters are about 22 px high at size 1
        (w, _), _ = cv2.getTextSize(text.words, cv2.FONT_HERSHEY_SIMPLEX, size, 2)
        x, y = at(text.x_mm, text.y_mm)
        x -= {"start": 0, "middle": w // 2, "end": w}[text.anchor]
        cv2.putText(image, text.words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, 112 if text.faint else 0, 3)
    return cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)


# ------------------------------------------------------------------------------------------------------- the command


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "project"
    write_testfield(folder / "testfield.csv", field())
    camera, projector = DeviceSpec(748, 576, (0.008, 0.008), 12.0), DeviceSpec(640, 640, (0.09, 0.09), 182.0)
    write_project(folder, "Rig four", camera, projector)
    return folder


def test_the_command_takes_a_project_or_a_csv_file(project: Path, tmp_path: Path) -> None:
    svg, pdf, figures = tmp_path / "a.svg", tmp_path / "a.pdf", tmp_path / "figures.json"
    assert main(["testfield", str(project), "--out", str(pdf)]) == 0
    assert main(["testfield", str(project / "testfield.csv"), "--out", str(svg), "--json", str(figures)]) == 0
    assert_true_to(field(), svg_circles(svg.read_text()), y_down=True)
    assert "Rig four" in PdfReader(pdf).pages[0].extract_text()
    told = json.loads(figures.read_text())
    assert told["targets"] == 35
    assert told["bars_mm"] == [150.0, 100.0]


@pytest.mark.parametrize(
    ("csv", "out", "told"),
    [
        ("row,col,x_mm\n0,0,0\n", "a.pdf", "y_mm"),
        (None, "a.pdf", "testfield.csv"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,4,0,0,5\n1,0,0,9,0,5\n", "a.svg", "overlap"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,9,0,30,5\n1,0,0,9,0,5\n", "a.svg", "z_mm"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,9000,0,0,5\n1,0,0,9,0,5\n", "a.pdf", "5000 mm"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,nan,0,0,5\n1,0,0,9,0,5\n", "a.pdf", "nan"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,9,0,0,5\n1,0,0,9,0,5\n", "a.png", ".pdf or .svg"),
    ],
)
def test_what_cannot_be_printed_is_refused_in_one_line(
    project: Path, csv: str | None, out: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = project / "testfield.csv"
    path.unlink() if csv is None else path.write_text(csv)
    before = sorted(project.iterdir())
    assert main(["testfield", str(project), "--out", str(project / out)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert told in lines[0]
    assert sorted(project.iterdir()) == before
