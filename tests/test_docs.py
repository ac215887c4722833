"""The gallery and the developer's guide: every example runs, and every extension point has one."""

from __future__ import annotations

import importlib
import runpy
import tempfile
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from core import pipeline
from core.devices import CAMERA_KINDS
from core.geometry import LENSES
from core.measure import ESTIMATORS, TARGET_KINDS
from core.patterns import KINDS
from core.pipeline import METHODS, load_calibrations
from core.project import read_project
from core.reconstruct import EXPORTERS
from core.report import CHAPTERS
from tests.copies import copied
from tests.test_architecture import ROOT

DOCS = ROOT / "resources" / "docs"
REGISTRIES = {
    "pattern_kind": KINDS,
    "target_kind": TARGET_KINDS,
    "centre_estimator": ESTIMATORS,
    "lens_model": LENSES,
    "calibration_method": METHODS,
    "exporter": EXPORTERS,
    "device": CAMERA_KINDS,
    "report_section": CHAPTERS,
}
EXTENSIONS = sorted((DOCS / "extending").glob("*.py"))
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))


@pytest.fixture(autouse=True)
def as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No window opens, no folder is left behind, and registries are afterwards as they were."""
    kept = {name: dict(registry) for name, registry in REGISTRIES.items()}
    monkeypatch.setattr(plt, "show", lambda: None)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    yield
    plt.close("all")
    for name, registry in REGISTRIES.items():
        registry.clear()
        registry.update(kept[name])


@pytest.fixture
def recorded(calibrated_original: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What an example lets the bench record and calibrates was recorded and calibrated before."""

    def simulate(folder: Path, scenario: str):
        assert scenario == "quick"
        return read_project(copied(calibrated_original, tmp_path / "project"))

    calibrate = pipeline.calibrate_project
    monkeypatch.setattr(pipeline, "simulate_project", simulate)
    monkeypatch.setattr(
        pipeline,
        "calibrate_project",
        lambda project, *method: calibrate(project, *method) if method else load_calibrations(project),
    )


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example: Path, recorded: None) -> None:
    runpy.run_path(str(example))
    assert plt.get_fignums()


@pytest.mark.parametrize("example", EXTENSIONS, ids=lambda path: path.stem)
def test_an_extension_adds_one_to_its_registry(example: Path, recorded: None) -> None:
    registry = REGISTRIES[example.stem]
    before = set(registry)
    runpy.run_path(str(example))
    assert len(set(registry) - before) == 1
    assert f"sphx_glr_auto_extending_{example.name}" in (DOCS / "extending.rst").read_text()


def test_every_extension_point_has_an_example() -> None:
    assert {path.stem for path in EXTENSIONS} == set(REGISTRIES)


def test_every_room_is_in_the_reference() -> None:
    """What `core` offers is documented, but for rooms that only the program itself uses."""
    listed = runpy.run_path(str(DOCS / "conf.py"))
    own = {
        "cli",
        "demo",
        "batch",
        "figures",
        "arrays",
        "resources",
        "numerics",
        "verify",
        "digits",
        "fields",
        "atomic",
        "parallel",
        "algebra",
        "compiling",
        "lazy",
        "starting",
    }
    rooms = {p.stem for p in (ROOT / "core").iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert {r for r in rooms if not r.startswith("_")} - own == set(listed["PUBLIC"])
    for room in listed["PUBLIC"]:
        importlib.import_module(f"core.{room}")
        assert listed["names_of"](room)
