"""Several cameras on one pattern: each camera's frames are of its own view, verified, taken again together."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.bench import experiment
from core.cli import main
from core.geometry import project, ray_directions
from core.model import Project
from core.pipeline import decode_capture
from core.project import read_project


@pytest.fixture
def stereo(tmp_path: Path) -> Project:
    """An empty project of the virtual rig with two cameras."""
    views = experiment("stereo").views

    def described(spec) -> dict:
        return {
            "width": spec.width,
            "height": spec.height,
            "pitch_mm": list(spec.pitch_mm),
            "nominal_c_mm": spec.nominal_c_mm,
        }

    document = {
        "format": "stripe-project",
        "version": 2,
        "name": "two",
        "cameras": {name: described(view.rig.camera) for name, view in views.items()},
        "projector": described(views["left"].rig.projector),
        "captures": [],
    }
    (tmp_path / "project.json").write_text(json.dumps(document))
    return read_project(tmp_path)


def faulty(camera: str, faults: str) -> str:
    return f"{camera}=virtual:stereo?shot=plane%2B00&camera={camera}{faults}"


@pytest.mark.parametrize("period_ms", [0, 1])  # pattern by pattern, and by the projector's clock
def test_all_cameras_take_each_pattern_and_wrong_frames_are_found_in_any(stereo: Project, period_ms: int) -> None:
    command = ["capture", str(stereo.path), "both", "--role", "plane"]
    command += ["--projector", f"virtual:stereo?shot=plane%2B00&period_ms={period_ms}", "--camera", faulty("left", "")]
    command += ["--camera", faulty("right", "&faults=stale-frame:0.04&fault_seed=3")]
    figures = stereo.path / "figures.json"
    assert main([*command, "--json", str(figures)]) == 0
    told = json.loads(figures.read_text())
    assert told["frames"] == 2 * 24
    assert period_ms or told["retakes"] > 0
    assert any(words.startswith("right: ") for words in told["findings"])
    for name, view in experiment("stereo").views.items():
        phase = decode_capture(read_project(stereo.path).captures[0], camera=name)
        rig, board = view.rig, view.shot("plane+00").scene.camera_from_board
        v, u = np.nonzero(np.isfinite(phase.u) & np.isfinite(phase.v))
        assert len(u) > 0.3 * phase.u.size
        rays, normal = ray_directions(rig.camera, rig.camera_interior, np.stack([u, v], axis=1)), board.rotation[:, 2]
        points = rays * (normal @ board.translation_mm / (rays @ normal))[:, None]
        lines = project(rig.projector, rig.projector_interior, points, rig.projector_from_camera)
        off = np.hypot(*(lines - np.stack([phase.u[v, u], phase.v[v, u]], axis=1)).T)
        assert np.median(off) < 0.1  # the noise is 0.03 lines; the other camera's coordinates are tens of lines off
