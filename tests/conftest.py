"""What tests of whole commands share: small projects from the virtual bench, each made once a session."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from core.pipeline import calibrate_project, simulate_project
from core.project import read_project


@pytest.fixture(scope="session")
def quick_original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The `quick` scenario as the bench records it; never change it."""
    return simulate_project(tmp_path_factory.mktemp("bench") / "quick", "quick", seed=3).path


@pytest.fixture(scope="session")
def calibrated_original(quick_original: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, calibrated both ways; never change it."""
    folder = tmp_path_factory.mktemp("calibrated") / "quick"
    shutil.copytree(quick_original, folder)
    calibrate_project(read_project(folder))
    return folder


@pytest.fixture
def quick(quick_original: Path, tmp_path: Path) -> Path:
    """A copy of the `quick` project to work on."""
    return Path(shutil.copytree(quick_original, tmp_path / "quick"))


@pytest.fixture
def calibrated(calibrated_original: Path, tmp_path: Path) -> Path:
    """A copy of the calibrated `quick` project to work on."""
    return Path(shutil.copytree(calibrated_original, tmp_path / "calibrated"))


@pytest.fixture(scope="session")
def quick_truth(quick_original: Path) -> dict[str, Any]:
    """What the bench knows about the `quick` project."""
    return json.loads((quick_original / "truth.json").read_text())


@pytest.fixture
def edit_json() -> Callable[..., None]:
    """Change fields of a JSON file; None removes one."""

    def edit(path: Path, **changes: Any) -> None:
        data = {**json.loads(path.read_text()), **changes}
        path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))

    return edit
