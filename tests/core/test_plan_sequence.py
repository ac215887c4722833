"""The planner against frames of an independent renderer: what it says of the rig, and what it predicts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from core.cli import main
from core.decode import decode
from core.errors import InputError
from core.model import DeviceSpec, Subject
from core.patterns import SequenceSpec, axis_of, brightness, parse_sequence
from core.pipeline.planning import RigLight, expected, plan_sequence, rig_light
from core.project import add_capture, create_project, read_project
from tests.captures import write_capture

LINES, CAMERA = (160, 160), (320, 40)
CONTRAST, AMBIENT, NOISE, BLUR = 90.0, 14.0, 2.2, 0.6


def render(
    pattern, place: NDArray, rng: np.random.Generator, shaded: float = 0.0, blur: float = BLUR
) -> NDArray[np.uint8]:
    """Rays: every pixel is the mean of 256 rays, each of which meets one line; noise by the sensor."""
    level = np.zeros(place.shape)
    shown = np.pad(brightness(pattern, np.arange(LINES[0])), 40)
    for shift in (np.arange(256) + 0.5) / 256:
        # quantiles of the normal distribution, by interpolation of its sum
        x = np.linspace(-5, 5, 2001)
        total = np.cumsum(np.exp(-x * x / 2))
        level += shown[np.rint(place + blur * np.interp(shift, total / total[-1], x)).astype(int) + 40] / 256
    level = level if axis_of(pattern) else np.full(place.shape, shown[40])
    contrast = np.where(np.arange(place.shape[1]) < 0.6 * place.shape[1], CONTRAST, CONTRAST * (1 - shaded))
    return np.uint8(np.clip(np.rint(AMBIENT + contrast * level + NOISE * rng.normal(size=place.shape)), 0, 255))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "p"
    create_project(folder, "p", DeviceSpec(*CAMERA, (0.01, 0.01), 12.0), DeviceSpec(*LINES, (0.09, 0.09), 100.0), {})
    rng, place = np.random.default_rng(3), field()
    patterns = parse_sequence("paper:axes=x").patterns(LINES)
    write_capture(folder / "captures" / "a", Subject("object"), [(p, render(p, place, rng)) for p in patterns])
    add_capture(folder, "captures/a")
    return folder


def field() -> NDArray:
    y, x = np.mgrid[0 : CAMERA[1], 0 : CAMERA[0]].astype(float)
    return 4 + (LINES[0] - 9) * x / CAMERA[0] + 0.03 * y


def test_the_rig_is_read_off_a_capture_and_noise_is_predicted_to_a_twentieth(project: Path) -> None:
    light, planned = plan_sequence(project, 24)
    assert light.contrast == pytest.approx(CONTRAST, rel=0.02)
    assert light.ambient == pytest.approx(AMBIENT, abs=0.5)
    assert np.sqrt(light.dark + light.shot * 60) == pytest.approx(NOISE, rel=0.06)
    assert light.blur_lines == pytest.approx(BLUR, rel=0.08)
    assert "capture a" in light.known_from[0]
    assert {p.preset for p in planned} == {
        "paper", "gray-sine", "gray-inverse", "multi-frequency", "two-period", "dense",
    }  # fmt: skip
    place, rng = field(), np.random.default_rng(8)
    for p in planned:
        assert p.frames <= 24
        if p.preset in ("paper", "gray-sine", "dense"):
            half = {"dense": f"dense:axes=x,frames={p.options.get('frames', 0) // 2:.0f}"}
            text = half.get(p.preset) or f"{p.words}{',' if p.options else ':'}axes=x"
            patterns = parse_sequence(text).patterns(LINES)
            u = decode(patterns, [render(q, place, rng) for q in patterns], lines=LINES).u
            error = (u - place)[np.abs(u - place) < 2]
            assert p.sigma_lines == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=0.05), p


def test_fine_fringes_of_sharp_lines_are_predicted_without_their_ripple() -> None:
    """The decoder takes the ripple of whole lines out where it sees enough of a surface."""
    light = RigLight(CONTRAST, AMBIENT, NOISE**2 + 1 / 12, blur_lines=0.45)
    planned = expected(SequenceSpec("gray-sine", {"period": 6, "steps": 7}), LINES, light)
    place, rng = field(), np.random.default_rng(8)
    patterns = parse_sequence(f"{planned.words},axes=x").patterns(LINES)
    error = decode(patterns, [render(q, place, rng, blur=0.45) for q in patterns], lines=LINES).u - place
    assert planned.sigma_lines == pytest.approx(float(np.sqrt(np.nanmean(error**2))), rel=0.03)


def test_pixels_in_half_light_count_by_their_noise(tmp_path: Path) -> None:
    """Two fifths see 58 grey values instead of 90: noise is a quarter more than at the median."""
    create_project(tmp_path, "p", DeviceSpec(*CAMERA, (0.01, 0.01), 12.0), DeviceSpec(*LINES, (0.09, 0.09), 100.0), {})
    rng, place = np.random.default_rng(3), field()
    patterns = parse_sequence("paper:axes=x").patterns(LINES)
    images = [render(p, place, rng, 0.35) for p in patterns]
    write_capture(tmp_path / "captures" / "a", Subject("object"), list(zip(patterns, images, strict=True)))
    add_capture(tmp_path, "captures/a")
    planned = expected(parse_sequence("paper"), LINES, rig_light(read_project(tmp_path)))
    error = decode(patterns, images, lines=LINES).u - place
    assert planned.sigma_lines == pytest.approx(float(np.sqrt(np.nanmean(error**2))), rel=0.05)


def test_the_command_tells_what_is_assumed(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settle = {"check": "settle", "figures": {"settle_ms": 8, "image_ms": 12}}
    (tmp_path / "pre.json").write_text(json.dumps({"findings": [settle]}))
    arguments = ["plan-sequence", str(project), "--frames", "16", "--preflight", str(tmp_path / "pre.json")]
    assert main([*arguments, "--json", str(tmp_path / "plan.json")]) == 0
    figures = json.loads((tmp_path / "plan.json").read_text())
    dense = next(s for s in figures["sequences"] if s["preset"] == "dense")
    assert dense["sequence"] == "dense:frames=16"
    assert dense["seconds"] == pytest.approx(16 * 0.020)
    assert figures["rig"]["frame_ms"] == 20
    assert "dense:frames=16" in capsys.readouterr().out


def test_bad_wishes_are_refused(project: Path) -> None:
    with pytest.raises(InputError, match="--frames"):
        plan_sequence(project, 3)
    with pytest.raises(InputError, match="--sigma"):
        plan_sequence(project, None, -1.0)


def test_the_fewest_frames_that_reach_a_sigma_are_found(tmp_path: Path) -> None:
    """Families with code begin with more frames than those without; the words of few frames repeat."""
    create_project(tmp_path, "p", DeviceSpec(*CAMERA, (0.01, 0.01), 12.0), DeviceSpec(160, 60, (0.09, 0.09), 100.0), {})
    frames: dict[float, int] = {}
    for sigma in (0.05, 0.2):
        planned = {p.preset: p for p in plan_sequence(tmp_path, None, sigma)[1] if p.preset != "paper"}
        assert len(planned) == 5
        for p in planned.values():
            assert p.reliable, p
            assert p.sigma_lines is not None, p
            assert p.sigma_lines < 1.05 * sigma, p
        frames[sigma] = planned["gray-sine"].frames
    assert frames[0.2] < frames[0.05]
    fewer = {p.preset: p.sigma_lines for p in plan_sequence(tmp_path, frames[0.05] - 2)[1]}
    assert (fewer["gray-sine"] or 1.0) > 0.05


def test_frames_that_decode_nowhere_have_no_sigma(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two neighbouring periods that tell 900 lines apart leave their order to the noise."""
    create_project(tmp_path, "p", DeviceSpec(*CAMERA, (0.01, 0.01), 12.0), DeviceSpec(900, 40, (0.09, 0.09), 200.0), {})
    assert main(["plan-sequence", str(tmp_path), "--frames", "14", "--json"]) == 0
    found = {s["preset"]: s for s in json.loads(capsys.readouterr().out)["sequences"]}
    assert (found["two-period"]["sigma_lines"], found["two-period"]["valid"]) == (None, 0.0)
    assert main(["plan-sequence", str(tmp_path), "--frames", "14"]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("two-period"))
    assert line.split()[1:3] == ["14", "-"]
