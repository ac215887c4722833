"""Boards as the program prints them, photographed through OpenCV's camera: the sheet's SVG, drawn and seen by rays."""

from __future__ import annotations

import re
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from core.model import DeviceSpec, PhaseMap, Testfield
from core.pipeline import print_testfield

SPEC = DeviceSpec(640, 480, (0.01, 0.01), 9.0)
K = np.array([[900.0, 0, 318.2], [0, 900.0, 241.9], [0, 0, 1.0]])
LENS = np.array([-0.1, 0.04, 1e-4, -2e-4, 0.0])
PER_MM, FINE = 8, 2  # texels a mm; samples a pixel along one axis


@dataclass(frozen=True)
class Printed:
    """A board's picture, black 0 and white 1, and the way (3, 2) from the board's mm to its texels."""

    field: Testfield
    picture: np.ndarray
    to_texels: np.ndarray


def field_of(kind: str, polarity: str = "black-on-white") -> Testfield:
    """A board of a kind about 200 mm wide."""
    if kind in ("aprilgrid", "tags"):  # Kalibr's rows go up, OpenCV's down
        row, col = (x.ravel() for x in np.mgrid[0:10, 0:12])
        x, y = (k // 2 * 31.2 + k % 2 * 24.0 for k in (col, row))
        xyz, size = np.column_stack([x, y if kind == "aprilgrid" else -y, 0.0 * x]), 7.2
    elif kind == "dots":
        row, col = (x.ravel() for x in np.mgrid[0:11, 0:16])
        xyz, size = np.column_stack([12.5 * col, -12.5 * row, 0.0 * row]), 5.5
    else:
        row, col = (x.ravel() for x in np.mgrid[0:7, 0:10])
        xyz, size = np.column_stack([20.0 * col, -20.0 * row, 0.0 * row]), 6.0 if kind == "rings" else 20.0
    return Testfield(row, col, xyz, np.full(len(row), size), polarity, kind)


def printed(field: Testfield) -> Printed:
    """Print a board, and draw what its SVG holds."""
    with tempfile.TemporaryDirectory() as folder:
        sheet = print_testfield(field, Path(folder) / "board.svg")
        root = ET.fromstring((Path(folder) / "board.svg").read_text())
    height, width = int(sheet.height_mm * PER_MM), int(sheet.width_mm * PER_MM)
    tones = {"#000000": 0, "#ffffff": 255}
    image = np.full((4 * height, 4 * width), 255, np.uint8)

    def fill(outline: np.ndarray, tone: int) -> None:
        middle = np.round((outline * 4 * PER_MM - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(image, [middle], tone, shift=4)

    if sheet.inverse:
        left, top, wide, high = sheet.ground_mm
        fill(np.array([[left, top], [left + wide, top], [left + wide, top + high], [left, top + high]]), 0)
    targets = next(g for g in root.iter() if g.get("id") == "targets")
    for e in targets:
        tone = tones[e.get("fill") or targets.attrib["fill"]]
        if e.tag.endswith("circle"):
            x, y, r = (float(e.attrib[key]) for key in ("cx", "cy", "r"))
            angle = np.linspace(0, 2 * np.pi, 90)
            fill(np.column_stack([x + r * np.cos(angle), y + r * np.sin(angle)]), tone)
        else:
            fill(np.array([pair.split(",") for pair in re.findall(r"[-\d.]+,[-\d.]+", e.attrib["d"])], float), tone)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    places = np.column_stack([field.xyz_mm[:, :2], np.ones(len(field.row))])
    return Printed(field, small, np.linalg.lstsq(places, sheet.targets_mm[:, :2] * PER_MM - 0.5, rcond=None)[0])


def photograph(
    board: Printed,
    rng: np.random.Generator,
    tilt_deg: float,
    hidden: bool,
    *,
    blur: tuple[float, float] = (0.5, 0.8),
    light: float = 2.0,
    grey: tuple[float, float] = (15.0, 165.0),
) -> tuple[np.ndarray, np.ndarray]:
    """A grey image, and the true places of all targets; what `rng` draws is the pose, and where things are.

    `hidden`: a hand lies over a quarter, corner and all. `blur` is between these sigmas, px. The light falls to 1 over
    `light` across the image. `grey` are the values of black and white.
    """
    middle = board.field.xyz_mm.mean(axis=0)
    about, roll = rng.uniform(0, 2 * np.pi, 2)
    turn = cv2.Rodrigues(np.deg2rad(tilt_deg) * np.array([np.cos(about), np.sin(about), 0.0]))[0]
    turn = turn @ cv2.Rodrigues(np.array([0, 0, roll]))[0] @ np.diag([1.0, -1.0, -1.0])
    shift = np.array([*rng.uniform(-8, 8, 2), 480.0 if tilt_deg < 45 else 430.0]) - turn @ middle
    reach = turn[:, 2] @ shift
    across = np.vstack([(turn[:, :2] * reach - np.outer(turn[:, 2], shift @ turn[:, :2])).T, turn[:, 2]])
    x, y, far = (_sight_lines() @ across.T.astype(np.float32)).transpose(2, 0, 1)
    x, y = x / far, y / far  # on the board, mm
    to = board.to_texels.astype(np.float32)
    texels = (x * to[0, k] + y * to[1, k] + to[2, k] for k in (0, 1))
    albedo = cv2.remap(board.picture, *texels, cv2.INTER_LINEAR, borderValue=0.4)
    if hidden:
        side = rng.choice([-1, 1], 2)
        albedo[(side[0] * (x - middle[0]) > 0) & (side[1] * (y - middle[1]) > 0)] = 0.3
    image = cv2.GaussianBlur(grey[0] + (grey[1] - grey[0]) * albedo, (0, 0), rng.uniform(*blur) * FINE)
    image = cv2.resize(image, (SPEC.width, SPEC.height), interpolation=cv2.INTER_AREA)
    image = image * np.linspace(1.2 / light, 1.2, SPEC.width)
    image = np.rint(image + rng.normal(0, 1.2, image.shape)).astype(np.float32)
    return image, cv2.projectPoints(board.field.xyz_mm, turn, shift, K, LENS)[0][:, 0]


@cache
def _sight_lines() -> np.ndarray:
    v, u = (np.mgrid[0 : SPEC.height * FINE, 0 : SPEC.width * FINE] + 0.5) / FINE - 0.5
    rays = cv2.undistortPoints(np.stack([u.ravel(), v.ravel()], 1)[:, None], K, LENS).reshape(-1, 2)
    return np.column_stack([rays, np.ones(len(rays))]).astype(np.float32).reshape(*v.shape, 3)


def phase_of(image: np.ndarray) -> PhaseMap:
    """A decoded image whose projector coordinates are linear in the camera's."""
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]].astype(np.float32)
    return PhaseMap(0.7 * u, 0.7 * v, 0 * u + 0.03, 0 * u + 0.03, 0 * u + 50, image, np.zeros(image.shape, np.uint8))
