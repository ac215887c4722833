"""What tests of whole commands share: small projects from the virtual bench, each made once for all workers."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from core.pipeline import calibrate_project, simulate_project, update_project
from core.project import read_project

Make = Callable[[Path], Any]
LONGEST = ("test_paper_experiment.py", "test_starting.py", "test_target_identity.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the modules that hold the longest tests: a worker that began one last would end alone."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """What is shared is no clue to a failure and takes gigabytes."""
    made = session.config._tmp_path_factory._basetemp  # type: ignore[attr-defined]
    if made is not None and "PYTEST_XDIST_WORKER" not in os.environ:
        shutil.rmtree(made / "shared", ignore_errors=True)


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Make], Path]:
    """Make a folder once in a run, whichever worker needs it first; nobody may change it."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent

    def make(name: str, how: Make) -> Path:
        folder, done = root / "shared" / name, root / f"{name}.made"
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                how(folder)
                done.touch()
        return folder

    return make


@pytest.fixture(scope="session")
def quick_original(once: Callable[[str, Make], Path]) -> Path:
    """The `quick` scenario as the bench records it; never change it."""
    return once("quick-3", lambda folder: simulate_project(folder, "quick", seed=3))


@pytest.fixture(scope="session")
def calibrated_original(quick_original: Path, once: Callable[[str, Make], Path]) -> Path:
    """The same, calibrated both ways; never change it."""

    def calibrated(folder: Path) -> None:
        shutil.copytree(quick_original, folder)
        calibrate_project(read_project(folder))

    return once("quick-3-calibrated", calibrated)


@pytest.fixture(scope="session")
def whole_original(calibrated_original: Path, once: Callable[[str, Make], Path]) -> Path:
    """The same with every stage done; never change it."""

    def whole(folder: Path) -> None:
        shutil.copytree(calibrated_original, folder)
        update_project(read_project(folder))

    return once("quick-3-whole", whole)


@pytest.fixture(scope="session")
def recorded(once: Callable[[str, Make], Path]) -> Path:
    """The `quick` scenario with other noise, as the window's tests have it; never change it."""
    return once("quick-0", lambda folder: simulate_project(folder, "quick"))


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
def plain_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without their drawings, a tenth of the work: where it matters that they are there, not how they look."""
    from core.report.chapters import CHAPTERS

    for key, chapter in CHAPTERS.items():
        monkeypatch.setitem(CHAPTERS, key, replace(chapter, drawings=lambda data: ()))


@pytest.fixture
def edit_json() -> Callable[..., None]:
    """Change fields of a JSON file; None removes one."""

    def edit(path: Path, **changes: Any) -> None:
        data = {**json.loads(path.read_text()), **changes}
        path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))

    return edit
